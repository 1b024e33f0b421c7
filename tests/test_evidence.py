import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import reference
from sketchcore import _core
from sketchcore.camera import VIEWPOINTS, Camera, pack_cameras
from sketchcore.grids import draw, voxelize
from sketchcore.shape import Cuboid, Shape

BYTES = st.integers(0, 255)
NAMES = st.lists(st.sampled_from(list(VIEWPOINTS)), min_size=1, max_size=4, unique=True)


@settings(max_examples=20)
@given(reference.shapes(5), st.sampled_from(list(VIEWPOINTS)))
def test_fields_are_distances_to_silhouette_and_ink(shape, name):
    drawing = draw(shape, VIEWPOINTS[name])
    np.testing.assert_array_equal(_core.evidence_fields(drawing[None])[0], reference.fields(drawing))


@pytest.mark.parametrize("value", [0, 255])
def test_fields_of_blank_and_of_full_paper(value):
    drawing = np.full((256, 256), value, np.uint8)
    np.testing.assert_array_equal(_core.evidence_fields(drawing[None])[0], reference.fields(drawing))


def test_fields_of_a_straight_line():
    drawing = np.zeros((1, 256, 256), np.uint8)
    drawing[0, 100] = 255
    column = _core.evidence_fields(drawing)[0, :, 128].astype(int)
    assert column[100, 1] == 255
    assert column[103:100:-1, 1].tolist() == [207, 223, 239]
    assert column[84:120, 1].min() == 0
    # The line is all there is inside: half a pixel in, then half a pixel out, then whole ones.
    assert column[98:103, 0].tolist() == [116, 124, 132, 124, 116]


def displaced(camera, offset):
    return Camera(camera.position + offset, camera.rotation)


@settings(max_examples=10)
@given(reference.shapes(5), NAMES, st.lists(st.floats(-0.05, 0.05), min_size=3, max_size=3))
def test_evidence_is_gathered_along_projections(shape, names, offset):
    cameras = [displaced(VIEWPOINTS[name], offset) for name in names]
    fields = _core.evidence_fields(np.stack([draw(shape, camera) for camera in cameras]))
    got = _core.evidence(fields, pack_cameras(cameras))
    least, most = reference.evidence(fields, cameras)
    assert (got.dtype, got.shape) == (np.uint8, (3, 64, 64, 32))
    # Positions in float32 decide about pixels.
    assert (least - 0.5 - 1e-3 <= got).all()
    assert (got <= most + 0.5 + 1e-3).all()
    assert (most - least > 1).mean() < 0.01


@settings(max_examples=20)
@given(st.lists(st.tuples(BYTES, BYTES), min_size=1, max_size=13))
def test_even_fields_give_least_and_mean(pairs):
    fields = np.empty((len(pairs), 256, 256, 2), np.uint8)
    fields[:] = np.array(pairs)[:, None, None]
    cameras = pack_cameras(list(VIEWPOINTS.values())[: len(pairs)])
    hull, mean, least = _core.evidence(fields, cameras)[:, 32, 32, 0].astype(int)
    signed, nearness = np.array(pairs).T
    assert (hull, least) == (signed.min(), nearness.min())
    assert abs(mean - nearness.mean()) <= 0.5 + 1e-4


def test_what_a_drawing_does_not_see_is_outside_the_hull():
    # From 0.6 away half of the grid is behind the eye or beyond the image; what it does see is 255 all over.
    camera = Camera((0.6, 0, 0), VIEWPOINTS["front"].rotation)
    got = _core.evidence(np.full((1, 256, 256, 2), 255, np.uint8), camera.packed[None])
    at, depth = reference.project(camera, reference.half_centers(64))
    seen = (depth > 0) & (np.abs(at - 128) < 128).all(axis=-1)
    assert 0.2 < seen.mean() < 0.8
    for volume in got:
        np.testing.assert_array_equal(volume, np.where(seen, 255, 0))


def test_behind_the_eye_is_outside_the_hull():
    away = Camera(VIEWPOINTS["front"].position, VIEWPOINTS["back"].rotation)
    assert not _core.evidence(np.full((1, 256, 256, 2), 255, np.uint8), away.packed[None]).any()


def test_the_order_of_drawings_does_not_matter():
    shape = Shape([Cuboid((0.1, 0, 0), (0.2, 0.3, 0.25)), Cuboid((0.3, 0, 0), (0.1, 0.1, 0.1), "subtract")])
    cameras = [VIEWPOINTS[name] for name in ("quarter-037", "top", "left")]
    fields = _core.evidence_fields(np.stack([draw(shape, camera) for camera in cameras]))
    order = [2, 0, 1]
    np.testing.assert_array_equal(
        _core.evidence(fields, pack_cameras(cameras)),
        _core.evidence(fields[order], pack_cameras([cameras[i] for i in order])),
    )


def test_the_hull_holds_the_object():
    shape = Shape([Cuboid((0, 0, 0.2), (0.2, 0.3, 0.1)), Cuboid((0, 0, -0.2), (0.2, 0.3, 0.1))])
    cameras = [VIEWPOINTS[n] for n in ("quarter-037", "front", "top")]
    fields = _core.evidence_fields(np.stack([draw(shape, c) for c in cameras]))
    hull, mean, least = _core.evidence(fields, pack_cameras(cameras))
    inside = voxelize(shape)[:, :, 32:] > 0
    # At most a pixel out of the silhouette, whose border goes through pixels' middles.
    assert hull[inside].min() >= 128 - 8
    assert hull[0, 0].max() == 0
    assert (least <= mean).all()
    # All drawings show the corners (0.2, 0.3, +-0.3). That voxel's centre is 0.013 away, 3 pixels at most; 16 a pixel.
    assert least[44, 51, 18] > 255 - 16 * (3 + 2) > 3 * least.mean()
