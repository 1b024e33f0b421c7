"""The search for where drawings belong: places that the drawing's lines speak for, judged by what is predicted there.

Lines (`perspective.py`) say to a fraction of a degree from which side a drawing was made, if nothing else is wrong with
it, and nearly as well where it belongs and how large, if it is only that; which of these it is, predictions tell
(`placement.py`). So the likeliest place is looked for along each of the ways in which a drawing may be out of place,
then around the most plausible of these.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sketchcore.camera import Camera
from sketchcore.nets.placement import LARGEST, Placement, bounds, plausibility, seen_at, shortfall
from sketchcore.nets.sketches import Sketches
from sketchcore.perspective import Lines, stray
from sketchcore.rounds import Volume

Predict = Callable[[Sequence[Sketches]], Iterator[Volume]]
"""A network's first predictions, one for the drawings of each object."""

_AMISS, _AMISS_AMONG, _PART = 5.0, 7.0, 0.5
"""A drawing is looked for that is so much likelier elsewhere (the logarithm): by its lines, and by this part of what
the box and the outline of what is predicted could gain. Of exact drawings, that is one in seven. Among
several it takes more: together they leave less in doubt, and one that is out of place then stands out."""
_GAIN = 1.0
"""How much likelier another place must be than the one where the drawing is."""
_HOPELESS = 3.0
"""A search ends where all that lines speak for is so much less likely than where the drawing is."""
_DOUBT = 0.0125
"""The likelihood of a place grows by e for so much more plausibility."""
_LINES = 0.75
"""What the likelihood of lines counts for: they say some things twice."""
_FAULT = 3.0
"""The logarithm of how much rarer drawings are with one fault more."""
_SPREADS = np.array([0.08, 7.0, 7.0, 5.0, 5.0, 0.06])
"""How far from the likeliest place others are tried: the logarithm of the scale, pixels, degrees, and the logarithm of
the field of view."""
_SURE = 1 / 9
"""Lines say where a drawing belongs three times less surely than they would if each were right."""
_DRAWS = 8
_USUAL = 138
"""Pixels of the larger side of the ink in most drawings."""


@dataclass(frozen=True)
class _Way:
    """A way in which a drawing may be out of place: which of the six numbers are off, and how many faults that is."""

    free: tuple[bool, bool, bool, bool, bool, bool]
    faults: int

    @property
    def index(self) -> NDArray[np.intp]:
        return np.flatnonzero(self.free)


_Place = tuple[_Way, NDArray[np.float64]]
_NONE = _Way((False, False, False, False, False, False), 0)
_TURNED = _Way((False, False, False, True, True, False), 1)
_SHIFTED = _Way((False, True, True, False, False, False), 1)
_SCALED = _Way((True, False, False, False, False, False), 1)
_WIDENED = _Way((False, False, False, False, False, True), 1)
_PLACED = _Way((True, True, True, False, False, False), 2)
_ALL = _Way((True, True, True, True, True, True), 4)
_SINGLE = (_TURNED, _SHIFTED, _SCALED, _WIDENED)


@dataclass(frozen=True)
class _Tried:
    """A place, in what way it differs from where the drawing is, what is predicted there, and how likely it is."""

    way: _Way
    numbers: NDArray[np.float64]
    volume: Volume
    likelihood: float


