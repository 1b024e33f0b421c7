"""Pen strokes: what a hand draws, the drawing that it makes, and the eraser."""

from __future__ import annotations

import itertools
import re
import secrets
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from sketchcore.grids import IMAGE
from sketchcore.strokes import Polyline, render

Kind = Literal["ink", "construction"]
Point = tuple[float, float, float]

MAX_POINTS = 20_000
"""Of one stroke: several minutes of a fast pen."""
REACH = 1024.0
"""Pixels that a stroke may leave the drawing by; a hand does not."""
_WIDTH = (1.5, 2.5)
"""Pixels that a line is wide at no pressure and at full pressure; without a pressure, at one half, it is 2 px."""
_WIDTH_STEP = 0.25
_SAMPLE = 0.5
"""Pixels between the places of a stroke that the eraser is tried at."""
_ID = re.compile(r"[0-9A-Za-z_-]{1,64}")


def new_id() -> str:
    """A name for a stroke, part or session that no other one has: 32 hexadecimal digits, 128 random bits."""
    return secrets.token_hex(16)


def check_id(value: object, what: str) -> str:
    """The id itself, if it is one: up to 64 letters, digits, `-` and `_`.

    Raises:
        ValueError: if it is none.
    """
    if not isinstance(value, str) or not _ID.fullmatch(value):
        raise ValueError(f"the id of {what} must be 1 to 64 letters, digits, '-' or '_', got {str(value)[:80]!r}")
    return value


@dataclass(frozen=True)
class Stroke:
    """One line of a pen, from where it is set down to where it is lifted.

    Attributes:
        points: (x, y, pressure), one or more; x and y in pixels of the drawing (0 to 256, y down, a pixel's centre at
            + 0.5), pressure from 0 to 1. Kept to a hundredth of a pixel.
        kind: "ink", or "construction" for a line that guides the hand and that the networks never see.
        id: a name that no other stroke has.

    Raises:
        ValueError: for no points or too many, numbers that are not finite or out of range, another kind, or no id.
    """

    points: tuple[Point, ...]
    kind: Kind
    id: str

    def __post_init__(self) -> None:
        check_id(self.id, "a stroke")
        if self.kind not in get_args(Kind):
            raise ValueError(f"a stroke is 'ink' or 'construction', got {str(self.kind)[:80]!r}")
        object.__setattr__(self, "points", _checked(self.points))

    @classmethod
    def of(cls, points: Iterable[Sequence[float]], kind: Kind = "ink") -> Stroke:
        """A new stroke through (x, y) or (x, y, pressure), with an id of its own; pressure is 0.5 if none is said."""
        return cls(
            tuple((float(p[0]), float(p[1]), float(p[2]) if len(p) > 2 else 0.5) for p in points), kind, new_id()
        )

    @property
    def xy(self) -> Polyline:
        """float64 [n, 2]: its places in pixels, a pixel's centre at + 0.5."""
        return np.array(self.points)[:, :2]


def _checked(points: object) -> tuple[Point, ...]:
    if not isinstance(points, list | tuple) or not 1 <= len(points) <= MAX_POINTS:
        count = len(points) if isinstance(points, list | tuple) else "none"
        raise ValueError(f"a stroke has 1 to {MAX_POINTS} points, got {count}")
    if not all(
        isinstance(point, list | tuple)
        and len(point) == 3
        and all(isinstance(number, int | float) and not isinstance(number, bool) for number in point)
        for point in points
    ):
        raise ValueError("a point of a stroke is three numbers: x, y and pressure")
    try:
        array = np.array(points, np.float64)
    except OverflowError:
        array = np.full((1, 3), np.inf)
    if not np.isfinite(array).all():
        raise ValueError("a stroke has a number that is NaN or infinite; every number must be finite")
    if (array[:, :2] < -REACH).any() or (array[:, :2] > IMAGE + REACH).any():
        raise ValueError(
            f"a stroke must stay within {REACH:g} pixels of the drawing, which is 0 to {IMAGE} wide and high"
        )
    if (array[:, 2] < 0).any() or (array[:, 2] > 1).any():
        raise ValueError("the pressure of a point must lie between 0 and 1")
    return tuple(map(tuple, array.round(2).tolist()))


def rasterize(strokes: Iterable[Stroke]) -> NDArray[np.uint8]:
    """The drawing that the networks see: uint8 [256, 256], ink 255 on 0; construction lines are left out.

    Lines are about 2 px wide, pressure makes them a little thinner or thicker.
    """
    by_width: dict[int, list[Polyline]] = {}
    for stroke in strokes:
        if stroke.kind == "ink":
            for steps, line in _runs(np.array(stroke.points)):
                by_width.setdefault(steps, []).append(line)
    drawing = np.zeros((IMAGE, IMAGE), np.uint8)
    for steps, lines in by_width.items():
        np.maximum(drawing, render(lines, steps * _WIDTH_STEP), out=drawing)
    peak = int(drawing.max())  # a dot between pixels fills none of them: ink is 255 all the same
    return drawing if peak in (0, 255) else np.rint(drawing * (255 / peak)).astype(np.uint8)


