"""What a chair's back is made of: panels, pads, slats, rungs, bows."""

from __future__ import annotations

from math import sqrt

from sketchcore.datagen.grammars.chair_seat import Seat
from sketchcore.datagen.grammars.parts import Dice, Parts, Range


class Back:
    """The plane of a back, perhaps reclined and wider or narrower upwards, and what can stand in it.

    Args:
        parts: what it is added to.
        dice: what it is drawn by.
        seat: what it stands on.
        office: whether it may be held by a single bar.
        leg: half of a leg's thickness.
        rounded: whether posts are round.
        tall: its height above the seat.
        slope: how much it leans back for one unit upwards.
        corners: x and z of the back legs, which posts are to go on from; None without any.
        bars: how many slats or rungs.
    """

    def __init__(
        self,
        parts: Parts,
        dice: Dice,
        seat: Seat,
        office: bool,
        leg: float,
        rounded: bool,
        tall: float,
        slope: float,
        corners: tuple[float, float] | None,
        bars: Range,
    ) -> None:
        self.parts, self.dice, self.seat, self.bars = parts, dice, seat, bars
        self.office, self.leg, self.rounded, self.tall, self.slope = office, leg, rounded, tall, slope
        self.on_legs = corners is not None
        self.thin = max(0.6 * leg, 0.012)
        self.post = (max(leg, self.thin),) * 2
        self.x, self.wide = corners or (-seat.depth + leg, seat.rear - leg)
        if seat.round:
            self.x, self.wide = -0.8 * seat.depth, 0.75 * seat.width
        self.flare = dice.between((0.85, 1.15)) if dice.chance(0.3) else 1.0
        self.lower, self.upper = seat.bottom + 0.3 * seat.thick, seat.top + tall

    def at(self, y: float, z: float = 0.0) -> tuple[float, float, float]:
        """On the plane of the back, so high up, and so much of the way from the middle to a post."""
        part = (y - self.lower) / (self.upper - self.lower)
        return (self.x - self.slope * (y - self.lower), y, z * self.wide * (1 + (self.flare - 1) * part))

    def build(self, kind: str) -> None:
        """Adds a back: panel, pad, slats, rungs, hoop, oval or shell."""
        builders = {
            "panel": self._panel,
            "pad": self._pad,
            "slats": self._slats,
            "rungs": self._rungs,
            "hoop": self._hoop,
            "oval": self._oval,
            "shell": self._shell,
        }
        builders[kind]()

    def _posts(self) -> None:
        start, end = self.at(self.lower, 1.0), self.at(self.upper, 1.0)
        self.parts.both.beam(start, end, self.post, round=self.rounded, axis="y")

    def _bracket(self) -> None:
        """From under the seat to a bar behind it."""
        thin, x = self.thin, self.x
        self.parts.box((0.5 * x, self.seat.bottom, 0.0), (-0.5 * x + thin, thin, 0.25 * self.wide))

    def _panel(self) -> None:
        dice, leg = self.dice, self.leg
        thick = self.thin * dice.between((1.0, 2.5))
        gap = dice.between((0.0, 0.3)) * self.tall if self.on_legs and dice.chance(0.4) else 0.0
        if gap:
            self._posts()
        top = self.at(self.upper, 1.0)
        start = self.at(self.seat.top + gap if gap else self.lower, 1.0)
        ends = (start[0], start[1], 0.0), (top[0], top[1], 0.0)
        self.parts.beam(*ends, (thick, start[2] + leg), (thick, top[2] + leg), axis="y")
        if dice.chance(0.15):
            # A rounded top.
            high = dice.between((0.1, 0.3)) * self.wide
            self.parts.cylinder(self.at(self.upper), (thick, high, self.wide * self.flare), "x")

    def _pad(self) -> None:
        dice, tall, wide = self.dice, self.tall, self.wide
        if dice.chance(0.6 if self.office else 0.25):
            bar = self.at(self.lower - 0.02), self.at(self.upper - 0.2 * tall)
            self.parts.beam(*bar, (self.thin, 0.25 * wide), axis="y")
            if self.office:
                self._bracket()
        else:
            self._posts()
        thick = dice.between((0.018, 0.06))
        start, top = self.at(self.seat.top + dice.between((0.15, 0.5)) * tall), self.at(self.upper)
        low = dice.between((0.75, 1.1)) * wide + self.leg
        high = dice.between((0.75, 1.1)) * wide * self.flare + self.leg
        ahead = 0.6 * thick
        ends = (start[0] + ahead, start[1], 0.0), (top[0] + ahead, top[1], 0.0)
        self.parts.beam(*ends, (thick, low), (thick, high), axis="y")

    def _slats(self) -> None:
        """Upright slats or spindles between rails, symmetric about the middle; or one broad splat."""
        dice, parts, thin, wide = self.dice, self.parts, self.thin, self.wide
        self._posts()
        rail = dice.between((0.02, 0.06))
        parts.box(self.at(self.upper - 0.5 * rail), (thin + self.slope * rail, rail, wide * self.flare + self.post[1]))
        low, high = self.lower, self.upper - 0.5 * rail
        if dice.chance(0.7):
            low = self.seat.top + dice.between((0.0, 0.3)) * self.tall
            parts.box(self.at(low), (thin + 0.5 * self.slope * rail, 0.6 * rail, wide + 0.5 * self.post[1]))
        count = dice.count(self.bars)
        rounded = dice.chance(0.3)
        room = 1.0 / count
        half = thin if rounded else max(wide * room * dice.between((0.25, 0.6)), 0.012)
        if dice.chance(0.2):
            parts.beam(self.at(low), self.at(high), (thin, dice.between((0.15, 0.45)) * wide), axis="y")
            return
        for k in range(count):
            z = (k + 0.5) * 2 * room - 1
            if z >= -1e-9:
                side = parts if abs(z) < 1e-9 else parts.both
                side.beam(self.at(low, z), self.at(high, z), (thin, half), round=rounded, axis="y")

    def _rungs(self) -> None:
        dice = self.dice
        self._posts()
        count = dice.count(self.bars)
        high = 0.5 * self.tall / count * dice.between((0.25, 0.65))
        size = (self.thin, max(high, 0.013))
        bowed = dice.chance(0.3)
        for k in range(count):
            y = self.seat.top + self.tall * (k + 0.6) / count
            x, y, z = self.at(min(y, self.upper - high), 1.0)
            if bowed:
                self.parts.both.beam((x, y, z), (x - 0.15 * z, y, 0.0), size, axis="z")
            else:
                self.parts.beam((x, y, -z), (x, y, z), size, axis="z")

    def _hoop(self) -> None:
        """A bow over spindles, as of a Windsor chair; upright, for a ring does not lean."""
        dice, parts, thin, lower = self.dice, self.parts, self.thin, self.lower
        thick = max(0.9 * self.leg, 0.015)
        half = max(self.wide, 0.12)
        upper = min(self.upper, self.seat.top + 2.8 * half)
        straight = dice.between((0.0, 0.5)) * (upper - self.seat.top)
        x, y = self.x, self.seat.top + straight
        parts.ring((x, y, 0.0), (thick, upper - y, half), "x", min(1.7 * thick / half, 0.5), (-95.0, 95.0))
        end = half - thick
        parts.both.beam((x, lower, end), (x, y + 0.01, end), (thick, thick), round=True, axis="y")
        count = dice.count(self.bars)
        for k in range(count):
            z = (k + 0.5) * 2 / count - 1
            if z >= -1e-9:
                side = parts if abs(z) < 1e-9 else parts.both
                high = y + (upper - y) * sqrt(max(1 - z * z, 0.0)) - thick
                side.beam((x, lower, 0.9 * z * half), (x, high, z * half), (thin, thin), round=True, axis="y")
        if dice.chance(0.3):
            parts.box((x, y, 0.0), (thin, thick, half))

    def _oval(self) -> None:
        dice, parts, wide, x, lower = self.dice, self.parts, self.wide, self.x, self.lower
        middle, tall = self.at(self.upper - 0.35 * self.tall), 0.35 * self.tall
        across = max(wide, 0.12) * dice.between((0.8, 1.1))
        thick = dice.between((0.016, 0.05))
        parts.cylinder(middle, (thick, tall, across), "x")
        if dice.chance(0.3):
            parts.cut.cylinder(middle, (2 * thick, 0.72 * tall, 0.72 * across), "x")
        foot = (middle[0] - 0.3 * thick, middle[1] - 0.85 * tall, 0.0)
        if self.office or dice.chance(0.5):
            parts.beam((x, lower, 0.0), foot, (self.thin, 0.25 * wide), axis="y")
        else:
            apart = 0.6 * across
            end = (foot[0], foot[1] + 0.3 * tall, apart)
            parts.both.beam((x, lower, apart), end, self.post, round=self.rounded, axis="y")
        if self.office:
            self._bracket()

    def _shell(self) -> None:
        """A curved back: part of a tube around the seat."""
        dice, parts, seat = self.dice, self.parts, self.seat
        thick, radius = dice.between((0.02, 0.05)), max(seat.rear, seat.width) + self.leg
        x, y = -seat.depth + radius, 0.5 * (self.lower + self.upper)
        half = 0.5 * (self.upper - self.lower)
        open_ = dice.between((-0.6, 0.5)) * radius
        hole = radius - 2 * thick
        parts.cylinder((x, y, 0.0), (radius, half, radius))
        parts.cut.cylinder((x, y + seat.thick, 0.0), (hole, half, hole))
        parts.cut.box((x + radius + open_, y + 0.5 * seat.thick + 0.01, 0.0), (radius, half, 2 * radius))
