"""The Rust kernels. Arrays are C-contiguous; cameras and shapes are packed (`Camera.packed`, `Shape.packed`)."""

from collections.abc import Callable, Mapping, Sequence
from typing import final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "CompactNetwork",
    "bilateral",
    "buffers",
    "carve",
    "check_style",
    "convolve",
    "convolve_transposed",
    "default_config",
    "draw",
    "draw_kinds",
    "draw_mesh",
    "draw_mesh_views",
    "evidence",
    "evidence_fields",
    "filter_gradient",
    "fit",
    "frustum",
    "generate",
    "heed_outlines",
    "hidden_lines",
    "isosurface",
    "lift",
    "lift_taps",
    "lift_transposed",
    "lines",
    "mesh_buffers",
    "mesh_frusta",
    "mesh_shares",
    "random_style",
    "redraw",
    "silhouettes",
    "straight",
    "style_camera",
    "to_camera_grid",
    "to_world_grid",
    "trace",
    "viewpoints",
    "voxelize",
    "voxelize_mesh",
    "widened",
]

def viewpoints() -> NDArray[np.float64]: ...
def widened(camera: NDArray[np.float64], share: float) -> NDArray[np.float64]: ...
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
def hidden_lines(shape: NDArray[np.float64], camera: NDArray[np.float64]) -> NDArray[np.uint8]: ...
def draw_kinds(
    depth: NDArray[np.float32],
    normal: NDArray[np.float32],
    camera: NDArray[np.float64],
    hidden: NDArray[np.uint8] | None,
    lines: list[str],
    style: str,
    seed: int,
    out: NDArray[np.uint8] | None = None,
) -> NDArray[np.uint8]: ...
def check_style(style: str) -> None: ...
def random_style(ranges: str, seed: int) -> str: ...
def style_camera(camera: NDArray[np.float64], style: str, seed: int) -> NDArray[np.float64]: ...
def redraw(
    drawing: NDArray[np.uint8], style: str, seed: int, out: NDArray[np.uint8] | None = None
) -> NDArray[np.uint8]: ...
def straight(drawing: NDArray[np.uint8], least: int) -> NDArray[np.float64]: ...
def trace(drawing: NDArray[np.uint8], least: int, step: int, through: bool) -> list[NDArray[np.float32]]: ...
def to_camera_grid(
    volumes: NDArray[np.float32], cameras: NDArray[np.float64], out: NDArray[np.float32] | None = None
) -> NDArray[np.float32]: ...
def to_world_grid(volumes: NDArray[np.float32], cameras: NDArray[np.float64], into: NDArray[np.float32]) -> None: ...
def silhouettes(drawings: NDArray[np.uint8]) -> NDArray[np.uint8]: ...
def carve(drawings: NDArray[np.uint8], cameras: NDArray[np.float64]) -> NDArray[np.uint8]: ...
def evidence_fields(drawings: NDArray[np.uint8]) -> NDArray[np.uint8]: ...
def evidence(fields: NDArray[np.uint8], cameras: NDArray[np.float64]) -> NDArray[np.uint8]: ...
def heed_outlines(
    volume: NDArray[np.float32], depths: NDArray[np.float32], cameras: NDArray[np.float64], hull: NDArray[np.uint8]
) -> NDArray[np.float32]:
    """The volume with outlines filled and what lies beyond them cleared.

    Args:
        volume: [64, 64, 64] (x, y, z), probabilities, symmetric about z = 0.
        depths: [n, 64, 64] (row, col), how far inside each drawing's outline a cell of its camera's grid is: pixels.
        cameras: [n, 15].
        hull: [64, 64, 32], the first part of `evidence`.
    """

