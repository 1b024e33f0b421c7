"""Strokes: traced from drawings and drawn again."""

from __future__ import annotations

import numpy as np
import pytest

import sketchcore as sk
from sketchcore.evaluate.testset import load_testset
from sketchcore.strokes import render, trace


def _square() -> np.ndarray:
    drawing = np.zeros((256, 256), np.uint8)
    drawing[60, 60:180] = drawing[180, 60:181] = drawing[60:180, 60] = drawing[60:180, 180] = 255
    return drawing


def test_a_square_is_four_straight_strokes_that_meet_at_its_corners() -> None:
    strokes = trace(_square())
    lengths = [float(np.hypot(*(s[-1] - s[0]))) for s in strokes]
    assert sum(length > 100 for length in lengths) == 4
    assert sum(length for length in lengths if length <= 100) <= 8  # an end of the walk may lie on a side
    corners = {(round(x / 5), round(y / 5)) for s in strokes for x, y in (s[0], s[-1])}
    assert {(12, 12), (36, 12), (12, 36), (36, 36)} <= corners


def test_a_crossing_parts_four_strokes() -> None:
    drawing = np.zeros((256, 256), np.uint8)
    drawing[128, 50:200] = drawing[40:220, 120] = 255
    long = [s for s in trace(drawing) if len(s) > 20]
    assert len(long) == 4
    assert all(min(np.hypot(*(s[i] - (120, 128))) for i in (0, -1)) < 3 for s in long)


def test_a_circle_stays_one_closed_stroke() -> None:
    angles = np.linspace(0, 2 * np.pi, 400)
    circle = np.stack([128 + 60 * np.cos(angles), 128 + 60 * np.sin(angles)], axis=1)
    strokes = trace(render([circle], 1.0))
    assert len(strokes) == 1
    assert np.hypot(*(strokes[0][0] - strokes[0][-1])) < 2
    assert np.hypot(*(strokes[0] - 128).T) == pytest.approx(60, abs=1.5)


def test_traced_drawings_drawn_again_are_where_they_were() -> None:
    for example in load_testset(4):
        drawing = example.drawings[0]
        again = render(trace(drawing), 1.0)
        ys, xs = np.nonzero(drawing)
        near = np.pad(again >= 64, 2)
        found = np.any([near[ys + dy, xs + dx] for dy in range(1, 4) for dx in range(1, 4)], axis=0)
        assert found.mean() > 0.97
        ys, xs = np.nonzero(again >= 64)
        near = np.pad(drawing > 0, 2)
        assert np.any([near[ys + dy, xs + dx] for dy in range(1, 4) for dx in range(1, 4)], axis=0).mean() > 0.97


@pytest.mark.parametrize("width", [1.0, 2.0, 3.0, 4.0])
def test_width_is_the_ink_across_a_line(width: float) -> None:
    drawing = render([np.array([[40.0, 100.0], [200.0, 100.0]])], width)
    assert drawing[:, 120].sum() / 255 == pytest.approx(width, abs=0.26)
    rows = np.arange(256)
    assert (drawing[:, 120] * rows).sum() / drawing[:, 120].sum() == pytest.approx(100, abs=0.3)


def test_what_is_outside_is_cut_off_and_no_pen_is_refused() -> None:
    line = np.array([[-50.0, 10.0], [300.0, 10.0]])
    assert (render([line], 1.0)[10] > 0).all()
    assert render([], 1.0).max() == 0
    with pytest.raises(ValueError, match="more than 0"):
        render([line], 0.0)
    assert trace(np.zeros((256, 256), np.uint8)) == []


def test_an_empty_shape_has_no_strokes() -> None:
    far = sk.Shape([sk.Cuboid((0, 0, 0), (0.2, 0.2, 0.2))])
    assert len(trace(sk.draw(far, sk.VIEWPOINTS["front"]))) >= 4
