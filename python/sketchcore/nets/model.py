"""What turns drawings into a volume, whichever network is behind it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

from sketchcore.nets.sketches import Sketches
from sketchcore.rounds import Volume


class Model(Protocol):
    """A network ready for use: what a reconstruction calls, round after round."""

    def first_predictions(self, samples: Sequence[Sketches]) -> Iterator[Volume]:
        """Yields float32 [64, 64, 64] (x, y, z), probability of occupancy, for the drawings of each object.

        It is what the network says, with nothing mended yet.
        """
        ...

    def in_place(self, sketches: Sketches, always: bool = False) -> Sketches:
        """The drawings moved to where they belong, and their cameras, as far as the network can tell.

        It is looked for where they are plainly out of place; or `always`.
        """
        ...

    def first(self, drawings: int) -> float:
        """How many times the tolerance the first round may move where rounds end after it (`until_settled`)."""
        ...

    def rounds(self, sketches: Sketches, iterations: int, start: Volume | None = None) -> Iterator[Volume]:
        """Yields float32 [64, 64, 64] (x, y, z), probability of occupancy: the first prediction, then each round's.

        `start` is a volume that was known before the first drawing.
        """
        ...
