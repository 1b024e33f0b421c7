"""Frusta and tori by formulas: volumes, stacks, drawings. Beside their twins in test_voxel.py and test_buffers.py."""

import re
from itertools import pairwise

import numpy as np
import pytest
from scipy import ndimage

import reference
from sketchcore import _core
from sketchcore.camera import VIEWPOINTS
from sketchcore.grids import buffers, draw, frustum, voxelize
from sketchcore.shape import Cuboid, Cylinder, Frustum, Shape, Torus

CENTER = (0.013, -0.007, 0.011)


def volume(*primitives):
    return voxelize(Shape(primitives)).sum() / 64**3


def along(axis, length, u, v):
    """Half sizes: one along an axis, two across it."""
    return tuple(np.insert([u, v], "xyz".index(axis), length).tolist())


@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("taper", [-1.0, -0.4, 0.0, 0.7, 1.0])
def test_a_cone_has_its_volume(axis, taper):
    # The mean over the height of the section's area, pi (r (1 + t w))^2 for w from -1 to 1.
    cone = Frustum(CENTER, along(axis, 0.35, 0.2, 0.15), axis, (0.05, -0.08), taper, round=True)
    exact = np.pi * 0.2 * 0.15 * 0.7 * (1 + taper**2 / 3)
    # Along the axis its ends are off the lattice: by half a voxel of the larger at most. Across it errs far less.
    assert volume(cone) == pytest.approx(exact, rel=0.01, abs=np.pi * 0.2 * 0.15 * (1 + abs(taper)) ** 2 / 128)
    camera = VIEWPOINTS["quarter-127"]
    seen = (frustum(Shape([cone]), camera, 4).sum(axis=(1, 2)) / 255 * reference.cell_volumes(camera)).sum()
    assert seen == pytest.approx(exact, rel=0.01)


@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("shear", [(0.0, 0.0), (0.2, 0.0), (-0.13, 0.17)])
def test_a_slanted_box_has_the_volume_of_the_straight_one(axis, shear):
    half = along(axis, 0.25, 0.12, 0.19)
    slanted, straight = volume(Frustum(CENTER, half, axis, shear)), volume(Cuboid(CENTER, half))
    # Its sections are shifted; how many centres each then holds differs by a row at most.
    assert slanted == pytest.approx(straight, rel=1 / (64 * 0.24) + 1 / (64 * 0.38))
    camera = VIEWPOINTS["quarter-052"]
    shapes = Shape([Frustum(CENTER, half, axis, shear)]), Shape([Cuboid(CENTER, half)])
    seen = [(frustum(s, camera, 4).sum(axis=(1, 2)) / 255 * reference.cell_volumes(camera)).sum() for s in shapes]
    assert seen[0] == pytest.approx(seen[1], rel=0.01)


@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("turn", [60, 180, 270, 360])
def test_a_torus_has_its_volume(axis, turn):
    # Pappus: the tube's area times the way of its middle, here of a ring that is stretched to an ellipse.
    u, v, thick, tube = 0.4, 0.32, 0.08, 0.25
    torus = Torus(CENTER, along(axis, thick, u, v), axis, tube, (-25, turn - 25))
    exact = (1 - tube) * u * v * np.radians(turn) * np.pi * thick * tube
    assert volume(torus) == pytest.approx(exact, rel=0.03)
    camera = VIEWPOINTS["quarter-217"]
    seen = (frustum(Shape([torus]), camera, 4).sum(axis=(1, 2)) / 255 * reference.cell_volumes(camera)).sum()
    assert seen == pytest.approx(exact, rel=0.02)


@pytest.mark.parametrize("axis", "xyz")
def test_without_shear_and_taper_it_is_a_cuboid_or_a_cylinder(axis):
    half, camera = (0.21, 0.17, 0.3), VIEWPOINTS["quarter-307"]
    for frustum_, plain in (
        (Frustum(CENTER, half, axis), Cuboid(CENTER, half)),
        (Frustum(CENTER, half, axis, round=True), Cylinder(CENTER, half, axis)),
    ):
        np.testing.assert_array_equal(voxelize(Shape([frustum_])), voxelize(Shape([plain])))
        for made, expected in zip(buffers(Shape([frustum_]), camera), buffers(Shape([plain]), camera), strict=True):
            np.testing.assert_allclose(made, expected, atol=1e-6)


def stack(edges, taper, round_):
    """A tall frustum cut into pieces at heights from -1 to 1."""
    tall, wide, shear = 0.4, 0.2, np.array([0.1, -0.06])
    pieces = []
    for low, high in pairwise(edges):
        middle, length = (low + high) / 2, (high - low) / 2
        size = 1 + taper * middle
        center = (shear[0] * middle, tall * middle, shear[1] * middle)
        half = (wide * size, tall * length, wide * size)
        pieces.append(Frustum(center, half, "y", tuple(shear * length), taper * length / size, round_))
    return Shape(pieces)


@pytest.mark.parametrize("round_", [False, True])
@pytest.mark.parametrize("view", ["quarter-037", "front", "top"])
def test_the_pieces_of_a_frustum_are_the_whole(round_, view):
    whole, pieces = stack([-1, 1], 0.6, round_), stack([-1, -0.43, 0.1, 0.35, 1], 0.6, round_)
    np.testing.assert_array_equal(voxelize(whole), voxelize(pieces))
    camera = VIEWPOINTS[view]
    np.testing.assert_array_equal(draw(whole, camera), draw(pieces, camera))
    for one, other in zip(buffers(whole, camera), buffers(pieces, camera), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-5)
    np.testing.assert_allclose(frustum(whole, camera), frustum(pieces, camera), atol=1)


