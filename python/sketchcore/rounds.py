"""The iterative update: drawing after drawing, round after round (paper, section 3.2)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from sketchcore import _core
from sketchcore.consensus import Consensus
from sketchcore.nets.models import Model, Sketches

Volume = NDArray[np.float32]


def update_rounds(model: Model, sketches: Sketches, iterations: int, start: Volume | None = None) -> Iterator[Volume]:
    """Predicts from the first drawing, then visits all drawings `iterations` times: 2, 3, ... n, then 1.

    Args:
        model: the network.
        sketches: the drawings.
        iterations: rounds, 0 or more.
        start: float32 [64, 64, 64], a volume known before the first drawing; it counts as one prediction.

    Yields:
        float32 [64, 64, 64] (x, y, z), probability of occupancy in the world grid: after the first prediction
        (round 0), and after each round.
    """
    consensus = Consensus(symmetric=model.symmetric, latest_only=model.latest_only)
    if start is not None:
        consensus.add(-1, start)
    yield visit(model, sketches, 0, consensus)
    order = [*range(1, len(sketches.drawings)), 0]
    for _ in range(iterations):
        for view in order:
            volume = visit(model, sketches, view, consensus)
        yield volume


def visit(model: Model, sketches: Sketches, view: int, consensus: Consensus) -> Volume:
    """One pass: the consensus into the drawing's camera grid, through the network, and back.

    Returns:
        the new consensus.
    """
    camera = sketches.cameras[view : view + 1]
    world = consensus.volume
    prior = None if world is None else _core.to_camera_grid(world[None], camera)[0]
    prediction = model.predict(sketches, view, prior)
    into = np.zeros((1, 64, 64, 64), np.float32) if world is None else world[None].copy()
    _core.to_world_grid(prediction[None], camera, into)
    return consensus.add(view, into[0])
