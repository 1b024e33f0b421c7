"""The compact network's rounds: each looks at all drawings together, and they take turns at looking in a mirror."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from functools import reduce

import numpy as np

from sketchcore.nets.cells import Cells, flip, fold, whole
from sketchcore.nets.outlines import heed_outlines
from sketchcore.nets.passes import Passes, Reading
from sketchcore.nets.pieces import join_pieces
from sketchcore.nets.search import in_place
from sketchcore.nets.sketches import Sketches
from sketchcore.rounds import FIRST, Volume

LOOKS: tuple[tuple[int, ...], ...] = ((), (0,), (0, 2), (2,))
"""Axes that the world is mirrored along in each of four rounds, over and over: what differs most comes first."""
BATCH = 8
"""Objects that first predictions are made of side by side."""


class CompactModel:
    """A `Model` by the passes of `CompactNet`.

    Mirrored, a world is seen by mirrored cameras in drawings flipped left to right. That describes the same object
    as well: about z = 0 because it is symmetric, along x because a mirrored object is an object too. The network
    answers each of the four descriptions a little differently, above all those that are mirrored along x from those
    that are not; the volume is the mean of all its answers, in which both kinds weigh the same, and each next
    round's prior. What is handed out has every outline filled (`outlines.py`), and its pieces joined
    (`pieces.py`).
    """

    def __init__(self, passes: Passes) -> None:
        self.passes = passes

    def by(self, passes: Passes) -> CompactModel:
        """The same model, its passes made by somebody else, such as `nets/together.py`."""
        other = copy(self)
        other.passes = passes
        return other

    def first_predictions(self, samples: Sequence[Sketches]) -> Iterator[Volume]:
        for first in range(0, len(samples), BATCH):
            batch = samples[first : first + BATCH]
            for cells in self.passes.decide(self.passes.read(batch), None, [len(s) for s in batch]):
                yield whole(cells)

    def in_place(self, sketches: Sketches, always: bool = False) -> Sketches:
        return in_place(self.first_predictions, sketches, whole(self._look(sketches)[1]), always)

    def first(self, drawings: int) -> float:
        # Further rounds mend what one drawing leaves open; they mend nothing that several say (docs/training.md).
        return FIRST if drawings == 1 else 12.0

    def _look(self, sketches: Sketches) -> tuple[Reading, Cells]:
        """What is read in drawings, and what it says by itself."""
        if self not in sketches.kept:
            [reading] = self.passes.read([sketches])
            sketches.kept[self] = reading, self.passes.decide([reading], None, [len(sketches)])[0]
        seen: tuple[Reading, Cells] = sketches.kept[self]
        return seen

    def rounds(self, sketches: Sketches, iterations: int, start: Volume | None = None) -> Iterator[Volume]:
        # How many answers there are, and their mean: of the world as it is, and mirrored along x.
        said: dict[bool, tuple[int, Cells]] = {}
        known = None if start is None else fold(0.5 * (start + start[:, :, ::-1])[:, :, 32:])
        mean = known
        reading, answer = self._look(sketches)
        readings = {LOOKS[0]: reading}
        for number in range(iterations + 1):
            look = LOOKS[number % len(LOOKS)]
            turn = flip if 0 in look else _as_it_is
            if look not in readings:
                [readings[look]] = self.passes.read([reduce(Sketches.mirrored, look, sketches)])
            if mean is not None:
                answer = turn(self.passes.decide([readings[look]], turn(mean)[None], [len(sketches)])[0])
            count, own = said.get(0 in look, (0, answer))
            said[0 in look] = count + 1, own + (answer - own) / np.float32(count + 1)
            kinds = [kind for _, kind in said.values()]  # one or both
            mean = (kinds[0] + kinds[-1]) * np.float32(0.5)
            if known is not None:  # one prediction among those of the drawings
                mean = (known + (number + 1) * mean) / np.float32(number + 2)
            yield join_pieces(heed_outlines(whole(mean), sketches))


def _as_it_is(cells: Cells) -> Cells:
    return cells
