"""How well the lines of a drawing run along the world's three axes, as a camera sees these.

Most edges of most things that people make and draw are upright, or run along their length or width. So their lines
point at the vanishing points of a camera that a drawing may have been made from, and past those of others. That tells
cameras' heights and fields of view apart, without a network; not which of the two horizontal axes is which.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sketchcore.camera import Camera

_INK = 128
_BLUR, _REACH = 1.2, 3.0
"""Pixels: of the drawing before its gradient is taken, and over which the direction of a line is averaged."""
_CLEAR = (0.5, 0.9)
"""Of the structure tensor's coherence: below, ink has no direction; above, it counts wholly."""
_TOLERANCE = 5.0
"""Degrees by which hand-drawn lines miss their vanishing point."""


@dataclass(frozen=True)
class Directions:
    """Where the ink of a drawing is, and along which way it runs there.

    Attributes:
        places: float64 [n, 2], pixels to the right and down.
        along: float64 [n, 2], unit vectors, of either sign.
        weights: float64 [n], 0 to 1: how clear the direction is. At corners and in scribbles it is not.
    """

    places: NDArray[np.float64]
    along: NDArray[np.float64]
    weights: NDArray[np.float64]

    @classmethod
    def of(cls, drawing: NDArray[np.uint8]) -> Directions:
        """The directions in a drawing, uint8 [256, 256], ink 255 on 0."""
        from scipy.ndimage import gaussian_filter, sobel

        soft = gaussian_filter(drawing.astype(np.float64) / 255, _BLUR)
        right, down = sobel(soft, 1), sobel(soft, 0)
        rows, columns = np.nonzero(drawing >= _INK)
        xx, xy, yy = (
            gaussian_filter(a * b, _REACH)[rows, columns] for a, b in ((right, right), (right, down), (down, down))
        )
        angle = 0.5 * np.arctan2(2 * xy, xx - yy) + math.pi / 2
        coherence = np.hypot(xx - yy, 2 * xy) / (xx + yy + 1e-12)
        weights = ((coherence - _CLEAR[0]) / (_CLEAR[1] - _CLEAR[0])).clip(0, 1)
        return cls(
            np.stack([columns, rows], axis=1) + np.float64(0.5),
            np.stack([np.cos(angle), np.sin(angle)], axis=1),
            weights,
        )

    def agreement(self, camera: Camera) -> float:
        """How much of the ink runs along an axis of the world as a camera sees it: 0 to 1, 0 without ink."""
        if not self.weights.any():
            return 0.0
        best = np.zeros(len(self.places))
        for axis in range(3):
            right, down, forward = camera.rotation[:, axis]
            # From a pixel towards the axis' vanishing point, wherever that is, at infinity too.
            towards = camera.focal * np.array([right, down]) - (self.places - 128) * forward
            length = np.hypot(*towards.T) + 1e-9
            sine = np.abs(towards[:, 0] * self.along[:, 1] - towards[:, 1] * self.along[:, 0]) / length
            off = np.degrees(np.arcsin(sine.clip(0, 1))) / _TOLERANCE
            best = np.maximum(best, np.exp(-0.5 * off**2))
        return float(best @ self.weights / self.weights.sum())
