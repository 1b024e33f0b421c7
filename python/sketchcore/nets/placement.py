"""Drawings out of place: moved and scaled to where their cameras would show the object.

Objects are centred in the world and fill it (the 120 % rule), and networks count on it; people draw smaller, larger
and off centre. A drawing is where it belongs when the solid that is predicted from it is centred and of the right size,
fills the outline, and is predicted with confidence. The three together say so far more surely than any one of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from sketchcore import _core
from sketchcore.camera import Camera
from sketchcore.nets.sketches import Sketches
from sketchcore.rounds import Volume

Predict = Callable[[Sequence[Sketches]], Iterator[Volume]]
"""A network's first predictions, one for the drawings of each object."""

LARGEST = 1 / 1.2
"""Largest side of an object, in world units."""
_CELLS = 64
"""Outlines are compared at this many pixels a side."""

_FILLED, _SIZE, _X, _Y = 0.61, 0.36, 1.4, 2.2
"""What counts beside confidence: how well the outline is filled, the logarithm of the size, and the distance of the
box's middle from the origin along x and y. Fitted to tell right places from wrong ones (docs/training.md)."""
_DOUBT = 0.045
"""The likelihood of a place grows by e for so much more of the sum."""
_OFF, _POOR = 0.035, 0.8
"""A drawing whose solid is off by less, in size or place, and fills more of its outline, is not plainly out of place.
Of exact drawings, about one in twelve is."""
_GAIN = 0.03
"""How much better a place must be than the one where the drawing is."""

_STEPS = 3
_OVERSHOOT = 1.2
"""Solids are predicted nearer to where they belong than drawings are: a step goes further than they say."""
_SPREADS = ((6.0, 0.06), (4.0, 0.04))
"""Pixels and logarithm of the scale over which places are drawn, round after round, about the likeliest."""
_DRAWS = 12


@dataclass(frozen=True)
class Placement:
    """How a drawing is moved: scaled about the point where its camera sees the world's origin, then shifted.

    Attributes:
        scale: 1 for none.
        shift: pixels to the right and down.
    """

    scale: float = 1.0
    shift: tuple[float, float] = (0.0, 0.0)

    def move(self, drawing: NDArray[np.uint8], camera: Camera) -> NDArray[np.uint8]:
        """The drawing, uint8 [256, 256], ink 255 on 0, where it belongs."""
        if self == Placement():
            return drawing
        center = seen_at(camera, np.zeros(3))
        inverse = 1 / self.scale
        offset = center - inverse * (center + self.shift)
        moved = Image.fromarray(drawing).transform(
            drawing.shape,
            Image.Transform.AFFINE,
            (inverse, 0, offset[0], 0, inverse, offset[1]),
            Image.Resampling.BICUBIC,
        )
        # Lines that shrink grow faint, and are brought back.
        return (np.asarray(moved, np.float32) * np.float32(max(inverse, 1.0))).clip(0, 255).astype(np.uint8)


def in_place(predict: Predict, sketches: Sketches, first: Volume, always: bool = False) -> Sketches:
    """The drawings moved to where they belong, as far as they are elsewhere and it can be told.

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
    cameras = [Camera.from_packed(row) for row in sketches.cameras]
    alone = [Sketches(sketches.drawings[i : i + 1], sketches.cameras[i : i + 1]) for i in range(len(sketches))]
    firsts = [first] if len(alone) == 1 else predict(alone)
    found = [
        _search(predict, one, camera, volume) if always or out_of_place(volume, one) else Placement()
        for one, camera, volume in zip(alone, cameras, firsts, strict=True)
    ]
    if all(place == Placement() for place in found):
        return sketches
    drawings = zip(found, sketches.drawings, cameras, strict=True)
    moved = Sketches(np.stack([place.move(drawing, camera) for place, drawing, camera in drawings]), sketches.cameras)
    if len(alone) > 1:
        [together] = predict([moved])
        if plausibility(together, moved) < plausibility(first, sketches) + _GAIN:
            return sketches
    return moved


def out_of_place(volume: Volume, sketches: Sketches) -> bool:
    """Whether drawings are plainly out of place: the prediction is off centre or off size, or leaves outlines empty."""
    box = bounds(volume)
    if box is None:
        return True
    middle, side = box
    off = max(abs(math.log(LARGEST / side)), float(np.abs(middle).max()) / LARGEST)
    return off > _OFF or float(min(_fills(volume, sketches))) < _POOR


def plausibility(volume: Volume, sketches: Sketches) -> float:
    """How much speaks for drawings being where they belong, given what was predicted from them; higher is better."""
    box = bounds(volume)
    if box is None:
        return -math.inf
    middle, side = box
    occupied = volume > 0.5
    # The IoU that is to be expected of the solid, if each voxel is right as often as it says.
    expected = float(volume[occupied].sum() / (occupied.sum() + volume[~occupied].sum()))
    filled = _FILLED * float(np.mean(_fills(volume, sketches)))
    off = _SIZE * abs(math.log(LARGEST / side)) + float(abs(middle) @ (_X, _Y, 0))
    return expected + filled - off


def bounds(volume: Volume, least: int = 6) -> tuple[NDArray[np.float64], float] | None:
    """The middle, float64 [3], and the largest side of a solid's box, in world units; None for an empty solid.

    A slice belongs to it that holds some voxels; where it ends between two is interpolated.

    Args:
        volume: float32 [64, 64, 64] (x, y, z), probability of occupancy.
        least: the voxels that a slice must hold.
    """
    lower, upper = np.zeros(3), np.zeros(3)
    for axis in range(3):
        slices = np.moveaxis(volume, axis, 0).reshape(_CELLS, -1)
        (held,) = np.nonzero((slices > 0.5).sum(axis=1) >= least)
        if not len(held):
            return None

        def level(index: int, slices: NDArray[np.float32] = slices) -> float:
            """The probability that just so many voxels of a slice reach."""
            return float(np.partition(slices[index], -least)[-least]) if 0 <= index < _CELLS else 0.0

        ends = []
        for last, step in ((int(held[0]), -1), (int(held[-1]), 1)):
            inside, beyond = level(last), level(last + step)
            ends.append(last + 0.5 + step * (inside - 0.5) / max(inside - beyond, 1e-6))
        lower[axis], upper[axis] = np.array(ends) / _CELLS - 0.5
    return 0.5 * (lower + upper), float((upper - lower).max())


def seen_at(camera: Camera, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where a camera sees a point of the world: float64 [2], pixels to the right and down in the 256^2 image."""
    x, y, z = camera.rotation @ (point - camera.position)
    focal = 128 / math.tan(math.radians(camera.fov_degrees / 2))
    return np.array([128 + focal * x / z, 128 + focal * y / z])


