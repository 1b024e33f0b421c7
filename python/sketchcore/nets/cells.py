"""The half world grid z > 0 in cells of two voxels a side, as the compact network has it.

Volumes in cells are float32 [32, 32, 16, 8] (x, y, z, voxel).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sketchcore.rounds import Volume

Cells = NDArray[np.float32]


def fold(half: Volume) -> Cells:
    """The cells of a half grid, [64, 64, 32] (x, y, z)."""
    cells: Cells = half.reshape(32, 2, 32, 2, 16, 2).transpose(0, 2, 4, 1, 3, 5).reshape(32, 32, 16, 8)
    return cells


def whole(cells: Cells) -> Volume:
    """The symmetric volume, [64, 64, 64] (x, y, z), whose half z > 0 has these cells."""
    half = cells.reshape(32, 32, 16, 2, 2, 2).transpose(0, 3, 1, 4, 2, 5).reshape(64, 64, 32)
    return np.concatenate([half[:, :, ::-1], half], axis=2)


def flip(cells: Cells) -> Cells:
    """The cells of the volume mirrored along x."""
    return cells.reshape(32, 32, 16, 2, 2, 2)[::-1, :, :, ::-1].reshape(32, 32, 16, 8)
