"""A drawing and the solid made of it, side by side, as a picture to look at."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from sketchcore.atomic import replacing
from sketchcore.camera import VIEWPOINTS, Camera
from sketchcore.reconstruction import Reconstruction

_STEPS = 400
_LIGHT = np.array([0.35, 0.85, 0.4]) / np.linalg.norm([0.35, 0.85, 0.4])
_FROM = ("quarter-037", "quarter-217", "right", "top")


def shade(probability: NDArray[np.float32], camera: Camera, size: int = 256) -> NDArray[np.uint8]:
    """Casts rays at the 0.5 iso-surface and shades it by the volumetric gradient (paper, section 5.3).

    Args:
        probability: float32 [64, 64, 64], world grid (x, y, z).
        camera: where to look from.
        size: pixels along each side.

    Returns:
        uint8 [size, size], grey, light background.
    """
    from scipy.ndimage import gaussian_filter, map_coordinates

    soft = gaussian_filter(np.pad(probability, 2), 0.7)
    gradient = np.stack(np.gradient(soft))

    def read(field: NDArray[np.float32], points: NDArray[np.float64]) -> NDArray[np.float32]:
        cells = (points + 0.5) * 64 - 0.5 + 2
        values: NDArray[np.float32] = map_coordinates(field, cells.T, order=1, mode="constant")
        return values

    at = (2 * np.arange(size) + 1) / size - 1
    half = np.tan(np.radians(camera.fov_degrees) / 2)
    x, y = np.meshgrid(at * half, at * half)
    rays = np.stack([x, y, np.ones_like(x)], axis=-1).reshape(-1, 3) @ camera.rotation
    depth = np.full(len(rays), np.inf)
    searching = np.arange(len(rays))
    for z in np.linspace(camera.near, camera.far, _STEPS):
        hit = read(soft, camera.position + rays[searching] * z) > 0.5
        depth[searching[hit]] = z
        searching = searching[~hit]
    seen = np.isfinite(depth)
    points = camera.position + rays[seen] * depth[seen, None]
    normal = -np.stack([read(g, points) for g in gradient], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True) + 1e-9
    facing = np.abs((normal * -rays[seen]).sum(axis=-1)) / np.linalg.norm(rays[seen], axis=-1)
    image = np.full(size * size, 250.0)
    image[seen] = 60 + 110 * np.clip(normal @ _LIGHT, 0, 1) + 60 * facing
    grey: NDArray[np.uint8] = np.clip(image, 0, 255).astype(np.uint8)
    return grey.reshape(size, size)


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
