"""What the straight lines of a drawing say about the camera that it was made by.

Most edges of most things are upright, or run along their length or width: their lines point at the vanishing points of
the world's three axes. These move when the camera is turned, and lines move past them when a drawing is scaled or
shifted. So lines alone tell to a fraction of a degree from which side a drawing was made, if it is where it belongs;
and to a pixel or two where it belongs, if the side is known. They do not tell well which of both is wrong: that takes
what is predicted from them (`nets/search.py`).

How a drawing is taken is six numbers here, float64 [6], or [n, 6] for several ways: the logarithm of the scale about
the point where the camera sees the world's origin, pixels to the right and down, degrees by which the camera is turned
about its own right and down axes, and the logarithm of how much wider its field of view is (`nets/placement.py`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from sketchcore import _core
from sketchcore.camera import Camera, turns
from sketchcore.drawing import INK
from sketchcore.nets.placement import seen_at

Numbers = NDArray[np.float64]

SPREADS = np.array([0.35, 30.0, 30.0, 10.0, 10.0, 0.15])
"""How far out of place drawings are: the standard deviation of each number."""
NOISE = (4.0, 1.6, 0.6, 0.25, 0.1)
"""Pixels by which the ends of a line may miss it, from a hand to a renderer: the likeliest is a drawing's own. A fit
begins with the most, so that it sees lines that are far off."""
_ALLOWED = 1.3
"""Standard deviation of a line's direction, as that of its ends by its length."""
_STRAIGHT = 0.15
"""Pixels that a straight line may seem to bend by; one that bends by more is so much less sure."""
_LOOSE, _WIDER = 0.3, 4.0
"""This share of the lines misses by so many times more."""
_STRAY, _STRAY_IF_SHORT, _SHORT = 0.25, 0.6, 16.0
"""The share of lines that run along no axis, and that of those shorter than so many pixels."""
_LEVEL = np.diag([1.0, -1.0, -1.0])
"""The axes of a camera that stands upright and looks along -z."""
_STEPS = 6
_SMALL = np.array([1e-3, 0.1, 0.1, 0.05, 0.05, 1e-3])
"""Changes that derivatives are taken by; a fit ends when it moves by less."""
_FURTHEST = np.array([0.15, 12.0, 12.0, 6.0, 6.0, 0.15])
"""The longest step of a fit."""


