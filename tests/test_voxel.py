from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings

import reference
from sketchcore.grids import voxelize
from sketchcore.shape import Cuboid, Cylinder, Frustum, Shape, Torus, Wedge


@settings(max_examples=60)
@given(reference.shapes(8))
def test_voxels_are_those_whose_centre_is_inside(shape):
    np.testing.assert_array_equal(voxelize(shape), reference.voxelize(shape))


def test_the_last_writer_wins():
    rings = [Cuboid((0, 0, 0), (h, h, h), op) for h, op in ((0.4, "add"), (0.3, "subtract"), (0.1, "add"))]
    volume = voxelize(Shape(rings))
    along = volume[:, 32, 32]
    edges = np.flatnonzero(np.diff(np.pad(along, 1).astype(int)))
    # Faces at -0.4, -0.3, -0.1, 0.1, 0.3, 0.4: centres from (x + 1/2) 64 - 1/2 on are inside.
    assert edges.tolist() == [6, 13, 26, 38, 51, 58]
    assert voxelize(Shape([*rings, Cuboid((0, 0, 0), (0.5, 0.5, 0.5), "subtract")])).sum() == 0


def test_axes_are_x_y_z():
    volume = voxelize(Shape([Cuboid((0.4, 0.2, -0.3), (0.05, 0.05, 0.05))]))
    middle = np.argwhere(volume).mean(axis=0)
    assert np.abs((middle + 0.5) / 64 - 0.5 - [0.4, 0.2, -0.3]).max() < 1 / 64


def test_a_box_on_the_lattice_has_its_volume_exactly():
    half = (0.25, 0.125, 0.375)
    volume = voxelize(Shape([Cuboid((0.0625, -0.125, 0.0625), half)]))
    assert volume.sum() == 64**3 * 8 * np.prod(half)
    assert volume.dtype == np.uint8
    assert volume.flags.c_contiguous


@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("radii", [(0.31, 0.31), (0.4, 0.17)])
def test_a_cylinder_has_its_volume(axis, radii):
    # Length on the lattice: the error is the section's alone. Lattice points in an ellipse differ from its area
    # by less than its perimeter (in voxels) times a half; in truth by far less.
    half = np.insert(np.array(radii), "xyz".index(axis), 0.25)
    volume = voxelize(Shape([Cylinder((0.003, -0.004, 0.005), tuple(half), axis)]))
    section = volume.sum() / 32
    area = np.pi * radii[0] * radii[1] * 64**2
    assert volume.sum() % 32 == 0
    assert abs(section - area) < 0.1 * np.pi * sum(radii) * 64


CORNERS = [(-1, -1), (-1, 1), (1, -1), (1, 1)]


@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("corner", CORNERS)
def test_a_wedge_is_half_of_its_box(axis, corner):
    center, half = (0.003, -0.004, 0.005), np.insert([0.31, 0.17], "xyz".index(axis), 0.25)
    volume = voxelize(Shape([Wedge(center, tuple(half), axis, corner)]))
    # 32 sections. A convex region of area A and outline P (in voxels) holds more than A - P/2 and at most A + P/2 + 1
    # lattice points (Nosarzewska, 1948).
    section = volume.sum() / 32
    area, outline = 2 * 0.31 * 0.17 * 64**2, 2 * (0.31 + 0.17 + np.hypot(0.31, 0.17)) * 64
    assert volume.sum() % 32 == 0
    assert area - outline / 2 < section <= area + outline / 2 + 1
    # The other half is the wedge of the opposite corner. Off the lattice, no centre lies on the face between them.
    other = voxelize(Shape([Wedge(center, tuple(half), axis, (-corner[0], -corner[1]))]))
    np.testing.assert_array_equal(volume + other, voxelize(Shape([Cuboid(center, tuple(half))])))


@pytest.mark.parametrize("corner", CORNERS)
def test_a_wedge_on_the_lattice_has_its_slanted_face_too(corner):
    volume = voxelize(Shape([Wedge((0, 0, 0), (0.125, 0.25, 0.25), "x", corner)]))
    y, z = np.meshgrid(*[np.arange(64) - 31.5] * 2, indexing="ij")
    triangle = (np.abs(y) < 16) & (np.abs(z) < 16) & (corner[0] * y + corner[1] * z >= 0)
    np.testing.assert_array_equal(volume[24:40], np.broadcast_to(triangle, (16, 64, 64)))
    assert volume.sum() == 16 * 16 * 33


@settings(max_examples=30)
@given(reference.primitives())
def test_the_mirror_image_of_a_primitive_is_its_voxels_mirrored(primitive):
    changes = {"center": (*primitive.center[:2], -primitive.center[2]), "op": "add"}
    if isinstance(primitive, Wedge) and primitive.axis != "z":
        changes["corner"] = (primitive.corner[0], -primitive.corner[1])
    if isinstance(primitive, Frustum) and primitive.axis != "z":
        changes["shear"] = (primitive.shear[0], -primitive.shear[1])
    if isinstance(primitive, Frustum) and primitive.axis == "z":
        changes |= {"shear": tuple(-s for s in primitive.shear), "taper": tuple(-t for t in primitive.taper)}
    if isinstance(primitive, Torus) and primitive.axis != "z":
        changes["arc"] = (-primitive.arc[1], -primitive.arc[0])
    mirrored = voxelize(Shape([replace(primitive, **changes)]))
    np.testing.assert_array_equal(mirrored, voxelize(Shape([replace(primitive, op="add")]))[..., ::-1])


def test_what_lies_outside_the_grid_is_cut_off():
    assert voxelize(Shape([Cuboid((0, 0, 0), (3, 3, 3))])).all()
    assert not voxelize(Shape([Cylinder((2, 0, 0), (1, 1, 1))])).any()
