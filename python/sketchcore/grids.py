"""World grid, camera grid, and what drawings say about them: the kernels, checked."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sketchcore import _core
from sketchcore.camera import Camera, pack_cameras
from sketchcore.destination import destination
from sketchcore.linestyle import STYLES, LineStyle, as_style, check_seed
from sketchcore.meshfile import load_mesh
from sketchcore.shape import Shape

if TYPE_CHECKING:
    import trimesh

    Solid = Shape | trimesh.Trimesh | str | os.PathLike[str]

SIDE = 64
IMAGE = 256
LINES = ("contours", "creases", "ridges", "valleys", "suggestive", "hidden", "hatching")
"""Kinds of lines that `draw` knows."""
SIDES = (32, 64, 128, 256)
"""Grids that are resampled have so many cells along each side."""
CREASE_DEGREES = 40.0
"""A mesh is round where its faces bend by no more than this: a ring of ten facets is, an octagon is not."""

Faces = tuple[NDArray[np.float64], NDArray[np.int64]]


def _as_camera(camera: object) -> Camera:
    if isinstance(camera, Camera):
        return camera
    raise TypeError(f"expected a sketchcore.Camera, got {type(camera).__name__}")


def _as_solid(solid: object) -> NDArray[np.float64] | Faces:
    """A packed shape, or the vertices and faces of a mesh."""
    if isinstance(solid, Shape):
        return solid.packed
    if isinstance(solid, str | os.PathLike):
        solid = load_mesh(solid)
    # Who has a mesh has imported trimesh; nobody else should wait for it.
    module = sys.modules.get("trimesh")
    if module is not None and isinstance(solid, module.Trimesh):
        return np.ascontiguousarray(solid.vertices, np.float64), np.ascontiguousarray(solid.faces, np.int64)
    expected = "a trimesh.Trimesh, a path to a mesh file or a sketchcore.Shape"
    raise TypeError(f"expected {expected}, got {type(solid).__name__}")


def voxelize(shape: Solid, out: NDArray[np.uint8] | None = None) -> NDArray[np.uint8]:
    """The world grid of a solid: uint8 [64, 64, 64] (x, y, z), 1 where a voxel's centre is inside.

    A `Shape` is taken as it stands. A mesh, y up, is scaled and centred: the grid's cube is 120 % of the largest side
    of its bounding box. Its inside is where the surface winds around: parts that overlap are one solid, cavities stay
    hollow, and all faces may be inside out. Meshes with holes or with faces turned over are decided by the majority of
    rays along the three axes; a sheet that encloses nothing leaves no voxels (rust/src/solid.rs says more).

    Args:
        shape: the shape, the mesh, or the path of a mesh file.
        out: an array of the result's shape and dtype to write into, and to return.

    Raises:
        ValueError: for a mesh without faces or extent, with an index out of range, or with NaN or infinity in a vertex;
            for a file that is no mesh; for an `out` of another shape, not C-contiguous or not writeable.
        FileNotFoundError: if there is no such file.
        TypeError: for anything but a `Shape`, a `trimesh.Trimesh` or a path, or an `out` of another dtype.
    """
    into = destination(out, (SIDE,) * 3, np.uint8)
    solid = _as_solid(shape)
    return _core.voxelize_mesh(*solid, into) if isinstance(solid, tuple) else _core.voxelize(solid, into)


def frustum(shape: Solid, camera: Camera, rays: int = 4) -> NDArray[np.uint8]:
    """The camera grid of a solid: uint8 [64, 64, 64] (depth, row, col), the share of a cell inside, 255 = all.

    Sampled by `rays` x `rays` (1 to 16) rays a cell across the image. Along depth exact for a `Shape`; for a mesh,
    placed as by `voxelize`, at four places a cell, in a world grid of 128^3 voxels.

    Raises:
        ValueError: if the camera stands inside the shape, or as `voxelize` does for a mesh.
        TypeError: for anything but a solid and a `Camera`.
    """
    solid, packed = _as_solid(shape), _as_camera(camera).packed
    if not isinstance(solid, tuple):
        return _core.frustum(solid, packed, rays)
    grid: NDArray[np.uint8] = _core.mesh_frusta(*solid, packed[None], rays)[0]
    return grid


def buffers(
    shape: Solid, camera: Camera, size: int = IMAGE, *, crease_degrees: float = CREASE_DEGREES
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Depth and normals of a shape, or of a mesh placed as by `voxelize`, by one ray a pixel.

    Faces of a mesh are seen from either side.

    Args:
        shape: the shape, the mesh, or the path of a mesh file.
        camera: where it is seen from.
        size: pixels along each side, 1 to 4096.
        crease_degrees: 0 to 90; normals of a mesh are smooth across edges at which it bends by no more.

    Returns:
        depth: float32 [size, size], world units along the camera's z axis; infinite where nothing is seen.
        normal: float32 [size, size, 3], unit normals in the world, towards the eye; 0 where nothing is seen.

    Raises:
        ValueError: if the camera stands inside the solid, a number is out of range, or as `voxelize` does for a mesh.
        FileNotFoundError: if there is no such file.
        TypeError: for anything but a solid and a `Camera`.
    """
    return _buffers(_as_solid(shape), _as_camera(camera).packed, size, crease_degrees)


