"""Vases: smooth profiles turned about an axis, hollow, on feet, with lips and handles."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from sketchcore.datagen.grammars.grammar import Grammar
from sketchcore.datagen.grammars.parts import Dice, Parts, Range
from sketchcore.datagen.grammars.profile import Point, hollow, radius, smooth


@dataclass(frozen=True)
class Form:
    """A kind of vase, in units of its largest radius.

    Attributes:
        height: of the body.
        points: what its profile goes through, from the bottom to the top: heights as shares of the body's, and radii.
        handles: weights of none, of one and of two.
        grip: where handles begin and end, as shares of the body's height.
    """

    height: Range
    points: tuple[tuple[Range, Range], ...]
    handles: tuple[float, float, float] = (1.0, 0.0, 0.0)
    grip: tuple[Range, Range] = ((0.3, 0.5), (0.75, 0.95))


_END, _TOP = (0.0, 0.0), (1.0, 1.0)
FORMS: Mapping[str, Form] = {
    "bowl": Form((0.45, 1.1), ((_END, (0.2, 0.45)), ((0.25, 0.45), (0.65, 0.9)), (_TOP, (0.85, 1.1))), (6.0, 0.5, 1.0)),
    "pot": Form((1.0, 2.0), ((_END, (0.45, 0.9)), ((0.4, 0.65), (0.9, 1.0)), (_TOP, (0.55, 1.1))), (5.0, 1.0, 2.0)),
    "urn": Form(
        (1.4, 2.6),
        ((_END, (0.3, 0.6)), ((0.45, 0.65), (0.95, 1.0)), ((0.82, 0.9), (0.35, 0.65)), (_TOP, (0.4, 0.9))),
        (3.0, 0.5, 1.5),
        ((0.55, 0.65), (0.85, 0.97)),
    ),
    "flower": Form(
        (2.0, 4.0),
        ((_END, (0.35, 0.7)), ((0.25, 0.45), (0.6, 1.0)), ((0.6, 0.8), (0.3, 0.6)), (_TOP, (0.5, 1.0))),
    ),
    "bottle": Form(
        (2.2, 4.2),
        (
            (_END, (0.6, 1.0)),
            ((0.2, 0.35), (0.85, 1.0)),
            ((0.45, 0.6), (0.7, 1.0)),
            ((0.68, 0.78), (0.2, 0.42)),
            (_TOP, (0.18, 0.4)),
        ),
        (5.0, 1.5, 0.5),
        ((0.4, 0.55), (0.75, 0.9)),
    ),
    "amphora": Form(
        (2.2, 3.6),
        (
            (_END, (0.15, 0.4)),
            ((0.2, 0.35), (0.55, 0.8)),
            ((0.5, 0.66), (0.95, 1.0)),
            ((0.78, 0.86), (0.25, 0.45)),
            (_TOP, (0.3, 0.6)),
        ),
        (1.0, 0.5, 5.0),
        ((0.55, 0.68), (0.86, 0.97)),
    ),
    "jug": Form(
        (1.5, 2.6),
        ((_END, (0.45, 0.8)), ((0.3, 0.45), (0.9, 1.0)), ((0.68, 0.82), (0.4, 0.7)), (_TOP, (0.45, 0.8))),
        (0.5, 6.0, 1.0),
        ((0.25, 0.45), (0.8, 0.97)),
    ),
    "cup": Form((1.4, 2.4), ((_END, (0.7, 1.0)), ((0.4, 0.6), (0.85, 1.0)), (_TOP, (0.9, 1.1))), (1.5, 4.0, 0.5)),
    "goblet": Form(
        (2.2, 3.6),
        (
            (_END, (0.45, 0.8)),
            ((0.06, 0.12), (0.15, 0.3)),
            ((0.3, 0.42), (0.12, 0.25)),
            ((0.5, 0.62), (0.6, 0.95)),
            (_TOP, (0.75, 1.0)),
        ),
        (5.0, 0.2, 1.0),
        ((0.55, 0.65), (0.85, 0.95)),
    ),
    "funnel": Form((1.2, 3.0), ((_END, (0.3, 0.8)), (_TOP, (0.6, 1.0))), (5.0, 1.0, 1.0)),
}
"""The forms by name. A goblet's hollow begins above its stem."""


