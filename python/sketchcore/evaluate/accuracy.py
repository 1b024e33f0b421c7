"""IoU in the world grid against the number of drawings and rounds, beside carving and the grid's own ceiling."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sketchcore.camera import pack_cameras
from sketchcore.evaluate.testset import Example, load_testset
from sketchcore.grids import carve, to_world_grid
from sketchcore.nets.models import Model
from sketchcore.nets.sketches import Sketches
from sketchcore.viewpoint import guess_viewpoint
from sketchcore.volume import iou

VIEWS = 4
ROUNDS = 5
RESAMPLES = 10_000


@dataclass(frozen=True)
class Figure:
    """A mean over the test set with its 95 % bootstrap interval."""

    mean: float
    low: float
    high: float

    @classmethod
    def of(cls, values: NDArray[np.float64]) -> Figure:
        """The mean of one value a shape; shapes are drawn again with replacement, always in the same way."""
        random = np.random.default_rng(0)
        picks = random.integers(0, len(values), (RESAMPLES, len(values)))
        low, high = np.quantile(values[picks].mean(axis=1), [0.025, 0.975])
        return cls(float(values.mean()), float(low), float(high))


@dataclass(frozen=True)
class Report:
    """What `evaluate` measured; lists over views count from one view.

    Attributes:
        shapes: how many.
        network: [views][round], rounds from 0 (first prediction).
        carving: [views], silhouette carving from the same drawings.
        orthogonal: [views], carving from front, top, right, back.
        ceiling: IoU of the true camera grid taken to the world grid: what one prediction can reach.
        viewpoint: share of first drawings whose viewpoint is guessed, up to the half turn about y.
        seconds: seconds a shape for all passes of the network.
    """

    shapes: int
    network: list[list[Figure]]
    carving: list[Figure]
    orthogonal: list[Figure]
    ceiling: Figure
    viewpoint: Figure
    seconds: float

    def to_dict(self) -> dict[str, Any]:
        """The report as plain data."""
        return asdict(self)


def evaluate(model: Model, shapes: int | None = None, progress: Callable[[int, int], None] | None = None) -> Report:
    """Measures a model on the fixed test set, from exact drawings, in the world grid.

    Args:
        model: the network.
        shapes: the first so many; None for all 500.
        progress: called as `progress(done, total)` after each shape.

    Raises:
        ValueError: for a number of shapes outside 1 ... 500.
    """
    examples = list(load_testset(shapes))
    network = np.empty((len(examples), VIEWS, ROUNDS + 1))
    carving, orthogonal = np.empty((2, len(examples), VIEWS))
    ceiling, viewpoint = np.empty((2, len(examples)))
    seconds = 0.0
    for i, example in enumerate(examples):
        started = time.perf_counter()
        network[i] = _network(model, example)
        seconds += time.perf_counter() - started
        carving[i] = _carving(example.drawings, list(example.cameras), example)
        orthogonal[i] = _carving(*example.orthogonal, example)
        ceiling[i] = iou(to_world_grid(example.frustum(0), example.cameras[0]), example.world)
        viewpoint[i] = _same_up_to_half_turn(guess_viewpoint(model, example.drawings[0])[0], example.viewpoint)
        if progress is not None:
            progress(i + 1, len(examples))
    views = range(VIEWS)
    return Report(
        shapes=len(examples),
        network=[[Figure.of(network[:, v, r]) for r in range(ROUNDS + 1)] for v in views],
        carving=[Figure.of(carving[:, v]) for v in views],
        orthogonal=[Figure.of(orthogonal[:, v]) for v in views],
        ceiling=Figure.of(ceiling),
        viewpoint=Figure.of(viewpoint),
        seconds=seconds / len(examples),
    )


def _network(model: Model, example: Example) -> list[list[float]]:
    cameras = pack_cameras(example.cameras)
    return [
        [iou(volume, example.world) for volume in model.rounds(Sketches(example.drawings[:n], cameras[:n]), ROUNDS)]
        for n in range(1, VIEWS + 1)
    ]


def _carving(drawings: NDArray[np.uint8], cameras: list[Any], example: Example) -> list[float]:
    return [iou(carve(drawings[:n], cameras[:n]), example.world) for n in range(1, VIEWS + 1)]


def _same_up_to_half_turn(guess: str, truth: str) -> bool:
    """Whether two three-quarter views are the same or a half turn about y apart: 037 and 217, and so on."""

    def turn(name: str) -> int:
        return int(name.removeprefix("quarter-")) % 180

    return turn(guess) == turn(truth)
