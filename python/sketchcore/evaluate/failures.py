"""Where a network fails: the shapes that it gets most wrong, to look at."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from sketchcore.atomic import replacing
from sketchcore.camera import VIEWPOINTS, Camera
from sketchcore.evaluate.accuracy import predictions
from sketchcore.evaluate.report import Report
from sketchcore.evaluate.testset import Example, count_shapes, load_testset
from sketchcore.nets.model import Model
from sketchcore.picture import shade
from sketchcore.viewpoint import opposite
from sketchcore.volume import iou

SHOWN = 6


@dataclass(frozen=True)
class Failure:
    """One shape.

    Attributes:
        shape: its number in the test set.
        iou: of the solid from its first drawing.
    """

    shape: int
    iou: float


@dataclass(frozen=True)
class Failures(Report):
    """What `measure_failures` found: the worst first; and how many shapes were looked at."""

    shapes: int
    worst: list[Failure]


def measure_failures(
    model: Model,
    shapes: int | None = None,
    out: str | os.PathLike[str] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Failures:
    """The shapes of the test set that a network gets most wrong from one drawing.

    Args:
        model: the network.
        shapes: the first so many; None for all 500.
        out: folder for failures.png: a row each of the drawing, the solid and the truth from where it was drawn, and
            both from the opposite side.
        progress: called as `progress(done, total)` after each shape.

    Raises:
        ValueError: for a number of shapes outside 1 ... 500.
    """
    total = count_shapes(shapes)
    found: list[tuple[float, int, NDArray[np.float32], Example]] = []
    for i, example in enumerate(load_testset(shapes, progress)):
        volume = predictions(model, example.drawings[:1], example.cameras[:1])[-1]
        found.append((iou(volume, example.world), i, volume, example))
        found = sorted(found, key=lambda entry: entry[:2])[:SHOWN]
    if out is not None:
        rows = [_row(example, volume) for _, _, volume, example in found]
        with replacing(Path(out) / "failures.png") as fresh:
            Image.fromarray(np.concatenate(rows)).save(fresh, format="PNG")
    return Failures(total, [Failure(i, score) for score, i, *_ in found])


def _row(example: Example, volume: NDArray[np.float32]) -> NDArray[np.uint8]:
    truth = example.world.astype(np.float32)
    cameras: list[Camera] = [example.cameras[0], VIEWPOINTS[opposite(example.viewpoint)]]
    seen = [shade(solid, camera) for camera in cameras for solid in (volume, truth)]
    return np.concatenate([255 - example.drawings[0], *seen], axis=1)
