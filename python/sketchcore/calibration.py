"""Cameras that a drawing's straight lines speak for: upright, looking at the origin, from anywhere on half a circle.

What `perspective.py` says near one camera is asked near many. Lines do not tell the two horizontal axes apart, so what
they say of one quarter of the circle they say of the next as well.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sketchcore.camera import Camera
from sketchcore.perspective import Lines

CARRIED = (False, False, False, True, True, True)
"""Which of a fit's numbers say how a camera is carried about the origin, and its field of view."""

_STEP = 15
_ELEVATIONS = (4.0, 14.0, 22.0, 30.0, 38.0)
_FIELDS_OF_VIEW = (28.0, 45.0)
_FACE_ON = 12.0
"""Nobody chooses to see one side alone, whose edges hide those behind: not from so few degrees beside it."""
_FITTED, _TRIED = 6, 20
"""So many cameras of a quarter are fitted to the lines, and so many are found in all."""
_APART = 3.0
"""Degrees by which those look different ways, or have other fields of view."""


def cameras_spoken_for(lines: Lines) -> tuple[list[Camera], float]:
    """The cameras that lines speak for, within 90 degrees of azimuth of their own.

    First those that are fitted to them; where lines say little, others all around are as likely, and follow.

    Args:
        lines: of the drawing, with one camera.

    Returns:
        40 cameras, each before the one a quarter turn on; and the likelihood of the lines (its natural logarithm, as
        `Lines.likelihood` has it) from the likeliest.
    """
    first = round(_azimuth(lines.cameras[0]) / _STEP) * _STEP - 90
    azimuths = [azimuth for azimuth in range(first, first + 90, _STEP) if not _face_on(azimuth)]
    around = [
        Camera.orbit(azimuth, elevation, fov_degrees=fov)
        for azimuth, elevation, fov in itertools.product(azimuths, _ELEVATIONS, _FIELDS_OF_VIEW)
    ]
    fitted = [camera for camera in _fitted(lines, around) if not _face_on(_azimuth(camera))]
    found: list[Camera] = []
    for camera in _likeliest(lines, fitted):
        same = [_upright(camera, turn) for turn in (-90.0, 0.0, 90.0)]
        if len(found) < _FITTED and all(_apart(one, other) > _APART for one in same for other in found):
            found.append(camera)
    found += _likeliest(lines, around)[: _TRIED - len(found)]
    return [_upright(camera, turn) for camera in found for turn in (0.0, 90.0)], float(likelihoods(lines, found).max())


def likelihoods(lines: Lines, cameras: Sequence[Camera]) -> NDArray[np.float64]:
    """How likely lines are from each of n cameras: float64 [n], as `Lines.likelihood` has it."""
    return lines.seen_by(*cameras).likelihood(np.zeros((len(cameras), 6)))


def _likeliest(lines: Lines, cameras: Sequence[Camera]) -> list[Camera]:
    """The likeliest camera first."""
    return [cameras[i] for i in np.argsort(-likelihoods(lines, cameras))] if cameras else []


def _fitted(lines: Lines, cameras: Sequence[Camera]) -> list[Camera]:
    """The likeliest cameras near others, carried about the origin, of any field of view."""
    free = np.tile(CARRIED, (len(cameras), 1))
    numbers, _ = lines.seen_by(*cameras, upright=True).fit(np.zeros((len(cameras), 6)), free)
    return [
        _upright(camera, turn=down, rise=-right, widen=math.exp(wider))
        for camera, (_, _, _, right, down, wider) in zip(cameras, numbers.tolist(), strict=True)
    ]


def _face_on(azimuth: float) -> bool:
    return abs((azimuth + 45) % 90 - 45) < _FACE_ON


def _azimuth(camera: Camera) -> float:
    x, _, z = camera.position
    return math.degrees(math.atan2(z, x))


def _upright(camera: Camera, turn: float = 0.0, rise: float = 0.0, widen: float = 1.0) -> Camera:
    """Another camera carried around the origin, by degrees of azimuth and elevation, and of another field of view."""
    x, y, z = camera.position
    elevation = math.degrees(math.atan2(y, math.hypot(x, z)))
    return Camera.orbit(_azimuth(camera) + turn, elevation + rise, fov_degrees=camera.fov_degrees * widen)


def _apart(one: Camera, other: Camera) -> float:
    """Degrees by which two cameras look different ways, or their fields of view differ."""
    cosine = float(one.rotation[2] @ other.rotation[2])
    return max(math.degrees(math.acos(min(cosine, 1.0))), abs(one.fov_degrees - other.fov_degrees))
