"""How lines are put down: one meaning for drawing, training and evaluation (`rust/src/style.rs`)."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from functools import lru_cache
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from sketchcore import _core
from sketchcore.camera import Camera
from sketchcore.untrusted import parse_json


@dataclass(frozen=True)
class LineStyle:
    """One way of drawing. Without arguments it is "clean", the renderer's own, whose pixels stay as they are.

    Lengths are pixels of the 256 x 256 drawing.

    Attributes:
        width: of the pen, 0.25 to 32; below 1 lines are as wide as 1 and the paler.
        antialias: whether pixels that a line covers in part get part of the ink; else all of it or none.
        noise: largest share of the ink that the paper's grain and the hand's pressure leave out, 0 to 1.
        wobble: largest displacement of a stroke across itself, 0 to 64.
        wavelength: of the wobble, roughly, 4 to 1024.
        overshoot: how far each stroke runs past both its ends, 0 to 128, and at most half its own length.
        gaps: share of the length that is left out, 0 to 0.9, in gaps of about 10 pixels.
        strokes: strokes for each line, 1 to 16.
        apart: distance between them, 0 to 32.
        taper: length at each end over which a stroke thins and fades, 0 to 256.
        viewpoint: degrees that the camera is turned about the origin, to a random side, 0 to 90.
        field_of_view: share by which it is larger or smaller, at the distance from which the object looks as large,
            0 to 0.75.
        scale: factor of the drawing about its centre, 0.1 to 2.
        shift: how far the drawing is out of place, to a random side, 0 to 256.

    Raises:
        ValueError: for a number that is not finite or out of range.
        TypeError: for what is no number.
    """

    width: float = 1.0
    antialias: bool = False
    noise: float = 0.0
    wobble: float = 0.0
    wavelength: float = 40.0
    overshoot: float = 0.0
    gaps: float = 0.0
    strokes: int = 1
    apart: float = 0.0
    taper: float = 0.0
    viewpoint: float = 0.0
    field_of_view: float = 0.0
    scale: float = 1.0
    shift: float = 0.0

    def __post_init__(self) -> None:
        for name in _NAMES:
            object.__setattr__(self, name, _checked(name, getattr(self, name)))
        if self.strokes < 1:  # the core knows no negative count
            raise ValueError(f"line style: strokes must lie between 1 and 16, got {self.strokes}")
        _core.check_style(self.to_json())

    def to_json(self) -> str:
        """All numbers by name."""
        return _to_json(self)

    @classmethod
    def from_json(cls, text: str) -> LineStyle:
        """The style of what `to_json` gave; numbers that are left out keep their defaults.

        Raises:
            ValueError: for what is no JSON object, or has an unknown name, or a number out of range.
            TypeError: for what is no number.
        """
        numbers = parse_json(text, "a line style")
        if not isinstance(numbers, dict):
            raise ValueError(f"a line style is a JSON object, got {type(numbers).__name__}")
        for name in numbers:
            if name not in _NAMES:
                raise ValueError(f"line style: unknown {name!r}; a style has {', '.join(_NAMES)}")
        return cls(**numbers)

    @classmethod
    def random(cls, seed: int, ranges: Mapping[str, object] | None = None) -> LineStyle:
        """A style such as training draws for each drawing.

        Args:
            seed: 0 ... 2^64 - 1.
            ranges: what differs from the `styles` of `sketchcore.datagen.default_config()`.

        Raises:
            ValueError: for an unknown range, or one out of order or of limits.
        """
        return cls.from_json(_core.random_style(json.dumps(dict(ranges or {})), check_seed(seed)))

    def camera(self, camera: Camera, seed: int = 0) -> Camera:
        """The camera that a drawing in this style is really made from, if it claims to be made from the given one."""
        packed = self.packed_camera(camera, seed)
        return camera if packed is camera.packed else Camera.from_packed(packed)

    def packed_camera(self, camera: Camera, seed: int = 0) -> NDArray[np.float64]:
        """`camera`'s result as `Camera.packed`."""
        if self.viewpoint == self.field_of_view == 0:
            return camera.packed
        return _core.style_camera(camera.packed, self.to_json(), check_seed(seed))

    def redraw(
        self, drawing: NDArray[np.uint8], seed: int = 0, out: NDArray[np.uint8] | None = None
    ) -> NDArray[np.uint8]:
        """A drawing traced to strokes and drawn again in this style, but for its camera.

        Args:
            drawing: uint8 [256, 256], ink 255 on 0.
            seed: 0 ... 2^64 - 1; the same one draws the same.
            out: an array of that shape and dtype to write into, and to return.

        Raises:
            ValueError: for another shape, or a seed out of range.
            TypeError: for another dtype.
        """
        drawing = np.asarray(drawing)
        if drawing.dtype != np.uint8:
            raise TypeError(f"a drawing must be uint8 (ink 255 on 0), got {drawing.dtype}")
        return _core.redraw(np.ascontiguousarray(drawing), self.to_json(), check_seed(seed), out)


