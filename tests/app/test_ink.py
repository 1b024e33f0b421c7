"""Strokes: what is accepted, the drawings that they make, and the eraser."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sketchcore.app.ink import MAX_POINTS, Stroke, bounds, erase, rasterize
from sketchcore.drawing import load_drawing

PLACES = st.tuples(st.floats(0, 256), st.floats(0, 256), st.floats(0, 1))
LINE = Stroke.of([(20, 100), (220, 100)])


def test_a_line_is_2_px_wide_where_the_pen_went() -> None:
    drawing = rasterize([LINE])
    assert drawing.shape == (256, 256)
    assert drawing.dtype == np.uint8
    across = drawing[:, 120].astype(float)
    assert across.sum() / 255 == pytest.approx(2, abs=0.26)
    assert (across * (np.arange(256) + 0.5)).sum() / across.sum() == pytest.approx(100, abs=0.3)
    assert not drawing[:, :17].any()
    assert not drawing[:, 223:].any()


def test_pressure_makes_a_line_wider() -> None:
    widths = [rasterize([Stroke.of([(20, 100, p), (220, 100, p)])])[:, 120].sum() / 255 for p in (0.0, 0.5, 1.0)]
    assert widths[0] < widths[1] - 0.2
    assert widths[1] < widths[2] - 0.2
    swelling = rasterize([Stroke.of([(20 + 2 * i, 100, i / 100) for i in range(101)])])
    assert swelling[:, 40].sum() < swelling[:, 200].sum()
    assert (swelling[100, 22:218] > 128).all()  # in one piece


def test_construction_lines_are_not_drawn() -> None:
    assert not rasterize([Stroke.of([(20, 100), (220, 100)], "construction")]).any()
    assert not rasterize([]).any()


def test_a_dot_is_ink() -> None:
    for place in ((100.0, 100.0), (100.5, 100.5), (100.25, 99.75)):
        dot = rasterize([Stroke.of([place])])
        assert dot.max() == 255
        assert 1 <= (dot > 0).sum() <= 25


@given(st.lists(st.lists(PLACES, min_size=2, max_size=20), min_size=1, max_size=5))
def test_the_networks_get_drawings_as_they_are(lines: list[list[tuple[float, float, float]]]) -> None:
    drawing = rasterize([Stroke.of([*line, (line[0][0] + 9, line[0][1], 0.5)]) for line in lines])
    if not 0 < (drawing > 0).mean() < 0.2:
        return
    np.testing.assert_array_equal(load_drawing(drawing), drawing)


def test_bounds_are_of_the_ink() -> None:
    assert bounds([LINE, Stroke.of([(5, 5)], "construction"), Stroke.of([(30, 40), (50, 10)])]) == (20, 10, 220, 100)
    assert bounds([Stroke.of([(5, 5)], "construction")]) is None


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([], "1 to 20000 points"),
        ([(0, 0, 0.5)] * (MAX_POINTS + 1), "1 to 20000 points"),
        ("abc", "1 to 20000 points"),
        ([(0, 0)], "three numbers"),
        ([(0, 0, True)], "three numbers"),
        ([(0, "1", 0.5)], "three numbers"),
        ([(0, math.nan, 0.5)], "finite"),
        ([(math.inf, 0, 0.5)], "finite"),
        ([(10**400, 0, 0.5)], "finite"),
        ([(5000, 0, 0.5)], "within 1024 pixels"),
        ([(0, 0, 1.5)], "between 0 and 1"),
    ],
)
def test_what_is_no_stroke_is_refused(points: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Stroke(points, "ink", "a")  # type: ignore[arg-type]


@pytest.mark.parametrize("id", ["", "../x", "a b", "a" * 65, 7, None])
def test_ids_are_plain(id: object) -> None:
    with pytest.raises(ValueError, match="id of a stroke"):
        Stroke(((0, 0, 0.5),), "ink", id)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="'ink' or 'construction'"):
        Stroke(((0, 0, 0.5),), "pencil", "a")  # type: ignore[arg-type]


def test_the_eraser_cuts_a_line_where_it_passes() -> None:
    left = erase([LINE], [(120, 60), (120, 140)], 10)
    assert len(left) == 2
    assert left[0].points[0] == (20, 100, 0.5)
    assert left[0].points[-1][0] == pytest.approx(110, abs=0.6)
    assert left[1].points[0][0] == pytest.approx(130, abs=0.6)
    assert left[1].points[-1] == (220, 100, 0.5)
    assert len({LINE.id, left[0].id, left[1].id}) == 3
    assert {stroke.kind for stroke in erase([Stroke.of([(0, 9), (99, 9)], "construction")], [(50, 9)], 5)} == {
        "construction"
    }


def test_what_the_eraser_does_not_touch_stays_the_very_same() -> None:
    far, near = Stroke.of([(10, 10), (50, 10)]), Stroke.of([(10, 30), (50, 30)])
    left = erase([far, near], [(0, 33), (100, 33)], 5)
    assert left == (far,)
    assert left[0] is far
    assert erase([far, near], [(200, 200)], 5) == (far, near)


def test_points_that_are_left_stay_where_they_were() -> None:
    angles = np.linspace(0, np.pi, 60)
    arc = Stroke.of(np.stack([128 + 90 * np.cos(angles), 128 - 90 * np.sin(angles)], axis=1).tolist())
    left = erase([arc], [(128, 38)], 8)
    assert len(left) == 2
    inner = [p for piece in left for p in piece.points[1:-1]]
    assert set(inner) <= set(arc.points)
    assert len(inner) >= 50


@given(
    st.lists(st.tuples(st.floats(0, 256), st.floats(0, 256)), min_size=1, max_size=8),
    st.lists(st.tuples(st.floats(0, 256), st.floats(0, 256)), min_size=1, max_size=4),
    st.floats(1, 40),
)
def test_nothing_is_left_under_the_eraser_and_all_beside_it(
    line: list[tuple[float, float]], path: list[tuple[float, float]], radius: float
) -> None:
    stroke = Stroke.of(line)
    left = erase([stroke], path, radius)

    def sampled(strokes: tuple[Stroke, ...]) -> np.ndarray:
        places = [np.empty((0, 2))]
        for one in strokes:
            xy = one.xy
            for a, b in itertools.pairwise(xy):
                places.append(a + np.linspace(0, 1, 50)[:, None] * (b - a))
            places.append(xy)
        return np.concatenate(places)

    def distance(places: np.ndarray) -> np.ndarray:
        steps = [np.array(path[:1])]
        for a, b in itertools.pairwise(path):
            steps.append(np.array(a) + np.linspace(0, 1, 400)[:, None] * (np.array(b) - np.array(a)))
        return np.hypot(*(places[:, None] - np.concatenate(steps)[None]).transpose(2, 0, 1)).min(axis=1)

    kept = sampled(left)
    assert (distance(kept) > radius - 0.3).all()
    was = sampled((stroke,))
    beside = was[distance(was) > radius + 2]
    if len(beside) and len(line) > 1:
        assert len(kept)
        assert np.hypot(*(beside[:, None] - kept[None]).transpose(2, 0, 1)).min(axis=1).max() < 8


@pytest.mark.parametrize(
    ("path", "radius", "message"),
    [
        ([(0, 0)], 0, "radius"),
        ([(0, 0)], math.nan, "radius"),
        ([(0, 0)], "5", "radius"),
        ([], 5, "points"),
        ([(0, 0, 0)], 5, r"list of \[x, y\]"),
        (5, 5, r"list of \[x, y\]"),
        ([(math.nan, 0)], 5, "finite"),
    ],
)
def test_what_is_no_eraser_is_refused(path: object, radius: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        erase([LINE], path, radius)  # type: ignore[arg-type]
