"""Chairs: dining chairs, arm chairs, office chairs, stools, benches, sofas."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import sqrt

from sketchcore.datagen.grammars.grammar import Grammar
from sketchcore.datagen.grammars.parts import Dice, Parts, Range


@dataclass(frozen=True)
class Seat:
    """What everything else of a chair hangs on: metres, the middle of the seat's upper face being above the origin.

    Attributes:
        top: height of the upper face.
        thick: thickness.
        depth: half of the extent from back to front.
        width: half of the extent from side to side, in front.
        rear: the same, at the back.
        round: whether it is a disc.
    """

    top: float
    thick: float
    depth: float
    width: float
    rear: float
    round: bool

    @property
    def bottom(self) -> float:
        """Height of the lower face."""
        return self.top - self.thick


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
            self._sofa(parts, seat, dice)
            return
        leg, rounded = dice.between(self.leg), dice.chance(self.round)
        _put_seat(parts, seat, dice)
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
        self._back(parts, seat, kind, leg, rounded, tall, slope, corners, dice)
        if dice.chance(0.7 if kind == "office" else self.arms):
            self._arms(parts, seat, kind, leg, rounded, tall, slope, dice)

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
            _column(parts, seat, base, leg, dice)
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

    def _back(
        self,
        parts: Parts,
        seat: Seat,
        kind: str,
        leg: float,
        rounded: bool,
        tall: float,
        slope: float,
        corners: tuple[float, float] | None,
        dice: Dice,
    ) -> None:
        back = dice.pick(self.backs)
        if kind == "office":
            back = dice.pick({"panel": 1.0, "pad": 3.0, "shell": 1.0, "oval": 0.8, "rungs": 0.5})
        if back in ("shell", "hoop") and max(seat.width, seat.rear) > 1.3 * seat.depth:
            back = "slats"  # what is round would be as deep as the seat is wide, or as high
        thin = max(0.6 * leg, 0.012)
        x0 = -seat.depth + leg if corners is None else corners[0]
        wide = seat.rear - leg if corners is None else corners[1]
        if seat.round:
            x0, wide = -0.8 * seat.depth, 0.75 * seat.width
        flare = dice.between((0.85, 1.15)) if dice.chance(0.3) else 1.0
        lower, upper = seat.bottom + 0.3 * seat.thick, seat.top + tall

        def at(y: float, z: float = 0.0) -> tuple[float, float, float]:
            """On the plane of the back, so high up, and so much of the way from the middle to a post."""
            part = (y - lower) / (upper - lower)
            return (x0 - slope * (y - lower), y, z * wide * (1 + (flare - 1) * part))

        post = (max(leg, thin), max(leg, thin))
        if back in ("slats", "rungs", "pad"):
            single = back == "pad" and dice.chance(0.6 if kind == "office" else 0.25)
            if single:
                parts.beam(at(lower - 0.02), at(upper - 0.2 * tall), (thin, 0.25 * wide), axis="y")
                if kind == "office":
                    parts.box((0.5 * x0, seat.bottom, 0.0), (-0.5 * x0 + thin, thin, 0.25 * wide))
            else:
                parts.both.beam(at(lower, 1.0), at(upper, 1.0), post, round=rounded, axis="y")
        if back == "panel":
            thick = thin * dice.between((1.0, 2.5))
            gap = dice.between((0.0, 0.3)) * tall if corners is not None and dice.chance(0.4) else 0.0
            if gap:
                parts.both.beam(at(lower, 1.0), at(upper, 1.0), post, round=rounded, axis="y")
            top = at(upper, 1.0)
            start = at(seat.top + gap if gap else lower, 1.0)
            parts.beam(
                (start[0], start[1], 0.0),
                (top[0], top[1], 0.0),
                (thick, start[2] + leg),
                (thick, top[2] + leg),
                axis="y",
            )
            if dice.chance(0.15):
                self._crest(parts, at, upper, wide, flare, thick, dice)
        elif back == "pad":
            thick = dice.between((0.018, 0.06))
            start, top = at(seat.top + dice.between((0.15, 0.5)) * tall), at(upper)
            spread = (dice.between((0.75, 1.1)) * wide + leg, dice.between((0.75, 1.1)) * wide * flare + leg)
            forward = 0.6 * thick
            parts.beam(
                (start[0] + forward, start[1], 0.0),
                (top[0] + forward, top[1], 0.0),
                (thick, spread[0]),
                (thick, spread[1]),
                axis="y",
            )
        elif back == "slats":
            rail = dice.between((0.02, 0.06))
            parts.box(at(upper - 0.5 * rail), (thin + slope * rail, rail, wide * flare + post[1]))
            if dice.chance(0.7):
                low = at(seat.top + dice.between((0.0, 0.3)) * tall)
                parts.box(low, (thin + 0.5 * slope * rail, 0.6 * rail, wide + 0.5 * post[1]))
            else:
                low = at(lower)
            self._slats(parts, at, low[1], upper - 0.5 * rail, thin, wide, dice)
        elif back == "rungs":
            count = dice.count(self.bars)
            high = 0.5 * tall / count * dice.between((0.25, 0.65))
            bowed = dice.chance(0.3)
            for k in range(count):
                y = seat.top + tall * (k + 0.6) / count
                x, y, z = at(min(y, upper - high), 1.0)
                if bowed:
                    parts.both.beam((x, y, z), (x - 0.15 * z, y, 0.0), (thin, max(high, 0.013)), axis="z")
                else:
                    parts.beam((x, y, -z), (x, y, z), (thin, max(high, 0.013)), axis="z")
        elif back == "hoop":
            self._hoop(parts, seat, at, lower, upper, leg, thin, wide, slope, dice)
        elif back == "oval":
            middle, disc = at(upper - 0.35 * tall), (0.35 * tall, max(wide, 0.12) * dice.between((0.8, 1.1)))
            thick = dice.between((0.016, 0.05))
            parts.cylinder(middle, (thick, *disc), "x")
            if dice.chance(0.3):
                parts.cut.cylinder(middle, (2 * thick, 0.72 * disc[0], 0.72 * disc[1]), "x")
            support = (middle[0] - 0.3 * thick, middle[1] - 0.85 * disc[0], 0.0)
            if kind == "office" or dice.chance(0.5):
                parts.beam((x0, lower, 0.0), support, (thin, 0.25 * wide), axis="y")
            else:
                apart = 0.6 * disc[1]
                parts.both.beam(
                    (x0, lower, apart),
                    (support[0], support[1] + 0.3 * disc[0], apart),
                    post,
                    round=rounded,
                    axis="y",
                )
            if kind == "office":
                parts.box((0.5 * x0, seat.bottom, 0.0), (-0.5 * x0 + thin, thin, 0.25 * wide))
        elif back == "shell":
            # A curved back: part of a tube around the seat.
            thick, radius = dice.between((0.02, 0.05)), max(seat.rear, seat.width) + leg
            round_at = (-seat.depth + radius, 0.5 * (lower + upper), 0.0)
            half = 0.5 * (upper - lower)
            open_ = dice.between((-0.6, 0.5)) * radius
            hole = radius - 2 * thick
            parts.cylinder(round_at, (radius, half, radius))
            parts.cut.cylinder((round_at[0], round_at[1] + seat.thick, 0.0), (hole, half, hole))
            parts.cut.box(
                (round_at[0] + radius + open_, round_at[1] + 0.5 * seat.thick + 0.01, 0.0), (radius, half, 2 * radius)
            )

    def _crest(self, parts: Parts, at, upper: float, wide: float, flare: float, thick: float, dice: Dice) -> None:  # type: ignore[no-untyped-def]
        """A rounded top."""
        parts.cylinder(at(upper), (thick, dice.between((0.1, 0.3)) * wide, wide * flare), "x")

    def _slats(self, parts: Parts, at, low: float, high: float, thin: float, wide: float, dice: Dice) -> None:  # type: ignore[no-untyped-def]
        """Upright slats or spindles, symmetric about the middle; or one broad splat."""
        count = dice.count(self.bars)
        rounded = dice.chance(0.3)
        room = 1.0 / count
        half = thin if rounded else max(wide * room * dice.between((0.25, 0.6)), 0.012)
        if dice.chance(0.2):
            parts.beam(at(low), at(high), (thin, dice.between((0.15, 0.45)) * wide), axis="y")
            return
        for k in range(count):
            z = (k + 0.5) * 2 * room - 1
            if z >= -1e-9:
                side = parts if abs(z) < 1e-9 else parts.both
                side.beam(at(low, z), at(high, z), (thin, half), round=rounded, axis="y")

    def _hoop(  # type: ignore[no-untyped-def]
        self,
        parts: Parts,
        seat: Seat,
        at,
        lower: float,
        upper: float,
        leg: float,
        thin: float,
        wide: float,
        slope: float,
        dice: Dice,
    ) -> None:
        """A bow over spindles, as of a Windsor chair; upright, for a ring does not lean."""
        thick = max(0.9 * leg, 0.015)
        half = max(wide, 0.12)
        upper = min(upper, seat.top + 2.8 * half)
        straight = dice.between((0.0, 0.5)) * (upper - seat.top)
        y = seat.top + straight
        x = at(lower)[0]
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

    def _arms(
        self, parts: Parts, seat: Seat, kind: str, leg: float, rounded: bool, tall: float, slope: float, dice: Dice
    ) -> None:
        up = min(dice.between(self.arm), max(0.8 * tall, 0.1))
        y, z = seat.top + up, max(seat.width, seat.rear) + leg * dice.between((-0.5, 1.0))
        thin = max(0.7 * leg, 0.013)
        broad = thin * dice.between((1.0, 2.4))
        rear = -seat.depth - slope * up
        front = seat.depth * dice.between((0.3, 1.0))
        tee = 3.0 if kind == "office" else 0.3
        kind = dice.pick({"posts": 3.0, "panel": 0.8, "loop": 0.8, "slanted": 1.0, "tee": tee})
        if kind == "tee":
            # A pad on a post in the middle of the seat's side.
            broad, x = max(broad, 0.02), 0.5 * (front + rear)
            parts.both.box((x, y, z), (0.4 * (front - rear), thin, broad))
            parts.both.beam((x, seat.bottom + 0.3 * seat.thick, z), (x, y, z), (2 * thin, thin), axis="y")
            low = seat.bottom + 0.5 * min(seat.thick, 0.06)
            parts.both.beam((x, low, 0.5 * seat.rear), (x, low, z), (2 * thin, 0.5 * min(seat.thick, 0.06)), axis="z")
            return
        if kind == "panel":
            thin *= dice.between((1.0, 2.5))
            parts.both.box(
                (0.5 * (front - seat.depth), 0.5 * (seat.bottom + y), z),
                (0.5 * (front + seat.depth), 0.5 * (y - seat.bottom), thin),
            )
            return
        if kind == "loop":
            half = 0.5 * (front + seat.depth)
            parts.both.ring(
                (front - half, seat.top, z), (half, up, thin), "z", min(2 * thin / half, 0.5), (-10.0, 190.0)
            )
            return
        parts.both.beam((rear, y, z), (front + thin, y - 0.02, z), (thin, broad), axis="x")
        foot = front if kind == "posts" else front - dice.between((0.2, 0.8)) * seat.depth
        parts.both.beam((foot, seat.bottom + 0.3 * seat.thick, z), (front, y, z), (thin, thin), round=rounded, axis="y")
        # Both ends hold on to something: the seat and the back may be narrower than the arms are apart.
        parts.both.beam(
            (foot, seat.bottom + 0.5 * seat.thick, 0.5 * seat.rear),
            (foot, seat.bottom + 0.5 * seat.thick, z),
            (thin, 0.45 * seat.thick),
            axis="z",
        )
        parts.both.beam(
            (rear + thin, y, 0.6 * seat.rear), (rear + thin, y, z), (thin, thin), axis="z"
        ) if seat.round else None

    def _sofa(self, parts: Parts, seat: Seat, dice: Dice) -> None:
        """An arm chair or sofa of thick blocks, perhaps on short feet."""
        feet = dice.between((0.04, 0.12)) if dice.chance(0.6) else 0.0
        top = dice.between((0.3, 0.44))
        arm, back = dice.between((0.05, 0.14)), dice.between((0.06, 0.14))
        tall = dice.between((0.3, 0.55))
        deep, wide = seat.depth, seat.width
        parts.box((0.0, 0.5 * (feet + top), 0.0), (deep, 0.5 * (top - feet), wide))
        slope = dice.between((0.0, 0.3))
        parts.beam(
            (-deep + back, feet, 0.0),
            (-deep + back - slope * tall, top + tall, 0.0),
            (back, wide),
            (back * dice.between((0.5, 1.0)), wide),
            axis="y",
        )
        if dice.chance(0.85):
            up = top + min(dice.between((0.12, 0.26)), tall)
            reach = deep * dice.between((0.8, 1.0))
            parts.both.box((reach - deep, 0.5 * (feet + up), wide + arm), (reach, 0.5 * (up - feet), arm))
            if dice.chance(0.4):
                parts.both.cylinder((reach - deep, up, wide + arm), (reach, 1.15 * arm, 1.15 * arm), "x")
        else:
            arm = 0.0
        if dice.chance(0.4):
            gap = 0.012
            parts.box((0.03, top + 0.04, 0.0), (deep - 0.02, 0.045, wide - gap))
        if feet:
            leg = dice.between((0.018, 0.035))
            rounded = dice.chance(self.round)
            for x in (deep - 1.5 * leg, -deep + 1.5 * leg):
                z = wide + 2 * arm - 1.5 * leg
                parts.both.beam((x, 0.0, z), (x, feet + 0.01, z), (0.7 * leg, 0.7 * leg), (leg, leg), round=rounded)


def _put_seat(parts: Parts, seat: Seat, dice: Dice) -> None:
    middle, half = seat.top - 0.5 * seat.thick, 0.5 * seat.thick
    if seat.round:
        # A rounded rim, whose tube is highest where the flat part ends.
        tube = min(half / min(seat.depth, seat.width), 0.5) if seat.thick > 0.05 and dice.chance(0.6) else 0.0
        parts.cylinder((0.0, middle, 0.0), ((1 - tube) * seat.depth, half, (1 - tube) * seat.width))
        if tube:
            parts.ring((0.0, middle, 0.0), (seat.depth, half, seat.width), "y", tube)
        return
    if seat.rear != seat.width:
        parts.beam(
            (-seat.depth, middle, 0.0), (seat.depth, middle, 0.0), (half, seat.rear), (half, seat.width), axis="x"
        )
    else:
        parts.box((0.0, middle, 0.0), (seat.depth, half, seat.width))
    if dice.chance(0.2):
        # A rounded front edge.
        parts.cylinder((seat.depth, middle, 0.0), (0.7 * half, half, seat.width), "z")
    elif dice.chance(0.15):
        # A rounded front.
        parts.cylinder((seat.depth, middle, 0.0), (0.35 * seat.depth, half, seat.width))


def _column(parts: Parts, seat: Seat, base: str, leg: float, dice: Dice) -> None:
    """A column on a plate, or on a star of beams, perhaps on castors."""
    thick = max(1.1 * leg, 0.018)
    parts.cylinder((0.0, 0.5 * seat.bottom + 0.01, 0.0), (thick, 0.5 * seat.bottom, thick))
    if dice.chance(0.4):
        parts.cylinder((0.0, 0.65 * seat.bottom, 0.0), (1.6 * thick, 0.3 * seat.bottom, 1.6 * thick))
    reach = max(seat.depth, min(seat.width, 0.3)) * dice.between((0.85, 1.2))
    if base == "pedestal" and dice.chance(0.7):
        high = dice.between((0.015, 0.03))
        if dice.chance(0.6):
            parts.cylinder((0.0, high, 0.0), (reach, high, reach))
        else:
            parts.turned([(reach, 0.0), (reach, 1.2 * high), (thick, 4 * high)])
        return
    size = max(0.8 * leg, 0.015)
    castors = 0.03 if dice.chance(0.6) else 0.0
    y, raised = size + castors, size + castors + dice.between((0.0, 0.07))
    for (cos, sin), both in _STARS[dice.pick({"five": 3.0, "backwards": 1.5, "four": 1.0, "cross": 1.0})]:
        x, z = cos * reach, sin * reach
        axis = "x" if abs(cos) > abs(sin) else "z"
        side = parts.both if both else parts
        side.beam((0.0, raised, 0.0), (x, y, z), (size, size), axis=axis)
        if castors:
            side.cylinder((x, castors, z), (castors, castors, 0.6 * castors), "z")


_STARS = {
    "five": (((1.0, 0.0), False), ((0.309, 0.951), True), ((-0.809, 0.588), True)),
    "backwards": (((-1.0, 0.0), False), ((-0.309, 0.951), True), ((0.809, 0.588), True)),
    "four": (((0.707, 0.707), True), ((-0.707, 0.707), True)),
    "cross": (((1.0, 0.0), False), ((-1.0, 0.0), False), ((0.0, 1.0), True)),
}
"""Directions of a star's beams, and whether each has a mirror image."""
