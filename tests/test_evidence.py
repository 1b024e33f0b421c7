import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import reference
from sketchcore import _core
from sketchcore.camera import VIEWPOINTS, pack_cameras
from sketchcore.grids import draw, voxelize
from sketchcore.shape import Cuboid, Shape

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


@pytest.mark.slow
@settings(max_examples=10)
@given(
    reference.shapes(5),
    NAMES,
    st.booleans(),
    st.lists(st.floats(-0.05, 0.05), min_size=3, max_size=3),
    st.data(),
)
def test_evidence_is_gathered_along_projections(shape, names, mirror, offset, data):
    target = data.draw(st.integers(0, len(names) - 1))
    cameras = [VIEWPOINTS[name] for name in names]
    moved = type(cameras[0])(cameras[target].position + offset, cameras[target].rotation)
    cameras[target] = moved
    fields = _core.evidence_fields(np.stack([draw(shape, camera) for camera in cameras]))
    got = _core.evidence(fields, pack_cameras(cameras), target, mirror)
    least, most = reference.evidence(fields, cameras, target, mirror)
    # Positions in float32 decide about pixels.
    assert (least - 0.5 - 1e-3 <= got).all()
    assert (got <= most + 0.5 + 1e-3).all()
    assert (most - least > 1).mean() < 0.01


def test_the_hull_holds_the_object():
    shape = Shape([Cuboid((0, 0, 0.2), (0.2, 0.3, 0.1)), Cuboid((0, 0, -0.2), (0.2, 0.3, 0.1))])
    cameras = [VIEWPOINTS[n] for n in ("quarter-037", "front", "right")]
    fields = _core.evidence_fields(np.stack([draw(shape, c) for c in cameras]))
    hull, match = _core.evidence(fields, pack_cameras(cameras), 0, True)
    inside = reference.contains(shape, reference.cell_centers(cameras[0]))
    # At most a pixel out of the silhouette, whose border goes through pixels' middles.
    assert hull[inside].min() >= 128 - 8
    assert hull[:, 0, 0].max() == 0
    assert 0 < match.mean() < 255
    assert voxelize(shape).any()


def test_one_drawing_alone_has_no_match():
    drawing = draw(Shape([Cuboid((0, 0, 0), (0.3, 0.3, 0.3))]), VIEWPOINTS["front"])
    fields = _core.evidence_fields(drawing[None])
    row = pack_cameras([VIEWPOINTS["front"]])
    assert not _core.evidence(fields, row, 0, False)[1].any()
    assert _core.evidence(fields, row, 0, True)[1].any()
