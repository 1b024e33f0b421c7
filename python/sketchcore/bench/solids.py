"""Triangle mesh to solid by Open3D: 4,096 rays, all of their crossings, and parity."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

SIDE = 64
_CENTERS = ((np.arange(SIDE) + 0.5) / SIDE - 0.5).astype(np.float32)
_BESIDE = (1.3e-6, 2.1e-6)
"""Rays pass a little beside the voxels' centres, so that they meet no edge."""


def torus(triangles: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """A watertight mesh of about so many triangles: a torus, slanted and uneven, so that no ray is anything special."""
    n = max(3, round((triangles / 2) ** 0.5))
    u, v = np.meshgrid(np.arange(n) / n * 2 * np.pi + 0.1, np.arange(n) / n * 2 * np.pi + 0.2, indexing="ij")
    radius = 1 + 0.42 * np.cos(v) + 0.05 * np.sin(3 * u)
    places = np.stack([radius * np.cos(u), 0.42 * np.sin(v) + 0.3 * np.cos(u), radius * np.sin(u)], axis=-1)
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    here, down, right, both = (a % n * n + b % n for a, b in ((i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)))
    faces = np.concatenate([np.stack(f, axis=-1).reshape(-1, 3) for f in ((here, right, both), (here, both, down))])
    return places.reshape(-1, 3), faces.astype(np.int64)


def open3d_solid(faces: NDArray[np.int64]) -> Callable[[NDArray[np.float64]], NDArray[np.uint8]]:
    """A mesh's voxels from its vertices: scaled as ours, its tree built, all crossings listed, on all cores.

    Raises:
        ModuleNotFoundError: if Open3D is not installed.
        RuntimeError: if a library is missing that it needs.
    """
    try:
        import open3d
    except ModuleNotFoundError:
        raise
    except ImportError as error:
        remedy = "apt-get install libusb-1.0-0 libgl1 libx11-6 libgomp1"
        raise RuntimeError(f"Open3D does not start ({error}); on Debian: {remedy}") from None

    rays = np.zeros((SIDE, SIDE, 6), np.float32)
    rays[..., 0], rays[..., 1] = _CENTERS[:, None] + _BESIDE[0], _CENTERS + _BESIDE[1]
    rays[..., 2], rays[..., 5] = -1, 1
    rays = open3d.core.Tensor(rays.reshape(-1, 6))
    corners = open3d.core.Tensor(faces.astype(np.uint32))

    def solid(vertices: NDArray[np.float64]) -> NDArray[np.uint8]:
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        placed = ((vertices - (low + high) / 2) / (1.2 * (high - low).max())).astype(np.float32)
        scene = open3d.t.geometry.RaycastingScene()
        scene.add_triangles(open3d.core.Tensor(placed), corners)
        found = scene.list_intersections(rays)
        # Each crossing turns all voxels above it: counted where it lies, and added up along the column.
        first = np.searchsorted(_CENTERS, found["t_hit"].numpy() - 1)
        crossings = np.bincount(found["ray_ids"].numpy() * (SIDE + 1) + first, minlength=SIDE * SIDE * (SIDE + 1))
        below: NDArray[np.uint8] = np.cumsum(
            crossings.astype(np.uint8).reshape(SIDE, SIDE, SIDE + 1)[..., :SIDE], axis=2, dtype=np.uint8
        )
        below &= 1
        return below

    return solid
