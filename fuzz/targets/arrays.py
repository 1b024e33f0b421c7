"""Arrays of any numbers, given to every public function that takes some."""

from __future__ import annotations

from random import Random
from typing import Any

import numpy as np
import skimage.measure
import trimesh
from numpy.typing import NDArray

import sketchcore as sk
from harness import Source, Target
from mutations import of_bytes
from sketchcore.drawing import composition
from sketchcore.mesh import extract_mesh

_LOADED = skimage.measure
_SPECIAL = (
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    1e-308,
    5e-324,
    1e-150,
    1e-20,
    1e20,
    1e150,
    1e308,
    -1e308,
    np.nan,
    np.inf,
    -np.inf,
)
_SHAPES = (
    *((64,) * 3, (1, 64, 64, 64), (256, 256), (2, 256, 256), (32,) * 3, (5, 7), (40, 30, 3), (8, 9, 4)),
    *((), (0,), (0, 64, 64, 64), (64, 64), (1, 1), (3, 3, 3), (128, 128, 128)),
)
_KINDS = ("u1", "?", "i1", "<u2", ">u2", "<i4", "<i8", "<u8", "<f2", "<f4", ">f4", "<f8", "<c8", "S3", "O")


def attempt(data: bytes) -> None:
    """First two bytes: which function; the rest: what it is given."""
    source = Source(data)
    source.choice(_CALLS)(source)


def _floats(source: Source, count: int, scale: Any = 1.0) -> NDArray[np.float64]:
    """Numbers near the scale mostly, and some of the special ones."""
    raw = np.frombuffer(source.take(2 * count), "<i2")
    special = source.below(4) == 0
    return np.where((raw % 8 == 0) & special, np.array(_SPECIAL)[raw // 8 % len(_SPECIAL)], raw / 16384 * scale)


def _mesh(source: Source) -> trimesh.Trimesh:
    vertices = _floats(source, 3 * (source.below(12) + (source.below(50) == 0) * 500)).reshape(-1, 3)
    count = source.below(24)
    faces = np.frombuffer(source.take(3 * count), "i1").reshape(-1, 3).astype(np.int64)
    if source.below(4):
        faces = np.abs(faces) % max(1, len(vertices))
    elif source.below(4) == 0:
        faces *= source.choice((2**40, -(2**40), 2**55))
    return trimesh.Trimesh(vertices, faces, process=False)


def _camera(source: Source) -> sk.Camera:
    match source.below(4):
        case 0:
            return sk.VIEWPOINTS[source.choice(tuple(sk.VIEWPOINTS))]
        case 1:
            return sk.Camera.from_packed(_floats(source, 15))
        case 2:
            turn = np.eye(3)[:, np.roll((0, 1, 2), source.below(3))]
            fov, near, far = np.abs(_floats(source, 3, (90, 1, 1)))
            return sk.Camera(_floats(source, 3), turn, fov, near, far)
        case _:
            azimuth, elevation, distance, fov = _floats(source, 4, (360, 90, 2, 90))
            return sk.Camera.orbit(azimuth, elevation, distance, fov_degrees=fov)


def _shape(source: Source) -> sk.Shape:
    def one() -> Any:
        center, half, op = _floats(source, 3), np.abs(_floats(source, 3)), source.choice(("add", "subtract", "add"))
        axis = source.choice("xyz")
        match source.below(5):
            case 0:
                return sk.Cuboid(center, half, op)
            case 1:
                return sk.Cylinder(center, half, axis, op)
            case 2:
                return sk.Wedge(center, half, axis, (source.choice((-1, 1)), source.choice((-1, 1))), op)
            case 3:
                return sk.Frustum(center, half, axis, _floats(source, 2), _floats(source, 2), bool(source.below(2)), op)
            case _:
                return sk.Torus(center, half, axis, abs(_floats(source, 1, 0.25)[0]), _floats(source, 2, 180), op)

    return sk.Shape(one() for _ in range(1 + source.below(6)))


def _any(source: Source) -> NDArray[Any]:
    """An array of any dtype and a shape that fits somewhere, or nowhere."""
    shape = source.choice(_SHAPES)
    dtype = np.dtype(source.choice(_KINDS))
    count = int(np.prod(shape))
    scale = source.choice((1, 1, 255, 1e9))
    values = np.resize(np.abs(_floats(source, 64, scale)), count).reshape(shape)
    if source.below(2):
        values = np.where(np.resize(values, count).reshape(shape) > 0.9, 1.0, 0.0)
    with np.errstate(all="ignore"):
        array = values.astype(dtype)
    return array[::-1] if source.below(6) == 0 and array.ndim else array


def _of_mesh(source: Source) -> None:
    mesh, call = _mesh(source), source.below(4)
    if call == 0:
        assert sk.voxelize(mesh).max() <= 1
    elif call == 1:
        sk.draw(mesh, _camera(source), crease_degrees=float(_floats(source, 1, 90)[0]))
    elif call == 2:
        depth, normal = sk.buffers(mesh, _camera(source), 1 + source.below(64))
        assert not np.isnan(depth).any()
        assert not np.isnan(normal).any()
    else:
        sk.frustum(mesh, _camera(source), 1 + source.below(3))


def _of_shape(source: Source) -> None:
    shape, call = _shape(source), source.below(5)
    if call == 0:
        sk.voxelize(shape)
    elif call == 1:
        sk.draw(shape, _camera(source), lines=source.choice(("all", sk.LINES)), style=source.choice(tuple(sk.STYLES)))
    elif call == 2:
        depth, normal = sk.buffers(shape, _camera(source), 1 + source.below(64))
        assert not np.isnan(depth).any()
        assert not np.isnan(normal).any()
    elif call == 3:
        sk.frustum(shape, _camera(source), 1 + source.below(3))
    else:
        assert sk.Shape.from_json(shape.to_json()) == shape


def _of_volume(source: Source) -> None:
    array, call = _any(source), source.below(5)
    if call == 0:
        sk.to_camera_grid(array, _camera(source) if source.below(4) else [_camera(source)])
    elif call == 1:
        sk.to_world_grid(array, _camera(source), into=_any(source) if source.below(3) == 0 else None)
    elif call == 2:
        sk.iou(array, _any(source) if source.below(3) == 0 else array)
    elif call == 3 and array.size < 70**3:
        assert extract_mesh(array, smooth=bool(source.below(2))).is_watertight
    else:
        sk.to_camera_grid(array, _camera(source), out=_any(source))  # type: ignore[arg-type]


def _of_drawings(source: Source) -> None:
    array, call = _any(source), source.below(5)
    if call == 0:
        sk.carve(array, [_camera(source)])  # type: ignore[arg-type]
    elif call == 1:
        sk.silhouette(array)  # type: ignore[arg-type]
    elif call == 2:
        composition(array)  # type: ignore[arg-type]
    else:
        sk.load_drawing(array)


_CALLS = (_of_mesh, _of_shape, _of_volume, _of_drawings, _of_mesh, _of_shape)


def seeds() -> list[bytes]:
    """Numbers of every call; the same each time."""
    random = Random(5)
    return [i.to_bytes(2, "little") + random.randbytes(700) for i in range(len(_CALLS)) for _ in range(6)]


TARGET = Target(attempt, seeds, of_bytes, (ValueError, TypeError), megabytes=1024)
