"""The Rust kernels. Arrays are C-contiguous; cameras and shapes are packed (`Camera.packed`, `Shape.packed`)."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "bilateral",
    "buffers",
    "carve",
    "default_config",
    "draw",
    "draw_mesh",
    "draw_mesh_views",
    "evidence",
    "evidence_fields",
    "frustum",
    "generate",
    "isosurface",
    "lift",
    "lift_taps",
    "lift_transposed",
    "lines",
    "mesh_buffers",
    "mesh_frusta",
    "mesh_shares",
    "silhouettes",
    "to_camera_grid",
    "to_world_grid",
    "viewpoints",
    "voxelize",
    "voxelize_mesh",
]

def viewpoints() -> NDArray[np.float64]: ...
def voxelize(shape: NDArray[np.float64], out: NDArray[np.uint8] | None = None) -> NDArray[np.uint8]: ...
def voxelize_mesh(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], out: NDArray[np.uint8] | None = None
) -> NDArray[np.uint8]: ...
def mesh_shares(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.uint8]: ...
def mesh_frusta(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], cameras: NDArray[np.float64], rays: int
) -> NDArray[np.uint8]: ...
def mesh_buffers(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    crease_degrees: float,
    camera: NDArray[np.float64],
    size: int,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]: ...
def draw_mesh(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    crease_degrees: float,
    camera: NDArray[np.float64],
    out: NDArray[np.uint8] | None = None,
) -> NDArray[np.uint8]: ...
def draw_mesh_views(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    crease_degrees: float,
    config: str,
    seed: int,
    index: int,
    drawings: NDArray[np.uint8],
) -> NDArray[np.float64]: ...
def frustum(shape: NDArray[np.float64], camera: NDArray[np.float64], rays: int) -> NDArray[np.uint8]: ...
def buffers(
    shape: NDArray[np.float64], camera: NDArray[np.float64], size: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]: ...
def isosurface(
    volume: NDArray[np.float32], level: float, camera: NDArray[np.float64], size: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]: ...
def lines(
    depth: NDArray[np.float32], normal: NDArray[np.float32], depth_step: float, crease_degrees: float
) -> NDArray[np.uint8]: ...
def draw(
    shape: NDArray[np.float64], camera: NDArray[np.float64], out: NDArray[np.uint8] | None = None
) -> NDArray[np.uint8]: ...
def to_camera_grid(
    volumes: NDArray[np.float32], cameras: NDArray[np.float64], out: NDArray[np.float32] | None = None
) -> NDArray[np.float32]: ...
def to_world_grid(volumes: NDArray[np.float32], cameras: NDArray[np.float64], into: NDArray[np.float32]) -> None: ...
def silhouettes(drawings: NDArray[np.uint8]) -> NDArray[np.uint8]: ...
def carve(drawings: NDArray[np.uint8], cameras: NDArray[np.float64]) -> NDArray[np.uint8]: ...
def evidence_fields(drawings: NDArray[np.uint8]) -> NDArray[np.uint8]: ...
def evidence(fields: NDArray[np.uint8], cameras: NDArray[np.float64]) -> NDArray[np.uint8]: ...
def lift(features: NDArray[np.float32], cameras: NDArray[np.float64]) -> NDArray[np.float32]: ...
def lift_transposed(gradient: NDArray[np.float32], cameras: NDArray[np.float64]) -> NDArray[np.float32]: ...
def lift_taps(cameras: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.float32]]: ...
def default_config() -> str: ...
def generate(
    config: str,
    seed: int,
    first: int,
    threads: int | None,
    drawings: NDArray[np.uint8],
    world: NDArray[np.uint8],
    frusta: NDArray[np.uint8],
    progress: Callable[[int], object] | None = None,
) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]: ...
def bilateral(
    vertices: NDArray[np.float64],
    faces: NDArray[np.uint32],
    iterations: int,
    sigma_spatial: float,
    sigma_normal: float,
) -> NDArray[np.float64]: ...
