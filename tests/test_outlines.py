"""Outlines are filled and what lies beyond them cleared, as far as a volume's own probabilities allow."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, binary_erosion

import reference_outlines
from reference import cameras
from sketchcore import VIEWPOINTS, Cuboid, Shape, _core, draw, iou, voxelize
from sketchcore.camera import pack_cameras
from sketchcore.nets.outlines import heed_outlines
from sketchcore.nets.sketches import BORDER, Sketches
from sketchcore.outline import outline_iou, pieces

SLAB = Shape([Cuboid((0.0, 0.0, 0.0), (0.35, 0.04, 0.3))])
TWO = (VIEWPOINTS["quarter-037"], VIEWPOINTS["quarter-127"])


def sketches_of(shape: Shape, views: int) -> Sketches:
    return Sketches(np.stack([draw(shape, c) for c in TWO[:views]]), pack_cameras(TWO[:views]))


def logit(p: NDArray[np.float32]) -> NDArray[np.float64]:
    q = p.astype(np.float64)
    return np.log(q / (1 - q))


@pytest.mark.parametrize("views", [1, 2])
def test_a_slab_that_nobody_dared_to_fill_is_filled_where_it_is_most_likely(views):
    truth = voxelize(SLAB).astype(np.float32)
    doubtful = 0.9 * truth
    doubtful[24:40] = np.where(truth[24:40] > 0, 0.35, 0.05)  # a gap across the middle
    doubtful = np.maximum(doubtful, 0.01).astype(np.float32)
    assert len(pieces(doubtful)) == 2
    filled = heed_outlines(doubtful, sketches_of(SLAB, views))
    assert len(pieces(filled)) == 1
    assert iou(filled, truth) > 0.85 > 0.75 > iou(doubtful, truth)
    for camera in TWO[:views]:
        drawing = draw(SLAB, camera)
        assert outline_iou(filled, camera, drawing) > 0.94 > 0.8 > outline_iou(doubtful, camera, drawing)


def test_a_surface_that_stands_back_from_its_outline_is_brought_to_it():
    truth = voxelize(SLAB).astype(bool)
    core = binary_erosion(truth)
    timid = np.where(core, 0.95, np.where(truth, 0.3, 0.02)).astype(np.float32)
    sketches = sketches_of(SLAB, 1)
    before, after = (outline_iou(v, TWO[0], sketches.drawings[0]) for v in (timid, heed_outlines(timid, sketches)))
    assert after > 0.89 > 0.85 > before, "the solid itself has 0.97"
    beyond = heed_outlines(timid, sketches) > 0.5
    assert not beyond[~binary_dilation(truth)].any(), "not past it"


def test_what_no_outline_holds_is_cleared_where_the_network_hardly_believes_in_it():
    sketches = sketches_of(SLAB, 2)
    truth = voxelize(SLAB)
    volume = np.where(truth, 0.95, 0.02).astype(np.float32)
    volume[20:44, 50:56, 20:44] = 0.6  # a block above
    volume[28:36, 4:8, 28:36] = 0.999  # one below, of which it is sure
    cleared = heed_outlines(volume, sketches) > 0.5
    assert not cleared[20:44, 50:56, 20:44].any()
    assert cleared[28:36, 4:8, 28:36].all()
    assert cleared[truth == 1].all()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.lists(cameras(), min_size=1, max_size=3))
def test_the_kernel_is_its_twin(seed, views):
    random = np.random.default_rng(seed)
    half = random.uniform(-0.2, 1.2, (64, 64, 32)).clip(0, 1).astype(np.float32)
    volume = np.concatenate([half[:, :, ::-1], half], axis=2)
    depths = random.uniform(-4, 8, (len(views), 64, 64)).astype(np.float32)
    hull = random.integers(100, 140, (64, 64, 32), dtype=np.uint8)
    heeded = _core.heed_outlines(volume, depths, pack_cameras(views), hull)
    slowly, close = reference_outlines.heed(volume, depths, views, hull)
    np.testing.assert_array_equal(heeded[:, :, :32], heeded[:, :, :31:-1])
    np.testing.assert_allclose(heeded[:, :, 32:][~close], slowly[~close], atol=2e-4)
    assert close.mean() < 0.6


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 2))
def test_logits_move_within_the_limit_and_only_where_they_should(seed, views):
    random = np.random.default_rng(seed)
    half = random.uniform(0.02, 0.98, (64, 64, 32)).astype(np.float32)
    volume = np.concatenate([half[:, :, ::-1], half], axis=2)
    sketches = sketches_of(SLAB, views)
    heeded = heed_outlines(volume, sketches)
    assert heeded.dtype == np.float32
    np.testing.assert_allclose(heeded, heeded[:, :, ::-1], atol=1e-6)
    moved = logit(heeded)[:, :, 32:] - logit(volume)[:, :, 32:]
    hull = sketches.evidence[0]
    assert np.abs(moved).max() <= 2 + 1e-3
    assert moved[hull >= BORDER].min() >= -1e-3
    assert moved[hull < BORDER - 16].max() <= 1e-3


def test_what_agrees_with_its_outlines_stays():
    volume = np.where(voxelize(SLAB), 0.97, 0.01).astype(np.float32)
    np.testing.assert_allclose(heed_outlines(volume, sketches_of(SLAB, 2)), volume, atol=0.05)


def test_nothing_and_everything_stay_finite():
    for value in (0.0, 1.0):
        volume = np.full((64, 64, 64), value, np.float32)
        heeded = heed_outlines(volume, sketches_of(SLAB, 1))
        assert np.isfinite(heeded).all()
        assert ((heeded > 0.5) == (volume > 0.5)).all()
