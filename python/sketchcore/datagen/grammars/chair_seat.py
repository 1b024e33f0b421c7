"""What a chair is built around: its seat; and the column that an office chair's stands on."""

from __future__ import annotations

from dataclasses import dataclass

from sketchcore.datagen.grammars.parts import Dice, Parts


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


def put_seat(parts: Parts, seat: Seat, dice: Dice) -> None:
    """A board, a cushion or a disc, perhaps with a rounded front or rim."""
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


def put_column(parts: Parts, seat: Seat, base: str, leg: float, dice: Dice) -> None:
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
