"""Evaluation: the test set, the figures, and that a perfect model would get perfect marks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pytest
import torch

import sketchcore as sk
from sketchcore.evaluate import evaluate
from sketchcore.evaluate.measure import Figure
from sketchcore.evaluate.present import as_table, save_plot
from sketchcore.evaluate.testset import Example, load_testset
from sketchcore.nets.sketches import Sketches
from sketchcore.outline import outline_iou, pieces
from sketchcore.rounds import Volume, update_rounds


class Oracle:
    """Looks the truth up by the camera, which no two examples share."""

    device = torch.device("cpu")

    def __init__(self, examples: list[Example]) -> None:
        self.truth = {camera.packed.tobytes(): e.frustum(i) for e in examples for i, camera in enumerate(e.cameras)}

    def first_predictions(self, samples: Sequence[Sketches]) -> Iterator[Volume]:
        return (next(self.rounds(sketches, 0)) for sketches in samples)

    def rounds(self, sketches: Sketches, iterations: int, start: Volume | None = None) -> Iterator[Volume]:
        blank = np.full((64, 64, 64), 0.1, np.float32)
        return update_rounds(
            lambda view, prior: self.truth.get(sketches.cameras[view].tobytes(), blank),
            sketches.cameras,
            iterations,
            start,
        )


def test_the_test_set_is_what_it_was() -> None:
    examples = list(load_testset())
    assert len(examples) == 500
    assert all(e.viewpoint in sk.QUARTER_VIEWS for e in examples)
    assert np.mean([e.world.mean() for e in examples]) == pytest.approx(0.115, abs=0.001)
    assert np.mean([len(e.shape.primitives) for e in examples]) == pytest.approx(9.3, abs=0.05)


def test_an_oracle_reaches_the_ceiling_and_carving_stays_below() -> None:
    report = evaluate(Oracle(list(load_testset(3))), 3)
    assert report.network[0][0].mean == pytest.approx(report.ceiling.mean)
    assert report.network[3][5].mean > 0.9
    assert all(a.mean <= b.mean for a, b in zip(report.carving, report.carving[1:], strict=False))
    assert report.carving[3].mean < report.network[3][5].mean
    assert report.orthogonal[3].mean > report.orthogonal[0].mean
    assert as_table(report).row_count == 8


def test_bootstrap_interval_of_a_known_spread() -> None:
    figure = Figure.of(np.random.default_rng(1).normal(0.5, 0.1, 400))
    assert figure.low < 0.5 < figure.high
    assert figure.high - figure.low == pytest.approx(2 * 1.96 * 0.1 / 20, rel=0.15)


def test_outline_and_pieces_of_a_known_solid() -> None:
    # Faces lie between voxels, so that the iso-surface is the shape's own.
    shape = sk.Shape(
        [sk.Cuboid((-0.25, 0, 0), (0.125, 0.1875, 0.1875)), sk.Cuboid((0.25, 0, 0), (0.0625, 0.1875, 0.1875))]
    )
    volume = sk.voxelize(shape).astype(np.float32)
    lower = np.where(np.arange(64)[:, None] < 32, volume, 0)
    for name in ("quarter-037", "front"):
        camera = sk.VIEWPOINTS[name]
        drawing = sk.draw(shape, camera)
        assert outline_iou(volume, camera, drawing) > 0.95
        assert 0.1 < outline_iou(lower, camera, drawing) < 0.7
    sizes = pieces(volume)
    assert sizes == sorted(sizes, reverse=True)
    assert len(sizes) == 2
    assert sum(sizes) == volume.sum()
    assert pieces(np.zeros((64, 64, 64), np.float32)) == []


def test_wrong_arguments(tmp_path) -> None:
    with pytest.raises(ValueError, match="between 1 and 500"):
        list(load_testset(0))
    with pytest.raises(ValueError, match=r"\.png"):
        save_plot(None, tmp_path / "plot.pdf")  # type: ignore[arg-type]