def _runs(points: NDArray[np.float64]) -> list[tuple[int, Polyline]]:
    """A stroke cut where its width changes: (width in steps, places as `strokes.render` takes them)."""
    if len(points) == 1:
        points = points.repeat(2, axis=0)
    pressure = (points[1:, 2] + points[:-1, 2]) / 2
    steps = np.rint((_WIDTH[0] + (_WIDTH[1] - _WIDTH[0]) * pressure) / _WIDTH_STEP).astype(int)
    cuts = [0, *(np.flatnonzero(np.diff(steps)) + 1).tolist(), len(steps)]
    return [(int(steps[a]), points[a : b + 1, :2] - 0.5) for a, b in itertools.pairwise(cuts)]


def bounds(strokes: Iterable[Stroke]) -> tuple[float, float, float, float] | None:
    """Left, top, right and bottom of the ink in pixels, where the pen went; None without ink."""
    places = [stroke.xy for stroke in strokes if stroke.kind == "ink"]
    if not places:
        return None
    every = np.concatenate(places)
    (left, top), (right, bottom) = every.min(axis=0).tolist(), every.max(axis=0).tolist()
    return left, top, right, bottom


def check_path(path: object, radius: object) -> tuple[Polyline, float]:
    """Where an eraser goes: float64 [n, 2] in pixels, and its radius.

    Raises:
        ValueError: for no places or too many, numbers that are not finite, or a radius that is not from 0 to 128.
    """
    if isinstance(radius, bool) or not isinstance(radius, int | float) or not 0 < radius <= IMAGE / 2:
        raise ValueError(f"the radius of an eraser must be more than 0 and at most {IMAGE // 2} pixels, got {radius!r}")
    if not isinstance(path, list | tuple) or not all(isinstance(p, list | tuple) and len(p) == 2 for p in path):
        raise ValueError("the path of an eraser is a list of [x, y]")
    return Stroke.of([(*p, 0.5) for p in path]).xy, float(radius)


def erase(strokes: Sequence[Stroke], path: Sequence[Sequence[float]], radius: float) -> tuple[Stroke, ...]:
    """The strokes with everything taken away that a round eraser passes over, of both kinds.

    A stroke that it crosses is left in pieces, each a new stroke of a new id; one that it does not touch stays the very
    same.

    Args:
        strokes: what is there.
        path: (x, y) that the eraser's centre moves along, pixels.
        radius: of the eraser, pixels.

    Raises:
        ValueError: see `check_path`.
    """
    places, reach = check_path(path, radius)
    low, high = places.min(axis=0) - reach, places.max(axis=0) + reach
    left: list[Stroke] = []
    for stroke in strokes:
        xy = stroke.xy
        if (xy.max(axis=0) < low).any() or (xy.min(axis=0) > high).any():
            left.append(stroke)
        else:
            left += _cut(stroke, places, reach)
    return tuple(left)


def _cut(stroke: Stroke, places: Polyline, reach: float) -> list[Stroke]:
    """What is left of a stroke."""
    points = np.array(stroke.points)
    lengths = np.hypot(*np.diff(points[:, :2], axis=0).T)
    counts = np.maximum(1, np.ceil(lengths / _SAMPLE)).astype(int)
    # Positions along the stroke, counted in points: 2.5 is halfway between the points 2 and 3.
    at = np.concatenate([*(i + np.arange(n) / n for i, n in enumerate(counts)), [len(points) - 1.0]])
    samples = np.stack([np.interp(at, np.arange(len(points)), points[:, i]) for i in range(3)], axis=1)
    kept = _distance(samples[:, :2], places) > reach
    if kept.all():
        return [stroke]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], kept, [False]]).astype(np.int8)))
    pieces = []
    for first, end in edges.reshape(-1, 2):
        start, stop = at[first], at[end - 1]
        inner = [points[i] for i in range(int(np.floor(start)) + 1, int(np.ceil(stop)))]
        if end - first > 1:  # a single place is a crumb
            pieces.append(Stroke.of([samples[first], *inner, samples[end - 1]], stroke.kind))
    return pieces


def _distance(samples: Polyline, places: Polyline) -> NDArray[np.float64]:
    """How far each sample is from a path, pixels: float64 [n]."""
    if len(places) == 1:
        places = places.repeat(2, axis=0)
    nearest = np.full(len(samples), np.inf)
    for a, b in itertools.pairwise(places):
        along = b - a
        share = ((samples - a) @ along / max(float(along @ along), 1e-12)).clip(0, 1)
        np.minimum(nearest, np.hypot(*(samples - a - share[:, None] * along).T), out=nearest)
    return nearest
