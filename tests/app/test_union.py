"""Parts in a scene: moved, scaled and turned, against shapes that were made there."""

from __future__ import annotations

import numpy as np
import pytest

import sketchcore as sk
from sketchcore.app.document import Placement
from sketchcore.app.union import place, unite


def solid(shape: sk.Shape) -> np.ndarray:
    return sk.voxelize(shape) * np.uint8(255)


def box(center: tuple[float, float, float], half: tuple[float, float, float]) -> sk.Shape:
    return sk.Shape([sk.Cuboid(center, half)])


V = 1 / 64
BOX = box((6 * V, 2 * V, -10 * V), (16 * V, 10 * V, 6 * V))


@pytest.mark.parametrize(
    ("placement", "expected"),
    [
        (Placement((6 * V, -12 * V, 3 * V)), box((12 * V, -10 * V, -7 * V), (16 * V, 10 * V, 6 * V))),
        (Placement(scale=0.5), box((3 * V, V, -5 * V), (8 * V, 5 * V, 3 * V))),
        (Placement(scale=1.5), box((9 * V, 3 * V, -15 * V), (24 * V, 15 * V, 9 * V))),
        (Placement(turn=1), box((10 * V, 2 * V, 6 * V), (6 * V, 10 * V, 16 * V))),
        (Placement(turn=2), box((-6 * V, 2 * V, 10 * V), (16 * V, 10 * V, 6 * V))),
        (Placement(turn=3), box((-10 * V, 2 * V, -6 * V), (6 * V, 10 * V, 16 * V))),
        (Placement((12 * V, -6 * V, 7 * V), 0.5, 1), box((17 * V, -5 * V, 10 * V), (3 * V, 5 * V, 8 * V))),
    ],
)
def test_a_part_stands_where_it_was_placed(placement: Placement, expected: sk.Shape) -> None:
    assert sk.iou(place(solid(BOX), placement) / 255, sk.voxelize(expected)) > 0.97


def test_a_part_that_stays_is_not_resampled() -> None:
    volume = np.random.default_rng(0).integers(0, 256, (64, 64, 64), dtype=np.uint8)
    np.testing.assert_array_equal(place(volume, Placement()), volume)
    for turn in range(4):
        turned = place(volume, Placement(turn=turn))
        np.testing.assert_array_equal(turned, np.rot90(volume, turn, axes=(0, 2)))


def test_moves_by_whole_voxels_lose_nothing_inside_and_all_outside() -> None:
    volume = np.random.default_rng(0).integers(0, 256, (64, 64, 64), dtype=np.uint8)
    moved = place(volume, Placement((3 / 64, 0, -2 / 64)))
    np.testing.assert_array_equal(moved[3:, :, :62], volume[:61, :, 2:])
    assert not moved[:3].any()
    assert not moved[:, :, 62:].any()
    assert not place(volume, Placement((1.5, 0, 0))).any()


def test_a_small_part_keeps_its_volume() -> None:
    cells = np.zeros((64, 64, 64), np.uint8)
    cells[8:56, 8:56, 30:32] = 255  # a sheet two voxels thick
    small = place(cells, Placement(scale=0.25)) / 255
    assert small.sum() == pytest.approx((cells / 255).sum() / 64, rel=0.05)


def test_the_scene_is_the_largest_of_all() -> None:
    a, b = solid(box((-0.2, 0, 0), (0.1, 0.1, 0.1))), solid(box((0.2, 0, 0), (0.1, 0.1, 0.1)))
    scene = unite([(a, Placement()), (b, Placement()), (a, Placement((0.0, 0.3, 0)))])
    expected = sk.voxelize(
        sk.Shape([*(sk.Cuboid(c, (0.1, 0.1, 0.1)) for c in ((-0.2, 0, 0), (0.2, 0, 0), (-0.2, 0.3, 0)))])
    )
    assert sk.iou(scene / 255, expected) > 0.95
    assert not unite([]).any()
