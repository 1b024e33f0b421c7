"""Where a solid is unsure, and which further drawing would help most."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sketchcore.app.document import check_viewpoint
from sketchcore.camera import VIEWPOINTS
from sketchcore.grids import SIDE, to_camera_grid

Field = NDArray[np.float32]


def unsure(volume: NDArray[np.generic]) -> Field:
    """The entropy of each voxel's occupancy: 1 where the probability is one half, 0 where it is 0 or 1.

    Args:
        volume: [64, 64, 64] (x, y, z), probability in [0, 1] as floats, or * 255 as uint8.

    Returns:
        float32 [64, 64, 64], bits.
    """
    return _entropy(_probability(volume))


def best_view(volume: NDArray[np.generic], taken: Sequence[str]) -> tuple[str, dict[str, float]]:
    """The viewpoint whose drawing would help most, of those that nothing was drawn from yet.

    A drawing shows what light reaches from its viewpoint. So along each ray of each viewpoint's camera grid the
    entropies are added up, each times the probability that nothing stands before it: that much is undecided of what
    would be seen.

    Args:
        volume: as for `unsure`.
        taken: viewpoints that there are drawings from.

    Returns:
        the viewpoint's name, and all scores by name, the highest first: bits.

    Raises:
        ValueError: for an unknown viewpoint, or if there are drawings from all 13.
    """
    names = [name for name in VIEWPOINTS if name not in {check_viewpoint(one) for one in taken}]
    if not names:
        raise ValueError("there are drawings from all 13 viewpoints already")
    probability = _probability(volume)
    scores = {name: _visible(probability, name) for name in names}
    ranked = dict(sorted(scores.items(), key=lambda one: one[1], reverse=True))
    return next(iter(ranked)), ranked


def _visible(probability: Field, name: str) -> float:
    """Bits that are undecided of what is seen from a viewpoint."""
    along = to_camera_grid(probability, VIEWPOINTS[name]).clip(0, 1)
    free = np.cumprod(1 - along, axis=0)
    reached = np.concatenate([np.ones((1, SIDE, SIDE), np.float32), free[:-1]])
    return float((reached * _entropy(along)).sum(dtype=np.float64))


def _probability(volume: NDArray[np.generic]) -> Field:
    array = np.asarray(volume)
    if array.shape != (SIDE,) * 3:
        raise ValueError(f"a volume must have shape [64, 64, 64], got {list(array.shape)}")
    if array.dtype == np.uint8:
        return array.astype(np.float32) / np.float32(255)
    return array.astype(np.float32).clip(0, 1)


def _entropy(probability: Field) -> Field:
    inner = probability.clip(1e-7, 1 - 1e-7)
    bits: Field = -(inner * np.log2(inner) + (1 - inner) * np.log2(1 - inner))
    return np.where((probability <= 0) | (probability >= 1), np.float32(0), bits)
