"""The search for where drawings belong (`placement.py`): places that predictions point to, then many about the best."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sketchcore import _core
from sketchcore.camera import Camera
from sketchcore.nets.placement import (
    CELLS,
    LARGEST,
    NEAR,
    Placement,
    bounds,
    box_is_off,
    out_of_place,
    plausibility,
    seen_at,
)
from sketchcore.nets.sketches import Sketches
from sketchcore.rounds import Volume

Predict = Callable[[Sequence[Sketches]], Iterator[Volume]]
"""A network's first predictions, one for the drawings of each object."""

_GAIN = 0.03
"""How much more plausible another place must be than the one where the drawing is, for one that is looked for."""
_PLAIN_GAIN = 0.14
"""The same where nobody asked: exact drawings of odd shapes may look out of place, but gain less (docs/training.md)."""
_DOUBT = 0.03
"""The likelihood of a place grows by e for so much more of its score."""
_STEPS = 3
_OVERSHOOT = 1.2
"""Solids are predicted nearer to where they belong than drawings are: a step goes further than they say."""
_FAR_SPREADS = (np.array([0.06, 6.0, 6.0, 0.0, 0.0]), np.array([0.04, 4.0, 4.0, 0.0, 0.0]))
"""Logarithm of the scale, pixels right and down, degrees about right and down over which places are drawn, round after
round, about the likeliest."""
_RINGS = (10.0, 5.0)
"""Degrees by which the camera is turned to each of eight sides, then to each about the likeliest of them."""
_NEAR_SPREAD = np.array([0.03, 3.0, 3.0, 4.0, 4.0])
"""The same, about the likeliest place after that."""
_DRAWS = 12
_NEAR_BY = np.array([0.04, 4.0, 4.0, 7.0, 7.0])
_STRAY = 0.01
"""What it costs in plausibility to go so far from where the search began, and four times that for twice as far."""


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
    if not always and not out_of_place(first, sketches):
        return sketches
    alone = [Sketches(sketches.drawings[i : i + 1], sketches.cameras[i : i + 1]) for i in range(len(sketches))]
    firsts = [first] if len(alone) == 1 else predict(alone)
    gain = _GAIN if always else _PLAIN_GAIN
    found = [
        _search(predict, one, volume, gain) if always or out_of_place(volume, one) else Placement()
        for one, volume in zip(alone, firsts, strict=True)
    ]
    if all(place == Placement() for place in found):
        return sketches
    taken = [place.of(one) for place, one in zip(found, alone, strict=True)]
    moved = Sketches(np.concatenate([s.drawings for s in taken]), np.concatenate([s.cameras for s in taken]))
    if len(alone) > 1:
        [together] = predict([moved])
        if plausibility(together, moved) < plausibility(first, sketches) + gain:
            return sketches
    return moved


@dataclass(frozen=True)
class _Tried:
    """A place, the drawing there, and what is predicted from it."""

    place: Placement
    sketches: Sketches
    volume: Volume

    @cached_property
    def plausibility(self) -> float:
        return plausibility(self.volume, self.sketches)

    @cached_property
    def finely(self) -> float:
        """The plausibility by weights that tell neighbouring places apart."""
        return plausibility(self.volume, self.sketches, NEAR)


def _search(predict: Predict, sketches: Sketches, first: Volume, gain: float) -> Placement:
    """Where one drawing belongs; where it is, unless another place is more plausible by so much."""

    def attempt(places: Sequence[Placement]) -> list[_Tried]:
        taken = [place.of(sketches) for place in places]
        return [_Tried(*one) for one in zip(places, taken, predict(taken), strict=True)]

    here = _Tried(Placement(), sketches, first)
    begun = _far(attempt, here, gain) if box_is_off(first) else here
    return _refined(attempt, begun, gain if begun is here else _GAIN).place


Attempt = Callable[[Sequence[Placement]], list[_Tried]]


def _far(attempt: Attempt, here: _Tried, gain: float) -> _Tried:
    """The place that solids' boxes point to, from where the drawing is and from where it would fit roughly."""
    camera = Camera.from_packed(here.sketches.cameras[0])
    tried = [here, *attempt([_roughly(here.sketches, camera)])]
    front = list(tried)
    for _ in range(_STEPS):
        steps = [step for one in front for step in _suggested(one, camera)]
        if not steps:
            break
        fresh = attempt(steps)
        tried += fresh
        front = sorted(fresh, key=lambda one: -one.plausibility)[:2]
        if front[0].plausibility < here.plausibility:  # what looked amiss is not mended by moving it
            break
    best = max(tried, key=lambda one: one.plausibility)
    if best is here:
        return here
    # Single predictions judge their places with errors; the mean over many about the best is surer.
    weighed, mean = [best], best.place
    for spread in _FAR_SPREADS:
        weighed += attempt(_around(mean, spread))
        mean = _mean([one.place for one in weighed], [one.plausibility for one in weighed])
    [best] = attempt([mean])
    return best if best.plausibility > here.plausibility + gain else here


