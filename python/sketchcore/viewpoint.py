"""Where a drawing was made from: one of the eight three-quarter viewpoints, or a camera somewhere else.

A viewpoint is as plausible as the solid that is predicted from it fills the drawing's outline when seen from it (the
prediction as it is, for once outlines are heeded every solid fills them), as the prediction is sure of itself, and as
the drawing's straight lines run along the axes that it sees (`perspective.py`). Cameras that stand elsewhere are those
that lines speak for (`calibration.py`); the place of the solid helps to choose among them (`nets/placement.py`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sketchcore.calibration import CARRIED, cameras_spoken_for, likelihoods
from sketchcore.camera import QUARTER_VIEWS, VIEWPOINTS, Camera, pack_cameras
from sketchcore.nets.model import Model
from sketchcore.nets.placement import CAMERA, expected_iou, plausibility
from sketchcore.nets.sketches import Sketches
from sketchcore.outline import outline_iou
from sketchcore.perspective import Lines

_CONFIDENCE, _LINES = 0.25, 0.01
"""What a prediction's confidence counts for beside the outline that it fills, and lines' likelihood (its logarithm)."""
_POOR = 0.86
"""A viewpoint from which less of the outline is filled may not be where the drawing was made from."""
_LIKELIER = 5.0
"""Nor may one when lines are so much likelier (the logarithm) from another camera than from any near it."""
_LINES_ANYWHERE = 0.006
"""What lines' likelihood counts for beside a prediction's plausibility, from cameras all around."""
_GAIN = 0.03
"""How much better both together must be for another camera."""


def guess_viewpoint(model: Model, drawing: NDArray[np.uint8]) -> list[str]:
    """The names of the eight three-quarter viewpoints, most plausible first.

    Args:
        model: the network.
        drawing: uint8 [256, 256], ink 255 on 0.
    """
    return [name for name, _ in _ranked(model, drawing, Lines.of(drawing, VIEWPOINTS[QUARTER_VIEWS[0]]))]


def guess_camera(model: Model, drawing: NDArray[np.uint8]) -> tuple[str, Camera]:
    """The most plausible viewpoint's name, and its camera or one near it.

    Where the viewpoint leaves part of the outline empty, or lines run along other axes than it sees, cameras over half
    the circle are tried as well, from lower down and with a narrower field of view too: people draw from where they
    like, but not face on. The other half says the same of many objects.

    Args:
        model: the network.
        drawing: uint8 [256, 256], ink 255 on 0.
    """
    looked = Lines.of(drawing, VIEWPOINTS[QUARTER_VIEWS[0]])
    name, fill = _ranked(model, drawing, looked)[0]
    viewpoint = VIEWPOINTS[name]
    lines = looked.seen_by(viewpoint)
    _, [near] = lines.fit(np.zeros((1, 6)), np.array([CARRIED]))
    found, likeliest = cameras_spoken_for(lines)
    if fill >= _POOR and likeliest <= near + _LIKELIER:
        return name, viewpoint
    cameras = [viewpoint, *found]
    sketches = _seen_by(drawing, cameras)
    scores = [
        plausibility(volume, seen, CAMERA) + _LINES_ANYWHERE * likely
        for volume, seen, likely in zip(
            model.first_predictions(sketches), sketches, likelihoods(lines, cameras), strict=True
        )
    ]
    best = max(range(len(cameras)), key=lambda i: scores[i])
    if scores[best] <= scores[0] + _GAIN:
        return name, viewpoint
    return _nearest(cameras[best]), cameras[best]


def _nearest(camera: Camera) -> str:
    """The three-quarter viewpoint that looks most nearly the same way."""
    return max(QUARTER_VIEWS, key=lambda name: float(camera.rotation[2] @ VIEWPOINTS[name].rotation[2]))


def opposite(name: str) -> str:
    """The three-quarter viewpoint half a turn about y from another one."""
    return QUARTER_VIEWS[(QUARTER_VIEWS.index(name) + len(QUARTER_VIEWS) // 2) % len(QUARTER_VIEWS)]


def _ranked(model: Model, drawing: NDArray[np.uint8], lines: Lines) -> list[tuple[str, float]]:
    """The viewpoints, most plausible first, and how far from each the solid fills the outline."""
    cameras = [VIEWPOINTS[name] for name in QUARTER_VIEWS]
    volumes = list(model.first_predictions(_seen_by(drawing, cameras)))
    fills = [outline_iou(volume, camera, drawing) for volume, camera in zip(volumes, cameras, strict=True)]
    scores = [
        fill + _CONFIDENCE * expected_iou(volume) + _LINES * likely
        for fill, volume, likely in zip(fills, volumes, likelihoods(lines, cameras), strict=True)
    ]
    best_first = sorted(range(len(cameras)), key=lambda i: -scores[i])
    return [(QUARTER_VIEWS[i], fills[i]) for i in best_first]


def _seen_by(drawing: NDArray[np.uint8], cameras: Sequence[Camera]) -> list[Sketches]:
    looked = Sketches(drawing[None], pack_cameras(cameras[:1]))
    return [looked.seen_by(pack_cameras([camera])) for camera in cameras]