@dataclass(frozen=True)
class Vase(Grammar):
    """Vases, bowls, bottles, amphoras, jugs, pots.

    Attributes:
        forms: how often each of `FORMS` is.
        unevenness: by how much radii differ from the form's, as a share of them.
        hollow: share of the vases that are open and hollow.
        wall: thickness of the wall, in units of the larger of height and width.
        feet: share on a foot.
        foot: its height, as a share of the body's.
        lips: share with a lip.
        lip: its height, as a share of the body's.
        lids: share of those that are not hollow with a lid and a knob.
        square: share with a square section instead of a round one.
        flattened: share with an oval section.
        flat: its extent along z, as a share of that along x.
        bands: share with hoops about the body.
        handle: thickness of handles, as a share of the body's width.
        angular: share of the handles that are made of straight pieces.
        sideways: share of the pairs of handles to the left and the right, instead of in front and behind.
        spouts: share of the vases with one handle that have a spout opposite.
    """

    forms: Mapping[str, float] = field(
        default_factory=lambda: {
            "bowl": 1.2,
            "pot": 1.2,
            "urn": 1.5,
            "flower": 1.8,
            "bottle": 1.2,
            "amphora": 1.0,
            "jug": 1.2,
            "cup": 0.6,
            "goblet": 0.7,
            "funnel": 0.8,
        }
    )
    unevenness: float = 0.12
    hollow: float = 0.76
    wall: Range = (0.03, 0.065)
    feet: float = 0.5
    foot: Range = (0.03, 0.14)
    lips: float = 0.5
    lip: Range = (0.025, 0.06)
    lids: float = 0.35
    square: float = 0.09
    flattened: float = 0.08
    flat: Range = (0.5, 0.85)
    bands: float = 0.12
    handle: Range = (0.035, 0.07)
    angular: float = 0.25
    sideways: float = 0.5
    spouts: float = 0.2

    def grow(self, parts: Parts, dice: Dice) -> None:
        """Builds one vase: foot, body and lip, handles and spout, and then the hollow."""
        name = dice.pick(self.forms)
        form = FORMS[name]
        height = dice.between(form.height)
        round_ = not dice.chance(self.square)
        squash = dice.between(self.flat) if dice.chance(self.flattened) else 1.0
        body = self._body(form, height, smoothly=round_ or dice.chance(0.5), dice=dice)
        largest = max(height, 2 * max(r for r, _ in body))
        wall = dice.between(self.wall) * largest

        bottom = -self._foot(parts, body, height, squash, round_, dice) if dice.chance(self.feet) else 0.0
        parts.turned(body, squash=squash, round=round_)
        profile = body
        if dice.chance(self.lips):
            profile = body + self._lip(parts, body[-1], height, wall, squash, round_, dice)
        if dice.chance(self.bands):
            self._bands(parts, body, height, squash, round_, dice)
        open_ = dice.chance(self.hollow)
        self._handles(parts, form, body, height, wall, squash, dice)
        if open_:
            floor = bottom + max(wall, dice.between((0.0, 0.12)) * height - bottom)
            if name == "goblet":
                floor = form.points[3][0][0] * height * dice.between((0.75, 0.95))
            inner = hollow(profile, wall, max(floor, 0.02 * height))
            parts.cut.turned(inner, squash=squash, round=round_)
        elif dice.chance(self.lids):
            self._lid(parts, profile[-1], height, squash, round_, dice)

    def _body(self, form: Form, height: float, smoothly: bool, dice: Dice) -> list[Point]:
        points = []
        for at, r in form.points:
            uneven = 1.0 + dice.around(self.unevenness)
            points.append((dice.between(r) * uneven, dice.between(at) * height))
        return smooth(points) if smoothly else points

    def _foot(self, parts: Parts, body: list[Point], height: float, squash: float, round_: bool, dice: Dice) -> float:
        """A disc, a ring that widens downwards, or a stem on a plate; and how high it is."""
        high, r = dice.between(self.foot) * height, body[0][0]
        kind = dice.pick({"disc": 1.0, "flared": 1.0, "stem": 0.6})
        if kind == "disc":
            wide = r * dice.between((0.9, 1.25))
            points = [(wide, -high), (wide, 0.0)]
        elif kind == "flared":
            points = smooth([(r * dice.between((1.1, 1.7)), -high), (r * dice.between((0.75, 1.0)), 0.0)])
        else:
            high *= 1.5
            wide, thin = max(r * dice.between((1.2, 1.8)), 0.35), r * dice.between((0.5, 0.8))
            points = [(wide, -high), (wide, -0.75 * high), *smooth([(1.2 * thin, -0.74 * high), (thin, 0.0)])]
        parts.turned(points, squash=squash, round=round_)
        return high

    def _lip(
        self, parts: Parts, rim: Point, height: float, wall: float, squash: float, round_: bool, dice: Dice
    ) -> list[Point]:
        """A collar or a flare on the rim; and how the profile goes on."""
        (r, y), high = rim, dice.between(self.lip) * height
        if dice.chance(0.5):
            wide = r + wall * dice.between((0.4, 1.0))
            parts.turned([(wide, y - 0.5 * high), (wide, y + 0.5 * high)], squash=squash, round=round_)
            return [(r, y + 0.5 * high)]
        flare = smooth(
            [(r, y), (r * dice.between((1.0, 1.15)), y + 0.8 * high), (r * dice.between((1.1, 1.3)), y + 1.5 * high)]
        )
        parts.turned(flare, squash=squash, round=round_)
        return flare[1:]

    def _bands(self, parts: Parts, body: list[Point], height: float, squash: float, round_: bool, dice: Dice) -> None:
        for _ in range(dice.count((1, 3))):
            y, thick = height * dice.between((0.1, 0.9)), 0.03 * height
            r = radius(body, y)
            if round_:
                parts.ring(
                    (0.0, y, 0.0), (r + thick, thick, (r + thick) * squash), "y", min(2 * thick / (r + thick), 0.5)
                )
            else:
                parts.box((0.0, y, 0.0), (r + thick, thick, (r + thick) * squash))

    def _lid(self, parts: Parts, rim: Point, height: float, squash: float, round_: bool, dice: Dice) -> None:
        (r, y), high = rim, height * dice.between((0.04, 0.15))
        parts.turned(
            smooth([(1.05 * r, y), (0.7 * r, y + 0.75 * high), (0.2 * r, y + high)]), squash=squash, round=round_
        )
        knob = max(r * dice.between((0.12, 0.25)), 0.03 * height)
        ball = smooth([(0.6 * knob, y + 0.95 * high), (knob, y + high + knob), (0.4 * knob, y + high + 1.9 * knob)])
        parts.turned(ball)

    def _handles(
        self, parts: Parts, form: Form, body: list[Point], height: float, wall: float, squash: float, dice: Dice
    ) -> None:
        count = dice.pick(dict(enumerate(form.handles)))
        low, high = (dice.between(at) * height for at in form.grip)
        angular, sideways = dice.chance(self.angular), count == 2 and dice.chance(self.sideways)
        # As seen from the axis, along which handles point, and across.
        scale = squash if sideways else 1.0
        ends = [(radius(body, y) * scale - 0.5 * wall, y) for y in (low, high)]
        largest = max(height, 2 * max(r for r, _ in body))
        thick = max(dice.between(self.handle) * 2 * max(r for r, _ in body), 0.018 * largest)
        widest = max(radius(body, low + k / 8 * (high - low)) for k in range(9)) * scale
        reach = max(widest + thick * dice.between((2.2, 5.0)), ends[1][0] + 2.5 * thick)
        sides = [] if count == 0 else [1.0, -1.0] if count == 2 else [-1.0]
        for side in sides:
            if sideways:
                if side > 0:
                    _handle(parts.both, ends, reach, thick, angular, side, "z")
            else:
                _handle(parts, ends, reach, thick, angular, side, "x")
        if count == 1 and dice.chance(self.spouts):
            r, y = radius(body, low), low + 0.2 * (high - low)
            tip = (reach * dice.between((1.0, 1.3)), min(high * dice.between((0.9, 1.1)), height), 0.0)
            parts.beam((0.7 * r, y, 0.0), tip, (2.2 * thick,) * 2, (1.1 * thick,) * 2, round=True, axis="y")


