"""The slow twin of `rust/src/trace.rs`: scikit-image thins, a graph in Python is followed."""

# mypy: disable-error-code="no-untyped-call"
# (scikit-image says that it is typed, and is not.)

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray
from skimage.measure import approximate_polygon
from skimage.morphology import skeletonize

from sketchcore.drawing import INK

Polyline = NDArray[np.float64]
"""float64 [n, 2], n >= 2: (x, y) in pixels, x to the right, y down; a pixel's centre is at its indices."""

_CORNER = 40.0
"""Degrees that a line turns by at a corner, which ends one stroke and begins another."""
_STRAIGHT = 1.5
"""Pixels that a line may stray from the straight one between two corners."""


def trace(drawing: NDArray[np.uint8]) -> list[Polyline]:
    """The strokes of a drawing: its lines from junction to junction, cut at corners.

    Args:
        drawing: uint8 [256, 256], ink 255 on 0.

    Returns:
        one polyline a stroke, its points about a pixel apart; closed lines without corner return to where they began.
    """
    thin = np.pad(skeletonize(drawing >= INK), 1)
    neighbours = {
        (int(r), int(c)): [
            (int(r + dr), int(c + dc))
            for dr, dc in ((0, 1), (1, 0), (0, -1), (-1, 0), (1, 1), (1, -1), (-1, -1), (-1, 1))
            if thin[r + dr, c + dc]
        ]
        for r, c in np.argwhere(thin)
    }
    # A line has two neighbours; a diagonal one beside a straight one is the same way round a bend.
    for pixel, around in neighbours.items():
        straight = [n for n in around if n[0] == pixel[0] or n[1] == pixel[1]]
        neighbours[pixel] = [
            n for n in around if n in straight or not any(abs(n[0] - s[0]) + abs(n[1] - s[1]) == 1 for s in straight)
        ]
    strokes = []
    used: set[frozenset[tuple[int, int]]] = set()
    ends = [pixel for pixel, around in neighbours.items() if len(around) != 2]
    for start in [*ends, *neighbours]:  # closed lines have no end: they begin anywhere
        for following in neighbours[start]:
            if frozenset((start, following)) in used:
                continue
            path = [start, following]
            used.add(frozenset(path))
            while len(neighbours[path[-1]]) == 2 and path[-1] != start:
                a, b = neighbours[path[-1]]
                path.append(b if a == path[-2] else a)
                used.add(frozenset(path[-2:]))
            strokes += _cut(np.array(path, np.float64)[:, ::-1] - 1)
    return strokes


def _cut(path: Polyline) -> list[Polyline]:
    """A path of pixels cut at its corners."""
    kept = approximate_polygon(path, _STRAIGHT)
    if len(kept) < 3:
        return [path]
    steps = np.diff(kept, axis=0)
    angles = np.degrees(np.arctan2(steps[:, 1], steps[:, 0]))
    turns = np.abs((np.diff(angles) + 180) % 360 - 180)
    corners = kept[1:-1][turns > _CORNER]
    at = [0, *(int(np.flatnonzero((path == corner).all(axis=1))[0]) for corner in corners), len(path) - 1]
    return [path[a : b + 1] for a, b in itertools.pairwise(at) if b > a]
