"""Drawings as strokes: lines traced from pixels to polylines, and polylines drawn as lines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from sketchcore import _core
from sketchcore.drawing import INK
from sketchcore.grids import IMAGE, as_drawings

Polyline = NDArray[np.float64]
"""float64 [n, 2], n >= 2: (x, y) in pixels, x to the right, y down; a pixel's centre is at its indices."""

_FINE = 4
"""Lines are drawn at so many times the resolution, then averaged."""


def trace(drawing: NDArray[np.uint8]) -> list[Polyline]:
    """The strokes of a drawing: its lines from junction to junction, cut at corners.

    Args:
        drawing: uint8 [256, 256], ink 255 on 0.

    Returns:
        one polyline a stroke, its points about a pixel apart; closed lines without corner return to where they began.

    Raises:
        ValueError: for another shape.
        TypeError: for another dtype.
    """
    return [stroke.astype(np.float64) for stroke in _core.trace(as_drawings(drawing)[0], INK, 1, False)]


def render(strokes: Sequence[Polyline], width: float) -> NDArray[np.uint8]:
    """The drawing of strokes by a round pen: uint8 [256, 256], ink 255 on 0.

    Args:
        strokes: polylines, pixels; what lies outside the drawing is cut off.
        width: of the pen, pixels.

    Raises:
        ValueError: for a width that is not more than 0.
    """
    if not width > 0:
        raise ValueError(f"a pen's width must be more than 0 pixels, got {width}")
    image = Image.new("L", (IMAGE * _FINE, IMAGE * _FINE))
    pen = ImageDraw.Draw(image)
    side = max(1, round(width * _FINE))
    for stroke in strokes:
        points = [tuple(point) for point in (stroke + 0.5) * _FINE - 0.5]
        pen.line(points, fill=255, width=side, joint="curve")
        for x, y in (points[0], points[-1]):
            pen.ellipse((x - side / 2, y - side / 2, x + side / 2, y + side / 2), fill=255)
    return np.asarray(image.reduce(_FINE))
