"""Vessels of a single wall, open somewhere: drawings look into them, so they are hollow.

An open mesh is voxelised as if it were closed. That is right for what is open where nobody looks, like the underside of
a seat, and for cracks. But where the named viewpoints see into it, a drawing shows the hollow. So a part of the inside,
bounded by the surface, is taken out where enough of it is seen.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, label, minimum_filter

from sketchcore import _core
from sketchcore.camera import VIEWPOINTS
from sketchcore.datagen.thin import SIDE, touched
from sketchcore.grids import CREASE_DEGREES

SEEN = 0.1
"""Of the voxels of a hollow, the share that some viewpoint sees; cracks show less."""
LEAST = 500
"""Voxels of the smallest hollow."""
_PIXELS = 256
"""Along each side of a drawing, in which a focal length is given."""


def hollow_out(
    vertices: NDArray[np.floating], faces: NDArray[np.integer], world: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """A mesh's solid without what drawings show to be empty; the walls around that are a voxel thick at least.

    Args:
        vertices: [n, 3], placed in the world by the 120 % rule.
        faces: [m, 3].
        world: uint8 [64, 64, 64], the mesh's voxels.

    Returns:
        uint8 [64, 64, 64], a new array.
    """
    places, corners = np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.int64)
    walls = touched(places, corners)
    inside = (world > 0) & ~walls
    parts, count = label(inside)
    if count == 0:
        return world.copy()
    at = np.argwhere(inside)
    seen = np.zeros(len(at), bool)
    for camera in VIEWPOINTS.values():
        depth, _ = _core.mesh_buffers(places, corners, CREASE_DEGREES, camera.packed, _PIXELS)
        # Nothing is in front of it, nor beside that: not through a crack.
        free = minimum_filter(depth, 3)
        points = ((at + 0.5) / SIDE - 0.5 - camera.position) @ camera.rotation.T
        across = np.floor(points[:, :2] / points[:, 2:] * camera.focal + _PIXELS / 2).astype(int)
        column, row = np.clip(across, 0, _PIXELS - 1).T
        seen |= points[:, 2] < free[row, column]
    which = parts[inside]
    size = np.bincount(which, minlength=count + 1)
    shown = np.bincount(which, seen, minlength=count + 1)
    chosen = (size >= LEAST) & (shown >= SEEN * size)
    chosen[0] = False
    empty = chosen[parts]
    made = world.copy()
    made[empty] = 0
    made[walls & binary_dilation(empty, np.ones((3, 3, 3)))] = 1
    return made
