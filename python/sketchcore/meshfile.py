"""Mesh files that come from elsewhere, as they stand: read by trimesh, one mesh each."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

# Half a second and 40 MB: imported when a file is read.
if TYPE_CHECKING:
    import trimesh

READ_SUFFIXES = (".obj", ".off", ".stl", ".ply", ".glb", ".gltf")
"""File formats that `load_mesh` reads."""


def load_mesh(path: str | os.PathLike[str]) -> trimesh.Trimesh:
    """The mesh in a file: the parts of a scene put together where they stand, polygons cut into triangles.

    Nothing is repaired, scaled or turned.

    Raises:
        FileNotFoundError: if there is no such file.
        ValueError: for another suffix, a file that cannot be read as what its suffix says, or one without faces.
    """
    import trimesh

    file = Path(path)
    if file.suffix.lower() not in READ_SUFFIXES:
        raise ValueError(f"a mesh is read from {', '.join(READ_SUFFIXES)}; got {file.name!r}")
    if not file.is_file():
        raise FileNotFoundError(f"no mesh at {file}")
    try:
        scene = trimesh.load_scene(file, process=False, skip_materials=True)
        parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh) and len(part.faces)]
    except Exception as error:  # readers raise whatever their parsing stumbled over
        raise ValueError(f"{file} cannot be read as {file.suffix.lower()}: {_reason(error)}") from error
    if not parts:
        raise ValueError(f"{file} has no faces; a mesh needs triangles or polygons")
    mesh: trimesh.Trimesh = parts[0] if len(parts) == 1 else trimesh.util.concatenate(parts)  # type: ignore[assignment]
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False, validate=False)


def _reason(error: Exception) -> str:
    text = str(error).strip().split("\n")[0]
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
