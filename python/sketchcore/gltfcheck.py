"""What a glTF file asks for, added up before it gets any of it: a few bytes can name gigabytes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from sketchcore.untrusted import parse_json

MAX_STEPS = 20_000
"""From the nodes of a scene up to its root, all together: so long takes it to place them."""
_BYTES = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_NUMBERS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}

Tree = Mapping[str, Any]


def check_gltf(content: bytes, binary: bool, most_bytes: int, most_triangles: int) -> None:
    """Refuses a file whose buffers, or whose meshes placed in the scene, are larger than meshes may be.

    Args:
        content: of a .gltf, or a .glb if it is binary.
        binary: which of both.
        most_bytes: of all accessors and of all views.
        most_triangles: of all meshes, and of all that nodes place.

    Raises:
        ValueError: for those, or what is no glTF.
    """
    text = content[20 : 20 + int.from_bytes(content[12:16], "little")] if binary else content
    tree = parse_json(text, "its JSON")
    if not isinstance(tree, dict):
        raise ValueError("its JSON is no object")
    views, accessors, meshes, nodes = (_rows(tree, name) for name in ("bufferViews", "accessors", "meshes", "nodes"))
    counts = [_count(accessor, "count") for accessor in accessors]
    sizes = [_BYTES.get(a.get("componentType", 0), 4) * _NUMBERS.get(a.get("type", ""), 16) for a in accessors]
    wanted = sum(count * size for count, size in zip(counts, sizes, strict=True))
    if max(wanted, sum(_count(view, "byteLength") for view in views)) > most_bytes:
        raise ValueError(f"its numbers would take more than {most_bytes // 2**20} MiB")
    triangles = [sum(_triangles(one, counts) for one in _rows(mesh, "primitives")) for mesh in meshes]
    placed = _placed(tree, nodes)
    drawn = sum(triangles[nodes[node]["mesh"]] for node in placed if "mesh" in nodes[node])
    if max(drawn, sum(triangles)) > most_triangles:
        raise ValueError(f"a mesh may have up to {most_triangles} triangles, this one would have {drawn}")


def _placed(tree: Tree, nodes: list[Tree]) -> list[int]:
    """The nodes of the scene that is shown."""
    scenes = _rows(tree, "scenes")
    level = list(scenes[tree.get("scene", 0)].get("nodes", ())) if scenes else []
    placed: dict[int, None] = {}
    depth = steps = 0
    while level:
        depth += 1
        steps += depth * len(level)
        if steps > MAX_STEPS:
            raise ValueError(f"its nodes hang on each other in more than {MAX_STEPS} steps")
        for node in level:
            if node in placed:
                raise ValueError("a node hangs on two others, or on itself")
            placed[node] = None
        level = [child for node in level for child in nodes[node].get("children", ())]
    return list(placed)


def _rows(tree: Tree, name: str) -> list[Tree]:
    rows = tree.get(name, [])
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise ValueError(f"its {name} are no list of objects")
    return rows


def _count(row: Tree, name: str) -> int:
    count = row.get(name)
    if type(count) is not int or count < 0:
        raise ValueError(f"a {name} in it is no whole number, 0 or more: {count!r:.40}")
    return count


def _triangles(primitive: Tree, counts: list[int]) -> int:
    """At most: a strip has nearly as many as it has corners."""
    named = [*primitive["attributes"].values(), *([primitive["indices"]] if "indices" in primitive else [])]
    most = max((counts[number] for number in named), default=0)
    return most if primitive.get("mode", 4) == 5 else most // 3
