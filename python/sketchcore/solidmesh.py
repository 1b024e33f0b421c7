"""A shape's surface as a mesh, exactly as its primitives say: they are tessellated and combined by Manifold."""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING

import numpy as np
import trimesh
from numpy.typing import NDArray

from sketchcore.shape import Cuboid, Cylinder, Frustum, Primitive, Shape, Torus, Wedge

if TYPE_CHECKING:
    import manifold3d

Floats = NDArray[np.float64]
_AXES = "xyz"
_TUBE = 20
"""Flat faces around the tube of a torus."""


def require_manifold() -> None:
    """Says how to get what meshes of shapes need.

    Raises:
        ImportError: if it is not there.
    """
    if find_spec("manifold3d") is None:
        raise ImportError("meshes of shapes need manifold3d; install it by: pip install 'sketchcore[meshes]'")


def to_mesh(shape: Shape, sections: int = 48) -> trimesh.Trimesh:
    """The surface of a shape: watertight, faces outwards; see `Shape.to_mesh`.

    Neighbours of a sort are united before they meet those of the other.
    """
    if sections < 3:
        raise ValueError(f"what is round has at least 3 flat faces around, got {sections}")
    require_manifold()
    import manifold3d
    from manifold3d import Manifold, OpType

    solid = Manifold()
    items = list(shape.primitives)
    while items:
        op = items[0].op
        run = next((i for i, item in enumerate(items) if item.op != op), len(items))
        parts = [_solid(item, sections) for item in items[:run]]
        del items[:run]
        solid = Manifold.batch_boolean([solid, *parts], OpType.Add if op == "add" else OpType.Subtract)
    if solid.is_empty():
        raise ValueError("nothing is left of the shape: what is added is subtracted again")
    assert solid.status() == manifold3d.Error.NoError
    mesh = solid.to_mesh64()
    return trimesh.Trimesh(np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts), process=False)


def _solid(item: Primitive, sections: int) -> manifold3d.Manifold:
    from manifold3d import Manifold, Mesh64

    vertices, faces = _ring_of(item, sections) if isinstance(item, Torus) else _prism(item, sections)
    # What is told by an axis and the two others is mirrored for y.
    if isinstance(item, Cuboid) or item.axis != "y":
        faces = faces[:, ::-1]
    mesh = Mesh64(vertices, faces.astype(np.uint64))
    mesh.merge()
    return Manifold(mesh)


def _placed(item: Primitive, u: Floats, v: Floats, along: Floats) -> Floats:
    """World coordinates, [..., 3], of offsets from a primitive's centre along the two cross axes and its own."""
    axis = 0 if isinstance(item, Cuboid) else _AXES.index(item.axis)
    points = np.stack([u, v, along], axis=-1)[..., np.argsort([*(a for a in range(3) if a != axis), axis])]
    placed: Floats = points + np.array(item.center)
    return placed


def _prism(item: Primitive, sections: int) -> tuple[Floats, NDArray[np.int64]]:
    """A lower and an upper section, each [n, 2], and the faces between them and across them."""
    axis = 0 if isinstance(item, Cuboid) else _AXES.index(item.axis)
    u, v = (item.half[a] for a in range(3) if a != axis)
    round_ = isinstance(item, Cylinder) or (isinstance(item, Frustum) and item.round)
    section = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    if round_:
        turn = 2 * np.pi * (np.arange(sections) + 0.5) / sections
        # Of the circle's area: the faces lie as much outside it as inside.
        section = np.stack([np.cos(turn), np.sin(turn)], axis=1) * np.sqrt(turn[0] * 2 / np.sin(turn[0] * 2))
    if isinstance(item, Wedge):
        section = section[(section * item.corner).sum(axis=1) >= 0]
    section = section * (u, v)
    shear, taper = np.zeros(2), np.zeros(2)
    if isinstance(item, Frustum):
        shear, taper = np.array(item.shear), np.array(item.taper)
    ends = [section * (1 + side * taper) + side * shear for side in (-1, 1)]
    n = len(section)
    points = np.concatenate(ends)
    along = np.repeat([-item.half[axis], item.half[axis]], n)
    i = np.arange(n)
    j = (i + 1) % n
    sides = [[i, i + n, j], [j, i + n, j + n]]
    caps = [[0 * i[2:], i[1:-1], i[2:]], [0 * i[2:] + n, i[2:] + n, i[1:-1] + n]]
    faces = np.concatenate([np.stack(f, axis=1) for f in (*sides, *caps)])
    return _placed(item, points[:, 0], points[:, 1], along), faces


def _ring_of(item: Torus, sections: int) -> tuple[Floats, NDArray[np.int64]]:
    """Circles around the tube, from one end of the arc to the other, and the faces between them."""
    axis = _AXES.index(item.axis)
    u, v = (item.half[a] for a in range(3) if a != axis)
    from_, to = np.radians(item.arc)
    whole = to - from_ >= 2 * np.pi - 1e-9
    steps = max(3, int(np.ceil((to - from_) / (2 * np.pi) * 2 * sections)))
    turn = from_ + (to - from_) * np.arange(steps + (not whole)) / steps
    around = 2 * np.pi * np.arange(_TUBE) / _TUBE
    radius = 1 - item.tube + item.tube * np.cos(around)
    points = _placed(
        item,
        u * np.cos(turn)[:, None] * radius,
        v * np.sin(turn)[:, None] * radius,
        np.broadcast_to(item.half[axis] * np.sin(around), (len(turn), _TUBE)),
    ).reshape(-1, 3)
    a, b = np.meshgrid(np.arange(steps), np.arange(_TUBE), indexing="ij")
    here, beside = a * _TUBE + b, a * _TUBE + (b + 1) % _TUBE
    step = np.where(a == len(turn) - 1, -a * _TUBE, _TUBE)
    faces = [np.stack([here, beside, here + step], axis=-1), np.stack([beside, beside + step, here + step], axis=-1)]
    if not whole:
        k = np.arange(1, _TUBE - 1)
        last = (len(turn) - 1) * _TUBE
        faces += [np.stack([0 * k, k + 1, k], axis=-1), np.stack([0 * k + last, k + last, k + 1 + last], axis=-1)]
    return points, np.concatenate([f.reshape(-1, 3) for f in faces])
