"""What straight lines say of cameras and places: pieces against a slow twin, likelihoods against what is known."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import sketchcore as sk
from reference_straight import straight
from sketchcore import _core
from sketchcore.drawing import INK
from sketchcore.nets.placement import Placement, seen_at
from sketchcore.perspective import Lines, stray

STAIRS = sk.Shape(
    [
        sk.Cuboid((0, -0.25, 0), (1 / 2.4, 0.1, 0.3)),
        sk.Cuboid((-0.1, -0.05, 0), (0.3, 0.1, 0.2)),
        sk.Cuboid((-0.2, 0.2, 0), (0.15, 0.15, 0.12)),
    ]
)
FINE = sk.LineStyle(antialias=True)
CAMERA = sk.VIEWPOINTS["quarter-037"]
TURN, SHIFT, SCALE = (np.array(free, bool) for free in ([0, 0, 0, 1, 1, 0], [0, 1, 1, 0, 0, 0], [1, 0, 0, 0, 0, 0]))


def drawn(turn: tuple[float, float] = (0.0, 0.0), camera: sk.Camera = CAMERA) -> np.ndarray:
    return sk.draw(STAIRS, camera.turned(*turn), style=FINE)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.booleans())
def test_pieces_are_those_of_the_slow_twin(seed: int, fine: bool) -> None:
    batch = sk.generate(seed, 1)
    drawing = sk.draw(batch.shapes[0], batch.cameras[0][0], style=FINE) if fine else batch.drawings[0, 0]
    found, expected = _core.straight(drawing, INK), straight(drawing)
    # A pixel just at a limit may cut a line elsewhere: nearly all must be the same.
    distance = np.abs(found[:, None] - expected[None]).max(axis=2)
    same = (distance.min(axis=1, initial=np.inf) < 1e-3).sum()
    assert len(found) == pytest.approx(len(expected), abs=2)
    assert same >= 0.9 * len(expected) - 1


def test_pieces_lie_on_the_edges_of_a_box() -> None:
    box = sk.Cuboid((0, 0, 0), (0.4, 0.25, 0.3))
    signs = [np.array(corner) for corner in itertools.product((-1, 1), repeat=3)]
    seen = [seen_at(CAMERA, sign * box.half) for sign in signs]
    edges = [(i, j) for i, j in itertools.combinations(range(8), 2) if (signs[i] != signs[j]).sum() == 1]

    def off(end: np.ndarray, edge: tuple[int, int]) -> float:
        """Pixels between a point and an edge's line."""
        a, b = seen[edge[0]], seen[edge[1]]
        (ux, uy), (vx, vy) = b - a, end - a
        return float(abs(ux * vy - uy * vx) / np.hypot(ux, uy))

    pieces = _core.straight(sk.draw(sk.Shape([box]), CAMERA, style=FINE), INK)
    assert len(pieces) == 9, "nine edges are seen"
    assert (pieces[:, 4] < 0.15).all()
    nearest = [min(edges, key=lambda edge: off(piece[:2], edge) + off(piece[2:4], edge)) for piece in pieces]
    assert len(set(nearest)) == 9
    for piece, edge in zip(pieces, nearest, strict=True):
        # No further from it than a line is wide, and along it to a quarter of a degree.
        assert max(off(piece[:2], edge), off(piece[2:4], edge)) < 1.2
        assert abs(off(piece[:2], edge) - off(piece[2:4], edge)) < 0.0045 * np.hypot(*(piece[2:4] - piece[:2])) + 0.1


@pytest.mark.parametrize("turn", [(6.0, 0.0), (0.0, -6.0), (-8.0, 9.0)])
def test_from_which_side_a_drawing_was_made_is_told_to_a_fraction_of_a_degree(turn: tuple[float, float]) -> None:
    lines = Lines.of(drawn(turn), CAMERA)
    [found], [reached] = lines.fit(np.zeros((1, 6)), TURN[None])
    np.testing.assert_allclose(found[3:5], turn, atol=0.6)
    assert (found[:3] == 0).all()
    true = np.array([0, 0, 0, *turn, 0])
    assert reached == pytest.approx(float(lines.likelihood(found[None])[0] - stray(found)))
    assert lines.likelihood(true[None]) > lines.likelihood(np.zeros((1, 6))) + 10


