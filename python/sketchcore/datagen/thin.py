"""What is thinner than a voxel and falls between their centres: sheets, rods, the walls of vessels.

They are drawn, so they have to be somewhere. Where no voxel nearby is wholly inside, and none along the surface's
normal by one half, the voxel that a point of the surface lies in is filled. What voxels show already stays as it is:
a slab that covers a voxel's centre has more than one half of it inside, or goes on in the next.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from sketchcore import _core

SIDE = 64
SPACING = 0.4
"""Points of the surface are at most so far apart, in voxels."""
WHOLE, HALF = 58, 32
"""Of a voxel's 64 points, so many make it a part of what is thick, and of what has been seen."""
_MOST = 4_000_000


def fill_thin(
    vertices: NDArray[np.floating], faces: NDArray[np.integer], world: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """A world volume with the parts of a mesh that it misses.

    Args:
        vertices: [n, 3], placed in the world by the 120 % rule.
        faces: [m, 3].
        world: uint8 [64, 64, 64], the mesh's voxels.

    Returns:
        uint8 [64, 64, 64], a new array.
    """
    places = np.ascontiguousarray(vertices, np.float64)
    shares = _core.mesh_shares(places, np.ascontiguousarray(faces, np.int64))
    # Beside what is thick nothing is thin: edges of boxes pass through voxels that are not half full.
    seen = np.where(maximum_filter(shares, 3) >= WHOLE, np.uint8(64), shares)
    filled = world.copy()
    for points, normals in surface_points(places, faces):
        _fill(filled, seen, points, normals)
    return filled


def touched(vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> NDArray[np.bool_]:
    """The voxels that a mesh's surface passes through, bool [64, 64, 64]: no way from face to face leads through it."""
    grid = np.zeros((SIDE, SIDE, SIDE), bool)
    for points, _ in surface_points(vertices, faces):
        grid[_at(points)] = True
    return grid


def surface_points(
    vertices: NDArray[np.floating], faces: NDArray[np.integer]
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Points all over a mesh, at most `SPACING` apart: [faces, points, 3] in voxels, and normals [faces, 3]."""
    corners = (np.asarray(vertices, np.float64)[faces] + 0.5) * SIDE
    # From the longest edge, a to b, row by row to the corner that is left.
    edges = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=-1)
    order = (edges.argmax(axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(corners, order[:, :, None], axis=1).swapaxes(0, 1)
    across = np.cross(b - a, c - a)
    area = np.linalg.norm(across, axis=1)
    longest = edges.max(axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = np.ceil(np.stack([longest, area / longest], axis=1) / SPACING)
    for along, up in np.unique(steps[area > 0], axis=0).astype(int):
        which = np.flatnonzero((steps == (along, up)).all(axis=1) & (area > 0))
        s, t = (at.ravel() for at in np.meshgrid(np.arange(along + 1) / along, np.arange(up + 1) / up))
        weights = np.stack([(1 - s) * (1 - t), s * (1 - t), t], axis=1)
        for some in np.array_split(which, 1 + len(which) * len(weights) // _MOST):
            ends = np.stack([a[some], b[some], c[some]], axis=1)
            yield weights @ ends, across[some] / area[some, None]


def _fill(
    filled: NDArray[np.uint8], seen: NDArray[np.uint8], points: NDArray[np.float64], normals: NDArray[np.float64]
) -> None:
    """Fills the voxels of points, [faces, points, 3] in voxels, unless something is seen there or along the normal."""
    missed = np.ones(points.shape[:2], bool)
    for step in (-1.0, -0.5, 0.0, 0.5, 1.0):
        missed &= seen[_at(points + step * normals[:, None])] < HALF
    filled[_at(points[missed])] = 1


def _at(points: NDArray[np.float64]) -> tuple[NDArray[np.int64], ...]:
    at = np.clip(points, 0, SIDE - 1).astype(np.int64)
    return at[..., 0], at[..., 1], at[..., 2]
