"""A mesh from elsewhere as a data set keeps it: placed in the world, cleaned, voxelised; and what was found there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sketchcore import _core
from sketchcore.camera import VIEWPOINTS
from sketchcore.datagen.hollow import hollow_out
from sketchcore.datagen.thin import fill_thin
from sketchcore.datagen.upright import facing, symmetry, turn
from sketchcore.grids import CREASE_DEGREES

COVER = 1.2
"""The world's cube is 120 % of a mesh's largest side."""
FILLED = 0.5
"""A mesh whose voxels fill less of its outline than this is left out: most of it is thinner than a voxel."""
_SEEN_FROM = ("quarter-037", "right", "top")


@dataclass(frozen=True)
class Placed:
    """A mesh in the world.

    Attributes:
        vertices: float32 [n, 3], each one in another place.
        faces: int32 [m, 3].
        world: uint8 [64, 64, 64], 0 or 1.
        found: what was repaired and measured, plain data.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    world: NDArray[np.uint8]
    found: dict[str, Any]


class LeftOutError(ValueError):
    """Why a mesh makes no object of a data set."""


def place(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], up: str, front: str | None, thin: bool = True
) -> Placed:
    """Turns, scales and centres a mesh, and takes away what is of no use in it.

    Args:
        vertices: float64 [n, 3], as in the file.
        faces: int64 [m, 3].
        up: one of `upright.AXES`.
        front: likewise, in the file's axes; None to look for it (`upright.facing`).
        thin: fill what falls between the voxels' centres (`thin.fill_thin`).

    Raises:
        LeftOutError: for a mesh without faces or extent, with an index out of range or coordinates that are not finite,
            that encloses nothing, or whose voxels fill little of its outline.
    """
    found: dict[str, Any] = {"faces_in_file": len(faces), "up": up}
    vertices, faces = _sound(vertices, faces)
    turned = vertices @ turn(up, front).T
    points, corners, cleaned = _clean(turned, faces)
    if front is None:
        # Which way it looks is read off the voxels.
        ahead = facing(_voxels(points, corners, thin)[0])
        points, corners, cleaned = _clean(turned @ turn("y", ahead).T, faces)
        front = _named(turn(up).T @ turn("y", ahead)[0])
    world, changed = _voxels(points, corners, thin)
    filled = _filled(points, corners, world)
    found |= cleaned | {
        "front": front,
        "faces": len(corners),
        **_edges(corners),
        "occupied": float(world.mean()),
        **changed,
        "symmetry": round(symmetry(world), 4),
        "filled": round(filled, 4),
    }
    if filled < FILLED:
        raise LeftOutError(f"too thin for voxels: they fill {filled:.0%} of its outline, not {FILLED:.0%}")
    return Placed(points, corners, world, found)


def _named(vector: NDArray[np.float64]) -> str:
    axis = int(np.argmax(np.abs(vector)))
    return ("-" if vector[axis] < 0 else "") + "xyz"[axis]


def _sound(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The vertices that faces name, and the faces; raises for what cannot be mended."""
    if len(faces) == 0:
        raise LeftOutError("no faces")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise LeftOutError(f"a face names a vertex that is not there (of {len(vertices)})")
    used, again = np.unique(faces, return_inverse=True)
    vertices = vertices[used]
    if not np.isfinite(vertices).all():
        raise LeftOutError("NaN or infinite coordinates")
    if not np.ptp(vertices, axis=0).max() > 0:
        raise LeftOutError("no extent: all vertices are in one place")
    return vertices, again.reshape(-1, 3)


def _clean(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float32], NDArray[np.int32], dict[str, int]]:
    """Placed by the 120 % rule, same vertices merged, faces without area and doubled ones taken away."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    placed = ((vertices - (low + high) / 2) / (COVER * (high - low).max())).astype(np.float32)
    points, names = np.unique(placed, axis=0, return_inverse=True)
    corners = names[faces].reshape(-1, 3)
    flat = (corners == np.roll(corners, 1, axis=1)).any(axis=1)
    corners = corners[~flat]
    if len(corners) == 0:
        raise LeftOutError("no face has an area")
    kept = corners
    if not _edges(corners)["closed"]:
        # Two solids that share a face are closed; else one of both sides is enough.
        _, first = np.unique(np.sort(corners, axis=1), axis=0, return_index=True)
        kept = corners[np.sort(first)]
    found = {
        "merged_vertices": len(placed) - len(points),
        "degenerate_faces": int(flat.sum()),
        "doubled_faces": len(corners) - len(kept),
    }
    return points, np.ascontiguousarray(kept, np.int32), found


def _voxels(
    points: NDArray[np.float32], corners: NDArray[np.int32], thin: bool
) -> tuple[NDArray[np.uint8], dict[str, int]]:
    """The voxels of a mesh, how many of them are there for what is thinner, and how many are not for what is hollow."""
    solid = _core.voxelize_mesh(points.astype(np.float64), corners.astype(np.int64))
    world = fill_thin(points, corners, solid) if thin else solid
    if not world.any():
        raise LeftOutError("encloses nothing: a sheet, or thinner than a voxel all over")
    hollow = hollow_out(points, corners, world)
    added, taken = int((world > solid).sum()), int((hollow < world).sum())
    return hollow, {"thin_voxels": added, "hollow_voxels": taken}


def _edges(corners: NDArray[np.int32]) -> dict[str, Any]:
    """Edges that have a single face, and those whose two faces disagree which way round they are.

    And whether the mesh is closed: each edge is run along as often one way as the other (rust/src/solid.rs).
    """
    runs = np.stack([corners, np.roll(corners, -1, axis=1)], axis=-1).reshape(-1, 2)
    _, which, faces = np.unique(np.sort(runs, axis=1), axis=0, return_inverse=True, return_counts=True)
    forward = np.bincount(which.ravel(), runs[:, 0] < runs[:, 1], len(faces))
    balanced = 2 * forward == faces
    return {
        "open_edges": int((faces == 1).sum()),
        "turned_edges": int(((faces == 2) & ~balanced).sum()),
        "closed": bool(balanced.all()),
    }


def _filled(points: NDArray[np.float32], corners: NDArray[np.int32], world: NDArray[np.uint8]) -> float:
    """The least share of the mesh's outline that its voxels fill, seen from three sides."""
    vertices, faces = points.astype(np.float64), corners.astype(np.int64)
    shares = []
    for name in _SEEN_FROM:
        camera = VIEWPOINTS[name].packed
        depth, _ = _core.mesh_buffers(vertices, faces, CREASE_DEGREES, camera, 64)
        voxels = _core.to_camera_grid(world[None].astype(np.float32), camera[None])[0]
        seen = np.isfinite(depth)
        shares.append(float((voxels.max(axis=0)[seen] > 0).mean()) if seen.any() else 0.0)
    return min(shares)
