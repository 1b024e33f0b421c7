"""What a network is told to be right: occupancy, yes or no; the share of a voxel that is inside; or a signed distance.

The surface is where a network is undecided, whichever it learnt: a probability of one half. The logit of a network that
predicts distances *is* the distance, in voxels.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import product
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from sketchcore import _core
from sketchcore.datagen.generate import Batch

SAMPLES = 4
"""Samples of a voxel along each axis that its share is measured by."""
REACH = 4
"""Voxels from the surface that a signed distance is truncated at."""


def binary(batch: Batch, index: int) -> NDArray[np.float32]:
    """Whether the centres of one sample's voxels are inside: float32 [64, 64, 32], the half grid z > 0, 0 or 1.

    One half where the sample is not symmetric about z = 0, and it is so on one side alone.
    """
    world = batch.world[index]
    inside: NDArray[np.float32] = (world[:, :, 32:] + world[:, :, 31::-1]).astype(np.float32) / np.float32(2)
    return inside


def fractional(batch: Batch, index: int) -> NDArray[np.float32]:
    """The share of each voxel that is inside: float32 [64, 64, 32], the half grid z > 0, in 0..1.

    Measured by 4 x 4 x 4 samples a voxel, evenly spaced: each is the grid of the shape moved the other way.

    Raises:
        ValueError: for a batch without shapes.
    """
    if not len(batch.packed_shapes):
        raise ValueError("the truth 'fractional' is measured on shapes, and meshes are none; take the preset compact")
    offsets = ((np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5) / 64
    moved = batch.packed_shapes[index].copy()
    centers = moved[:, 2:5].copy()
    inside = np.empty((64, 64, 64), np.uint8)
    count = np.zeros((64, 64, 32), np.uint8)
    for offset in product(offsets, repeat=3):
        moved[:, 2:5] = centers - offset
        count += _core.voxelize(moved, inside)[:, :, 32:]
    return count.astype(np.float32) / np.float32(SAMPLES**3)


def distance(batch: Batch, index: int) -> NDArray[np.float32]:
    """The signed distance from each voxel's centre to the surface: float32 [64, 64, 32], the half grid z > 0.

    In voxels, positive inside, truncated at 4. The surface of the binary grid runs half-way between two voxels of
    which one is inside: distances are Euclidean, to the nearest centre on the other side, less one half.
    """
    # The nearest centre may lie beyond the plane of symmetry; what is further away than the reach does not matter.
    inside = batch.world[index, :, :, 31 - REACH :] > 0
    if inside.all() or not inside.any():
        raise ValueError("a grid that is all full or all empty has no surface to measure a distance from")
    signed = np.where(inside, _to_others(inside) - 0.5, 0.5 - _to_others(~inside))
    return np.clip(signed[:, :, REACH + 1 :], -REACH, REACH).astype(np.float32)


def _to_others(mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    found: NDArray[np.float64] = distance_transform_edt(mask)
    return found


WORLD_TRUTHS: Mapping[str, Callable[[Batch, int], NDArray[np.float32]]] = MappingProxyType(
    {"binary": binary, "fractional": fractional, "distance": distance}
)
"""Truths in the world grid, by the name that a preset calls them by; of one sample of a batch."""


def in_camera_grids(truth: str, frusta: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The truth of a network that predicts camera grids: 255 = inside.

    Args:
        truth: "fractional", or "binary" for cells of which at least half is inside.
        frusta: uint8, the share of each cell that is inside, 255 = all.

    Raises:
        ValueError: for another truth.
    """
    if truth == "fractional":
        return frusta
    if truth == "binary":
        return np.where(frusta > 127, np.uint8(255), np.uint8(0))
    raise ValueError(f"the truth in camera grids is 'fractional' or 'binary', got {truth!r}")
