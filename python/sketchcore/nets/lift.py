"""From image planes to the world: each cell of a coarse world grid reads its features from a drawing.

The kernels (`rust/src/lift.rs`) do it on the CPU; other devices gather by themselves what the kernels name.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional as F

from sketchcore import _core

PLANE, BINS = 64, 16
"""Pixels along each side, and depths between near and far, of a drawing's features."""
COARSE = (32, 32, 16)
"""Cells (x, y, z) of the half grid z > 0, each two voxels wide."""


def lift(features: Tensor, cameras: NDArray[np.float64]) -> Tensor:
    """What each cell reads from each drawing at its place, then at its mirror image's about z = 0.

    Args:
        features: float32 [D, 64 * 64 * 16, width], row by row of pixels, depths within.
        cameras: float64 [D, 15], packed.

    Returns:
        float32 [D, 32 * 32 * 16, 2 * width], linear between pixels and depths, 0 outside the image.
    """
    if features.device.type == "cpu":
        out: Tensor = _Lift.apply(features, cameras)
        return out
    rows, weights = (torch.from_numpy(taps).to(features.device) for taps in _core.lift_taps(cameras))
    return lift_by_taps(features, rows, weights)


def lift_by_taps(features: Tensor, rows: Tensor, weights: Tensor) -> Tensor:
    """The same from the rows and weights of `_core.lift_taps`, int32 and float32 [D, 32 * 32 * 16, 2, 8]."""
    drawings, length, width = features.shape
    first = torch.arange(drawings, device=rows.device, dtype=torch.int64)[:, None, None, None] * length
    read = F.embedding_bag(
        (rows + first).view(-1, rows.shape[-1]),
        features.flatten(0, 1),
        per_sample_weights=weights.view(-1, rows.shape[-1]),
        mode="sum",
    )
    return read.view(drawings, -1, 2 * width)


class _Lift(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, features: Tensor, cameras: NDArray[np.float64]) -> Tensor:
        ctx.cameras = cameras
        return torch.from_numpy(_core.lift(features.detach().contiguous().numpy(), cameras))

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None]:
        (gradient,) = gradients
        return torch.from_numpy(_core.lift_transposed(gradient.contiguous().numpy(), ctx.cameras)), None
