"""What rounds do to a solid: how much each one moves, what it gains, and whether the order of the drawings matters."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sketchcore.camera import pack_cameras
from sketchcore.evaluate.accuracy import ROUNDS, VIEWS, predictions
from sketchcore.evaluate.figure import Figure
from sketchcore.evaluate.report import Report
from sketchcore.evaluate.testset import Example, count_shapes, load_testset
from sketchcore.nets.model import Model
from sketchcore.nets.sketches import Sketches
from sketchcore.volume import iou

MANY_ROUNDS = 10
ORDERS = 4


@dataclass(frozen=True)
class Convergence(Report):
    """What `measure_convergence` found; lists over views count from one view.

    Attributes:
        shapes: how many.
        change: [views][round], L2 distance between the probabilities of a round and of the one before, from round 1.
        network: [views][round], IoU, rounds from 0 (first prediction).
        refined: what the rounds gain on a single drawing's first prediction.
        lost: [views], the best round's mean IoU less the last round's.
        orders: [views - 1], from two drawings on: standard deviation of a shape's IoU over orders of its drawings.
    """

    shapes: int
    change: list[list[Figure]]
    network: list[list[Figure]]
    refined: Figure
    lost: list[float]
    orders: list[Figure]


def measure_convergence(
    model: Model, shapes: int | None = 100, progress: Callable[[int, int], None] | None = None
) -> Convergence:
    """Ten rounds, none saved, over one to four drawings of the test set, and orders of them (paper, section 6.4).

    Args:
        model: the network.
        shapes: the first so many; None for all 500.
        progress: called as `progress(done, total)` after each shape.

    Raises:
        ValueError: for a number of shapes outside 1 ... 500.
    """
    total = count_shapes(shapes)
    network = np.empty((total, VIEWS, MANY_ROUNDS + 1))
    change = np.empty((total, VIEWS, MANY_ROUNDS))
    orders = np.empty((total, VIEWS - 1))
    for i, example in enumerate(load_testset(shapes, progress)):
        for v in range(VIEWS):
            volumes = predictions(model, example.drawings[: v + 1], example.cameras[: v + 1], MANY_ROUNDS, tolerance=0)
            network[i, v] = [iou(volume, example.world) for volume in volumes]
            change[i, v] = [float(np.linalg.norm(b - a)) for a, b in itertools.pairwise(volumes)]
            if v > 0:
                orders[i, v - 1] = _spread(model, example, v + 1)
    means = network.mean(axis=0)
    return Convergence(
        shapes=total,
        change=[[Figure.of(change[:, v, r]) for r in range(MANY_ROUNDS)] for v in range(VIEWS)],
        network=[[Figure.of(network[:, v, r]) for r in range(MANY_ROUNDS + 1)] for v in range(VIEWS)],
        refined=Figure.of(network[:, 0, -1] - network[:, 0, 0]),
        lost=(means.max(axis=1) - means[:, -1]).tolist(),
        orders=[Figure.of(orders[:, v]) for v in range(VIEWS - 1)],
    )


def _spread(model: Model, example: Example, views: int) -> float:
    """Of the IoU over rotations of the order of the drawings: each of them comes first once."""
    cameras = pack_cameras(example.cameras)
    scores = []
    for first in range(min(views, ORDERS)):
        order = np.roll(np.arange(views), -first)
        sketches = model.in_place(Sketches(example.drawings[order], cameras[order]))
        *_, volume = model.rounds(sketches, ROUNDS)
        scores.append(iou(volume, example.world))
    return float(np.std(scores))
