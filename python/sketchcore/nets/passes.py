"""What a reconstruction asks of the compact network, whoever computes it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from sketchcore.nets.cells import Cells
from sketchcore.nets.sketches import Sketches

Reading = Any
"""What the network has read in the drawings of an object; whoever computes it knows what that is."""


class Passes(Protocol):
    """The two halves of a pass, for several objects side by side."""

    def read(self, samples: Sequence[Sketches]) -> list[Reading]:
        """What does not change from round to round: a reading of the drawings of each object."""
        ...

    def decide(self, readings: Sequence[Reading], prior: Cells | None, counts: Sequence[int]) -> Cells:
        """Occupancy from what was read and a prior.

        Args:
            readings: from `read`, one an object.
            prior: float32 [B, 32, 32, 16, 8], probability of occupancy of each object's cells; None for none.
            counts: drawings of each object.

        Returns:
            float32 [B, 32, 32, 16, 8], probability of occupancy.
        """
        ...
