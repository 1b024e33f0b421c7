"""Mesh files of every format, and what is done with the meshes: voxels, buffers, data sets. First byte: the format."""

from __future__ import annotations

import base64
import json
from random import Random

import numpy as np
import trimesh
import trimesh.exchange.load

import sketchcore as sk
from harness import SCRATCH, Target
from mutations import dump, of_bytes, of_json
from sketchcore.datagen import cleaning
from sketchcore.meshfile import READ_SUFFIXES, load_mesh

_FOLDER = SCRATCH / "meshes"


def attempt(data: bytes) -> None:
    """Reads a file and does everything with it that is done with meshes."""
    _FOLDER.mkdir(exist_ok=True)
    (_FOLDER / "part.bin").write_bytes(_buffer())
    path = _FOLDER / f"mesh{READ_SUFFIXES[data[0] % len(READ_SUFFIXES)] if data else '.obj'}"
    path.write_bytes(data[1:])
    mesh = load_mesh(path)
    assert mesh.vertices.shape[1:] == mesh.faces.shape[1:] == (3,)
    voxels = sk.voxelize(mesh)
    assert voxels.max() <= 1
    camera = sk.VIEWPOINTS["quarter-037"]
    sk.buffers(mesh, camera, 32)
    sk.draw(mesh, camera)
    vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
    cleaning.place(vertices, faces, "y", None)


def _box() -> trimesh.Trimesh:
    return trimesh.creation.box((1.0, 2.0, 0.5))


def _buffer() -> bytes:
    box = _box()
    return np.asarray(box.vertices, "<f4").tobytes() + np.asarray(box.faces, "<u2").tobytes()


def _gltf(uri: str | None) -> dict[str, object]:
    buffer = {"byteLength": 168} | ({} if uri is None else {"uri": uri})
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0, 2]}],
        "nodes": [
            {"mesh": 0, "children": [1], "translation": [1, 0, 0], "rotation": [0, 0, 0, 1]},
            {"mesh": 0, "scale": [1, 2, 1]},
            {"name": "camera", "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], "mesh": 0},
        ],
        "meshes": [{"name": "box", "primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 4}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [-1] * 3, "max": [1] * 3},
            {"bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR", "byteOffset": 0},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 96, "byteStride": 12},
            {"buffer": 0, "byteOffset": 96, "byteLength": 72},
        ],
        "buffers": [buffer],
        "images": [{"uri": "texture.png"}],
        "materials": [{"name": "wood", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
    }


def _glb(tree: bytes, binary: bytes) -> bytes:
    tree += b" " * (-len(tree) % 4)
    chunks = len(tree).to_bytes(4, "little") + b"JSON" + tree + len(binary).to_bytes(4, "little") + b"BIN\0" + binary
    return b"glTF" + (2).to_bytes(4, "little") + (12 + len(chunks)).to_bytes(4, "little") + chunks


def seeds() -> list[bytes]:
    """A box in every format, and files of the parts of formats that few writers use."""
    box, kinds = _box(), {suffix: bytes([i]) for i, suffix in enumerate(READ_SUFFIXES)}
    written = {suffix: box.export(file_type=suffix[1:]) for suffix in (".obj", ".off", ".stl", ".ply", ".glb")}
    files = [kinds[s] + (text.encode() if isinstance(text, str) else text) for s, text in written.items()]
    files.append(kinds[".ply"] + box.export(file_type="ply", encoding="ascii"))
    files.append(kinds[".stl"] + box.export(file_type="stl_ascii").encode())
    files.append(
        kinds[".obj"]
        + b"mtllib a.mtl\no one\nv 0 0 0\nv 1 0 0 0.5 0.5 0.5\nv 1 1 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvn 0 0 1\nusemtl a\n"
        + b"f 1/1/1 2/1/1 3/1/1 4/1/1\ng two\nf -1 -2 -3\nf 1//1 2//1 5//1\nf 5 4 3 2 1\nl 1 2\np 1\n"
    )
    data = "data:application/octet-stream;base64," + base64.b64encode(_buffer()).decode()
    files += [kinds[".gltf"] + dump(_gltf(uri)) for uri in ("part.bin", data)]
    files.append(kinds[".glb"] + _glb(dump(_gltf(None)), _buffer()))
    return files


def mutate(data: bytes, random: Random) -> bytes:
    """The tree of glTF as JSON; what is binary or text as bytes."""
    suffix = READ_SUFFIXES[data[0] % len(READ_SUFFIXES)] if data else ""
    if suffix not in (".gltf", ".glb") or random.random() < 0.15:
        return data[:1] + of_bytes(data[1:], random)
    try:
        if suffix == ".gltf":
            return data[:1] + dump(of_json(json.loads(data[1:]), random))
        size = int.from_bytes(data[13:17], "little")
        return data[:1] + _glb(dump(of_json(json.loads(data[21 : 21 + size]), random)), data[29 + size :])
    except (ValueError, RecursionError):
        return data[:1] + of_bytes(data[1:], random)


TARGET = Target(attempt, seeds, mutate, (ValueError,), megabytes=1024)
