"""What a chair's arms are made of; and sofas, which are little else."""

from __future__ import annotations

from sketchcore.datagen.grammars.chair_seat import Seat
from sketchcore.datagen.grammars.parts import Dice, Parts


def put_arms(
    parts: Parts, seat: Seat, up: float, office: bool, leg: float, rounded: bool, slope: float, dice: Dice
) -> None:
    """Arms so high above the seat, on posts or panels, or bent; `slope` is the back's."""
    y, z = seat.top + up, max(seat.width, seat.rear) + leg * dice.between((-0.5, 1.0))
    thin = max(0.7 * leg, 0.013)
    broad = thin * dice.between((1.0, 2.4))
    rear = -seat.depth - slope * up
    front = seat.depth * dice.between((0.3, 1.0))
    tee = 3.0 if office else 0.3
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
        parts.both.ring((front - half, seat.top, z), (half, up, thin), "z", min(2 * thin / half, 0.5), (-10.0, 190.0))
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
    if seat.round:
        parts.both.beam((rear + thin, y, 0.6 * seat.rear), (rear + thin, y, z), (thin, thin), axis="z")


def put_sofa(parts: Parts, seat: Seat, round_feet: float, dice: Dice) -> None:
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
        rounded = dice.chance(round_feet)
        for x in (deep - 1.5 * leg, -deep + 1.5 * leg):
            z = wide + 2 * arm - 1.5 * leg
            parts.both.beam((x, 0.0, z), (x, feet + 0.01, z), (0.7 * leg, 0.7 * leg), (leg, leg), round=rounded)
