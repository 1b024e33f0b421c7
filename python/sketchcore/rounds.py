"""The paper's iterative update: drawing after drawing, round after round (section 3.2). And what a round changed."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from sketchcore import _core

Volume = NDArray[np.float32]
TOLERANCE = 0.02
"""Rounds end when the next is expected to move fewer voxels than this share of the solid's to the other side."""
FIRST = 3.5
"""How much more than its second round a network's first one moves; a later one, about as much as the next."""

Predict = Callable[[int, Volume | None], Volume]


def update_rounds(
    predict: Predict, cameras: NDArray[np.float64], iterations: int, start: Volume | None = None
) -> Iterator[Volume]:
    """Predicts from the first drawing, then visits all drawings `iterations` times: 2, 3, ... n, then 1.

    Args:
        predict: called with a drawing's number and the prior, float32 [64, 64, 64] (depth, row, col) in that drawing's
            camera grid, or None for the first prediction; returns the probability of occupancy in that grid.
        cameras: float64 [n, 15], packed, one a drawing.
        iterations: rounds, 0 or more.
        start: float32 [64, 64, 64], a volume in the world grid known before the first drawing.

    Yields:
        float32 [64, 64, 64] (x, y, z), probability of occupancy in the world grid: after the first prediction
        (round 0), and after each round. What a camera does not see stays as it was.
    """
    volume = visit(predict, cameras, 0, start)
    yield volume
    order = [*range(1, len(cameras)), 0]
    for _ in range(iterations):
        for view in order:
            volume = visit(predict, cameras, view, volume)
        yield volume


def visit(predict: Predict, cameras: NDArray[np.float64], view: int, volume: Volume | None) -> Volume:
    """One pass: the world volume into the drawing's camera grid, through the network, and back."""
    camera = cameras[view : view + 1]
    prior = None if volume is None else _core.to_camera_grid(volume[None], camera)[0]
    prediction = predict(view, prior)
    into = np.zeros((64, 64, 64), np.float32) if volume is None else volume.copy()
    _core.to_world_grid(prediction[None], camera, into[None])
    return into


def until_settled(volumes: Iterator[Volume], tolerance: float = TOLERANCE, first: float = FIRST) -> Iterator[Volume]:
    """The volumes of rounds up to the one after which the next would change next to nothing.

    Args:
        volumes: the first prediction, then each round's.
        tolerance: the least share of the occupied voxels (`crossing`) that a round is worth running for; 0 for all.
        first: the first round may move so many times that share (`Model.first`).
    """
    before: Volume | None = None
    for number, volume in enumerate(volumes):
        yield volume
        if before is not None and crossing(before, volume) < tolerance * (first if number == 1 else 1):
            return
        before = volume


def crossing(before: Volume, after: Volume) -> float:
    """The voxels that are on the other side of one half than before, as a share of those now above it."""
    occupied = after > 0.5
    return int((occupied != (before > 0.5)).sum()) / max(int(occupied.sum()), 1)
