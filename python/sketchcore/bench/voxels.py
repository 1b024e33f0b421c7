"""Shape to world voxels in NumPy: slices for what a primitive covers, on half the grid, then mirrored."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

SIDE = 64
_CENTERS = (np.arange(SIDE) + 0.5) / SIDE - 0.5
_HALF = SIDE // 2


def numpy_voxels(rows: NDArray[np.float64]) -> NDArray[np.uint8]:
    """The world grid of a shape of cuboids and cylinders that is symmetric about z = 0, packed as `Shape.packed`."""
    grid = np.zeros((SIDE, SIDE, _HALF), np.uint8)
    for kind, op, *numbers in rows.tolist():
        center, half = numbers[:3], numbers[3:]
        ends = [_ends(c, h, 0 if axis < 2 else _HALF) for axis, (c, h) in enumerate(zip(center, half, strict=True))]
        part = grid[ends[0], ends[1], slice(ends[2].start - _HALF, ends[2].stop - _HALF)]
        if kind == 0:
            part[...] = int(op)
            continue
        axis = int(kind) - 1
        du, dv = (((_CENTERS[ends[a]] - center[a]) / half[a]) ** 2 for a in range(3) if a != axis)
        disc = np.expand_dims(du[:, None] + dv <= 1.0, axis)
        if op:
            part |= disc
        else:
            part &= ~disc
    return np.concatenate([grid[..., ::-1], grid], axis=2)


def _ends(center: float, half: float, first: int) -> slice:
    """The voxels whose centres lie within, from a first one on."""
    low = math.ceil((center - half + 0.5) * SIDE - 0.5)
    high = math.floor((center + half + 0.5) * SIDE - 0.5)
    return slice(max(low, first), max(min(high + 1, SIDE), first))
