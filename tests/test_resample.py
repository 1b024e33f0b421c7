import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import reference
from sketchcore.camera import VIEWPOINTS, Camera
from sketchcore.grids import SIDES, to_camera_grid, to_world_grid

TOLERANCE = 1e-5
SEEDS = st.integers(0, 2**32 - 1)


def smooth(seed):
    """A random field within [0, 1] that changes by less than a tenth from one cell to the next."""
    random = np.random.default_rng(seed)
    field = np.zeros((64, 64, 64))
    for _ in range(4):
        wave = random.uniform(-0.1, 0.1, 3)
        field += np.cos(np.indices((64, 64, 64)).transpose(1, 2, 3, 0) @ wave + random.uniform(0, 7))
    return (0.5 + field / 8).astype(np.float32)


@pytest.mark.slow
@settings(max_examples=12)
@given(SEEDS, reference.cameras())
def test_camera_grid_is_trilinear_with_zeros_outside(seed, camera):
    volume = smooth(seed)
    got = to_camera_grid(volume, camera)
    assert got.dtype == np.float32
    off = np.abs(got - reference.to_camera_grid(volume, camera))
    # Beyond the outermost centres the field falls to 0 within a cell, however smooth: ten times as steep, and
    # positions up to 160 cells from the eye have an ulp of 1.5e-5.
    ramp = (np.abs(reference.cell_centers(camera)) > 0.5 - 0.5 / 64 - 1e-6).any(axis=-1)
    assert off[~ramp].max(initial=0) < TOLERANCE
    assert off[ramp].max(initial=0) < 3 * TOLERANCE


@pytest.mark.slow
@settings(max_examples=12)
@given(SEEDS, reference.cameras())
def test_world_grid_is_trilinear_and_keeps_into_outside(seed, camera):
    volume = smooth(seed)
    into = np.random.default_rng(seed).random((64, 64, 64), np.float32)
    kept = into.copy()
    got = to_world_grid(volume, camera, into)
    expected, margin = reference.to_world_grid(volume, camera, into)
    np.testing.assert_array_equal(into, kept)
    # Rounding decides who is outside next to the border; within half a cell of it values fall off to one half.
    assert (margin < 1e-4).mean() < 1e-3
    off = np.abs(got - expected)
    assert off[margin > 0.501].max(initial=0) < TOLERANCE
    assert off[(margin > 1e-4) & (margin < 0.501)].max(initial=0) < 3 * TOLERANCE