def in_place(predict: Predict, sketches: Sketches, first: Volume, always: bool = False) -> Sketches:
    """The drawings where they belong, and their cameras, as far as they are elsewhere and it can be told.

    For each of them some forty places are tried, if it is plainly out of place by itself.

    Args:
        predict: what the network first predicts.
        sketches: the drawings of one object.
        first: float32 [64, 64, 64], that of these drawings.
        always: try the places of each of them, out of place or not.

    Returns:
        the drawings; the very same object if none is moved.
    """
    alone = [Sketches(sketches.drawings[i : i + 1], sketches.cameras[i : i + 1]) for i in range(len(sketches))]
    lines = [Lines.of(one.drawings[0], Camera.from_packed(one.cameras[0])) for one in alone]
    elsewhere = [_run_elsewhere(one) for one in lines]
    bar = _AMISS if len(alone) == 1 else _AMISS_AMONG
    amiss = [always or _amiss(gained, first, one) > bar for gained, one in zip(elsewhere, alone, strict=True)]
    if not any(amiss):
        return sketches
    looked_for = [one for one, off in zip(alone, amiss, strict=True) if off]
    firsts = iter([first] if len(alone) == 1 else list(predict(looked_for)))
    found = [
        _Search(predict, one, run, next(firsts)).place() if off else Placement()
        for one, run, off in zip(alone, lines, amiss, strict=True)
    ]
    if all(place == Placement() for place in found):
        return sketches
    taken = [place.of(one) for place, one in zip(found, alone, strict=True)]
    moved = Sketches(np.concatenate([s.drawings for s in taken]), np.concatenate([s.cameras for s in taken]))
    if len(alone) > 1:
        [together] = predict([moved])
        said = sum(_said(one, place.numbers) - _said(one, np.zeros(6)) for one, place in zip(lines, found, strict=True))
        if not (plausibility(together, moved) - plausibility(first, sketches)) / _DOUBT + said > _GAIN:
            return sketches
    return moved


def _amiss(elsewhere: float, volume: Volume, sketches: Sketches) -> float:
    """How much likelier drawings may be elsewhere, by their lines and by what is predicted."""
    return elsewhere + _PART * shortfall(volume, sketches) / _DOUBT


def _said(lines: Lines, numbers: NDArray[np.float64]) -> float:
    """What lines say of a place, and how rare drawings are that are so far from where they belong."""
    return _LINES * float(lines.likelihood(numbers[None])[0] - stray(numbers))


def _run_elsewhere(lines: Lines) -> float:
    """How much likelier the lines are if the drawing has one fault than if it has none, the logarithm."""
    if not len(lines):
        return 0.0
    here = float(lines.likelihood(np.zeros((1, 6)))[0])
    _, reached = lines.fit(np.zeros((len(_SINGLE), 6)), np.array([way.free for way in _SINGLE]))
    return float(reached.max()) - here


