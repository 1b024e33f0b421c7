"""What networks are told to be right, against slow twins written from the definitions."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given, settings

import reference
import sketchcore as sk
from sketchcore.datagen.generate import Batch
from sketchcore.train.loss import distance_loss
from sketchcore.train.truth import REACH, WORLD_TRUTHS, binary, distance, fractional, in_camera_grids


def batch_of(shape: sk.Shape) -> Batch:
    """A batch of one shape, without drawings."""
    none = np.zeros((1, 0, 256, 256), np.uint8)
    return Batch(none, sk.voxelize(shape)[None], none, np.zeros((1, 0, 15)), [shape.packed])


def mirrored(shape: sk.Shape) -> sk.Shape:
    """The shape and its mirror image about z = 0, each primitive beside its own."""
    rows = shape.packed.copy()
    rows[:, 4] *= -1
    other = sk.Shape.from_packed(rows)
    return sk.Shape([p for pair in zip(shape.primitives, other.primitives, strict=True) for p in pair])


def test_binary_truth_is_the_half_grid() -> None:
    batch = sk.generate(3, 2)
    for index in range(2):
        np.testing.assert_array_equal(binary(batch, index), batch.world[index, :, :, 32:])
    assert binary(batch, 0).dtype == np.float32


@settings(max_examples=10)
@given(reference.shapes())
def test_fractional_truth_counts_samples_inside(shape: sk.Shape) -> None:
    rng = np.random.default_rng(0)
    # Where shares are between 0 and 1 above all.
    share = fractional(batch_of(shape), 0)
    partly = np.argwhere((share > 0) & (share < 1))
    picked = np.concatenate([rng.permutation(partly)[:60], rng.integers(0, (64, 64, 32), (40, 3))])
    inner = (np.arange(4) - 1.5) / 4
    offsets = np.stack(np.meshgrid(inner, inner, inner, indexing="ij"), axis=-1).reshape(-1, 3)
    points = (picked[:, None] + np.array([0, 0, 32]) + offsets + 0.5) / 64 - 0.5
    # Points on a face may fall to either side: moved by a hair each way, they bound the count.
    counts = [
        reference.contains(shape, points + hair).mean(axis=1)
        for hair in 1e-9 * np.array([[0, 0, 0], [1, 1, 1], [-1, -1, -1], [1, -1, 1], [-1, 1, -1]])[:, None, None]
    ]
    got = share[tuple(picked.T)]
    agree = (got >= np.min(counts, axis=0) - 1e-6) & (got <= np.max(counts, axis=0) + 1e-6)
    assert agree.all()


def test_fractional_truth_of_a_cuboid_is_exact_where_faces_lie_between_samples() -> None:
    # Faces at a quarter of a voxel from the voxels' borders: shares are products of 1/4, 3/4 and 1.
    quarter = 1 / 256
    shape = sk.Shape([sk.Cuboid((0, 0, 0), (16 / 64 + quarter, 8 / 64 - quarter, 20 / 64 + 2 * quarter))])
    share = fractional(batch_of(shape), 0)
    along_x = np.clip(np.minimum(np.arange(64) - 14.75, 48.25 - np.arange(64)), 0, 1)
    along_y = np.clip(np.minimum(np.arange(64) - 23.25, 39.75 - np.arange(64)), 0, 1)
    along_z = np.clip(20.5 - np.arange(32), 0, 1)
    expected = along_x[:, None, None] * along_y[:, None] * along_z
    np.testing.assert_allclose(share, expected, atol=1e-6)
    assert set(np.unique(share)) > {0.0, 1.0}


def test_fractions_are_undecided_where_the_binary_truth_changes() -> None:
    batch = sk.generate(5, 1)
    share, whole = fractional(batch, 0), binary(batch, 0)
    assert share.dtype == np.float32
    assert ((share > 0.5) == (whole > 0.5))[(share < 0.3) | (share > 0.7)].mean() > 0.995
    assert share.mean() == pytest.approx(whole.mean(), rel=0.1)


@settings(max_examples=10)
@given(reference.shapes(4).map(mirrored))
def test_distance_is_to_the_nearest_centre_on_the_other_side(shape: sk.Shape) -> None:
    batch = batch_of(shape)
    world = batch.world[0] > 0
    if not world[:, :, 31 - REACH :].any():
        with pytest.raises(ValueError, match="no surface"):
            distance(batch, 0)
        return
    got = distance(batch, 0)
    assert got.shape == (64, 64, 32)
    np.testing.assert_array_equal(got > 0, world[:, :, 32:])
    rng = np.random.default_rng(0)
    near = rng.permutation(np.argwhere(np.abs(got) < REACH))[:30]
    for x, y, z in [*near, *rng.integers(0, (64, 64, 32), (30, 3))]:
        others = np.argwhere(world != world[x, y, 32 + z])
        exact = np.sqrt(((others - [x, y, 32 + z]) ** 2).sum(axis=1).min()) - 0.5
        signed = exact if world[x, y, 32 + z] else -exact
        assert got[x, y, z] == pytest.approx(np.clip(signed, -REACH, REACH), abs=1e-5)


def test_a_plane_of_symmetry_is_no_surface() -> None:
    got = distance(batch_of(sk.Shape([sk.Cuboid((0, 0, 0), (0.25, 0.25, 0.25))])), 0)
    assert got[32, 32, 0] == REACH
    np.testing.assert_allclose(got[32, 32, 12:20], [3.5, 2.5, 1.5, 0.5, -0.5, -1.5, -2.5, -3.5])


def test_an_empty_grid_has_no_surface() -> None:
    batch = batch_of(sk.Shape([sk.Cuboid((0, 0, 0), (0.25, 0.25, 0.25))]))
    for value in (0, 1):
        batch.world[:] = value
        with pytest.raises(ValueError, match="no surface"):
            distance(batch, 0)


def test_distance_loss_against_numpy() -> None:
    rng = np.random.default_rng(0)
    got, truth = rng.normal(size=(2, 2, 64, 64, 32)).astype(np.float32)
    loss = distance_loss(torch.from_numpy(got), torch.from_numpy(truth))
    assert float(loss) == pytest.approx(np.abs(got - truth).mean(), rel=1e-5)


def test_camera_grids_are_shares_or_halves() -> None:
    frusta = np.arange(256, dtype=np.uint8)
    np.testing.assert_array_equal(in_camera_grids("fractional", frusta), frusta)
    np.testing.assert_array_equal(in_camera_grids("binary", frusta), 255 * (np.arange(256) / 255 > 0.5))
    with pytest.raises(ValueError, match="'fractional' or 'binary', got 'distance'"):
        in_camera_grids("distance", frusta)


def test_every_truth_is_of_the_half_grid() -> None:
    batch = sk.generate(1, 1)
    for name, truth in WORLD_TRUTHS.items():
        made = truth(batch, 0)
        assert (made.shape, made.dtype) == ((64, 64, 32), np.float32), name
        assert made.flags.c_contiguous
