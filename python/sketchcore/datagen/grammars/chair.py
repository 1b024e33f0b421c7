"""Chairs: dining chairs, arm chairs, office chairs, stools, benches, sofas."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from sketchcore.datagen.grammars.chair_arms import put_arms, put_sofa
from sketchcore.datagen.grammars.chair_back import Back
from sketchcore.datagen.grammars.chair_seat import Seat, put_column, put_seat
from sketchcore.datagen.grammars.grammar import Grammar
from sketchcore.datagen.grammars.parts import Dice, Parts, Range


@dataclass(frozen=True)
class Chair(Grammar):
    """Chairs of all kinds. Lengths are metres, angles are slopes: how far for one unit upwards.

    Attributes:
        kinds: how often each kind is; "sofa" is any thick one, upholstered down to the floor or nearly.
        height: of the seat; a stool's is `stool`.
        stool: see there.
        depth: of the seat.
        width: of the seat; a bench's is `bench`.
        bench: see there.
        thickness: of the seat.
        cushions: share of the seats that are as thick as `cushion`.
        cushion: see there.
        seats: how often each form of seat is: with parallel sides, narrower at the back, round.
        legs: how often each kind of base is; "star" stands on a column and is an office chair's.
        leg: thickness of legs, half.
        round: share of the chairs with round legs and posts.
        tapered: share of the chairs whose legs get thinner downwards.
        splay: how much legs slant outwards.
        splayed: share of the chairs with slanting legs.
        stretchers: share of the chairs on legs with bars between them.
        aprons: share of the chairs on legs with boards below the seat.
        backs: how often each kind of back is.
        back: height of the back above the seat.
        recline: how much a back slants backwards.
        bars: how many slats or rungs.
        arms: share of the chairs with arms.
        arm: height of arms above the seat.
    """

    kinds: Mapping[str, float] = field(
        default_factory=lambda: {"chair": 5.0, "office": 1.8, "stool": 1.2, "bench": 0.4, "sofa": 0.9}
    )
    height: Range = (0.38, 0.52)
    stool: Range = (0.38, 0.8)
    depth: Range = (0.36, 0.54)
    width: Range = (0.36, 0.56)
    bench: Range = (0.8, 1.5)
    thickness: Range = (0.03, 0.07)
    cushions: float = 0.3
    cushion: Range = (0.07, 0.16)
    seats: Mapping[str, float] = field(default_factory=lambda: {"square": 3.0, "trapezium": 1.5, "round": 1.2})
    legs: Mapping[str, float] = field(
        default_factory=lambda: {
            "legs": 7.0,
            "sled": 0.7,
            "cantilever": 0.5,
            "panels": 0.5,
            "pedestal": 0.6,
            "rockers": 0.3,
        }
    )
    leg: Range = (0.011, 0.03)
    round: float = 0.4
    tapered: float = 0.4
    splay: Range = (0.03, 0.25)
    splayed: float = 0.5
    stretchers: float = 0.5
    aprons: float = 0.3
    backs: Mapping[str, float] = field(
        default_factory=lambda: {
            "panel": 2.0,
            "pad": 1.2,
            "slats": 2.0,
            "rungs": 2.5,
            "hoop": 1.0,
            "oval": 0.5,
            "shell": 0.5,
        }
    )
    back: Range = (0.28, 0.7)
    recline: Range = (0.0, 0.35)
    bars: Range = (2, 6)
    arms: float = 0.35
    arm: Range = (0.16, 0.28)

    def grow(self, parts: Parts, dice: Dice) -> None:
        """Builds one chair, from the seat to the legs and the back."""
        kind = dice.pick(self.kinds)
        seat = self._seat(kind, dice)
        if kind == "sofa":
            put_sofa(parts, seat, self.round, dice)
            return
        leg, rounded = dice.between(self.leg), dice.chance(self.round)
        put_seat(parts, seat, dice)
        base = "star" if kind == "office" else dice.pick(self.legs)
        if kind in ("stool", "bench") and base in ("cantilever", "rockers"):
            base = "legs"
        if kind == "bench" and base == "pedestal":
            base = "panels"
        corners = self._base(parts, seat, base, leg, rounded, dice)
        if kind == "stool" and dice.chance(0.85):
            return
        if kind == "bench" and dice.chance(0.4):
            return
        slope = dice.between(self.recline) if dice.chance(0.8) else 0.0
        tall = dice.between(self.back) * (0.5 if kind == "stool" else 1.0)
        back, office = dice.pick(self.backs), kind == "office"
        if office:
            back = dice.pick({"panel": 1.0, "pad": 3.0, "shell": 1.0, "oval": 0.8, "rungs": 0.5})
        if back in ("shell", "hoop") and max(seat.width, seat.rear) > 1.3 * seat.depth:
            back = "slats"  # what is round would be as deep as the seat is wide, or as high
        Back(parts, dice, seat, office, leg, rounded, tall, slope, corners, self.bars).build(back)
        if dice.chance(0.7 if office else self.arms):
            up = min(dice.between(self.arm), max(0.8 * tall, 0.1))
            put_arms(parts, seat, up, office, leg, rounded, slope, dice)

    def _seat(self, kind: str, dice: Dice) -> Seat:
        top = dice.between(self.stool if kind == "stool" else self.height)
        depth, width = dice.between(self.depth) / 2, dice.between(self.width) / 2
        thick = dice.between(self.cushion if dice.chance(self.cushions) else self.thickness)
        form = dice.pick(self.seats)
        if kind == "bench":
            width, form = dice.between(self.bench) / 2, "square"
        if kind == "stool":
            depth, width = 0.75 * depth, 0.75 * width
            top = max(top, 1.4 * width + depth)
            form = "round" if dice.chance(0.5) else "square"
        if kind == "sofa":
            depth, width, form = 1.25 * depth, 1.2 * width * dice.between((1.0, 2.4)), "square"
        if form == "round" and dice.chance(0.8):
            width = depth
        rear = width * dice.between((0.65, 0.92)) if form == "trapezium" else width
        return Seat(top, thick, depth, width, rear, form == "round")

    def _base(
        self, parts: Parts, seat: Seat, base: str, leg: float, rounded: bool, dice: Dice
    ) -> tuple[float, float] | None:
        """What the seat stands on; and where on the seat back legs are, if they are, so that posts can go on."""
        if base in ("star", "pedestal"):
            put_column(parts, seat, base, leg, dice)
            return None
        inset = 0.3 if seat.round else 0.0
        front = (1 - inset) * seat.depth - leg
        ends = ((front, (1 - inset) * seat.width - leg), (-front, (1 - inset) * seat.rear - leg))
        if base == "panels":
            for half_width in (seat.width, seat.rear)[: 1 if dice.chance(0.7) else 2]:
                thick = max(leg, 0.02)
                parts.both.box(
                    (0.0, 0.5 * seat.bottom, half_width - thick), (0.9 * seat.depth, 0.5 * seat.bottom, thick)
                )
            return None
        size = (leg, leg)
        if base == "cantilever":
            z = seat.width - leg
            parts.both.beam((seat.depth - leg, leg, z), (seat.depth - leg, seat.top - leg, z), size, round=rounded)
            parts.both.beam((-seat.depth, leg, z), (seat.depth, leg, z), size, round=rounded)
            parts.both.beam((-seat.depth, seat.bottom, z), (seat.depth, seat.bottom, z), size, round=rounded)
            parts.box((-seat.depth + leg, leg, 0.0), (leg, leg, z + leg))
            return None
        slant = dice.between(self.splay) if dice.chance(self.splayed) else 0.0
        backwards = slant * dice.between((0.5, 1.5)) if dice.chance(0.7) else 0.0
        foot = size
        if dice.chance(self.tapered):
            foot = (leg * dice.between((0.5, 0.85)),) * 2
        ground = 2 * leg if base in ("sled", "rockers") else 0.0
        fall = seat.bottom - ground
        feet = []
        for (x, z), sign in zip(ends, (1.0, -1.0), strict=True):
            to = (x + sign * fall * (slant if sign > 0 else backwards), ground, z + 0.7 * slant * fall)
            parts.both.beam((x, seat.bottom + 0.5 * seat.thick, z), to, size, foot, round=rounded, axis="y")
            feet.append(((x, z), (to[0], to[2])))
        if base == "sled":
            (_, (xf, zf)), (_, (xb, zb)) = feet
            parts.both.beam((xb - leg, leg, zb), (xf + leg, leg, zf), size, round=False, axis="x")
        if base == "rockers":
            (_, (xf, zf)), (_, (xb, zb)) = feet
            radius = dice.between((0.8, 1.3))
            arc = (270.0 - 38.0 / radius, 270.0 + 32.0 / radius)
            middle, z = 0.5 * (xf + xb), 0.5 * (zf + zb)
            parts.both.ring((middle, radius - leg, z), (radius, radius, leg), "z", min(2.2 * leg / radius, 0.5), arc)
        if dice.chance(self.stretchers) and base == "legs":
            self._stretchers(parts, seat, feet, 0.75 * leg, rounded, dice)
        if dice.chance(self.aprons):
            deep, (x, z) = 0.5 * dice.between((0.05, 0.1)), ends[0]
            y, thin = seat.bottom - deep, max(0.6 * leg, 0.012)
            parts.both.beam((ends[1][0], y, ends[1][1]), (x, y, z), (deep, thin), axis="x")
            for x, z in ends:
                parts.box((x, y, 0.0), (thin, deep, z))
        return ends[1] if not seat.round else None

    def _stretchers(
        self,
        parts: Parts,
        seat: Seat,
        feet: list[tuple[tuple[float, float], tuple[float, float]]],
        thin: float,
        rounded: bool,
        dice: Dice,
    ) -> None:
        """Bars between the legs: at the sides, in front, behind, or across from side to side."""
        thin = max(thin, 0.011)

        def along(k: int, y: float) -> tuple[float, float, float]:
            (x, z), (fx, fz) = feet[k]
            part = y / seat.bottom
            return (fx + (x - fx) * part, y, fz + (z - fz) * part)

        y = seat.bottom * dice.between((0.15, 0.6))
        kind = dice.pick({"sides": 1.0, "all": 1.5, "h": 1.0, "twice": 0.8})
        heights = [y] if kind != "twice" else [y, min(y + 0.3 * seat.bottom, 0.85 * seat.bottom)]
        size = (thin, thin)
        for y in heights:
            (xb, _, zb), (xf, _, zf) = along(1, y), along(0, y)
            parts.both.beam((xb, y, zb), (xf, y, zf), size, round=rounded, axis="x")
            if kind in ("all", "twice"):
                drop = dice.between((0.0, 0.12)) * seat.bottom
                for k in (0, 1):
                    x, _, z = along(k, y - drop)
                    parts.beam((x, y - drop, -z), (x, y - drop, z), size, round=rounded)
            if kind == "h":
                z = 0.5 * (zb + zf)
                parts.beam((0.5 * (xb + xf), y, -z), (0.5 * (xb + xf), y, z), size, round=rounded)