def _refined(attempt: Attempt, begun: _Tried, gain: float) -> _Tried:
    """From which side it was drawn, and the last pixels."""
    if begun.plausibility == -math.inf:  # nothing is predicted that could be judged
        return begun

    def score(one: _Tried) -> float:
        stray = (_numbers(one.place) - _numbers(begun.place)) / _NEAR_BY
        return one.finely - _STRAY * float(stray @ stray)

    tried, best = [begun], begun
    for degrees in _RINGS:
        sides = [math.tau * side / 8 for side in range(8)]
        turns = [np.array([0, 0, 0, degrees * math.cos(side), degrees * math.sin(side)]) for side in sides]
        tried += attempt([_changed(best.place, turn) for turn in turns])
        best = max(tried, key=score)
    tried += attempt(_around(best.place, _NEAR_SPREAD))
    tried += attempt([_mean([one.place for one in tried], [score(one) for one in tried])])
    best = max(tried, key=score)
    return best if score(best) > score(begun) + gain else begun


def _roughly(sketches: Sketches, camera: Camera) -> Placement:
    """The ink in the middle, as large as drawings usually are."""
    rows, columns = np.nonzero(sketches.drawings[0] >= 64)
    if not len(rows):
        return Placement()
    low, high = np.array([columns.min(), rows.min()]), np.array([columns.max(), rows.max()]) + 1
    scale = 138 / float((high - low).max())
    shift = scale * (seen_at(camera, np.zeros(3)) - 0.5 * (low + high))
    return Placement(scale, (float(shift[0]), float(shift[1])))


def _suggested(one: _Tried, camera: Camera) -> list[Placement]:
    """Places that a prediction points to: its box where it belongs, and its outline on the drawing's as well."""
    box = bounds(one.volume)
    if box is None:
        return []
    middle, side = box
    factor = min(max(LARGEST / side, 0.5), 2.0) ** _OVERSHOOT
    origin = seen_at(camera, np.zeros(3))
    shift = factor * (np.array(one.place.shift) + origin - seen_at(camera, _OVERSHOOT * middle))
    places = [Placement(one.place.scale * factor, (float(shift[0]), float(shift[1])))]
    seen = np.isfinite(_core.isosurface(one.volume, 0.5, camera.packed, CELLS)[0])
    drawn = one.sketches.depths[0] > 0
    if seen.any() and drawn.any():
        further = shift + 0.9 * factor * (256 / CELLS) * (_middle(seen) - _middle(drawn))
        places.append(Placement(places[0].scale, (float(further[0]), float(further[1]))))
    return places


def _middle(mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """The middle of a mask's box: columns, rows."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    return 0.5 * np.array([columns[0] + columns[-1], rows[0] + rows[-1]], np.float64)


def _numbers(place: Placement) -> NDArray[np.float64]:
    """A place as float64 [5]: logarithm of the scale, shift, turn."""
    return np.array([math.log(place.scale), *place.shift, *place.turn])


def _place(numbers: NDArray[np.float64]) -> Placement:
    scale, right, down, about_right, about_down = numbers.tolist()
    return Placement(math.exp(scale), (right, down), (about_right, about_down))


def _around(place: Placement, spread: NDArray[np.float64]) -> list[Placement]:
    """Places about another one, always the same, in pairs on opposite sides of it."""
    changes = np.random.default_rng(0).standard_normal((_DRAWS // 2, 5)) * spread
    return [_changed(place, change) for change in (*changes, *-changes)]


def _changed(place: Placement, change: NDArray[np.float64]) -> Placement:
    return _place(_numbers(place) + change)


def _mean(places: Sequence[Placement], scores: Sequence[float]) -> Placement:
    """The mean of places, weighted by their likelihoods."""
    weights = np.exp((np.array(scores) - max(scores)) / _DOUBT)
    return _place(weights / weights.sum() @ np.stack([_numbers(place) for place in places]))
