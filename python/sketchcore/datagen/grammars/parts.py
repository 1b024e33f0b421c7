"""What a grammar builds a shape of, and the random numbers that it draws."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TypeVar

from sketchcore.shape import Primitive, Shape

T = TypeVar("T")
Point = Sequence[float]
Range = tuple[float, float]
"""Least and most of what is drawn from evenly."""


class Dice:
    """Random numbers that are the same on every machine: a stream for each (seed, sample)."""

    def __init__(self, seed: int, index: int) -> None:
        self.unit = random.Random(seed << 64 | index).random
        """Evenly in [0, 1)."""

    def between(self, span: Range) -> float:
        """Evenly between two numbers."""
        return span[0] + (span[1] - span[0]) * self.unit()

    def around(self, by: float) -> float:
        """Evenly between -`by` and `by`."""
        return by * (2 * self.unit() - 1)

    def count(self, span: Range) -> int:
        """A whole number, from the least to the most, both included."""
        return int(span[0]) + int(self.unit() * (int(span[1]) - int(span[0]) + 1))

    def chance(self, share: float) -> bool:
        """Whether something happens that happens so often."""
        return self.unit() < share

    def pick(self, weights: Mapping[T, float]) -> T:
        """A key, each as often as its value says."""
        left = self.unit() * sum(weights.values())
        for key, weight in weights.items():
            left -= weight
            if left < 0:
                return key
        return key


class Parts:
    """A shape in the making: in any unit, y up, its front along +x, symmetric about z = 0; it is scaled in the end.

    `parts.cut` adds parts that are taken away from what is there, `parts.both` adds each with its mirror image about
    z = 0, and `parts.both.cut` does both. What is added later wins.
    """

    def __init__(self, rows: list[tuple[float, ...]] | None = None, op: float = 1.0, mirror: bool = False) -> None:
        self.rows = [] if rows is None else rows
        self._op, self._mirror = op, mirror

    @property
    def cut(self) -> Parts:
        """Parts that are taken away."""
        return Parts(self.rows, 0.0, self._mirror)

    @property
    def both(self) -> Parts:
        """Parts that come with their mirror images."""
        return Parts(self.rows, self._op, True)

    def box(self, center: Point, half: Point) -> None:
        """An axis-aligned box."""
        self._add(0.0, center, half)

    def cylinder(self, center: Point, half: Point, axis: str = "y") -> None:
        """A cylinder along an axis, its section an ellipse; `half` as for `sketchcore.Cylinder`."""
        self._add(1.0 + "xyz".index(axis), center, half)

    def beam(
        self, start: Point, end: Point, size: Point, to: Point | None = None, *, round: bool = False, axis: str = ""
    ) -> None:
        """A leg, a rail, a slanted panel: from the middle of one end to that of the other.

        Args:
            start: x, y, z.
            end: x, y, z.
            size: half sizes of the section at `start`, along the two axes that are not the beam's, in order.
            to: those at `end`, if they are others; those of a round beam differ by the same share.
            round: whether the section is an ellipse.
            axis: the axis across which its ends are flat, if not the one along which they are furthest apart.
        """
        away = [abs(b - a) for a, b in zip(start, end, strict=True)]
        along = "xyz".index(axis) if axis else away.index(max(away))
        u, v = [a for a in range(3) if a != along]
        lower, upper, small, large = start, end, size, to or size
        if start[along] > end[along]:
            lower, upper, small, large = end, start, large, small
        half = [0.0, 0.0, 0.0]
        half[along] = 0.5 * (upper[along] - lower[along])
        half[u], half[v] = 0.5 * (small[0] + large[0]), 0.5 * (small[1] + large[1])
        taper = [(large[k] - small[k]) / (small[k] + large[k]) for k in (0, 1)]
        if round:
            taper[1] = taper[0]
        shear = [0.5 * (upper[a] - lower[a]) for a in (u, v)]
        center = [0.5 * (a + b) for a, b in zip(lower, upper, strict=True)]
        self._add((19.0 if round else 16.0) + along, center, half, (*shear, *taper))

    def turned(
        self, profile: Sequence[Point], x: float = 0.0, z: float = 0.0, *, squash: float = 1.0, round: bool = True
    ) -> None:
        """A profile turned about a vertical axis.

        Args:
            profile: (radius, height) from the bottom to the top; a second point at the same height is a step.
            x: where the axis stands.
            z: likewise.
            squash: the section's extent along z, as a share of that along x.
            round: a square section instead of a circle's if not.
        """
        for (r0, y0), (r1, y1) in pairwise(profile):
            if y1 > y0 and r0 + r1 > 0:
                self.beam((x, y0, z), (x, y1, z), (r0, r0 * squash), (r1, r1 * squash), round=round, axis="y")

    def ring(
        self, center: Point, half: Point, axis: str = "y", tube: float = 0.2, arc: tuple[float, float] = (0.0, 360.0)
    ) -> None:
        """A ring about an axis or an arc of one: as `sketchcore.Torus`."""
        self._add(22.0 + "xyz".index(axis), center, half, (tube, *arc, 0.0))

    def add(self, primitive: Primitive) -> None:
        """Any other primitive; its own op is left aside."""
        row = Shape([primitive]).packed[0].tolist()
        self._add(row[0], row[2:5], row[5:8], tuple(row[8:]) or (0.0,) * 4)

    def _add(self, kind: float, center: Point, half: Point, more: tuple[float, ...] = (0.0,) * 4) -> None:
        row = (kind, self._op, *center, *half, *more)
        self.rows.append(row)
        if self._mirror:
            mirrored = _mirrored(row)
            if mirrored != row:
                self.rows.append(mirrored)


def _mirrored(row: tuple[float, ...]) -> tuple[float, ...]:
    """The mirror image of a packed row about z = 0."""
    kind, op, x, y, z, *half, a, b, c, d = row
    if 4 <= kind < 12:
        kind += -2.0 if int(kind) & 2 else 2.0
    elif kind in (18.0, 21.0):
        a, b, c, d = -a, -b, -c, -d
    elif 16 <= kind < 22:
        b = -b
    elif kind in (22.0, 23.0):
        b, c = -c, -b
    return (kind, op, x, y, -z, *half, a, b, c, d)