@pytest.mark.parametrize("side", SIDES)
@settings(max_examples=4)
@given(SEEDS, st.sampled_from(list(VIEWPOINTS.values())))
def test_noise_is_resampled_too_at_every_size(side, seed, camera):
    # From 0 to 1 between two cells: positions in float32, 4e-6 of a cell apart at 64, count in full. An ulp or two
    # for each of the sums that lead to them, on each of three axes.
    close = 1e-4 * side / 64
    # The twin is slow: it makes a sixteenth of the planes at 256.
    step = max(1, (side // 64) ** 2)
    volume = np.random.default_rng(seed).integers(0, 2, (side,) * 3, np.uint8).astype(np.float32)
    off = np.abs(to_camera_grid(volume, camera)[::step] - reference.to_camera_grid(volume, camera, step))
    assert off.max() < close
    expected, margin = reference.to_world_grid(volume, camera, 0.0, step)
    off = np.abs(to_world_grid(volume, camera)[::step] - expected)
    assert off[margin > close].max(initial=0) < close


def test_a_linear_field_is_read_exactly():
    # x + 2y - z / 2 at the cells' own centres: trilinear reading of a linear field has no error of its own.
    field = reference.voxel_centers() @ [1.0, 2.0, -0.5]
    camera = VIEWPOINTS["quarter-142"]
    points = reference.cell_centers(camera)
    well_inside = (np.abs(points) < 0.5 - 0.5 / 64).all(axis=-1)
    got = to_camera_grid(field, camera)
    assert well_inside.mean() > 0.2
    np.testing.assert_allclose(got[well_inside], (points @ [1.0, 2.0, -0.5])[well_inside], atol=1e-5)
    assert (got[(np.abs(points) > 0.5 + 0.5 / 64).any(axis=-1)] == 0).all()


def test_slices_rows_and_columns_are_the_images_own():
    # A small ball at +y (above) and -z (right, from the front), nearer than the origin.
    points = reference.voxel_centers()
    ball = (np.linalg.norm(points - [0.2, 0.3, -0.1], axis=-1) < 0.06).astype(np.float32)
    seen = to_camera_grid(ball, VIEWPOINTS["front"])
    depth, row, col = (np.indices(seen.shape) * seen).sum(axis=(1, 2, 3)) / seen.sum()
    size = 64 / (2 * np.tan(np.radians(22.5)))
    assert depth == pytest.approx((1.8 - 1.25) / 1.5 * 64 - 0.5, abs=0.2)
    assert row == pytest.approx(32 - 0.3 / 1.8 * size - 0.5, abs=0.2)
    assert col == pytest.approx(32 + 0.1 / 1.8 * size - 0.5, abs=0.2)


@pytest.mark.parametrize("name", VIEWPOINTS)
def test_a_smooth_field_comes_back(name):
    # Trilinear reading errs by h^2 / 8 times the second derivative along each axis, h the spacing of cells; a ball
    # exp(-r^2 / s^2) has at most 2 / s^2. Cells are 1/64 in the world; at most 2.28 / 64 across and 1.5 / 64 along.
    camera, s = VIEWPOINTS[name], 0.15
    points = reference.voxel_centers()
    ball = np.exp(-((points - [0.05, -0.08, 0.04]) ** 2).sum(axis=-1) / s**2)
    back = to_world_grid(to_camera_grid(ball, camera), camera)
    p = points @ camera.rotation.T + [0, 0, 2.0]
    half = np.tan(np.radians(22.5))
    seen = (np.abs(p[..., :2]) < 0.95 * half * p[..., 2:]).all(axis=-1) & (np.abs(p[..., 2] - 2) < 0.7)
    across = 2 * 2.75 * half
    bound = (3 + 2 * across**2 + 1.5**2) / 64**2 / 8 * 2 / s**2
    assert bound < 0.05
    assert np.abs(back - ball)[seen].max() < bound


def test_batches_are_their_volumes_one_by_one():
    volumes = np.stack([smooth(i) for i in range(3)])
    cameras = [VIEWPOINTS[name] for name in ("front", "top", "quarter-217")]
    seen = to_camera_grid(volumes, cameras)
    back = to_world_grid(seen, cameras, volumes)
    for i, camera in enumerate(cameras):
        np.testing.assert_array_equal(seen[i], to_camera_grid(volumes[i], camera))
        np.testing.assert_array_equal(back[i], to_world_grid(seen[i], camera, volumes[i]))
    assert to_camera_grid(volumes[:0], []).shape == (0, 64, 64, 64)


@pytest.mark.parametrize("side", SIDES[:-1])
def test_batches_of_every_size_keep_into_outside(side):
    random = np.random.default_rng(side)
    volumes, into = random.random((2, 2, side, side, side), np.float32)
    cameras = [VIEWPOINTS["quarter-052"], VIEWPOINTS["top"]]
    seen, back = to_camera_grid(volumes, cameras), to_world_grid(volumes, cameras, into)
    for i, camera in enumerate(cameras):
        np.testing.assert_array_equal(seen[i], to_camera_grid(volumes[i], camera))
        np.testing.assert_array_equal(back[i], to_world_grid(volumes[i], camera, into[i]))
    assert (back[:, 0, 0, 0] == into[:, 0, 0, 0]).any()


def test_any_number_type_and_layout_is_read():
    volume, camera = smooth(5), VIEWPOINTS["left"]
    expected = to_camera_grid(volume, camera)
    np.testing.assert_array_equal(to_camera_grid(np.asfortranarray(volume), camera), expected)
    np.testing.assert_array_equal(to_camera_grid(volume.astype(np.float64), camera), expected)
    np.testing.assert_array_equal(to_camera_grid(np.repeat(volume, 2, 0)[::2], camera), expected)
    np.testing.assert_array_equal(
        to_camera_grid(volume > 0.5, camera), to_camera_grid((volume > 0.5).astype(np.uint8), camera)
    )


def test_a_frustum_that_misses_the_grid_reads_nothing():
    away = Camera(VIEWPOINTS["front"].position, VIEWPOINTS["back"].rotation)
    assert not to_camera_grid(np.ones((64, 64, 64)), away).any()
    assert not to_world_grid(np.ones((64, 64, 64)), away).any()
    into = np.full((64, 64, 64), 0.25, np.float32)
    np.testing.assert_array_equal(to_world_grid(np.ones((64, 64, 64)), away, into), into)
