"""Mesh files that come from elsewhere, as they stand: read by trimesh, one mesh each, within limits."""

from __future__ import annotations

import io
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from sketchcore.gltfcheck import check_gltf
from sketchcore.untrusted import check_size, reason

# Half a second and 40 MB: imported when a file is read.
if TYPE_CHECKING:
    import trimesh

READ_SUFFIXES = (".obj", ".off", ".stl", ".ply", ".glb", ".gltf")
"""File formats that `load_mesh` reads."""
MAX_BYTES = 2**29
"""Of a file, and of all files together that a glTF names."""
MAX_TRIANGLES = 10_000_000
"""Of a mesh, once its parts are put together."""


def load_mesh(path: str | os.PathLike[str]) -> trimesh.Trimesh:
    """The mesh in a file: the parts of a scene put together where they stand, polygons cut into triangles.

    Nothing is repaired, scaled or turned. A .gltf may name files of numbers in its own folder, and in no other; no
    texture or material is read.

    Raises:
        FileNotFoundError: if there is no such file.
        ValueError: for another suffix, a file that cannot be read as what its suffix says, or one without faces; for
            more than 512 MiB or ten million triangles.
    """
    import trimesh

    file = Path(path)
    suffix = file.suffix.lower()
    if suffix not in READ_SUFFIXES:
        raise ValueError(f"a mesh is read from {', '.join(READ_SUFFIXES)}; got {file.name!r}")
    check_size(file, MAX_BYTES, "mesh")
    content = file.read_bytes()
    try:
        if suffix in (".glb", ".gltf"):
            check_gltf(content, suffix == ".glb", MAX_BYTES, MAX_TRIANGLES)
        # Of an open file, nothing but what the resolver gives is read beside it.
        beside: Any = _Beside(file)
        opened = io.BytesIO(content)
        scene = trimesh.load_scene(opened, suffix[1:], resolver=beside, process=False, skip_materials=True)
        meshes = {name: part for name, part in scene.geometry.items() if isinstance(part, trimesh.Trimesh)}
        placed = [name for name in (scene.graph[node][1] for node in scene.graph.nodes_geometry) if name in meshes]
        triangles = sum(len(meshes[name].faces) for name in placed)
        if triangles > MAX_TRIANGLES:
            raise ValueError(f"a mesh may have up to {MAX_TRIANGLES} triangles, this one has {triangles}")
        parts = [part for part in scene.dump() if isinstance(part, trimesh.Trimesh) and len(part.faces)]
        if parts:
            whole: Any = parts[0] if len(parts) == 1 else trimesh.util.concatenate(parts)
            mesh = trimesh.Trimesh(whole.vertices, whole.faces, process=False, validate=False)
            if mesh.vertices.shape[1:] != (3,) or mesh.faces.shape[1:] != (3,):
                raise ValueError(f"its vertices are {mesh.vertices.shape}, its faces {mesh.faces.shape}, not [n, 3]")
            return mesh
    except MemoryError:
        raise
    except Exception as error:  # readers raise whatever their parsing stumbled over
        raise ValueError(f"{file} cannot be read as {suffix}: {reason(error)}") from error
    raise ValueError(f"{file} has no faces; a mesh needs triangles or polygons")


class _Beside:
    """Files in the folder of another one, by their plain names; as many bytes as a mesh may have."""

    def __init__(self, file: Path) -> None:
        self._folder, self._left = file.resolve().parent, MAX_BYTES

    def get(self, name: str) -> bytes:
        path = self._folder / name
        if path.name != name or path.is_symlink() or not path.is_file():
            raise ValueError(f"it needs {name[:80]!r}, which is no file in its folder")
        self._left -= path.stat().st_size
        if self._left < 0:
            raise ValueError(f"the files that it names have more than {MAX_BYTES // 2**20} MiB together")
        return path.read_bytes()

    __getitem__ = get