def _buffers(
    solid: NDArray[np.float64] | Faces, packed: NDArray[np.float64], size: int, crease_degrees: float
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    if isinstance(solid, tuple):
        return _core.mesh_buffers(*solid, crease_degrees, packed, size)
    return _core.buffers(solid, packed, size)


def draw(
    shape: Solid,
    camera: Camera,
    out: NDArray[np.uint8] | None = None,
    *,
    lines: str | Sequence[str] = "all",
    style: str | LineStyle = "clean",
    seed: int = 0,
    crease_degrees: float = CREASE_DEGREES,
) -> NDArray[np.uint8]:
    """The line drawing of a solid, uint8 [256, 256], ink 255 on 0 (Saito and Takahashi; paper, section 4.2).

    Args:
        shape: the shape, the mesh, or the path of a mesh file; a mesh is placed as by `voxelize`.
        camera: where it is seen from.
        out: an array of the result's shape and dtype to write into, and to return.
        lines: "all", which is "contours" and "creases" together, or one or several of these: "contours", where a
            surface ends before another one or before nothing; "creases", where normals jump; "ridges" and "valleys",
            where a surface bends most, outwards or inwards; "suggestive", valleys of brightness under a light at
            the eye (DeCarlo and others, 2003); "hidden", dashed, contours and creases behind the first surface;
            "hatching", strokes in the shade.
        style: how the lines are put down: a name from `sketchcore.STYLES`, or a `LineStyle`.
        seed: of what is random in a style; the same one draws the same.
        crease_degrees: 0 to 90; edges at which a mesh bends by no more are tessellation, and leave no lines.

    Raises:
        ValueError: if the camera stands inside the solid, for unknown lines or styles, a number out of range, or as
            `voxelize` does for a mesh; for an `out` of another shape, not C-contiguous or not writeable.
        FileNotFoundError: if there is no such file.
        TypeError: for anything but a solid and a `Camera`, what is no style, hidden lines of a mesh, or an `out` of
            another dtype.
    """
    solid, hand, seed, kinds = _as_solid(shape), as_style(style), check_seed(seed), _as_kinds(lines)
    into = destination(out, (IMAGE,) * 2, np.uint8)
    stand = hand.packed_camera(_as_camera(camera), seed)
    if kinds is not None:
        hidden = None
        if "hidden" in kinds:
            if isinstance(solid, tuple):
                raise TypeError("hidden lines are those of a sketchcore.Shape: nothing else knows what lies behind")
            hidden = _core.hidden_lines(solid, stand)
        seen = _buffers(solid, stand, IMAGE, crease_degrees)
        return _core.draw_kinds(*seen, stand, hidden, kinds, hand.to_json(), seed, into)
    if isinstance(solid, tuple):
        _core.draw_mesh(*solid, crease_degrees, stand, into)
    else:
        _core.draw(solid, stand, into)
    return into if hand == STYLES["clean"] else hand.redraw(into, seed, into)


def _as_kinds(lines: str | Sequence[str]) -> list[str] | None:
    """Names of kinds of lines; None for all that a drawing has by default."""
    names = [lines] if isinstance(lines, str) else list(lines)
    for name in names:
        if name not in ("all", *LINES):
            raise ValueError(f"unknown lines {name!r}; there are all, {', '.join(LINES)}")
    if not names:
        raise ValueError(f"a drawing needs some lines: all, {', '.join(LINES)}")
    if names == ["all"]:
        return None
    return [kind for name in names for kind in (("contours", "creases") if name == "all" else (name,))]


def _as_volumes(volume: NDArray[np.floating], name: str) -> NDArray[np.float32]:
    array = np.asarray(volume)
    if array.dtype.kind not in "fiub":
        raise TypeError(f"{name} must hold numbers, got dtype {array.dtype}")
    if array.ndim not in (3, 4) or array.shape[-3:] not in [(side,) * 3 for side in SIDES]:
        expected = f"[s, s, s] or [n, s, s, s], s one of {list(SIDES)}"
        raise ValueError(f"{name} must have shape {expected}, got {list(array.shape)}")
    with np.errstate(over="ignore"):  # what is too large for float32 is infinite, and refused
        return np.ascontiguousarray(array, np.float32).reshape(-1, *array.shape[-3:])


def _as_cameras(camera: Camera | Sequence[Camera], batch: bool) -> NDArray[np.float64]:
    if batch == isinstance(camera, Camera):
        raise TypeError("a volume goes with one camera, a batch of volumes with a sequence of as many cameras")
    return pack_cameras([camera] if isinstance(camera, Camera) else camera)


def _as_out(
    out: NDArray[np.float32] | None, volume: NDArray[np.floating], read: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Where a grid for each volume goes, [n, s, s, s]; `out` has the volume's shape."""
    made = destination(out, np.shape(volume), np.float32)
    if np.may_share_memory(made, read):
        raise ValueError("out must not overlap volume: each cell is read from many places")
    return made.reshape(read.shape)


def to_camera_grid(
    volume: NDArray[np.floating], camera: Camera | Sequence[Camera], out: NDArray[np.float32] | None = None
) -> NDArray[np.float32]:
    """Resamples world volumes into camera grids, trilinear, 0 outside the world grid.

    Args:
        volume: [s, s, s] (x, y, z), or a batch [n, s, s, s]; s is 32, 64, 128 or 256.
        camera: one camera, or n of them for a batch.
        out: a float32 array of the volume's shape to write into, and to return.

    Returns:
        float32 of the same shape (depth, row, col).

    Raises:
        ValueError: for a wrong shape, a number of cameras that differs from that of volumes, NaN or infinity, or an
            `out` that is not C-contiguous, not writeable or overlaps the volume.
        TypeError: for what is no volume or no camera, or an `out` of another dtype.
    """
    volumes = _as_volumes(volume, "volume")
    cameras = _as_cameras(camera, np.ndim(volume) == 4)
    result = _as_out(out, volume, volumes)
    _core.to_camera_grid(volumes, cameras, result)
    return result.reshape(np.shape(volume)) if out is None else out


def to_world_grid(
    volume: NDArray[np.floating],
    camera: Camera | Sequence[Camera],
    into: NDArray[np.floating] | None = None,
    out: NDArray[np.float32] | None = None,
) -> NDArray[np.float32]:
    """Resamples camera grids into world volumes, trilinear; voxels outside the frustum keep `into`, or 0.

    Args:
        volume: [s, s, s] (depth, row, col), or a batch [n, s, s, s]; s is 32, 64, 128 or 256.
        camera: one camera, or n of them for a batch.
        into: what holds outside the frustum, the shape of `volume` (x, y, z); it is left as it is.
        out: a float32 array of the volume's shape to write into, and to return; `into` itself to change it in place.

    Returns:
        float32 of the same shape (x, y, z).

    Raises:
        ValueError: for a wrong shape, a number of cameras that differs from that of volumes, NaN or infinity, or an
            `out` that is not C-contiguous, not writeable or overlaps the volume.
        TypeError: for what is no volume or no camera, or an `out` of another dtype.
    """
    volumes = _as_volumes(volume, "volume")
    cameras = _as_cameras(camera, np.ndim(volume) == 4)
    if into is not None and np.shape(into) != np.shape(volume):
        raise ValueError(f"into must have the volume's shape {list(np.shape(volume))}, got {list(np.shape(into))}")
    outside = 0.0 if into is None else _as_volumes(into, "into")
    result = _as_out(out, volume, volumes)
    if out is None or out is not into:
        np.copyto(result, outside)
    _core.to_world_grid(volumes, cameras, result)
    return result.reshape(np.shape(volume)) if out is None else out


def as_drawings(drawings: NDArray[np.uint8] | Sequence[NDArray[np.uint8]]) -> NDArray[np.uint8]:
    """Drawings as uint8 [n, 256, 256], contiguous; ink 255 on 0.

    Raises:
        ValueError: for another shape.
        TypeError: for another dtype.
    """
    array = np.asarray(drawings)
    if array.dtype != np.uint8:
        raise TypeError(f"drawings must be uint8 (ink 255 on 0), got {array.dtype}")
    if array.ndim == 2:
        array = array[None]
    if array.ndim != 3 or array.shape[1:] != (IMAGE, IMAGE):
        raise ValueError(f"drawings must have shape [n, 256, 256], got {list(array.shape)}")
    return np.ascontiguousarray(array)


def silhouette(drawing: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The inside of a drawing's outline: uint8 [256, 256], 1 inside, lines and holes included.

    Gaps of up to 10 pixels in the outline are closed; so is a real opening that narrow into a wider space.

    Raises:
        ValueError: for another shape than [256, 256].
        TypeError: for another dtype than uint8.
    """
    if np.ndim(drawing) != 2:
        raise ValueError(f"silhouette takes one drawing of shape [256, 256], got {list(np.shape(drawing))}")
    inside: NDArray[np.uint8] = _core.silhouettes(as_drawings(drawing))[0]
    return inside


def carve(drawings: NDArray[np.uint8] | Sequence[NDArray[np.uint8]], cameras: Sequence[Camera]) -> NDArray[np.uint8]:
    """Silhouette carving: uint8 [64, 64, 64] (x, y, z), 1 where a voxel's centre falls into every silhouette.

    Args:
        drawings: uint8 [n, 256, 256], ink 255 on 0.
        cameras: one a drawing.

    Raises:
        ValueError: for no drawings, a wrong shape, or a number of cameras that differs from that of drawings.
        TypeError: for a wrong dtype or what is no camera.
    """
    images = as_drawings(drawings)
    if isinstance(cameras, Camera):
        raise TypeError("carve takes a sequence of sketchcore.Camera, one a drawing")
    if len(images) == 0:
        raise ValueError("carving needs at least one drawing")
    if len(images) != len(cameras):
        raise ValueError(f"each drawing needs a camera: got {len(images)} drawings, {len(cameras)} cameras")
    return _core.carve(images, pack_cameras(cameras))
