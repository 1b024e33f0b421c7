"""Profiles to be turned about an axis: smooth curves in as few straight steps as show no lines between them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import sqrt

Point = tuple[float, float]
"""Radius and height."""

_STEPS = 8
"""Points of each span that are looked at."""
_HERMITE = [
    (t, (1 - t * t * (3 - 2 * t), t * t * (3 - 2 * t), t * (t - 1) * (t - 1), t * t * (t - 1)))
    for t in (k / _STEPS for k in range(1, _STEPS + 1))
]
"""For each of them, how much of the two ends and of the ways there goes into it."""
_TURN = 0.11
"""Square of the sine of the angle by which the next step may turn: 19 degrees; a crease is drawn from 30 on."""
_AWAY = 0.006
"""How far a curve may be from its steps, in the unit of the profile's points."""


def smooth(points: Sequence[Point]) -> list[Point]:
    """A curve through points, from the bottom to the top, as steps that rise all along.

    A spline of cubic pieces whose direction at each point is that from the one before it to the one after it.
    """
    lengths = [sqrt((r1 - r0) ** 2 + (y1 - y0) ** 2) for (r0, y0), (r1, y1) in pairwise(points)]
    ways = []
    for k in range(len(points)):
        before, after = max(k - 1, 0), min(k + 1, len(points) - 1)
        length = sum(lengths[before:after]) or 1.0
        ways.append([(points[after][i] - points[before][i]) / length for i in (0, 1)])
    dense = [points[0]]
    for k, length in enumerate(lengths):
        (r0, y0), (r1, y1), (dr0, dy0), (dr1, dy1) = points[k], points[k + 1], ways[k], ways[k + 1]
        for t, (a, b, c, d) in _HERMITE:
            r = a * r0 + b * r1 + length * (c * dr0 + d * dr1)
            y = a * y0 + b * y1 + length * (c * dy0 + d * dy1)
            dense.append((max(r, 0.0), min(max(y, dense[-1][1]), points[-1][1])) if t < 1 else points[k + 1])
    return _thinned(dense)


def _thinned(dense: list[Point]) -> list[Point]:
    """The first and the last, and as few others as keep to the curve and do not turn by too much at once."""
    kept, last = [dense[0]], 0
    for i in range(2, len(dense)):
        (r0, y0), (r1, y1) = dense[last], dense[i]
        dr, dy = r1 - r0, y1 - y0
        length = dr * dr + dy * dy
        first_r, first_y = dense[last + 1][0] - r0, dense[last + 1][1] - y0
        turn = first_r * dy - first_y * dr
        bent = turn * turn > 0.25 * _TURN * (first_r * first_r + first_y * first_y) * length
        if not bent:
            for r, y in dense[last + 1 : i]:
                off = (r - r0) * dy - (y - y0) * dr
                if off * off > _AWAY * _AWAY * length:
                    bent = True
                    break
        if bent and dense[i - 1][1] > y0:
            kept.append(dense[i - 1])
            last = i - 1
    kept.append(dense[-1])
    return kept


def hollow(outer: Sequence[Point], wall: float, floor: float) -> list[Point]:
    """What to take out of a turned profile so that a wall is left, open at the top.

    Args:
        outer: the profile from the bottom to the top, without steps.
        wall: its thickness, at right angles to it.
        floor: height at which the hollow begins.

    Returns:
        The profile of the hollow, a little beyond the top; empty if there is no room for one.
    """
    inner: list[Point] = []
    for (r0, y0), (r1, y1) in pairwise(outer):
        if y1 <= y0 or y1 <= floor:
            continue
        slope = (r1 - r0) / (y1 - y0)
        across = wall * sqrt(min(1.0 + slope * slope, 9.0))
        for r, y in ((r0, y0), (r1, y1)):
            if y < floor:
                r, y = r0 + slope * (floor - y0), floor
            if inner and y <= inner[-1][1]:
                # Between two steps of different slants the thicker wall counts.
                inner[-1] = (min(inner[-1][0], max(r - across, 0.3 * r)), y)
            else:
                inner.append((max(r - across, 0.3 * r), y))
    if inner:
        top = inner[-1]
        inner.append((top[0], top[1] + wall))
    return inner


def radius(profile: Sequence[Point], height: float) -> float:
    """A profile's radius at some height, that of its ends beyond them."""
    for (r0, y0), (r1, y1) in pairwise(profile):
        if y0 <= height <= y1 and y1 > y0:
            return r0 + (r1 - r0) * (height - y0) / (y1 - y0)
    return profile[-1][0] if height > profile[-1][1] else profile[0][0]
