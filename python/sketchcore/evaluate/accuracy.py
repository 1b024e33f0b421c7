"""IoU in the world grid against the number of drawings and rounds, beside carving and the grid's own ceiling."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sketchcore.camera import Camera, pack_cameras
from sketchcore.datagen.prepared import Prepared
from sketchcore.evaluate.figure import Figure
from sketchcore.evaluate.report import Report
from sketchcore.evaluate.testset import Example, count_shapes, load_meshes, load_testset
from sketchcore.grids import carve, to_world_grid
from sketchcore.nets.model import Model
from sketchcore.nets.sketches import Sketches
from sketchcore.rounds import TOLERANCE, Volume, until_settled
from sketchcore.viewpoint import guess_viewpoint, opposite
from sketchcore.volume import iou

TESTSET = "the fixed test set"
VIEWS = 4
ROUNDS = 5


@dataclass(frozen=True)
class Accuracy(Report):
    """What `measure_accuracy` found; lists over views count from one view.

    Attributes:
        shapes: how many.
        network: [views][round], rounds from 0 (first prediction).
        gain: [views - 1], what each further drawing adds after the last round.
        concavities: [views], of the voxels inside the visual hull of the drawings and outside the shape, the share that
            is left empty (carving: none).
        carving: [views], silhouette carving from the same drawings.
        orthogonal: [views], carving from front, top, right, back.
        ceiling: IoU of the true camera grid taken to the world grid: what one prediction can reach.
        viewpoint: share of first drawings whose viewpoint is guessed, up to the half turn about y.
        seconds: seconds a shape for all passes of the network.
        each: [shape][views], IoU after the last round.
        source: what the shapes are of.
    """

    shapes: int
    network: list[list[Figure]]
    gain: list[Figure]
    concavities: list[Figure]
    carving: list[Figure]
    orthogonal: list[Figure]
    ceiling: Figure
    viewpoint: Figure
    seconds: float
    each: list[list[float]]
    source: str = TESTSET


def measure_accuracy(
    model: Model,
    shapes: int | None = None,
    data: Path | None = None,
    align: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> Accuracy:
    """Measures a model on the fixed test set, from exact drawings, in the world grid (paper, sections 6.1 and 6.5).

    Args:
        model: the network.
        shapes: the first so many; None for all.
        data: data set of meshes (`sketchcore prepare`) whose test split is measured on instead.
        align: move drawings that are plainly out of place, as `reconstruct` does where nobody says; False takes all
            where they are.
        progress: called as `progress(done, total)` after each shape.

    Raises:
        FileNotFoundError: if there is no such data set.
        ValueError: for a number of shapes outside 1 ... 500, or more than the test split has; for an empty one.
    """
    examples: Iterator[Example]
    if data is None:
        source, examples, total = TESTSET, load_testset(shapes, progress), count_shapes(shapes)
    else:
        meshes = Prepared(data)
        source, examples = f"the test split of {meshes.folder.name}", load_meshes(meshes, shapes, progress)
        total = shapes or meshes.count("test")
    if not align:
        source += ", drawings where they are"
    network = np.empty((total, VIEWS, ROUNDS + 1))
    concavities, carving, orthogonal = np.empty((3, total, VIEWS))
    ceiling, viewpoint = np.empty((2, total))
    seconds = 0.0
    for i, example in enumerate(examples):
        hulls = _hulls(example.drawings, list(example.cameras))
        started = time.perf_counter()
        for v in range(VIEWS):
            volumes = predictions(model, example.drawings[: v + 1], example.cameras[: v + 1], align=align)
            network[i, v] = [iou(volume, example.world) for volume in volumes]
            concavities[i, v] = _left_empty(volumes[-1], hulls[v], example.world)
        seconds += time.perf_counter() - started
        carving[i] = [iou(hull, example.world) for hull in hulls]
        orthogonal[i] = [iou(hull, example.world) for hull in _hulls(*example.orthogonal)]
        ceiling[i] = iou(to_world_grid(example.frustum(0), example.cameras[0]), example.world)
        guess = guess_viewpoint(model, example.drawings[0])[0]
        viewpoint[i] = guess in (example.viewpoint, opposite(example.viewpoint))
    last = network[:, :, -1]
    return Accuracy(
        shapes=total,
        network=[[Figure.of(network[:, v, r]) for r in range(ROUNDS + 1)] for v in range(VIEWS)],
        gain=[Figure.of(last[:, v + 1] - last[:, v]) for v in range(VIEWS - 1)],
        concavities=[Figure.of(concavities[:, v]) for v in range(VIEWS)],
        carving=[Figure.of(carving[:, v]) for v in range(VIEWS)],
        orthogonal=[Figure.of(orthogonal[:, v]) for v in range(VIEWS)],
        ceiling=Figure.of(ceiling),
        viewpoint=Figure.of(viewpoint),
        seconds=seconds / total,
        each=last.tolist(),
        source=source,
    )


def predictions(
    model: Model,
    drawings: NDArray[np.uint8],
    cameras: Sequence[Camera],
    rounds: int = ROUNDS,
    tolerance: float = TOLERANCE,
    align: bool = True,
) -> list[Volume]:
    """The volumes of drawings, uint8 [n, 256, 256], as `reconstruct` makes them: the first prediction, then each round.

    Where rounds end early, because the solid has settled, their last volume stands for those that were saved.
    """
    sketches = Sketches(drawings, pack_cameras(cameras))
    if align:
        sketches = model.in_place(sketches)
    made = list(until_settled(model.rounds(sketches, rounds), tolerance, model.first(len(sketches))))
    return made + [made[-1]] * (rounds + 1 - len(made))


def _left_empty(volume: NDArray[np.float32], hull: NDArray[np.uint8], world: NDArray[np.uint8]) -> float:
    concave = (hull > 0) & (world == 0)
    return float((volume[concave] <= 0.5).mean()) if concave.any() else 1.0


def _hulls(drawings: NDArray[np.uint8], cameras: list[Camera]) -> list[NDArray[np.uint8]]:
    """Carved from the first drawing, the first two, and so on."""
    return [carve(drawings[:n], cameras[:n]) for n in range(1, VIEWS + 1)]
