"""The pieces of a solid are joined where they most probably meet."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from sketchcore.nets.pieces import LEAST, _cheapest, join_pieces
from sketchcore.outline import pieces


def two_blocks() -> np.ndarray:
    """Two blocks, one above the other, with a gap of six voxels between them."""
    volume = np.full((64, 64, 64), 0.05, np.float32)
    volume[20:40, 10:25, 22:42] = 0.9
    volume[20:40, 31:46, 22:42] = 0.9
    return volume


def test_two_parts_are_joined_along_the_most_probable_way():
    volume = two_blocks()
    volume[28:31, 25:31, 30:34] = 0.4
    volume[36:39, 25:31, 30:34] = 0.3
    joined = join_pieces(volume)
    assert len(pieces(volume)) == 2
    assert len(pieces(joined)) == 1
    assert (joined[28:31, 25:31, 30:34] > 0.5).any(axis=(0, 2)).all()
    assert (joined[36:39] == volume[36:39]).all()
    assert (joined >= volume).all()


def test_dust_is_taken_away_and_parts_that_nothing_joins_stay():
    volume = two_blocks()
    volume[5:7, 5, 10] = volume[5:7, 5, 53] = 0.8
    joined = join_pieces(volume)
    assert pieces(joined) == [20 * 15 * 20] * 2
    assert joined[5, 5, 10] < 0.5
    np.testing.assert_array_equal(np.delete(joined, [5, 6], axis=0), np.delete(volume, [5, 6], axis=0))


def test_what_is_whole_or_empty_stays():
    for volume in (two_blocks()[:, :30].copy(), np.zeros((64, 64, 64), np.float32), np.ones((64, 64, 64), np.float32)):
        assert join_pieces(volume) is volume


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_bridges_are_symmetric_and_lead_through_what_is_possible(seed):
    random = np.random.default_rng(seed)
    half = random.uniform(0, 0.7, (64, 64, 32)).astype(np.float32) ** 2
    half[10:20, 10:20, 4:12] = half[40:60, 10:30, 4:12] = 0.9
    volume = np.concatenate([half[:, :, ::-1], half], axis=2)
    joined = join_pieces(volume)
    np.testing.assert_array_equal(joined, joined[:, :, ::-1])
    assert (volume[joined > volume] > LEAST).all()
    assert len(pieces(joined)) <= len(pieces(volume))
    sizes = pieces(joined)
    assert sizes[-1] >= 0.01 * sizes[0]


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 40))
def test_the_cheapest_voxel_of_each_piece_is_the_first_with_the_least_cost(seed, count):
    random = np.random.default_rng(seed)
    labels = random.integers(0, 50, (8, 8, 8), dtype=np.int32)
    costs = random.integers(0, 4, labels.shape) / 2.0
    costs[random.random(costs.shape) < 0.1] = np.inf
    pieces_ = sorted(set(random.permutation(np.unique(labels))[:count].tolist()))
    expected = [min(np.flatnonzero(labels == piece), key=lambda i: costs.flat[i]) for piece in pieces_]
    assert _cheapest(costs, labels, pieces_).tolist() == expected


def test_thousands_of_pieces_are_joined_as_well():
    random = np.random.default_rng(0)
    half = np.where(random.random((64, 64, 32)) < 0.08, 0.8, 0.2).astype(np.float32)
    half[:4, :4, :2] = 0.8
    volume = np.concatenate([half[:, :, ::-1], half], axis=2)
    joined = join_pieces(volume)
    assert len(pieces(volume)) > 10_000
    assert len(pieces(joined)) == 1


def test_a_part_and_its_mirror_image_are_two_pieces_unless_they_touch():
    apart = np.full((64, 64, 64), 0.2, np.float32)
    apart[20:40, 20:40, 40:50] = apart[20:40, 20:40, 14:24] = 0.9
    joined = join_pieces(apart)
    assert len(pieces(apart)) == 2
    assert len(pieces(joined)) == 1
    touching = apart.copy()
    touching[20:40, 20:40, 24:40] = 0.9
    assert join_pieces(touching) is touching
