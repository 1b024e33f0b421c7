"""A grammar of one's own: bottles. Shapes, drawings and training data from a page of Python.

sketchcore generate --grammar examples/bottles.py --count 8 --views 2 -o bottles       # drawings and volumes
sketchcore generate --grammar examples/bottles.py --meshes 100 -o bottles              # watertight meshes
sketchcore train --grammar examples/bottles.py --minutes 60 -o bottle-network          # a network for bottles
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from sketchcore.datagen.grammars import Dice, Grammar, Parts, Range
from sketchcore.datagen.grammars.profile import hollow, smooth


@dataclass(frozen=True)
class Bottle(Grammar):
    """Every field is an amplitude: a pair is drawn from evenly, a number is a share, a dictionary has weights."""

    shapes: Mapping[str, float] = field(default_factory=lambda: {"wine": 2.0, "flask": 1.0, "crate": 0.5})
    height: Range = (2.5, 4.0)
    neck: Range = (0.25, 0.45)
    length: Range = (0.2, 0.4)
    open: float = 0.7
    corks: float = 0.5
    handles: float = 0.15

    def grow(self, parts: Parts, dice: Dice) -> None:
        """One bottle: in units of its radius, y up, symmetric about z = 0. It is scaled in the end."""
        kind = dice.pick(self.shapes)
        height, neck = dice.between(self.height), dice.between(self.neck)
        shoulder = height * (1 - dice.between(self.length))
        belly = 0.6 if kind == "flask" else 1.0

        # Radii and heights from the bottom to the top. What is smooth goes through `smooth`, what is not has corners.
        body = [(belly, 0.0), (1.0, 0.3 * shoulder), (0.95, 0.7 * shoulder), (neck, shoulder), (neck, height)]
        profile = smooth(body) if kind != "crate" else body
        parts.turned(profile, round=kind != "crate")
        parts.turned([(neck + 0.1, height - 0.25), (neck + 0.1, height - 0.05)], round=kind != "crate")

        if dice.chance(self.handles):
            parts.ring((neck, shoulder, 0.0), (0.6, 0.45, 0.12), "z", tube=0.22)
        if dice.chance(self.open):
            parts.cut.turned(hollow(profile, wall=0.12, floor=0.2), round=kind != "crate")
        elif dice.chance(self.corks):
            parts.cylinder((0.0, height + 0.1, 0.0), (0.8 * neck, 0.15, 0.8 * neck))
