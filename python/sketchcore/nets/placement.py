"""Where a drawing belongs: how large it is drawn, where on the paper, and from which side.

Objects are centred in the world and fill it (the 120 % rule), and networks count on it; people draw smaller, larger,
off centre, and from a little beside the viewpoint. A drawing is where it belongs when the solid that is predicted from
it is centred and of the right size, fills the outline, and is predicted with confidence. The three together say so far
more surely than any one of them; what the drawing's own straight lines say (`perspective.py`) comes to that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from sketchcore import _core
from sketchcore.camera import Camera
from sketchcore.nets.sketches import Sketches
from sketchcore.rounds import Volume

LARGEST = 1 / 1.2
"""Largest side of an object, in world units."""
CELLS = 64
"""Outlines are compared at this many pixels a side."""

PLACE = (0.42, 0.79, 0.83, 0.08)
"""What counts beside confidence: how well the outline is filled, the logarithm of the size, and the distance of the
box's middle from the origin along x and y. Fitted to choose among places that lines speak for (docs/training.md)."""
CAMERA = (0.5, 0.0, 0.35, 0.5)
"""The same to choose among cameras all around, whose likelihood by lines is added (`viewpoint.py`)."""


@dataclass(frozen=True)
class Placement:
    """How a drawing is taken: scaled about the point where its camera sees the world's origin, then shifted; its camera
    carried around that origin.

    Attributes:
        scale: 1 for none.
        shift: pixels to the right and down.
        turn: degrees about the camera's right and down axes.
        widening: its field of view is so many times as large (`Camera.widened`).
    """

    scale: float = 1.0
    shift: tuple[float, float] = (0.0, 0.0)
    turn: tuple[float, float] = (0.0, 0.0)
    widening: float = 1.0

    @classmethod
    def from_numbers(cls, numbers: NDArray[np.float64]) -> Placement:
        """The placement of six numbers, float64 [6] (see `numbers`)."""
        scale, right, down, about_right, about_down, widening = numbers.tolist()
        return cls(math.exp(scale), (right, down), (about_right, about_down), math.exp(widening))

    @property
    def numbers(self) -> NDArray[np.float64]:
        """float64 [6]: the logarithm of the scale, the shift, the turn, and the logarithm of the widening."""
        return np.array([math.log(self.scale), *self.shift, *self.turn, math.log(self.widening)])

    def of(self, sketches: Sketches) -> Sketches:
        """One drawing, taken so."""
        camera = Camera.from_packed(sketches.cameras[0])
        taken = camera.turned(*self.turn)
        turned = (taken if self.widening == 1 else taken.widened(self.widening)).packed[None]
        if self.scale == 1 and self.shift == (0, 0):
            return sketches.seen_by(turned)
        return Sketches(self.move(sketches.drawings[0], camera)[None], turned)

    def move(self, drawing: NDArray[np.uint8], camera: Camera) -> NDArray[np.uint8]:
        """The drawing, uint8 [256, 256], ink 255 on 0, where it belongs."""
        if self.scale == 1 and self.shift == (0, 0):
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


def plausibility(volume: Volume, sketches: Sketches, weights: tuple[float, float, float, float] = PLACE) -> float:
    """How much speaks for drawings being where they belong, given what was predicted from them; higher is better.

    Args:
        volume: float32 [64, 64, 64], the prediction.
        sketches: what it was made from.
        weights: `PLACE` or `CAMERA`.
    """
    if not (volume > 0.5).any():
        return -math.inf
    return expected_iou(volume) + weights[0] - shortfall(volume, sketches, weights)


def expected_iou(volume: Volume) -> float:
    """The IoU that is to be expected of a solid, if each voxel is right as often as it says; 0 for an empty one."""
    occupied = volume > 0.5
    return float(volume[occupied].sum() / max(occupied.sum() + volume[~occupied].sum(), 1e-9))


def shortfall(volume: Volume, sketches: Sketches, weights: tuple[float, float, float, float] = PLACE) -> float:
    """By how much a prediction misses the size and the place that objects have, and its drawings' outlines; 0 is best.

    Args:
        volume: float32 [64, 64, 64], the prediction.
        sketches: what it was made from.
        weights: `PLACE` or `CAMERA`.
    """
    box = bounds(volume)
    if box is None:
        return math.inf
    middle, side = box
    filled, size, along_x, along_y = weights
    off = size * abs(math.log(LARGEST / side)) + float(abs(middle) @ (along_x, along_y, 0))
    return off + filled * (1 - float(np.mean(fills(volume, sketches))))


def bounds(volume: Volume, least: int = 6) -> tuple[NDArray[np.float64], float] | None:
    """The middle, float64 [3], and the largest side of a solid's box, in world units; None for an empty solid.

    A slice belongs to it that holds some voxels; where it ends between two is interpolated.

    Args:
        volume: float32 [64, 64, 64] (x, y, z), probability of occupancy.
        least: the voxels that a slice must hold.
    """
    lower, upper = np.zeros(3), np.zeros(3)
    for axis in range(3):
        slices = np.moveaxis(volume, axis, 0).reshape(CELLS, -1)
        (held,) = np.nonzero((slices > 0.5).sum(axis=1) >= least)
        if not len(held):
            return None

        def level(index: int, slices: NDArray[np.float32] = slices) -> float:
            """The probability that just so many voxels of a slice reach."""
            return float(np.partition(slices[index], -least)[-least]) if 0 <= index < CELLS else 0.0

        ends = []
        for last, step in ((int(held[0]), -1), (int(held[-1]), 1)):
            inside, beyond = level(last), level(last + step)
            ends.append(last + 0.5 + step * (inside - 0.5) / max(inside - beyond, 1e-6))
        lower[axis], upper[axis] = np.array(ends) / CELLS - 0.5
    return 0.5 * (lower + upper), float((upper - lower).max())


def seen_at(camera: Camera, point: NDArray[np.float64]) -> NDArray[np.float64]:
    """Where a camera sees a point of the world: float64 [2], pixels to the right and down in the 256^2 image."""
    x, y, z = camera.rotation @ (point - camera.position)
    return np.array([128 + camera.focal * x / z, 128 + camera.focal * y / z])


def fills(volume: Volume, sketches: Sketches) -> list[float]:
    """For each drawing, the IoU of its outline and the solid's."""
    found = []
    for depths, camera in zip(sketches.depths, sketches.cameras, strict=True):
        seen = np.isfinite(_core.isosurface(volume, 0.5, camera, CELLS)[0])
        drawn = depths > 0
        found.append(float((seen & drawn).sum() / max((seen | drawn).sum(), 1)))
    return found