def _handle(
    parts: Parts, ends: list[Point], reach: float, thick: float, angular: bool, side: float, along: str
) -> None:
    """One handle in a vertical plane through the axis: bent like a ring, or of three straight pieces."""
    (r0, y0), (r1, y1) = ends

    def at(r: float, y: float) -> tuple[float, float, float]:
        return (side * r, y, 0.0) if along == "x" else (0.0, y, side * r)

    middle, tall = 0.5 * (y0 + y1), 0.5 * (y1 - y0) + thick
    if angular:
        parts.beam(at(r1, y1), at(reach, y1), (thick, thick), axis=along)
        parts.beam(at(r0, y0), at(reach, y1 - thick), (thick, thick), axis="y")
        return
    inner = min(r0, r1)
    wide = reach - inner
    half = (wide, tall, thick) if along == "x" else (thick, tall, wide)
    # Angles go from x to y about z, and from y to z about x.
    turn = (-100.0, 100.0) if along == "x" else (-10.0, 190.0)
    if side < 0:
        turn = (turn[0] + 180.0, turn[1] + 180.0)
    parts.ring(at(inner, middle), half, "z" if along == "x" else "x", min(2 * thick / (wide + tall) * 1.6, 0.5), turn)
    if r0 - inner > thick:
        parts.beam(at(inner, y0), at(r0, y0), (thick, thick), round=True, axis=along)
    if r1 - inner > thick:
        parts.beam(at(inner, y1), at(r1, y1), (thick, thick), round=True, axis=along)
