"""Frozen parts where they were placed, and the current solid, as one volume."""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from sketchcore.app.document import Placement
from sketchcore.grids import SIDE

_TURNS = ((1, 0), (0, 1), (-1, 0), (0, -1))
"""Cosine and sine of the quarter turns."""


def unite(placed_parts: Iterable[tuple[NDArray[np.uint8], Placement]]) -> NDArray[np.uint8]:
    """The union of volumes, each where it is placed: the largest probability, uint8 [64, 64, 64]; zeros for none."""
    scene = np.zeros((SIDE,) * 3, np.uint8)
    for volume, placement in placed_parts:
        np.maximum(scene, place(volume, placement), out=scene)
    return scene


def place(volume: NDArray[np.uint8], placement: Placement) -> NDArray[np.uint8]:
    """A volume scaled, turned about y and moved, resampled into the world grid; what leaves the grid is cut off.

    Trilinear; where a part is made smaller, a voxel is the mean over as many places as it covers.

    Args:
        volume: uint8 [64, 64, 64] (x, y, z), probability * 255.
        placement: where it goes.

    Returns:
        uint8 [64, 64, 64]; the volume itself where it stays in its place.
    """
    if placement == Placement():
        return volume
    from scipy.ndimage import affine_transform

    cosine, sine = _TURNS[placement.turn]
    # From the scene back to the part: p = turn^T (q - center) / scale.
    back = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]]) / placement.scale
    middle = (SIDE - 1) / 2
    moved = np.array(placement.center) * SIDE
    source = np.pad(volume, 1).astype(np.float32)  # nothing is outside: interpolated towards 0
    finer = max(1, round(1 / placement.scale)) if placement.scale < 1 else 1
    inner = (np.arange(min(finer, 4)) + 0.5) / min(finer, 4) - 0.5
    total = np.zeros((SIDE,) * 3, np.float32)
    for within in itertools.product(inner, repeat=3):
        offset = back @ (np.array(within) - middle - moved) + middle + 1
        total += affine_transform(source, back, offset, output_shape=(SIDE,) * 3, order=1, prefilter=False)
    return np.rint(total / len(inner) ** 3).astype(np.uint8)
