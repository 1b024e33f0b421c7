"""Drawings less than perfect, one fault at a time, in three strengths: what people's drawings do to a network.

Each fault is one number of a `LineStyle`, or two: what is measured here is what `sketchcore.draw` draws and what
training may learn from.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sketchcore.camera import Camera
from sketchcore.grids import draw
from sketchcore.linestyle import LineStyle
from sketchcore.shape import Shape

STRENGTHS: Mapping[str, tuple[float, float, float]] = MappingProxyType(
    {
        "wobble": (1.0, 2.5, 4.0),
        "gaps": (0.10, 0.25, 0.40),
        "overshoot": (4.0, 8.0, 14.0),
        "over-sketching": (2.0, 3.0, 5.0),
        "width": (2.0, 3.0, 4.0),
        "viewpoint": (5.0, 10.0, 20.0),
        "field of view": (0.10, 0.20, 0.35),
        "scale": (0.85, 0.70, 0.50),
        "shift": (10.0, 25.0, 45.0),
    }
)
"""Each fault's three strengths.

Wobble: largest displacement of a line across itself, pixels, over about 40 pixels of its length. Gaps: share of the
length left out. Overshoot: pixels that each line runs past both its ends, at most half its own length.
Over-sketching: strokes a line, 1, 2 and 3 pixels apart. Width: pixels. Viewpoint: degrees that the camera is turned
about the origin. Field of view: share that it is larger or smaller by, at the distance from which the object looks as
large. Scale: factor of the drawing about its centre. Shift: pixels that it is off centre by.
"""

_CAMERA = ("viewpoint", "field of view")


def faulty_style(faults: Mapping[str, int]) -> LineStyle:
    """The style of drawings with faults.

    Args:
        faults: names from `STRENGTHS` with a strength each, 1 to 3; none gives the clean style.

    Raises:
        KeyError: for an unknown fault.
        ValueError: for another strength.
    """
    numbers: dict[str, Any] = {}
    for name, strength in faults.items():
        if strength not in (1, 2, 3):
            raise ValueError(f"the strength of {name} must be 1, 2 or 3, got {strength}")
        amount = STRENGTHS[name][strength - 1]
        if name == "over-sketching":
            numbers |= {"strokes": int(amount), "apart": float(strength)}
        else:
            numbers[name.replace(" ", "_")] = amount
    return LineStyle(antialias=not faults.keys() <= set(_CAMERA), **numbers)


def distorted(
    shape: Shape, camera: Camera, faults: Mapping[str, int], random: np.random.Generator
) -> NDArray[np.uint8]:
    """A drawing with faults of a shape.

    Args:
        shape: what is drawn.
        camera: that the drawing claims to be made from.
        faults: names from `STRENGTHS` with a strength each, 1 to 3; none gives the clean drawing.
        random: where lines stray, and to which side.

    Returns:
        uint8 [256, 256], ink 255 on 0.

    Raises:
        KeyError: for an unknown fault.
        ValueError: for another strength.
    """
    return draw(shape, camera, style=faulty_style(faults), seed=int(random.integers(2**63)))
