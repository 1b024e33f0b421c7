"""Drawings less than perfect, one fault at a time, in three strengths: what people's drawings do to a network.

Lines are traced to strokes and drawn again, so that nothing here is shared with the pen that training draws with
(`rust/src/pen.rs`). The camera's faults are those of a drawing that was made from elsewhere than it claims.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from sketchcore.camera import Camera
from sketchcore.grids import IMAGE, draw
from sketchcore.shape import Shape
from sketchcore.strokes import Polyline, render, trace

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

WAVELENGTH = 40.0
WIDTH = 1.0
"""Of lines that are drawn again, pixels: as wide as a clean drawing's."""
_GAP = 10.0  # about this long, pixels
_CAMERA = ("viewpoint", "field of view")

Strokes = list[Polyline]


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
    for name, strength in faults.items():
        if strength not in (1, 2, 3):
            raise ValueError(f"the strength of {name} must be 1, 2 or 3, got {strength}")
    amounts = {name: STRENGTHS[name][strength - 1] for name, strength in faults.items()}
    if "viewpoint" in amounts:
        camera = turned(camera, amounts["viewpoint"], random)
    if "field of view" in amounts:
        camera = widened(camera, amounts["field of view"], random)
    drawing = draw(shape, camera)
    if not set(amounts) - set(_CAMERA):
        return drawing
    strokes = trace(drawing)
    for name, spoil in _SPOILERS.items():
        if name in amounts:
            strokes = spoil(strokes, amounts[name], faults[name], random)
    return render(strokes, amounts.get("width", WIDTH))


def turned(camera: Camera, degrees: float, random: np.random.Generator) -> Camera:
    """The camera turned about the world's origin, to a random side."""
    side = random.uniform(0, 2 * math.pi)
    return camera.turned(degrees * math.cos(side), degrees * math.sin(side))


def widened(camera: Camera, share: float, random: np.random.Generator) -> Camera:
    """The camera with a larger or smaller field of view, as far away as makes the object look as large."""
    fov = camera.fov_degrees * (1 + share if random.integers(2) else 1 - share)
    ratio = math.tan(math.radians(camera.fov_degrees / 2)) / math.tan(math.radians(fov / 2))
    middle = -camera.rotation @ camera.position  # the origin, in the camera's frame
    by = (ratio - 1) * middle[2]
    position = camera.position - by * camera.rotation[2]
    return Camera(position, camera.rotation, fov, max(camera.near + by, 0.05), camera.far + by)


def _wobble(strokes: Strokes, amount: float, strength: int, random: np.random.Generator) -> Strokes:
    out = []
    for stroke in strokes:
        at = _lengths(stroke)
        waves = sum(
            random.uniform(0.3, 1.0)
            * np.sin(2 * math.pi * at / (WAVELENGTH * stretch) + random.uniform(0, 2 * math.pi))
            for stretch in (0.7, 1.0, 1.4)
        )
        out.append(stroke + (amount * waves / max(np.abs(waves).max(), 1.0))[:, None] * _normals(stroke))
    return out


def _gaps(strokes: Strokes, amount: float, strength: int, random: np.random.Generator) -> Strokes:
    """Pen lifted at random places until that share of all length is gone."""
    lengths = np.array([_lengths(stroke)[-1] for stroke in strokes])
    kept = [np.ones(len(stroke), np.bool_) for stroke in strokes]
    lack = amount * lengths.sum()
    while lack > 0:
        i = random.choice(len(strokes), p=lengths / lengths.sum())
        at = _lengths(strokes[i])
        long = min(random.uniform(0.5, 1.5) * _GAP, lack)
        begin = random.uniform(-0.5 * long, at[-1] - 0.5 * long)
        gone = kept[i] & (at >= begin) & (at < begin + long)
        kept[i] &= ~gone
        lack -= max(float(np.gradient(at)[gone].sum()) if gone.sum() > 1 else 1.0, 0.25)
    runs = []
    for stroke, keep in zip(strokes, kept, strict=True):
        borders = np.flatnonzero(np.diff(np.concatenate([[False], keep, [False]]).astype(np.int8)))
        runs += [stroke[a:b] for a, b in zip(borders[::2], borders[1::2], strict=True) if b - a >= 2]
    return runs


def _overshoot(strokes: Strokes, amount: float, strength: int, random: np.random.Generator) -> Strokes:
    out = []
    for stroke in strokes:
        by = min(amount, 0.5 * _lengths(stroke)[-1])
        if not np.array_equal(stroke[0], stroke[-1]):  # a closed line has no end
            reach = min(8, len(stroke) - 1)
            before, after = (_unit(stroke[a] - stroke[b]) for a, b in ((0, reach), (-1, -1 - reach)))
            stroke = np.concatenate([[stroke[0] + by * before], stroke, [stroke[-1] + by * after]])
        out.append(stroke)
    return out


def _oversketch(strokes: Strokes, amount: float, strength: int, random: np.random.Generator) -> Strokes:
    """Each line by several strokes side by side, each a little bent and begun a little early or late."""
    out = []
    for stroke in strokes:
        at = _lengths(stroke)
        for j in range(int(amount)):
            offset = (j - (amount - 1) / 2) * strength
            slant = random.uniform(-0.5, 0.5) * strength * (2 * at / max(at[-1], 1.0) - 1)
            out.append(stroke + (offset + slant)[:, None] * _normals(stroke))
    return out


def _scale(strokes: Strokes, amount: float, strength: int, random: np.random.Generator) -> Strokes:
    centre = (IMAGE - 1) / 2
    return [centre + amount * (stroke - centre) for stroke in strokes]


def _shift(strokes: Strokes, amount: float, strength: int, random: np.random.Generator) -> Strokes:
    angle = random.uniform(0, 2 * math.pi)
    return [stroke + amount * np.array([math.cos(angle), math.sin(angle)]) for stroke in strokes]


_SPOILERS: Mapping[str, Callable[[Strokes, float, int, np.random.Generator], Strokes]] = MappingProxyType(
    {
        "scale": _scale,
        "shift": _shift,
        "over-sketching": _oversketch,
        "overshoot": _overshoot,
        "wobble": _wobble,
        "gaps": _gaps,
    }
)


def _lengths(stroke: Polyline) -> NDArray[np.float64]:
    """Length along a stroke up to each of its points."""
    steps = np.hypot(*np.diff(stroke, axis=0).T)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _normals(stroke: Polyline) -> Polyline:
    """A unit vector across a stroke at each of its points, smooth along it."""
    reach = min(5, len(stroke) - 1)
    padded = np.pad(stroke, ((reach, reach), (0, 0)), mode="edge")
    along = padded[2 * reach :] - padded[: len(stroke)]
    across = np.stack([-along[:, 1], along[:, 0]], axis=1)
    unit: Polyline = across / np.maximum(np.hypot(*across.T), 1e-9)[:, None]
    return unit


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    return vector / max(float(np.hypot(*vector)), 1e-9)
