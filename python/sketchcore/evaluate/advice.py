"""What the advised second viewpoint brings, beside one drawn by lot (the paper's novices drew redundant views)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sketchcore.advice import best_view
from sketchcore.camera import VIEWPOINTS
from sketchcore.evaluate.accuracy import predictions
from sketchcore.evaluate.figure import Figure
from sketchcore.evaluate.report import Report
from sketchcore.evaluate.testset import Example, count_shapes, load_testset
from sketchcore.grids import draw
from sketchcore.nets.model import Model
from sketchcore.rounds import Volume
from sketchcore.volume import iou

LOTS = 2
"""Viewpoints drawn by lot for each shape, of the 12 that are left; the advised one may be among them."""


@dataclass(frozen=True)
class Advice(Report):
    """What `measure_advice` found: IoU in the world grid after the last round, and differences paired by shape.

    Attributes:
        shapes: how many.
        one: of the first drawing alone, from the viewpoint that the test set names first, not displaced.
        advised: with a second drawing from the advised viewpoint.
        random: with one from a viewpoint drawn by lot, the mean of `LOTS`.
        gain: advised less random.
        better: share of lots that the advised viewpoint beats or equals.
        viewpoints: how often each was advised.
        each: [shape] of (one, advised, random).
    """

    shapes: int
    one: Figure
    advised: Figure
    random: Figure
    gain: Figure
    better: float
    viewpoints: dict[str, int]
    each: list[list[float]]


def measure_advice(
    model: Model, shapes: int | None = 100, progress: Callable[[int, int], None] | None = None
) -> Advice:
    """Measures advice on the fixed test set, from exact drawings of the 13 viewpoints.

    Args:
        model: the network.
        shapes: the first so many; None for all 500.
        progress: called as `progress(done, total)` after each shape.

    Raises:
        ValueError: for a number of shapes outside 1 ... 500.
    """
    total = count_shapes(shapes)
    each = np.empty((total, 3))
    beaten = np.empty((total, LOTS))
    viewpoints: Counter[str] = Counter()
    lots = np.random.default_rng(0)
    for i, example in enumerate(load_testset(shapes, progress)):
        first = example.viewpoint
        alone = _reconstruct(model, example, [first])
        name, scores = best_view(alone, [first])
        drawn = [str(other) for other in lots.choice(sorted(scores), LOTS, replace=False)]
        ious = {
            other: iou(_reconstruct(model, example, [first, other]), example.world) for other in sorted({name, *drawn})
        }
        others = np.array([ious[other] for other in drawn])
        each[i] = iou(alone, example.world), ious[name], others.mean()
        beaten[i] = ious[name] >= others
        viewpoints[name] += 1
    one, advised, random = each.T
    return Advice(
        shapes=total,
        one=Figure.of(one),
        advised=Figure.of(advised),
        random=Figure.of(random),
        gain=Figure.of(advised - random),
        better=float(beaten.mean()),
        viewpoints={name: viewpoints[name] for name in VIEWPOINTS},
        each=each.tolist(),
    )


def _reconstruct(model: Model, example: Example, names: Sequence[str]) -> Volume:
    cameras = [VIEWPOINTS[name] for name in names]
    drawings = np.stack([draw(example.shape, camera) for camera in cameras])
    return predictions(model, drawings, cameras)[-1]