def lift(features: NDArray[np.float32], cameras: NDArray[np.float64]) -> NDArray[np.float32]: ...
def lift_transposed(gradient: NDArray[np.float32], cameras: NDArray[np.float64]) -> NDArray[np.float32]: ...
def lift_taps(cameras: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.float32]]: ...
def default_config() -> str: ...
def fit(
    shape: NDArray[np.float64], cover: float, min_occupancy: float, min_extent: int
) -> NDArray[np.float64] | None: ...
def generate(
    config: str,
    seed: int,
    first: int,
    threads: int | None,
    drawings: NDArray[np.uint8],
    world: NDArray[np.uint8],
    frusta: NDArray[np.uint8],
    progress: Callable[[int], object] | None = None,
    shapes: Sequence[NDArray[np.float64]] | None = None,
) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]: ...
def bilateral(
    vertices: NDArray[np.float64],
    faces: NDArray[np.uint32],
    iterations: int,
    sigma_spatial: float,
    sigma_normal: float,
) -> NDArray[np.float64]: ...
def convolve(
    input: NDArray[np.float32],
    weight: NDArray[np.float32],
    bias: NDArray[np.float32] | None = None,
    *,
    rectify: bool = False,
) -> NDArray[np.float32]:
    """A convolution of 3 cells a side, stride 1, one cell of zeros around; float32 [n, cells..., outputs].

    Args:
        input: [n, rows, cols, inputs] or [n, x, y, z, inputs].
        weight: [outputs, inputs, 3, 3] or [outputs, inputs, 3, 3, 3].
        bias: [outputs].
        rectify: take negative inputs for 0.

    Raises:
        ValueError: for arrays that do not fit each other, or are not C-contiguous.
    """

def convolve_transposed(
    gradient: NDArray[np.float32], weight: NDArray[np.float32], *, rectified: NDArray[np.float32] | None = None
) -> NDArray[np.float32]:
    """The gradient by the input of `convolve`, [n, cells..., inputs], from that by its output.

    Args:
        gradient: [n, cells..., outputs].
        weight: as for `convolve`.
        rectified: the input, if it was rectified.

    Raises:
        ValueError: as `convolve`.
    """

def filter_gradient(
    input: NDArray[np.float32], gradient: NDArray[np.float32], *, rectify: bool = False
) -> NDArray[np.float32]:
    """The gradient by the weight of `convolve`, [outputs, inputs, 3, 3] or [outputs, inputs, 3, 3, 3].

    The same to the bit on any number of threads.

    Args:
        input: as for `convolve`.
        gradient: by its output, [n, cells..., outputs].
        rectify: as for `convolve`.

    Raises:
        ValueError: as `convolve`.
    """

@final
class CompactNetwork:
    """The compact network on the CPU, float32, weights laid out once: `CompactNet` for whoever only asks.

    Several threads may ask at once. Its own threads are those of rayon's pool.

    Args:
        weights: by the names of `CompactNet.state_dict()`, float32.
        stem, image, features, fused, world, groups: as in `CompactConfig`.

    Raises:
        ValueError: for widths that no network has, or weights that do not fit them.
    """

    def __new__(
        cls,
        weights: Mapping[str, NDArray[np.float32]],
        *,
        stem: int,
        image: tuple[int, int, int],
        features: int,
        fused: int,
        world: tuple[int, int, int],
        groups: int,
    ) -> CompactNetwork: ...
    def read(
        self,
        drawings: NDArray[np.uint8],
        fields: NDArray[np.uint8],
        cameras: NDArray[np.float64],
        counts: Sequence[int],
        evidence: NDArray[np.uint8],
    ) -> NDArray[np.float32]:
        """What does not change from round to round, float32 [B, 32 * 32 * 16, width + 8].

        Args:
            drawings: [D, 256, 256], those of the first object first.
            fields: [D, 256, 256, 2], `evidence_fields`.
            cameras: [D, 15], packed.
            counts: drawings of each object, 1 or more; they add up to D.
            evidence: [B, 3, 64, 64, 32], `evidence` of each object's drawings.
        """

    def decide(
        self, readings: NDArray[np.float32], prior: NDArray[np.float32] | None, counts: Sequence[int]
    ) -> NDArray[np.float32]:
        """Probability of occupancy of each cell's eight voxels, float32 [B, 32, 32, 16, 8].

        Args:
            readings: from `read`.
            prior: what an earlier round decided, of the same form.
            counts: drawings of each object, 1 or more.
        """