def _fills(volume: Volume, sketches: Sketches) -> list[float]:
    """For each drawing, the IoU of its outline and the solid's."""
    fills = []
    for depths, camera in zip(sketches.depths, sketches.cameras, strict=True):
        seen = np.isfinite(_core.isosurface(volume, 0.5, camera, _CELLS)[0])
        drawn = depths > 0
        fills.append(float((seen & drawn).sum() / max((seen | drawn).sum(), 1)))
    return fills


@dataclass(frozen=True)
class _Tried:
    """A place, what is predicted there, and how much speaks for it."""

    place: Placement
    sketches: Sketches
    volume: Volume
    plausibility: float


def _search(predict: Predict, sketches: Sketches, camera: Camera, first: Volume) -> Placement:
    """Where one drawing belongs; where it is, unless another place is better by a clear margin."""
    here = _Tried(Placement(), sketches, first, plausibility(first, sketches))

    def attempt(places: Sequence[Placement]) -> list[_Tried]:
        moved = [Sketches(place.move(sketches.drawings[0], camera)[None], sketches.cameras) for place in places]
        return [
            _Tried(place, sketch, volume, plausibility(volume, sketch))
            for place, sketch, volume in zip(places, moved, predict(moved), strict=True)
        ]

    # What each prediction says about its own place, from where the drawing is and from where it would fit roughly.
    tried = [here, *attempt([_roughly(sketches, camera)])]
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
        return here.place
    # Single predictions judge their places with errors; the mean over many about the best is surer.
    weighed, mean = [best], best.place
    random = np.random.default_rng(0)
    for pixels, scale in _SPREADS:
        around = random.standard_normal((_DRAWS // 2, 3)) * (scale, pixels, pixels)
        weighed += attempt([_changed(mean, change) for change in (*around, *-around)])
        mean = _mean(weighed)
    [final] = attempt([mean])
    return final.place if final.plausibility > here.plausibility + _GAIN else here.place


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
    seen = np.isfinite(_core.isosurface(one.volume, 0.5, camera.packed, _CELLS)[0])
    drawn = one.sketches.depths[0] > 0
    if seen.any() and drawn.any():
        further = shift + 0.9 * factor * (256 / _CELLS) * (_middle(seen) - _middle(drawn))
        places.append(Placement(places[0].scale, (float(further[0]), float(further[1]))))
    return places


def _middle(mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """The middle of a mask's box: columns, rows."""
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    return 0.5 * np.array([columns[0] + columns[-1], rows[0] + rows[-1]], np.float64)


def _changed(place: Placement, change: NDArray[np.float64]) -> Placement:
    right, down = place.shift
    return Placement(place.scale * math.exp(change[0]), (right + float(change[1]), down + float(change[2])))


def _mean(tried: Sequence[_Tried]) -> Placement:
    """The mean of places, weighted by their likelihoods."""
    scores = np.array([one.plausibility for one in tried])
    weights = np.exp((scores - scores.max()) / _DOUBT)
    weights /= weights.sum()
    scale = math.exp(float(weights @ np.log([one.place.scale for one in tried])))
    shift = weights @ np.array([one.place.shift for one in tried])
    return Placement(scale, (float(shift[0]), float(shift[1])))
