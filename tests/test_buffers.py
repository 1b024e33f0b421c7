import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import reference
from sketchcore.camera import VIEWPOINTS, Camera
from sketchcore.grids import buffers, frustum
from sketchcore.shape import Cuboid, Cylinder, Shape, Wedge

SIZE = 128


@pytest.mark.slow
@settings(max_examples=40)
@given(reference.shapes(), reference.cameras() | st.sampled_from(list(VIEWPOINTS.values())))
def test_depth_and_normals_are_those_of_the_first_point_inside(shape, camera):
    depth, normal = buffers(shape, camera, SIZE)
    expected = reference.depth(shape, camera, SIZE)
    allowed = SIZE**2 // 10_000
    both = np.isfinite(depth) & np.isfinite(expected)
    off = np.isfinite(depth) != np.isfinite(expected)
    off[both] = np.abs(depth[both] - expected[both]) > 1e-6
    assert off.sum() <= allowed
    faces = reference.normals(shape, camera, expected)
    fits = np.any([np.abs(normal - face).max(axis=-1) < 1e-5 for face in faces], axis=0)
    assert (both & ~off & ~fits).sum() <= allowed
    rays = reference.directions(camera, SIZE)
    assert ((normal * rays).sum(axis=-1) <= 1e-6).all(), "towards the eye"
    assert np.abs(np.linalg.norm(normal[np.isfinite(depth)], axis=-1) - 1).max(initial=0) < 1e-6
    assert not normal[~np.isfinite(depth)].any()


@pytest.mark.parametrize("size", [1, 7, 64, 250])
def test_a_plane_has_its_depth(size):
    camera = VIEWPOINTS["front"]
    depth, normal = buffers(Shape([Cuboid((0, 0, 0), (0.2, 2, 2))]), camera, size)
    assert depth.shape == (size, size)
    assert normal.shape == (size, size, 3)
    np.testing.assert_allclose(depth, 1.8, atol=1e-6)
    np.testing.assert_array_equal(normal, np.broadcast_to([1, 0, 0], (size, size, 3)))


def test_a_slanted_plane_is_affine_in_inverse_depth():
    # The plane y = 0.1 seen from above and aside: n . (eye + z ray) = 0.1, so 1 / z = n . ray / (0.1 - n . eye).
    camera = VIEWPOINTS["quarter-037"]
    depth, normal = buffers(Shape([Cuboid((0, 0, 0), (9, 0.1, 9))]), camera)
    rays = reference.directions(camera, 256)
    with np.errstate(divide="ignore"):
        expected = (0.1 - camera.position[1]) / rays[..., 1]
    np.testing.assert_allclose(depth, expected, atol=1e-6)
    assert (normal == [0, 1, 0]).all()
    bend = np.diff(1 / depth.astype(np.float64), 2, axis=1)
    assert np.abs(bend).max() < 1e-6


@pytest.mark.parametrize("axis", "xyz")
@pytest.mark.parametrize("corner", [(-1, -1), (-1, 1), (1, -1), (1, 1)])
def test_the_face_of_a_wedge_has_its_depth_and_its_normal(axis, corner):
    # The plane u su / hu + v sv / hv = 0, that is n . (eye + z ray) = 0; seen from outside it, so far on every side
    # that it fills the image.
    half = np.array([40.0, 50.0, 60.0])
    u, v = (a for a in range(3) if "xyz"[a] != axis)
    n = np.zeros(3)
    n[u], n[v] = -corner[0] / half[u], -corner[1] / half[v]
    n /= np.linalg.norm(n)
    away = n + 0.2 * np.eye(3)["xyz".index(axis)]
    elevation = np.degrees(np.arcsin(away[1] / np.linalg.norm(away)))
    camera = Camera.orbit(np.degrees(np.arctan2(away[2], away[0])) + 3, elevation - 5)
    depth, normal = buffers(Shape([Wedge((0, 0, 0), tuple(half), axis, corner)]), camera)
    rays = reference.directions(camera, 256)
    np.testing.assert_allclose(depth, -(camera.position @ n) / (rays @ n), atol=1e-6)
    np.testing.assert_allclose(normal, np.broadcast_to(n, (256, 256, 3)), atol=1e-6)
    # Cut out of a box that reaches as far, it leaves the same face, seen from the other half.
    rest = [Cuboid((0, 0, 0), tuple(half)), Wedge((0, 0, 0), tuple(half), axis, (-corner[0], -corner[1]), "subtract")]
    again = buffers(Shape(rest), camera)
    np.testing.assert_allclose(again[0], depth, atol=1e-6)
    np.testing.assert_allclose(again[1], normal, atol=1e-6)


