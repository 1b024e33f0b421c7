"""A drawing and the solid made of it, side by side, as a picture to look at."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from sketchcore import _core
from sketchcore.atomic import replacing
from sketchcore.camera import VIEWPOINTS, Camera
from sketchcore.reconstruction import Reconstruction

_LIGHT = np.array([0.35, 0.85, 0.4]) / np.linalg.norm([0.35, 0.85, 0.4])
_FROM = ("quarter-037", "quarter-217", "right", "top")
_PAPER = 250


def shade(probability: NDArray[np.float32], camera: Camera, size: int = 256) -> NDArray[np.uint8]:
    """The 0.5 iso-surface, ray-cast and lit by its normals (paper, section 5.3).

    Args:
        probability: float32 [64, 64, 64], world grid (x, y, z).
        camera: where to look from.
        size: pixels along each side.

    Returns:
        uint8 [size, size], grey on light paper.
    """
    depth, normal = _core.isosurface(probability, 0.5, camera.packed, size)
    toward_eye = np.clip(-(normal @ camera.rotation[2]), 0, 1)
    light = 55 + 115 * np.clip(normal @ _LIGHT, 0, 1) + 60 * toward_eye
    grey: NDArray[np.uint8] = np.where(np.isfinite(depth), light, _PAPER).astype(np.uint8)
    return grey


def side_by_side(reconstruction: Reconstruction) -> NDArray[np.uint8]:
    """The drawings, dark on light, above the solid from the same cameras, then the solid from four sides.

    Returns:
        uint8 [512, width, 3].
    """
    volume = reconstruction.probability
    columns = [
        np.concatenate([255 - drawing, shade(volume, camera)])
        for drawing, camera in zip(reconstruction.drawings, reconstruction.views, strict=True)
    ]
    shaded = [shade(volume, VIEWPOINTS[name]) for name in _FROM]
    columns.append(np.concatenate([_row(shaded[:2]), _row(shaded[2:])]))
    return np.repeat(_row(columns)[:, :, None], 3, axis=2)


def _row(images: Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    return np.concatenate(list(images), axis=1)


def save_picture(reconstruction: Reconstruction, path: str | os.PathLike[str]) -> None:
    """Writes `side_by_side` as a PNG, whole or not at all."""
    with replacing(path) as fresh:
        Image.fromarray(side_by_side(reconstruction)).save(fresh, format="PNG")
