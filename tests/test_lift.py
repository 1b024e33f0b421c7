import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import reference
from sketchcore import _core
from sketchcore.camera import VIEWPOINTS, Camera, pack_cameras

SEEDS = st.integers(0, 2**32 - 1)
WIDTHS = st.integers(1, 3)
ENTRIES = 64 * 64 * 16
CELLS = 32 * 32 * 16
HALF_ULP = 2.0**-24
"""Relative error of one operation in float32."""
READING = 10 * HALF_ULP
"""Of a reading: each of eight weights and products is rounded, and so are the sums they go through."""


def nearer(camera, share):
    return Camera(camera.position * share, camera.rotation, camera.fov_degrees, camera.near, camera.far)


# From anywhere between the origin, in the middle of the cells, and where drawings are made.
CAMERAS = reference.cameras() | st.builds(nearer, reference.cameras(), st.floats(0, 1))


def noise(seed, *shape):
    return np.random.default_rng(seed).uniform(-1, 1, shape).astype(np.float32)


def lift(features, camera):
    return _core.lift(features[None], camera.packed[None])[0]


def lift_transposed(gradient, camera):
    return _core.lift_transposed(gradient[None], camera.packed[None])[0]


def taps(camera):
    rows, weights = _core.lift_taps(camera.packed[None])
    return rows[0], weights[0]


def places(camera):
    """Where each cell reads, [16384, 2, 3]: row, column, bin; NaN behind the eye."""
    centers = reference.half_centers(32).reshape(-1, 1, 3)
    return reference.feature_places(camera, np.concatenate([centers, centers * reference.MIRROR], axis=1))


def among_pixels(at):
    """Whether a place lies between the centres of pixels; rounding decides who lies on the outermost ones."""
    return ((at[..., :2] > 1e-9) & (at[..., :2] < 63 - 1e-9)).all(axis=-1)


@settings(max_examples=40)
@given(SEEDS, WIDTHS, CAMERAS)
def test_cells_read_linearly_between_pixels_and_depths(seed, width, camera):
    features = noise(seed, ENTRIES, width)
    got = lift(features, camera)
    assert (got.dtype, got.shape) == (np.float32, (CELLS, 2 * width))
    np.testing.assert_allclose(got, reference.lift(features, camera), rtol=0, atol=READING)


@settings(max_examples=20)
@given(SEEDS, WIDTHS, CAMERAS)
def test_the_transpose_is_the_transpose(seed, width, camera):
    features, gradient = noise(seed, ENTRIES, width), noise(seed + 1, CELLS, 2 * width)
    there = np.vdot(lift(features, camera).astype(float), gradient)
    back = np.vdot(features.astype(float), lift_transposed(gradient, camera))
    rows, weights = taps(camera)
    most = np.bincount(rows[weights > 0], minlength=1).max(initial=0)
    terms = np.vdot(lift(np.abs(features), camera).astype(float), np.abs(gradient))
    assert abs(there - back) <= (READING + (most + 2) * HALF_ULP) * terms


@settings(max_examples=20)
@given(SEEDS, WIDTHS, CAMERAS)
def test_taps_give_the_same_readings(seed, width, camera):
    features = noise(seed, ENTRIES, width)
    rows, weights = taps(camera)
    assert (rows.dtype, rows.shape) == (np.int32, (CELLS, 2, 8))
    assert (weights.dtype, weights.shape) == (np.float32, (CELLS, 2, 8))
    assert rows.min() >= 0
    assert rows.max() < ENTRIES
    assert weights.min() >= 0
    read = np.einsum("csk,cskw->csw", weights, features[rows], dtype=np.float64)
    np.testing.assert_allclose(read.reshape(CELLS, -1), lift(features, camera), rtol=0, atol=READING)


@settings(max_examples=20)
@given(CAMERAS)
def test_weights_sum_to_one_inside_the_image_and_to_zero_far_outside(camera):
    total = taps(camera)[1].sum(axis=-1, dtype=np.float64)
    at = places(camera)
    np.testing.assert_allclose(total[among_pixels(at)], 1, rtol=0, atol=8 * HALF_ULP)
    behind = np.isnan(at[..., 0])
    outside = ((at[..., :2] <= -1 - 1e-9) | (at[..., :2] >= 64 + 1e-9)).any(axis=-1)
    assert not total[behind | outside].any()
    assert total.max(initial=0) <= 1 + 8 * HALF_ULP


