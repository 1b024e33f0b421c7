"""What can be measured of a reconstruction without its truth: outlines against drawings, and pieces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sketchcore import _core
from sketchcore.grids import silhouette
from sketchcore.reconstruction import Reconstruction


def outline_iou(solid: Reconstruction) -> list[float]:
    """For each drawing, the IoU of the solid's outline as its camera sees it and the drawing's, filled.

    Both fill their holes: what the background does not reach from the border counts as inside.
    """
    return [
        _overlap(_core.isosurface(solid.probability, 0.5, camera.packed, len(drawing))[0], drawing)
        for drawing, camera in zip(solid.drawings, solid.views, strict=True)
    ]


def _overlap(depth: NDArray[np.float32], drawing: NDArray[np.uint8]) -> float:
    # As ink, the solid's outline is filled by the same rule as the drawing's.
    seen = silhouette(np.where(np.isfinite(depth), 255, 0).astype(np.uint8)).astype(bool)
    drawn = silhouette(drawing).astype(bool)
    return float((seen & drawn).sum() / max((seen | drawn).sum(), 1))


def pieces(probability: NDArray[np.float32]) -> list[int]:
    """Sizes in voxels of the pieces that hang together through faces, the largest first."""
    from scipy.ndimage import label

    labels, _ = label(probability > 0.5)
    return sorted(np.bincount(labels.ravel())[1:].tolist(), reverse=True)