@pytest.mark.parametrize("view", ["quarter-037", "front", "top"])
def test_a_turned_profile_shows_no_lines_between_its_steps(view):
    # A ball in steps of 15 degrees: its drawing is its outline.
    turn = np.radians(np.arange(-90, 91, 15))
    radii, heights = 0.4 * np.cos(turn), 0.4 * np.sin(turn)
    radii[[0, -1]] = 0.0
    ball = []
    for (r0, y0), (r1, y1) in pairwise(zip(radii, heights, strict=True)):
        half = ((r0 + r1) / 2, (y1 - y0) / 2, (r0 + r1) / 2)
        ball.append(Frustum((0, (y0 + y1) / 2, 0), half, taper=(r1 - r0) / (r0 + r1), round=True))
    ink = draw(Shape(ball), VIEWPOINTS[view]) > 0
    # Where a step runs out into the outline, that is three pixels wide.
    inside = ndimage.binary_erosion(ndimage.binary_fill_holes(ink), iterations=3)
    assert inside.sum() > 5000
    assert not (ink & inside).any()


def test_a_ray_may_cross_a_ring_twice_and_its_gap_as_well():
    # Along x through a ring about z, in its middle plane: two stretches; the tube is cut where the arc has its gap.
    camera = VIEWPOINTS["front"]
    torus = {"center": (0, 0, 0), "half": (0.4, 0.4, 0.1), "axis": "z", "tube": 0.25}
    for arc, spans in (((0, 360), [(-0.4, -0.2), (0.2, 0.4)]), ((90, 270), [(-0.4, -0.2)]), ((-90, 90), [(0.2, 0.4)])):
        cells = frustum(Shape([Torus(**torus, arc=arc)]), camera)[:, 31:33, 31:33].mean(axis=(1, 2)) / 255
        depth = camera.near + (np.arange(64) + 0.5) * 1.5 / 64
        inside = np.any([(2 - high < depth) & (depth < 2 - low) for low, high in spans], axis=0)
        edges = np.any([np.abs(depth - (2 - x)) < 1.5 / 64 for span in spans for x in span], axis=0)
        np.testing.assert_allclose(cells[~edges], inside[~edges], atol=0.02)


def test_rows_are_as_long_as_they_have_to_be():
    box, leg = Cuboid((0, 0, 0), (0.1, 0.2, 0.3)), Frustum((0, 0, 0), (0.1, 0.2, 0.3), "z", (0.3, 0.2), (0.1, -0.5))
    ring = Torus((0, 0, 0), (0.1, 0.2, 0.3), "x", 0.3, (-30, 60), "subtract")
    assert Shape([box]).packed.shape == (1, 8)
    expected = [
        [0, 1, 0, 0, 0, 0.1, 0.2, 0.3, 0, 0, 0, 0],
        [18, 1, 0, 0, 0, 0.1, 0.2, 0.3, 0.3, 0.2, 0.1, -0.5],
        [22, 0, 0, 0, 0, 0.1, 0.2, 0.3, 0.3, -30, 60, 0],
    ]
    shape = Shape([box, leg, ring])
    np.testing.assert_array_equal(shape.packed, expected)
    # The core takes a long row of any kind, and a short one of the kinds that need no more.
    np.testing.assert_array_equal(_core.voxelize(shape.packed[:1].copy()), voxelize(Shape([box])))
    with pytest.raises(ValueError, match="whose row has 12 numbers; got 8"):
        _core.voxelize(shape.packed[1:, :8].copy())


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Frustum((0, 0, 0), (1, 1, 1), taper=1.5), "taper must lie between -1 and 1, got 1.5"),
        (lambda: Frustum((0, 0, 0), (1, 1, 1), taper=(0.5, 0.2), round=True), "tapers along both axes alike"),
        (lambda: Frustum((0, 0, 0), (1, 1, 1), taper=(0.5,)), "taper must be two finite numbers"),
        (lambda: Frustum((0, 0, 0), (1, 1, 1), shear=(0, np.nan)), "shear must be two finite numbers"),
        (lambda: Frustum((0, 0, 0), (1, 0, 1)), "half sizes must be more than 0"),
        (lambda: Frustum((0, 0, 0), (1, 1, 1), "w"), "axis must be 'x', 'y' or 'z'"),
        (lambda: Torus((0, 0, 0), (1, 1, 1), tube=0.6), "more than 0 and at most 0.5, got 0.6"),
        (lambda: Torus((0, 0, 0), (1, 1, 1), arc=(30, 30)), "from less than to, by 360 at most"),
        (lambda: Torus((0, 0, 0), (1, 1, 1), arc=(0, 400)), "from less than to, by 360 at most"),
        (lambda: Torus((0, 0, 0), (1, 1, 1), op="remove"), "'add' or 'subtract', got 'remove'"),
    ],
)
def test_bad_frusta_and_tori_are_refused(make, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        make()


@pytest.mark.parametrize(
    ("row", "message"),
    [
        ([16, 1, 0, 0, 0, 1, 1, 1, 0, 0, 1.5, 0], "taper must lie between -1 and 1"),
        ([19, 1, 0, 0, 0, 1, 1, 1, 0, 0, 0.5, 0], "the same taper along both axes"),
        ([16, 1, 0, 0, 0, 1, 1, 1, np.inf, 0, 0, 0], "shear and taper must be finite"),
        ([22, 1, 0, 0, 0, 1, 1, 1, 0, 0, 90, 0], "tube must be more than 0"),
        ([22, 1, 0, 0, 0, 1, 1, 1, 0.2, 90, 0, 0], "arc must be"),
        ([25, 1, 0, 0, 0, 1, 1, 1, 0, 0, 0, 0], "22, 23, 24 a torus"),
    ],
)
def test_the_core_refuses_bad_rows(row, message):
    with pytest.raises(ValueError, match=message):
        _core.voxelize(np.array([row], float))