@settings(max_examples=20)
@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4), CAMERAS)
def test_a_linear_field_is_read_exactly(slope, camera):
    pixel, bin_ = np.divmod(np.arange(ENTRIES), 16)
    field = np.stack([pixel // 64, pixel % 64, bin_, np.ones(ENTRIES)], axis=-1) @ slope
    got = lift(field.astype(np.float32)[:, None], camera)
    at = places(camera)
    inside = among_pixels(at)
    # Linear reading of a linear field has no error of its own; the field itself is rounded once.
    bound = (READING + HALF_ULP) * np.abs(field).max() + 1e-12
    np.testing.assert_allclose(got[inside], (at @ slope[:3] + slope[3])[inside], rtol=0, atol=bound)


@settings(max_examples=20)
@given(SEEDS, WIDTHS, CAMERAS)
def test_the_mirror_image_is_what_the_mirrored_camera_sees(seed, width, camera):
    # Mirrored, right becomes left: the camera's x axis is turned round, and so are the pixels of each row.
    axes = camera.rotation * reference.MIRROR * np.array([[-1], [1], [1]])
    mirrored = Camera(camera.position * reference.MIRROR, axes, camera.fov_degrees, camera.near, camera.far)
    features = noise(seed, 64, 64, 16, width)
    own, image = np.split(lift(features.reshape(ENTRIES, -1), camera), 2, axis=1)
    flipped = np.ascontiguousarray(features[:, ::-1]).reshape(ENTRIES, -1)
    own_of_mirrored, image_of_mirrored = np.split(lift(flipped, mirrored), 2, axis=1)
    np.testing.assert_allclose(own_of_mirrored, image, rtol=0, atol=2 * READING)
    np.testing.assert_allclose(image_of_mirrored, own, rtol=0, atol=2 * READING)


def test_cells_are_in_order_and_pixels_are_the_images_own():
    # From the front, at (2, 0, 0): depth grows against x, rows against y, columns against z.
    pixel, bin_ = np.divmod(np.arange(ENTRIES), 16)
    features = np.stack([pixel // 64, pixel % 64, bin_], axis=-1).astype(np.float32)
    got = lift(features, VIEWPOINTS["front"]).reshape(32, 32, 16, 2, 3)
    at = (np.arange(32) + 0.5) / 32 - 0.5
    x, y, z = np.meshgrid(at, at, at[16:], indexing="ij")
    size = 32 / np.tan(np.radians(22.5)) / (2 - x)
    inside = (np.abs(y) * size < 31.5) & (z * size < 31.5)
    assert inside.mean() > 0.9
    for side in (0, 1):
        rows, cols, depths = got[..., side, :][inside].T
        np.testing.assert_allclose(rows, (31.5 - y * size)[inside], atol=1e-4)
        np.testing.assert_allclose(cols, (31.5 - (1, -1)[side] * z * size)[inside], atol=1e-4)
        np.testing.assert_allclose(depths, ((2 - x - 1.25) / 1.5 * 16 - 0.5)[inside], atol=1e-4)


@pytest.mark.parametrize(("near", "far", "bin_"), [(3.0, 4.0, 0), (0.5, 1.0, 15)])
def test_depths_beyond_the_outermost_are_read_there(near, far, bin_):
    front = VIEWPOINTS["front"]
    # The grid fills more than the image: cells read the very last entry, and must not read beyond it.
    camera = Camera(front.position, front.rotation, fov_degrees=30.0, near=near, far=far)
    features = np.tile(np.arange(16, dtype=np.float32), 64 * 64)[:, None]
    inside = among_pixels(places(camera))
    np.testing.assert_allclose(lift(features, camera)[inside], bin_, atol=1e-5)
    rows, weights = taps(camera)
    assert rows.max() // 16 == 64 * 64 - 1
    assert (rows[weights > 0] % 16 == bin_).all()


def test_behind_the_eye_nothing_is_read():
    away = Camera(VIEWPOINTS["front"].position, VIEWPOINTS["back"].rotation)
    assert not lift(np.ones((ENTRIES, 2), np.float32), away).any()
    assert not lift_transposed(np.ones((CELLS, 4), np.float32), away).any()
    assert not taps(away)[1].any()


def test_batches_are_their_drawings_one_by_one():
    cameras = [VIEWPOINTS[name] for name in ("front", "top", "quarter-217")]
    rows = pack_cameras(cameras)
    features, gradient = noise(0, 3, ENTRIES, 2), noise(1, 3, CELLS, 4)
    for i, camera in enumerate(cameras):
        np.testing.assert_array_equal(_core.lift(features, rows)[i], lift(features[i], camera))
        np.testing.assert_array_equal(_core.lift_transposed(gradient, rows)[i], lift_transposed(gradient[i], camera))
        for of_all, of_one in zip(_core.lift_taps(rows), taps(camera), strict=True):
            np.testing.assert_array_equal(of_all[i], of_one)


def test_no_drawings_read_nothing():
    none = np.zeros((0, 15))
    assert _core.lift(np.zeros((0, ENTRIES, 3), np.float32), none).shape == (0, CELLS, 6)
    assert _core.lift_transposed(np.zeros((0, CELLS, 6), np.float32), none).shape == (0, ENTRIES, 3)
    assert [taps.shape for taps in _core.lift_taps(none)] == [(0, CELLS, 2, 8)] * 2


def test_what_a_network_makes_is_passed_on_even_when_it_is_not_a_number():
    # A diverged network is the training's to notice: it looks at the loss.
    features = np.full((ENTRIES, 1), np.nan, np.float32)
    assert np.isnan(lift(features, VIEWPOINTS["top"])).all()


@pytest.mark.parametrize("width", [0, 1, 3])
def test_a_gradient_has_features_for_both_readings(width):
    with pytest.raises(ValueError, match=rf"gradient must .* \[n, 16384, 2 \* width > 0\], got \[1, 16384, {width}\]"):
        lift_transposed(np.zeros((CELLS, width), np.float32), VIEWPOINTS["top"])


def test_features_have_at_least_one_channel():
    with pytest.raises(ValueError, match=r"features must .* \[n, 65536, width > 0\], got \[1, 65536, 0\]"):
        lift(np.zeros((ENTRIES, 0), np.float32), VIEWPOINTS["top"])


@pytest.mark.parametrize("function", [_core.lift, _core.lift_transposed])
def test_a_number_alone_is_no_array_of_features(function):
    with pytest.raises(ValueError, match=r"must have shape \[n, .*\], got \[\]"):
        function(np.zeros((), np.float32), VIEWPOINTS["top"].packed[None])
