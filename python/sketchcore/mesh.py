"""A volume's iso-surface as a closed triangle mesh, and the files that keep it (paper, section 5.3)."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from sketchcore import _core
from sketchcore.atomic import write_atomically
from sketchcore.volume import as_probability

# Imported by what needs them: half a second and 40 MB, and a reconstruction alone makes no mesh.
if TYPE_CHECKING:
    import trimesh

MESH_SUFFIXES = (".glb", ".obj", ".stl", ".ply")
"""File formats that `save_mesh` writes."""

# No value closer to the level than this: else vertices of several cells fall onto one voxel centre, and faces
# between them have no area.
_CLEARANCE = 0.02

# Strength of the filter, chosen on boxes and cylinders, straight and slanted, from binary and from fractional
# volumes: the strongest that still leaves the edges of a box alone (see tests/test_mesh.py).
_ITERATIONS = 8
_SIGMA_VOXELS = 1.25
_SIGMA_NORMAL = 0.35


def extract_mesh(probability: ArrayLike, level: float = 0.5, smooth: bool = True) -> trimesh.Trimesh:
    """The surface where a volume crosses a level, watertight for any volume, normals outward.

    Marching cubes (Lorensen and Cline, 1987), then a bilateral filter against its stair steps
    (rust/src/mesh.rs). Outside the grid the volume counts as 0, so the mesh closes at the grid's border.
    A voxel *at* the level is outside, as it is for `iou`.

    Args:
        probability: [x, y, z], a cube [n, n, n] in [0, 1]; voxel (i, j, k) is centred on
            ((i, j, k) + 1/2)/n - 1/2.
        level: more than 0 and less than 1.
        smooth: filter the stair steps; the faces stay the same, the vertices move.

    Returns:
        A mesh in world units.

    Raises:
        ValueError: if no voxel is above the level, the level lies outside (0, 1), or the volume is none.
    """
    import trimesh
    from skimage.measure import marching_cubes

    volume = as_probability(probability)
    if not 0 < level < 1:
        raise ValueError(f"level must lie between 0 and 1, got {level}")
    inside = volume > level
    if not inside.any():
        raise ValueError(f"the volume is empty: no voxel is above {level:g}, so it has no surface")
    clear = np.where(inside, np.maximum(volume, level + _CLEARANCE), np.minimum(volume, level - _CLEARANCE))
    # "lorensen" decides a cell by its corners' signs alone, so neighbours agree on their common face. The
    # default, "lewiner", weighs values, and leaves holes and edges of four faces where they tie.
    corners, faces, _, _ = marching_cubes(  # type: ignore[no-untyped-call]
        np.pad(clear, 1).astype(np.float32), level, gradient_direction="ascent", method="lorensen"
    )
    n = len(volume)
    vertices = np.ascontiguousarray((corners.astype(np.float64) - 0.5) / n - 0.5)
    if smooth:
        vertices = _core.bilateral(
            vertices, faces.astype(np.uint32, order="C"), _ITERATIONS, _SIGMA_VOXELS / n, _SIGMA_NORMAL
        )
    return trimesh.Trimesh(vertices, faces, process=False)


def save_mesh(mesh: trimesh.Trimesh, path: str | os.PathLike[str]) -> None:
    """Write a mesh as `.glb`, `.obj`, `.stl` or `.ply`, by the path's suffix, whole or not at all.

    Raises:
        ValueError: for another suffix.
        FileNotFoundError: if the folder does not exist.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in MESH_SUFFIXES:
        raise ValueError(f"a mesh is saved as {', '.join(MESH_SUFFIXES)}; got {Path(path).name!r}")
    # A file that trimesh itself opens stays open where the disk is full.
    content: Any = mesh.export(file_type=suffix[1:])
    write_atomically(path, content.encode() if isinstance(content, str) else content)
