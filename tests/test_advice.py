"""Where a solid is unsure, and the viewpoint that is advised."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pytest
import torch

import sketchcore as sk
from sketchcore.advice import best_view, unsure
from sketchcore.evaluate.advice import measure_advice
from sketchcore.evaluate.parts import PARTS
from sketchcore.nets.sketches import Sketches
from sketchcore.rounds import Volume


def test_a_half_is_most_unsure() -> None:
    volume = np.zeros((64, 64, 64), np.float32)
    volume[0, 0, :5] = (0.5, 0.25, 0.75, 1.0, 0.01)
    field = unsure(volume)
    assert field.dtype == np.float32
    assert field[0, 0, 0] == pytest.approx(1)
    assert field[0, 0, 1] == field[0, 0, 2] == pytest.approx(0.8113, abs=1e-4)
    assert field[0, 0, 3] == field[9, 9, 9] == 0
    assert 0 < field[0, 0, 4] < 0.1
    as_bytes = unsure(np.rint(volume * 255).astype(np.uint8))
    np.testing.assert_allclose(as_bytes, field, atol=0.02)


def wall(axis: int, at: int) -> np.ndarray:
    """A sure block with an unsure layer on one side of it."""
    volume = np.zeros((64, 64, 64), np.float32)
    volume[16:48, 16:48, 16:48] = 1
    layer = [slice(16, 48)] * 3
    layer[axis] = slice(at, at + 4)
    volume[tuple(layer)] = 0.5
    return volume


@pytest.mark.parametrize(
    ("axis", "at", "taken", "expected"),
    [
        (0, 12, ["quarter-037"], {"quarter-127", "quarter-142", "quarter-217", "quarter-232"}),  # behind
        (0, 48, ["quarter-142"], {"quarter-037", "quarter-052", "quarter-307", "quarter-322"}),  # before
        (2, 48, ["quarter-037", "quarter-217"], set(sk.VIEWPOINTS)),
    ],
)
def test_the_side_that_is_unsure_is_to_be_drawn(axis: int, at: int, taken: list[str], expected: set[str]) -> None:
    name, scores = best_view(wall(axis, at), taken)
    assert name in expected - set(taken)
    assert name == max(scores, key=lambda one: scores[one])
    assert list(scores) == sorted(scores, key=lambda one: -scores[one])
    assert set(scores) == set(sk.VIEWPOINTS) - set(taken)


def test_what_was_drawn_or_mirrors_it_is_not_advised() -> None:
    _, scores = best_view(wall(0, 48), ["quarter-037"])
    assert scores["quarter-322"] < 0.1 * max(scores.values())  # the mirror image about z = 0
    assert scores["quarter-052"] < 0.3 * max(scores.values())


def test_advice_has_an_end() -> None:
    names = list(sk.VIEWPOINTS)
    name, scores = best_view(wall(0, 48), names[:-1])
    assert name == names[-1]
    assert len(scores) == 1
    with pytest.raises(ValueError, match="all 13"):
        best_view(wall(0, 48), names)
    with pytest.raises(ValueError, match="unknown viewpoint"):
        best_view(wall(0, 48), ["below"])
    with pytest.raises(ValueError, match="shape"):
        best_view(np.zeros((64, 64)), [])
    with pytest.raises(ValueError, match="shape"):
        unsure(np.zeros((32, 32, 32)))


class Carver:
    """Fills the visual hull, and is unsure of it where one drawing alone says so."""

    device = torch.device("cpu")

    def first_predictions(self, samples: Sequence[Sketches]) -> Iterator[Volume]:
        for sketches in samples:
            cameras = [sk.Camera.from_packed(row) for row in sketches.cameras]
            hull = sk.carve(sketches.drawings, cameras).astype(np.float32)
            yield hull * np.float32(0.6 if len(sketches) == 1 else 1)

    def in_place(self, sketches: Sketches, always: bool = False) -> Sketches:
        return sketches

    def first(self, drawings: int) -> float:
        return 3.5

    def rounds(self, sketches: Sketches, iterations: int, start: Volume | None = None) -> Iterator[Volume]:
        yield from self.first_predictions([sketches])


def test_advice_is_measured_beside_lots() -> None:
    seen: list[tuple[int, int]] = []
    report = measure_advice(Carver(), 3, lambda done, total: seen.append((done, total)))
    assert seen == [(1, 3), (2, 3), (3, 3)]
    assert report.shapes == 3
    assert report.advised.mean > report.one.mean
    assert report.gain.mean == pytest.approx(report.advised.mean - report.random.mean)
    assert sum(report.viewpoints.values()) == 3
    assert 0 <= report.better <= 1
    assert np.mean(report.each, axis=0) == pytest.approx([report.one.mean, report.advised.mean, report.random.mean])
    assert PARTS["advice"].table(report).row_count == 4
    with pytest.raises(ValueError, match="between 1 and 500"):
        measure_advice(Carver(), 0)
