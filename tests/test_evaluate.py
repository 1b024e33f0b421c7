"""Evaluation: the test set, the figures, and that a perfect model would get perfect marks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from PIL import Image

import sketchcore as sk
from sketchcore.datagen.prepare import Preparation, prepare
from sketchcore.datagen.prepared import Prepared
from sketchcore.evaluate.accuracy import measure_accuracy
from sketchcore.evaluate.comparison import compare
from sketchcore.evaluate.convergence import measure_convergence
from sketchcore.evaluate.drawings import measure_drawings
from sketchcore.evaluate.failures import measure_failures
from sketchcore.evaluate.figure import Figure
from sketchcore.evaluate.parts import PARTS, measure_part, write_part
from sketchcore.evaluate.present import comparison_table
from sketchcore.evaluate.robustness import measure_robustness
from sketchcore.evaluate.testset import Example, load_meshes, load_testset
from sketchcore.nets.sketches import Sketches
from sketchcore.outline import outline_iou, pieces
from sketchcore.rounds import Volume, update_rounds

EXAMPLES = Path(__file__).parents[1] / "examples"


class Oracle:
    """Looks the truth up by the camera, which no two examples share."""

    device = torch.device("cpu")

    def __init__(self, examples: list[Example]) -> None:
        self.truth = {camera.packed.tobytes(): e.frustum(i) for e in examples for i, camera in enumerate(e.cameras)}

    def first_predictions(self, samples: Sequence[Sketches]) -> Iterator[Volume]:
        return (next(self.rounds(sketches, 0)) for sketches in samples)

    def in_place(self, sketches: Sketches, always: bool = False) -> Sketches:
        return sketches

    def first(self, drawings: int) -> float:
        return 3.5

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
    report = measure_accuracy(Oracle(list(load_testset(3))), 3)
    assert report.network[0][0].mean == pytest.approx(report.ceiling.mean)
    assert report.network[3][5].mean > 0.9
    assert all(a.mean <= b.mean for a, b in zip(report.carving, report.carving[1:], strict=False))
    assert report.carving[3].mean < report.network[3][5].mean
    assert report.orthogonal[3].mean > report.orthogonal[0].mean
    assert all(f.mean > 0.95 for f in report.concavities)
    assert np.mean(report.each, axis=0) == pytest.approx([by_round[-1].mean for by_round in report.network])
    assert report.gain[0].mean == pytest.approx(report.network[1][5].mean - report.network[0][5].mean)
    assert PARTS["accuracy"].table(report).row_count == 10


class Carver:
    """Fills the visual hull: all that an outline can tell."""

    device = torch.device("cpu")

    def first_predictions(self, samples: Sequence[Sketches]) -> Iterator[Volume]:
        for sketches in samples:
            cameras = [sk.Camera.from_packed(row) for row in sketches.cameras]
            yield sk.carve(sketches.drawings, cameras).astype(np.float32)

    def in_place(self, sketches: Sketches, always: bool = False) -> Sketches:
        return sketches

    def first(self, drawings: int) -> float:
        return 3.5

    def rounds(self, sketches: Sketches, iterations: int, start: Volume | None = None) -> Iterator[Volume]:
        yield from self.first_predictions([sketches])  # nothing changes afterwards: it stops at once


def test_carving_leaves_no_concavity_empty_and_its_early_stop_counts_for_all_rounds() -> None:
    report = measure_accuracy(Carver(), 2)
    assert [f.mean for f in report.concavities] == [0.0] * 4
    for by_round, carving in zip(report.network, report.carving, strict=True):
        assert {f.mean for f in by_round} == {carving.mean}


class Astray(Oracle):
    """Moves drawings to where they do not belong."""

    def in_place(self, sketches: Sketches, always: bool = False) -> Sketches:
        return sketches.seen_by(np.stack([sk.VIEWPOINTS["top"].packed] * len(sketches)))


def test_drawings_may_stay_where_they_are() -> None:
    examples = list(load_testset(2))
    moved = measure_accuracy(Astray(examples), 2)
    stayed = measure_accuracy(Astray(examples), 2, align=False)
    assert moved.network[0][5].mean < 0.5
    assert stayed.network[0][5].mean == pytest.approx(stayed.ceiling.mean)
    assert stayed.source == "the fixed test set, drawings where they are"
    with pytest.raises(ValueError, match="robustness takes no --no-align; accuracy takes it"):
        measure_part("robustness", align=False)


class Fading(Oracle):
    """Forgets with every round and with every drawing that comes before the first one."""

    def rounds(self, sketches: Sketches, iterations: int, start: Volume | None = None) -> Iterator[Volume]:
        truth = next(super().rounds(sketches, 0))
        for number in range(iterations + 1):
            volume = truth.copy()
            volume[:, : 4 * number] = 0
            yield volume


def test_convergence_of_a_model_that_gets_worse() -> None:
    report = measure_convergence(Fading(list(load_testset(2))), 2)
    assert all(lost > 0.2 for lost in report.lost)
    assert report.refined.mean < -0.2
    assert len(report.change[0]) == 10
    assert len(report.network[3]) == 11
    # Each order begins with another drawing, whose frustum reaches elsewhere.
    assert all(spread.mean > 0 for spread in report.orders)
    still = measure_convergence(Carver(), 1)
    assert still.lost == [0.0] * 4
    assert all(f.mean == 0 for by_round in still.change for f in by_round)
    assert all(f.mean == 0 for f in still.orders)


def test_carving_suffers_from_faulty_drawings() -> None:
    report = measure_robustness(Carver(), 2)
    assert report.clean[1].mean > report.clean[0].mean
    assert report.drop["shift"][2][1].mean > max(0.1, report.drop["shift"][0][1].mean)
    assert report.drop["all together"][2][1].mean > 0.1
    assert PARTS["robustness"].table(report).row_count == 10


def test_the_worst_shapes_come_first_and_are_drawn(tmp_path: Path) -> None:
    report = measure_failures(Carver(), 8, tmp_path)
    scores = [failure.iou for failure in report.worst]
    assert scores == sorted(scores)
    assert len(scores) == 6
    hulls = [sk.iou(sk.carve(e.drawings[:1], e.cameras[:1]), e.world) for e in load_testset(8)]
    assert scores == sorted(hulls)[:6]
    with Image.open(tmp_path / "failures.png") as image:
        assert image.size == (5 * 256, 6 * 256)
    assert PARTS["failures"].table(report).row_count == 6


def test_peoples_drawings_are_measured_by_their_outlines(tmp_path: Path) -> None:
    report = measure_drawings(Carver(), [EXAMPLES], tmp_path)
    assert {drawn.name for drawn in report.objects} == {"chair", "house", "mug", "car"}
    assert all(overlap > 0.9 for drawn in report.objects for overlap in drawn.outline)
    assert {path.name for path in tmp_path.iterdir()} == {"chair.png", "house.png", "mug.png", "car.png"}
    with pytest.raises(FileNotFoundError, match="no folder"):
        measure_drawings(Carver(), [tmp_path / "nowhere"])
    (tmp_path / "empty").mkdir()
    with pytest.raises(ValueError, match="holds no drawings"):
        measure_drawings(Carver(), [tmp_path / "empty"])
    (tmp_path / "examples.json").write_text('[{"name": "x"}]')
    with pytest.raises(ValueError, match="no list of named objects"):
        measure_drawings(Carver(), [tmp_path])


def test_reports_are_written_compared_and_refused(tmp_path: Path) -> None:
    for folder, model in (("oracle", Oracle(list(load_testset(2)))), ("carver", Carver())):
        (tmp_path / folder).mkdir()
        write_part("accuracy", measure_accuracy(model, 2), tmp_path / folder)
        assert (tmp_path / folder / "accuracy.png").stat().st_size > 10_000
        (tmp_path / folder / "accuracy.json").rename(tmp_path / f"{folder}.json")
    report = compare([tmp_path / "oracle.json", tmp_path / "carver.json"])
    assert report.shapes == 2
    assert all(difference.mean < 0 for difference in report.differences["carver"])
    assert comparison_table(report).row_count == 3
    with pytest.raises(ValueError, match="two or more"):
        compare([tmp_path / "oracle.json"])
    (tmp_path / "bad.json").write_text("{}")
    with pytest.raises(ValueError, match="was not written by"):
        compare([tmp_path / "oracle.json", tmp_path / "bad.json"])
    with pytest.raises(ValueError, match="accuracy takes no --drawings"):
        measure_part("accuracy", folders=[tmp_path])
    with pytest.raises(ValueError, match="drawings takes no --shapes"):
        measure_part("drawings", shapes=3)
    with pytest.raises(ValueError, match="one or more --drawings"):
        measure_part("drawings")


def test_meshes_are_a_test_set_as_well(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    for i in range(2):
        trimesh.creation.box((1.0, 0.5 + 0.2 * i, 0.7)).export(tmp_path / "meshes" / f"{i}.ply")
    prepare(tmp_path / "meshes", tmp_path / "boxes", Preparation(up="y", front="x", split=(0, 0, 1)), jobs=1)
    data = Prepared(tmp_path / "boxes")
    examples = list(load_meshes(data))
    assert {e.viewpoint for e in examples} <= set(sk.QUARTER_VIEWS)
    worlds = [data.load("test", number).world for number in range(2)]
    assert all(any(np.array_equal(e.world, world) for world in worlds) for e in examples)
    report = measure_accuracy(Oracle(examples), data=tmp_path / "boxes")
    assert (report.shapes, report.source) == (2, "the test split of boxes")
    assert report.network[0][0].mean > 0.9
    assert "the test split of boxes" in str(PARTS["accuracy"].table(report).title)
    with pytest.raises(ValueError, match="between 1 and 2"):
        measure_accuracy(Oracle(examples), 3, data=tmp_path / "boxes")
    with pytest.raises(ValueError, match="accuracy takes it"):
        measure_part("robustness", data=tmp_path / "boxes")
    write_part("accuracy", report, tmp_path)
    (tmp_path / "other.json").write_text((tmp_path / "accuracy.json").read_text().replace("boxes", "chairs"))
    with pytest.raises(ValueError, match="measured on the test split of boxes, the test split of chairs"):
        compare([tmp_path / "accuracy.json", tmp_path / "other.json"])


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


def test_wrong_arguments() -> None:
    with pytest.raises(ValueError, match="between 1 and 500"):
        list(load_testset(0))
