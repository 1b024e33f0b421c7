"""Passes of the compact network that several threads ask for at the same time, made side by side.

Each thread reconstructs from its own drawings as if it were alone: round after round, until its solid has settled.
Where passes of several are asked for while one is being made, the next one makes them all. Nobody waits for others to
come.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence
from itertools import takewhile

import numpy as np

from sketchcore.nets.cells import Cells
from sketchcore.nets.passes import Passes, Reading
from sketchcore.nets.sketches import Sketches


class Watched:
    """Passes that are made only while they are wanted.

    Args:
        passes: who makes them.
        check: called before each; it raises where they are no longer wanted.
    """

    def __init__(self, passes: Passes, check: Callable[[], None]) -> None:
        self._passes, self._check = passes, check

    def read(self, samples: Sequence[Sketches]) -> list[Reading]:
        self._check()
        return self._passes.read(samples)

    def decide(self, readings: Sequence[Reading], prior: Cells | None, counts: Sequence[int]) -> Cells:
        self._check()
        return self._passes.decide(readings, prior, counts)


class _Asked:
    """A pass that somebody waits for: in the end, an answer or an error."""

    def __init__(self, readings: Sequence[Reading], prior: Cells | None, counts: Sequence[int]) -> None:
        self.readings, self.prior, self.counts = list(readings), prior, list(counts)
        self.answer: Cells | None = None
        self.error: BaseException | None = None

    @property
    def done(self) -> bool:
        return self.answer is not None or self.error is not None


class Together:
    """Passes of one network for many threads, up to so many objects at once.

    The decoder's passes are put together, for on a graphics processor several cost little more than one. Drawings are
    read as they come: more than two at once are no faster (`inference.py`).

    Args:
        passes: the network.
        most: objects in a pass, 1 or more; a single call that has more is a pass by itself.

    Raises:
        ValueError: for fewer than one.
    """

    def __init__(self, passes: Passes, most: int) -> None:
        if most < 1:
            raise ValueError(f"a pass is made of at least 1 object, got {most}")
        self._passes, self._most = passes, most
        self._turn = threading.Condition()
        self._asked: deque[_Asked] = deque()
        self._busy = False

    def read(self, samples: Sequence[Sketches]) -> list[Reading]:
        return self._passes.read(samples)

    def decide(self, readings: Sequence[Reading], prior: Cells | None, counts: Sequence[int]) -> Cells:
        mine = _Asked(readings, prior, counts)
        with self._turn:
            self._asked.append(mine)
        # Whoever finds nobody at work does the work that has come up, whether it is its own or not.
        while True:
            with self._turn:
                self._turn.wait_for(lambda: mine.done or not self._busy)
                if mine.done:
                    break
                self._busy = True
                some = self._next()
            try:
                self._make(some)
            finally:
                with self._turn:
                    self._busy = False
                    self._turn.notify_all()
        if mine.error is not None:
            raise mine.error
        assert mine.answer is not None
        return mine.answer

    def _next(self) -> list[_Asked]:
        """The pass that waits longest, and those that can be made with it."""
        first = self._asked[0]
        alike = takewhile(lambda one: (one.prior is None) == (first.prior is None), self._asked)
        some = [next(alike)]
        for one in alike:
            if sum(len(each.counts) for each in some) + len(one.counts) > self._most:
                break
            some.append(one)
        for _ in some:
            self._asked.popleft()
        return some

    def _make(self, some: list[_Asked]) -> None:
        try:
            readings = [reading for one in some for reading in one.readings]
            priors = [one.prior for one in some if one.prior is not None]
            counts = [count for one in some for count in one.counts]
            answers = self._passes.decide(readings, np.concatenate(priors) if priors else None, counts)
            ends = np.cumsum([len(one.counts) for one in some])
            for one, end in zip(some, ends, strict=True):
                one.answer = answers[end - len(one.counts) : end]
        except BaseException as error:
            if len(some) == 1:
                some[0].error = error
                return
            for one in some:  # what is wrong with one is no harm to the others
                self._make([one])