@dataclass(frozen=True)
class Lines:
    """The straight lines of a drawing, and the camera that it is said to be made by, or several.

    Attributes:
        ends: float64 [n, 2, 2], pixels to the right and down.
        bend: float64 [n], pixels by which each seems to bend.
        cameras: the camera; or m of them, one for each of the m ways to take the drawing that are asked about.
        upright: whether cameras that stand upright stay so: they are turned about the world's vertical axis instead of
            their own down axis, after they were turned about their right one.
    """

    ends: NDArray[np.float64]
    bend: NDArray[np.float64]
    cameras: tuple[Camera, ...]
    upright: bool = False

    @classmethod
    def of(cls, drawing: NDArray[np.uint8], camera: Camera) -> Lines:
        """The lines in a drawing, uint8 [256, 256], ink 255 on 0."""
        pieces = _core.straight(drawing, INK)
        return cls(pieces[:, :4].reshape(-1, 2, 2), pieces[:, 4], (camera,))

    def seen_by(self, *cameras: Camera, upright: bool = False) -> Lines:
        """The same lines, made by other cameras."""
        return Lines(self.ends, self.bend, cameras, upright)

    @cached_property
    def _bases(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Of each camera the rotation, where it sees the origin, and the field of view: [k, 3, 3], [k, 2], [k]."""
        return (
            np.stack([camera.rotation for camera in self.cameras]),
            np.stack([seen_at(camera, np.zeros(3)) for camera in self.cameras]),
            np.array([camera.fov_degrees for camera in self.cameras]),
        )

    @cached_property
    def _middles(self) -> NDArray[np.float64]:
        return np.asarray(self.ends.mean(axis=1))

    @cached_property
    def _along(self) -> NDArray[np.float64]:
        return np.asarray(self.ends[:, 1] - self.ends[:, 0])

    @cached_property
    def _length(self) -> NDArray[np.float64]:
        return np.asarray(np.hypot(*self._along.T))

    @cached_property
    def _strays(self) -> NDArray[np.float64]:
        """The share of lines as long as each that run along no axis."""
        return np.where(self._length < _SHORT, _STRAY_IF_SHORT, _STRAY)

    def __len__(self) -> int:
        return len(self.ends)

    def likelihood(self, numbers: Numbers) -> NDArray[np.float64]:
        """How much likelier the lines are if the drawing is taken so, than if they ran anywhere.

        Args:
            numbers: float64 [m, 6], ways to take it.

        Returns:
            float64 [m], natural logarithms of the ratio of likelihoods, each for the likeliest noise; 0 without lines.
        """
        off = self._off(numbers)
        return np.asarray(np.max([self._likelihood(off, noise) for noise in NOISE], axis=0))

    def information(self, numbers: Numbers) -> NDArray[np.float64]:
        """How sharply lines tell of the numbers near one way to take the drawing: float64 [6, 6], inverse covariance.

        Args:
            numbers: float64 [6].
        """
        at = numbers[None]
        off = self._off(at)
        noise = max(NOISE, key=lambda one: float(self._likelihood(off, one)[0]))
        return np.asarray(self._normal(at, np.ones((1, 6), np.bool_), noise)[0][0])

    def fit(self, starts: Numbers, free: NDArray[np.bool_]) -> tuple[Numbers, NDArray[np.float64]]:
        """The likeliest ways to take the drawing.

        Args:
            starts: float64 [m, 6], where to begin.
            free: bool [m, 6], which numbers may change from there.

        Returns:
            float64 [m, 6], the numbers, and float64 [m], their `likelihood` less `stray`.
        """
        at = starts.astype(np.float64)
        best, reached = at.copy(), np.full(len(at), -np.inf)
        held = ~free[:, :, None] | ~free[:, None, :]
        for noise in NOISE:
            for _ in range(_STEPS):
                curvature, slope = self._normal(at, free, noise)
                curvature = curvature + np.diag(SPREADS**-2)
                slope = np.where(free, slope + at * SPREADS**-2, 0.0)
                curvature = np.where(held, np.eye(6), curvature)
                step = -np.linalg.solve(curvature, slope[..., None])[..., 0]
                step /= np.maximum(1.0, np.max(np.abs(step) / _FURTHEST, axis=1, keepdims=True))
                at = at + step
                if np.max(np.abs(step) / _SMALL) < 1:
                    break
            likely = self._likelihood(self._off(at), noise) - stray(at)
            better = likely > reached
            best[better], reached[better] = at[better], likely[better]
        return best, reached

    def _off(self, numbers: Numbers, which: NDArray[np.intp] | None = None) -> NDArray[np.float64]:
        """Radians between each line and the directions to the three vanishing points: float64 [m, n, 3].

        Args:
            numbers: float64 [m, 6].
            which: intp [m], the camera of each, if there are several; None for theirs in order.
        """
        rotation, origin, fov = self._bases
        if len(self.cameras) > 1 and which is not None:
            rotation, origin, fov = rotation[which], origin[which], fov[which]
        origin = origin[:, None]
        rotations = rotation @ self._turns(rotation, numbers[:, 3:5]).transpose(0, 2, 1)
        middle, along = self._middles, self._along
        middle = origin + numbers[:, None, 1:3] + np.exp(numbers[:, :1, None]) * (middle - origin)
        focal = 128 / np.tan(np.radians(0.5 * fov * np.exp(numbers[:, 5])))[:, None, None]
        # From a line's middle towards an axis' vanishing point, wherever that is, at infinity too: [m, n, axis].
        across, down, forward = (rotations[:, None, i, :] for i in range(3))
        towards_x = focal * across - (middle[..., :1] - 128) * forward
        towards_y = focal * down - (middle[..., 1:] - 128) * forward
        along_x, along_y = along[:, :1], along[:, 1:]
        beside, ahead = along_x * towards_y - along_y * towards_x, along_x * towards_x + along_y * towards_y
        return np.asarray(np.arctan(beside / np.where(ahead == 0, 1e-300, ahead)))

    def _turns(self, rotation: NDArray[np.float64], degrees: Numbers) -> NDArray[np.float64]:
        right, down = degrees.T
        if not self.upright:
            return turns(rotation, right, down)
        none = np.zeros_like(down)
        return turns(_LEVEL, none, down) @ turns(rotation, right, none)

    def _densities(self, off: NDArray[np.float64], noise: float) -> list[tuple[NDArray[np.float64], Numbers]]:
        """For lines that keep close to their axis and for loose ones: densities, and standard deviations.

        float64 [m, n, 3], by the density of a line that runs anywhere; and float64 [n, 1], radians.
        """
        strays = self._strays[:, None]
        close = (_ALLOWED * np.hypot(noise, np.maximum(self.bend - _STRAIGHT, 0)) / self._length)[:, None]
        found = []
        for share, deviation in ((1 - _LOOSE, close), (_LOOSE, _WIDER * close)):
            normal = np.exp(-0.5 * (off / deviation) ** 2) * (math.sqrt(math.pi / 2) / deviation)
            found.append((share * (1 - strays) / (3 * strays) * normal, deviation))
        return found

    def _likelihood(self, off: NDArray[np.float64], noise: float) -> NDArray[np.float64]:
        density = sum((values for values, _ in self._densities(off, noise)), np.zeros(()))
        return np.asarray(np.log(self._strays * (1 + density.sum(axis=2))).sum(axis=1))

    def _normal(
        self, numbers: Numbers, free: NDArray[np.bool_], noise: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Curvature [m, 6, 6] and slope [m, 6] of half the squared errors, each line's three axes weighed.

        After Gauss and Newton: errors are taken to change in proportion to the numbers; those not free have none.
        """
        which, number = np.nonzero(free)
        changes = np.zeros((len(which), 6))
        changes[np.arange(len(which)), number] = _SMALL[number]
        order = np.concatenate([np.arange(len(numbers)), which])
        all_off = self._off(np.concatenate([numbers, numbers[which] + changes]), order)
        off, changed = all_off[: len(numbers)], all_off[len(numbers) :]
        densities = self._densities(off, noise)
        total = 1 + sum((values for values, _ in densities), np.zeros(())).sum(axis=2, keepdims=True)
        weights = sum((values / deviation**2 for values, deviation in densities), np.zeros(())) / total
        slopes = np.zeros((len(numbers), 6, off[0].size))
        differences = (changed - off[which] + math.pi / 2) % math.pi - math.pi / 2
        slopes[which, number] = (differences / _SMALL[number, None, None]).reshape(len(which), -1)
        weighted = slopes * weights.reshape(len(numbers), 1, -1)
        return weighted @ slopes.transpose(0, 2, 1), (weighted @ off.reshape(len(numbers), -1, 1))[..., 0]


def stray(numbers: Numbers) -> NDArray[np.float64]:
    """How unlikely it is that drawings are so far out of place: float64 [m], the logarithm, for float64 [m, 6]."""
    return np.asarray(0.5 * ((numbers / SPREADS) ** 2).sum(axis=-1))