@pytest.mark.parametrize(("scale", "shift"), [(1.0, (12.0, 0.0)), (1.0, (-5.0, -14.0)), (0.8, (0.0, 0.0))])
def test_where_a_drawing_belongs_is_told_to_a_few_pixels(scale: float, shift: tuple[float, float]) -> None:
    drawing = Placement(scale, shift).move(drawn(), CAMERA)
    lines = Lines.of(drawing, CAMERA)
    true = np.array([-math.log(scale), *(-np.array(shift) / scale), 0.0, 0.0, 0.0])
    [found], _ = lines.fit(np.zeros((1, 6)), (SCALE if scale != 1 else SHIFT)[None])
    np.testing.assert_allclose(found[0], true[0], atol=0.05)
    np.testing.assert_allclose(found[1:3], true[1:3], atol=4.0)
    # Taken so, it is what it was.
    assert Lines.of(Placement.from_numbers(true).move(drawing, CAMERA), CAMERA).likelihood(np.zeros((1, 6))) == (
        pytest.approx(float(lines.likelihood(true[None])[0]), rel=0.25)
    )


def test_a_turned_camera_is_that_of_the_package() -> None:
    lines = Lines.of(drawn(), CAMERA)
    for right, down in ((7.0, -3.0), (0.0, 20.0)):
        turned = lines.seen_by(CAMERA.turned(right, down))
        there = np.array([[0, 0, 0, right, down, 0]])
        assert lines.likelihood(there) == pytest.approx(turned.likelihood(np.zeros((1, 6))))


def test_a_wider_camera_is_told_and_sees_the_origin_as_large() -> None:
    wide = CAMERA.widened(1.2)
    assert wide.fov_degrees == pytest.approx(54)
    assert np.linalg.norm(wide.position) * math.tan(math.radians(27)) == pytest.approx(2 * math.tan(math.radians(22.5)))
    lines = Lines.of(sk.draw(STAIRS, wide, style=FINE), CAMERA)
    [found], _ = lines.fit(np.zeros((1, 6)), np.array([[0, 0, 0, 0, 0, 1]], bool))
    assert math.exp(found[5]) == pytest.approx(1.2, abs=0.05)
    there = lines.seen_by(wide).likelihood(np.zeros((1, 6)))
    assert lines.likelihood(np.array([[0, 0, 0, 0, 0, math.log(1.2)]])) == pytest.approx(there)


def test_information_is_the_curvature_of_the_likelihood_without_outliers() -> None:
    # A box's lines all run along axes, and stay with theirs nearby: there the logarithm is a parabola.
    lines = Lines.of(drawn(), CAMERA)
    [at], _ = lines.fit(np.zeros((1, 6)), np.ones((1, 6), bool))
    told = lines.information(at)
    np.testing.assert_allclose(told, told.T)
    assert (np.linalg.eigvalsh(told) >= -1e-9).all()
    for axis, step in ((1, 1.0), (2, 1.0), (3, 0.2), (4, 0.2)):
        change = np.zeros(6)
        change[axis] = step
        [minus, middle, plus] = lines.likelihood(np.stack([at - change, at, at + change]))
        assert 2 * middle - minus - plus == pytest.approx(step**2 * told[axis, axis], rel=0.7)


def test_several_fits_are_each_what_it_is_alone() -> None:
    lines = Lines.of(drawn((4.0, -5.0)), CAMERA)
    starts, free = np.zeros((3, 6)), np.stack([TURN, SHIFT, SCALE])
    together, reached = lines.fit(starts, free)
    for i in range(3):
        [alone], [likely] = lines.fit(starts[i : i + 1], free[i : i + 1])
        assert likely == pytest.approx(reached[i], abs=0.1)
        assert np.abs((alone - together[i]) / (0.02, 1, 1, 0.2, 0.2, 0.02)).max() < 1
    assert reached.argmax() == 0


def test_a_wobbly_hand_is_allowed_more() -> None:
    exact = Lines.of(drawn(), CAMERA)
    wobbly = Lines.of(sk.draw(STAIRS, CAMERA, style=sk.LineStyle(antialias=True, wobble=2.0), seed=3), CAMERA)
    off = np.array([[0, 0, 0, 3.0, 3.0, 0]])
    here = np.zeros((1, 6))
    assert exact.likelihood(here) - exact.likelihood(off) > 4 * (wobbly.likelihood(here) - wobbly.likelihood(off))


def test_without_lines_all_places_are_alike() -> None:
    lines = Lines.of(np.zeros((256, 256), np.uint8), CAMERA)
    assert len(lines) == 0
    numbers = np.array([[0, 0, 0, 0, 0, 0], [0.1, 5, 5, 3, 3, 0.1]])
    np.testing.assert_array_equal(lines.likelihood(numbers), 0)
    found, _ = lines.fit(numbers, np.ones((2, 6), bool))
    assert (np.abs(found) <= np.abs(numbers)).all(), "nothing holds them where they are"