class _Search:
    """Where one drawing belongs; where it is, unless another place is likelier by so much."""

    def __init__(self, predict: Predict, sketches: Sketches, lines: Lines, first: Volume) -> None:
        self.predict, self.sketches, self.lines = predict, sketches, lines
        self.camera = Camera.from_packed(sketches.cameras[0])
        self.tried = [self._tried(_NONE, np.zeros(6), sketches, first)]

    def place(self) -> Placement:
        here = self.tried[0]
        singles, others = self._spoken_for()
        self._attempt([*singles, *self._suggested(here)])
        if self._second() < here.likelihood - _HOPELESS:
            return Placement()
        self._attempt(others)
        self._attempt(self._suggested(self._best()))
        ways = sorted({one.way for one in self.tried[1:]}, key=lambda way: -self._best(way).likelihood)
        for way in dict.fromkeys((*ways[:2], _SHIFTED)):
            self._attempt(self._around(way, self._best(way).numbers, 1.0))
        best = self._best()
        if best.way is _NONE:
            return Placement()
        self._attempt(self._around(best.way, self._mean(best.way), 0.5))
        self._attempt([(best.way, self._mean(best.way))])
        # Single predictions judge their places with errors; the mean of many is surer.
        mean, best = self.tried[-1], self._best()
        taken = mean if mean.likelihood > best.likelihood - 1 else best
        return Placement.from_numbers(taken.numbers) if taken.likelihood > here.likelihood + _GAIN else Placement()

    def _tried(self, way: _Way, numbers: NDArray[np.float64], sketches: Sketches, volume: Volume) -> _Tried:
        plausible = plausibility(volume, sketches) / _DOUBT
        return _Tried(way, numbers, volume, plausible + _said(self.lines, numbers) - _FAULT * way.faults)

    def _attempt(self, places: Sequence[_Place]) -> None:
        taken = [Placement.from_numbers(numbers).of(self.sketches) for _, numbers in places]
        for (way, numbers), sketches, volume in zip(places, taken, self.predict(taken), strict=True):
            self.tried.append(self._tried(way, numbers, sketches, volume))

    def _best(self, way: _Way | None = None) -> _Tried:
        return max((one for one in self.tried if way in (None, one.way)), key=_likelihood)

    def _second(self) -> float:
        return max((one.likelihood for one in self.tried[1:]), default=-math.inf)

    def _spoken_for(self) -> tuple[list[_Place], list[_Place]]:
        """The places that lines speak for: if only one thing is wrong with the drawing, and otherwise.

        Lines are asked from where the drawing is, and from where it would fit roughly.
        """
        roughly = self._roughly()
        shifted = np.array([0.0, *(roughly[1:3] / math.exp(roughly[0])), 0.0, 0.0, 0.0])
        places = [(_NONE, np.zeros(6)), (_SHIFTED, shifted)]
        if not len(self.lines):
            return places[1:], [(_PLACED, roughly)]
        begun = [(way, np.zeros(6)) for way in (*_SINGLE, _PLACED, _ALL)]
        begun += [(_SHIFTED, shifted), (_PLACED, roughly), (_ALL, roughly)]
        fits, _ = self.lines.fit(np.array([start for _, start in begun]), np.array([way.free for way, _ in begun]))
        for (way, _), numbers in zip(begun, fits, strict=True):
            if all(np.abs((numbers - known) / _SPREADS).max() > 0.05 for _, known in places):
                places.append((way, numbers))
        singles = [place for place in places[2:] if place[0] in _SINGLE]
        return singles, [place for place in places[1:] if all(place is not one for one in singles)]

    def _roughly(self) -> NDArray[np.float64]:
        """The ink in the middle, as large as drawings usually are."""
        rows, columns = np.nonzero(self.sketches.drawings[0] >= 64)
        if not len(rows):
            return np.zeros(6)
        low, high = np.array([columns.min(), rows.min()]), np.array([columns.max(), rows.max()]) + 1
        scale = _USUAL / float((high - low).max())
        shift = scale * (seen_at(self.camera, np.zeros(3)) - 0.5 * (low + high))
        return np.array([math.log(scale), *shift, 0.0, 0.0, 0.0])

    def _suggested(self, one: _Tried) -> list[_Place]:
        """The place at which the box of what is predicted would be where it belongs."""
        box = bounds(one.volume)
        if box is None:
            return []
        middle, side = box
        scale = min(max(LARGEST / side, 0.5), 2.0)
        shift = scale * (one.numbers[1:3] + seen_at(self.camera, np.zeros(3)) - seen_at(self.camera, middle))
        return [(_PLACED, np.array([one.numbers[0] + math.log(scale), *shift, 0.0, 0.0, 0.0]))]

    def _around(self, way: _Way, at: NDArray[np.float64], far: float) -> list[_Place]:
        """Places about another one as far as lines allow, always the same, in pairs on opposite sides of it."""
        index = way.index
        told = _SURE * self.lines.information(at) if len(self.lines) else np.zeros((6, 6))
        told = told[np.ix_(index, index)] + np.diag(_SPREADS[index] ** -2)
        spread = far * np.linalg.cholesky(np.linalg.inv(told))
        sides = np.random.default_rng(0).standard_normal((_DRAWS // 2, len(index)))
        sides *= math.sqrt(len(index)) / np.linalg.norm(sides, axis=1, keepdims=True)
        places = np.repeat(at[None], _DRAWS, axis=0)
        places[:, index] += np.concatenate([sides, -sides]) @ spread.T
        return [(way, place) for place in places]

    def _mean(self, way: _Way) -> NDArray[np.float64]:
        """The mean of places, weighted by their likelihoods."""
        tried = [one for one in self.tried if one.way is way]
        weights = np.exp(np.array([one.likelihood for one in tried]) - self._best(way).likelihood)
        return np.asarray(weights / weights.sum() @ np.stack([one.numbers for one in tried]))


def _likelihood(one: _Tried) -> float:
    return one.likelihood