@lru_cache(maxsize=64)
def _to_json(style: LineStyle) -> str:
    return json.dumps(asdict(style))


def _checked(name: str, value: object) -> float | int | bool:
    """A number of a style; the core knows its limits."""
    if isinstance(value, np.generic):
        value = value.item()
    switch, count = name == "antialias", name == "strokes"
    if not isinstance(value, (int, float)) or isinstance(value, bool) != switch or (count and isinstance(value, float)):
        kind = "True or False" if switch else "a whole number" if count else "a number"
        raise TypeError(f"line style: {name} must be {kind}, got {type(value).__name__}")
    if not math.isfinite(value):
        raise ValueError(f"line style: {name} must be finite, got {value}")
    return value if switch or count else float(value)


_NAMES = tuple(field.name for field in fields(LineStyle))

STYLES: Mapping[str, LineStyle] = MappingProxyType(
    {
        "clean": LineStyle(),
        "pen": LineStyle(width=1.4, antialias=True, wobble=0.5, wavelength=60.0, overshoot=1.0, taper=4.0),
        "pencil": LineStyle(
            width=1.3, antialias=True, noise=0.55, wobble=0.8, wavelength=60.0, overshoot=3.0, taper=16.0
        ),
        "loose": LineStyle(
            width=1.5, antialias=True, noise=0.15, wobble=1.8, wavelength=60.0, overshoot=7.0, gaps=0.06, taper=16.0
        ),
        "sketchy": LineStyle(
            width=1.2,
            antialias=True,
            noise=0.35,
            wobble=1.4,
            wavelength=70.0,
            overshoot=8.0,
            gaps=0.04,
            strokes=3,
            apart=1.4,
            taper=24.0,
            viewpoint=2.0,
        ),
    }
)
"""Styles by name, from the renderer's own to a sketch."""


def as_style(style: str | LineStyle) -> LineStyle:
    """The style of a name; a style stays as it is.

    Raises:
        ValueError: for a name that is none of `STYLES`.
        TypeError: for anything else.
    """
    if isinstance(style, LineStyle):
        return style
    if not isinstance(style, str):
        raise TypeError(f"a style is a name or a sketchcore.LineStyle, got {type(style).__name__}")
    if style not in STYLES:
        raise ValueError(f"unknown style {style!r}; the styles are {', '.join(STYLES)}")
    return STYLES[style]


def check_seed(seed: int) -> int:
    """The seed itself.

    Raises:
        ValueError: for one outside 0 ... 2^64 - 1.
        TypeError: for what is no whole number.
    """
    if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)):
        raise TypeError(f"seed must be a whole number, got {type(seed).__name__}")
    if not 0 <= seed < 2**64:
        raise ValueError(f"seed must lie between 0 and 2^64 - 1, got {seed}")
    return int(seed)
