"""A solid hangs together: its pieces are joined where the network most nearly believes that they meet.

Every object that is drawn is one solid. A network that weighs voxel by voxel may leave two parts of it a hair apart.
"""

# mypy: disable-error-code="no-untyped-call"

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, binary_erosion, label

from sketchcore.rounds import Volume

DUST = 0.01
"""A piece smaller than this share of the largest is taken away."""
LEAST = 0.12
"""A bridge leads through no voxel that is less probable: as far as outlines move a voxel, too."""
BRIDGE = 0.6
"""How probable the voxels of a bridge become."""
OUTSIDE = 0.49
"""How probable the voxels of dust become."""


def join_pieces(volume: Volume) -> Volume:
    """The volume with its pieces joined to the largest one, and dust taken away.

    A bridge is the path along which the voxels' improbability adds up to least, and what is next to it. Where there is
    none, a piece stays apart.

    Args:
        volume: float32 [64, 64, 64] (x, y, z), probability of occupancy, symmetric about z = 0.

    Returns:
        float32 [64, 64, 64], symmetric as well; the same array if it is in one piece.
    """
    occupied = volume > 0.5
    half = occupied[:, :, 32:]
    if half[:, :, 0].any() and label(half)[1] == 1:  # one piece that reaches its mirror image
        return volume
    labels, count = label(occupied)
    if count < 2:
        return volume
    sizes = np.bincount(labels.ravel())
    sizes[0] = 0
    largest = int(sizes.argmax())
    small = sizes < DUST * sizes[largest]
    joined = np.where(small[labels] & (labels > 0), np.minimum(volume, OUTSIDE), volume)
    others = np.flatnonzero(~small)
    others = others[others != largest]
    if len(others):
        bridges = _bridges(volume, labels, largest, others.tolist())
        joined[bridges] = np.maximum(joined[bridges], BRIDGE)
    return joined


def _bridges(volume: Volume, labels: NDArray[np.int32], largest: int, others: list[int]) -> NDArray[np.bool_]:
    from skimage.graph import MCP  # few solids need it

    possible = volume > LEAST
    # Improbable voxels cost most; through the solid a path is almost free, but not endless. Others are closed: -1.
    cost = np.where(possible, np.maximum(0.5 - volume, 0) + 0.01, -1)
    paths = MCP(cost, fully_connected=False)
    whole = labels == largest
    costs, _ = paths.find_costs(np.argwhere(whole & ~binary_erosion(whole)))
    bridges = np.zeros_like(possible)
    for nearest in zip(*np.unravel_index(_cheapest(costs, labels, others), labels.shape), strict=True):
        if np.isfinite(costs[nearest]):
            bridges[tuple(np.transpose(paths.traceback(nearest)))] = True
    bridges |= bridges[:, :, ::-1]
    wide: NDArray[np.bool_] = binary_dilation(bridges) & possible
    return wide


def _cheapest(costs: NDArray[np.float64], labels: NDArray[np.int32], pieces: list[int]) -> NDArray[np.intp]:
    """The flat index of each piece's voxel that costs least, the first of several: all pieces in one go."""
    voxels = np.flatnonzero(np.isin(labels, pieces))
    of = labels.ravel()[voxels]
    order = np.lexsort((costs.ravel()[voxels], of))
    first = np.unique(of[order], return_index=True)[1]
    cheapest: NDArray[np.intp] = voxels[order[first]]
    return cheapest