def test_a_cylinder_curves_away():
    # Seen along -x, the ray through image height y (at depth 1) and width w meets |(x, z)| = r first at ...
    camera, r = VIEWPOINTS["front"], 0.3
    depth, normal = buffers(Shape([Cylinder((0, 0, 0), (r, 0.5, r))]), camera)
    w = reference.directions(camera, 256)[..., 2]
    with np.errstate(invalid="ignore"):
        expected = (2 - np.sqrt(4 - (1 + w**2) * (4 - r**2))) / (1 + w**2)
    seen = np.isfinite(depth)
    assert seen.sum() > 1000
    np.testing.assert_allclose(depth[seen], expected[seen], atol=1e-6)
    radial = np.stack([2 - depth, np.zeros_like(depth), depth * w], axis=-1) / r
    np.testing.assert_allclose(normal[seen], radial[seen], atol=1e-5)


def test_the_image_is_upright_and_not_mirrored():
    # From the front (+x, looking along -x) a box at +y is above, and one at -z is on the right.
    for center, side in (((0, 0.3, 0), "above"), ((0, 0, -0.3), "right")):
        depth, _ = buffers(Shape([Cuboid(center, (0.05, 0.05, 0.05))]), VIEWPOINTS["front"])
        row, col = np.argwhere(np.isfinite(depth)).mean(axis=0)
        assert (row < 100) == (side == "above")
        assert (col > 156) == (side == "right")


@pytest.mark.slow
@settings(max_examples=20)
@given(reference.shapes(5), reference.cameras(), st.integers(1, 2))
def test_frustum_cells_hold_the_share_inside(shape, camera, rays):
    expected = reference.frustum(shape, camera, rays)
    cells = frustum(shape, camera, rays)
    # Half a step of a byte for rounding; 1e-3 more for slivers that one side counts as rounding.
    wrong = np.abs(cells / 255 - expected) > 0.5 / 255 + 1e-6
    assert wrong.sum() <= 64**3 // 10_000


def test_frustum_cells_agree_with_samples():
    shape = Shape([Cuboid((0, -0.1, 0), (0.3, 0.1, 0.2)), Cylinder((0.05, 0.1, 0), (0.1, 0.3, 0.1)),
                   Cylinder((0, -0.1, 0.1), (0.4, 0.05, 0.05), "x", "subtract")])  # fmt: skip
    camera = VIEWPOINTS["quarter-322"]
    cells = frustum(shape, camera, 4)
    rays = reference.directions(camera, 256)[64:192, 64:192]
    depths = camera.near + (np.arange(64 * 32) + 0.5) / (64 * 32) * (camera.far - camera.near)
    samples = np.empty((64, 32, 32))
    for k in range(64):
        points = camera.position + rays * depths[32 * k : 32 * k + 32, None, None, None]
        inside = reference.contains(shape, points).mean(axis=0)
        samples[k] = inside.reshape(32, 4, 32, 4).mean(axis=(1, 3))
    # 32 samples along a ray are half a sample off at each end; a cell holds hardly ever more than two.
    assert np.abs(cells[:, 16:48, 16:48] / 255 - samples).max() < 2 * 0.5 / 32 + 0.5 / 255
    assert ((samples > 0) & (samples < 1)).sum() > 200


@pytest.mark.parametrize("name", ["quarter-052", "front", "top"])
@pytest.mark.parametrize("rays", [1, 2, 4])
def test_a_frustum_holds_the_volume(name, rays):
    camera = VIEWPOINTS[name]
    # Exact along depth, so only the outline's pixels err: the share of the outline, falling with the rays.
    for primitive, volume in (
        (Cuboid((0.02, 0.01, -0.03), (0.3, 0.2, 0.25)), 8 * 0.3 * 0.2 * 0.25),
        (Cylinder((0.02, 0.01, -0.03), (0.3, 0.2, 0.25), "z"), np.pi * 0.3 * 0.2 * 0.5),
        (Wedge((0.02, 0.01, -0.03), (0.3, 0.2, 0.25), "y", (1, -1)), 4 * 0.3 * 0.2 * 0.25),
    ):
        cells = frustum(Shape([primitive]), camera, rays)
        got = (cells.sum(axis=(1, 2)) / 255 * reference.cell_volumes(camera)).sum()
        assert got == pytest.approx(volume, rel=0.02 / rays)


def test_a_cell_wholly_inside_is_255():
    camera = VIEWPOINTS["back"]
    assert (frustum(Shape([Cuboid((0, 0, 0), (1.5, 9, 9))]), camera) == 255).all()
    half = frustum(Shape([Cuboid((-1, 0, 0), (1, 9, 9))]), Camera.orbit(0, 0))
    # The eye at x = 2 sees depths from 2 on inside: exactly half of the 64 slices.
    assert (half[32:] == 255).all()
    assert (half[:32] == 0).all()


@pytest.mark.parametrize("slices", [0.25, 0.5, 3.75])
def test_part_of_a_slice_is_its_share(slices):
    # A wall at right angles to the view, from the near plane on.
    thick = slices * 1.5 / 64
    cells = frustum(Shape([Cuboid((0.75 - thick / 2, 0, 0), (thick / 2, 9, 9))]), VIEWPOINTS["front"])
    expected = np.clip(slices - np.arange(64), 0, 1) * 255
    assert np.abs(cells - expected[:, None, None]).max() <= 0.5 + 1e-6
