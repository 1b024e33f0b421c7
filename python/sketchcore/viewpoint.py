"""Where a drawing was made from: one of the eight three-quarter viewpoints, or a camera near it.

A camera is as plausible as the solid that is predicted from it fills the drawing's outline when seen from it: the
prediction as it is, for once outlines are heeded every solid fills them.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sketchcore.camera import QUARTER_VIEWS, VIEWPOINTS, Camera, pack_cameras
from sketchcore.nets.models import Model
from sketchcore.nets.sketches import Sketches
from sketchcore.outline import outline_iou

_POOR = 0.86
"""A viewpoint from which less of the outline is filled may not be where the drawing was made from."""
_GAIN = 0.03
"""How much more of it another camera must fill."""
_TURNS = (0.0, -10.0, 10.0)
_ELEVATIONS = (38.0, 30.0, 22.0, 14.0)
_FIELDS_OF_VIEW = (45.0, 30.0)


def guess_viewpoint(model: Model, drawing: NDArray[np.uint8]) -> list[str]:
    """The names of the eight three-quarter viewpoints, most plausible first.

    Args:
        model: the network.
        drawing: uint8 [256, 256], ink 255 on 0.
    """
    return [name for _, name in _ranked(model, drawing)]


def guess_camera(model: Model, drawing: NDArray[np.uint8]) -> tuple[str, Camera]:
    """The most plausible viewpoint's name, and its camera or one near it.

    Where the viewpoint leaves part of the outline empty, others are tried as well, around it and around the opposite
    one, of which drawings of many objects say the same: from lower down, from 10 degrees to either side, with a
    narrower field of view. People draw from where they like.

    Args:
        model: the network.
        drawing: uint8 [256, 256], ink 255 on 0.
    """
    fill, name = _ranked(model, drawing)[0]
    if fill >= _POOR:
        return name, VIEWPOINTS[name]
    tried = []
    for near in (name, opposite(name)):
        position = VIEWPOINTS[near].position
        azimuth = math.degrees(math.atan2(position[2], position[0]))
        for turn, elevation, fov in itertools.product(_TURNS, _ELEVATIONS, _FIELDS_OF_VIEW):
            tried.append((near, Camera.orbit(azimuth + turn, elevation, fov_degrees=fov)))
    fills = _plausibilities(model, drawing, [camera for _, camera in tried])
    best, (near, camera) = max(zip(fills, tried, strict=True), key=lambda one: one[0])
    return (near, camera) if best > fill + _GAIN else (name, VIEWPOINTS[name])


def opposite(name: str) -> str:
    """The three-quarter viewpoint half a turn about y from another one."""
    return QUARTER_VIEWS[(QUARTER_VIEWS.index(name) + len(QUARTER_VIEWS) // 2) % len(QUARTER_VIEWS)]


def _ranked(model: Model, drawing: NDArray[np.uint8]) -> list[tuple[float, str]]:
    fills = _plausibilities(model, drawing, [VIEWPOINTS[name] for name in QUARTER_VIEWS])
    return sorted(zip(fills, QUARTER_VIEWS, strict=True), key=lambda one: one[0], reverse=True)


def _plausibilities(model: Model, drawing: NDArray[np.uint8], cameras: Sequence[Camera]) -> list[float]:
    sketches = Sketches(drawing[None], pack_cameras(cameras[:1]))
    volumes = model.first_predictions([sketches.seen_by(pack_cameras([camera])) for camera in cameras])
    return [outline_iou(volume, camera, drawing) for volume, camera in zip(volumes, cameras, strict=True)]
