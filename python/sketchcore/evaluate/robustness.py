"""What faulty drawings cost: IoU on the fixed test set from drawings distorted in three strengths."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sketchcore.evaluate.accuracy import VIEWS, predictions
from sketchcore.evaluate.distort import STRENGTHS, distorted
from sketchcore.evaluate.figure import Figure
from sketchcore.evaluate.report import Report
from sketchcore.evaluate.testset import ShapeExample, count_shapes, load_testset
from sketchcore.nets.model import Model
from sketchcore.volume import iou

COUNTS = (1, VIEWS)
"""Numbers of drawings that are measured."""
TOGETHER = "all together"


@dataclass(frozen=True)
class Robustness(Report):
    """What `measure_robustness` found.

    Attributes:
        shapes: how many.
        clean: IoU from clean drawings, one for each of `COUNTS`.
        drop: fault -> [strength][count], what the fault costs: IoU from clean drawings less that from faulty ones.
    """

    shapes: int
    clean: list[Figure]
    drop: dict[str, list[list[Figure]]]


def measure_robustness(
    model: Model, shapes: int | None = 50, progress: Callable[[int, int], None] | None = None
) -> Robustness:
    """Each fault of `distort.STRENGTHS` alone, and all together.

    Args:
        model: the network.
        shapes: the first so many; None for all 500.
        progress: called as `progress(done, total)` after each shape.

    Raises:
        ValueError: for a number of shapes outside 1 ... 500.
    """
    total = count_shapes(shapes)
    clean = np.empty((total, len(COUNTS)))
    kinds: dict[str, tuple[str, ...]] = {name: (name,) for name in STRENGTHS} | {TOGETHER: tuple(STRENGTHS)}
    spoilt = {kind: np.empty((total, 3, len(COUNTS))) for kind in kinds}
    for i, example in enumerate(load_testset(shapes, progress)):
        clean[i] = _scores(model, example, {}, i)
        for kind, names in kinds.items():
            for strength in (1, 2, 3):
                faults = dict.fromkeys(names, strength)
                spoilt[kind][i, strength - 1] = _scores(model, example, faults, i)
    counts = range(len(COUNTS))
    return Robustness(
        shapes=total,
        clean=[Figure.of(clean[:, c]) for c in counts],
        drop={
            kind: [[Figure.of(clean[:, c] - values[:, s, c]) for c in counts] for s in range(3)]
            for kind, values in spoilt.items()
        },
    )


def _scores(model: Model, example: ShapeExample, faults: dict[str, int], seed: int) -> list[float]:
    drawings = np.stack(
        [
            distorted(example.shape, camera, faults, np.random.default_rng((seed, v)))
            for v, camera in enumerate(example.cameras)
        ]
    )
    return [iou(predictions(model, drawings[:n], example.cameras[:n])[-1], example.world) for n in COUNTS]
