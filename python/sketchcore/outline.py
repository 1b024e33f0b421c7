"""How well a solid fills the outline of a drawing: what can be said of a reconstruction without its truth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sketchcore import _core
from sketchcore.camera import Camera
from sketchcore.grids import silhouette


def outline_iou(probability: NDArray[np.float32], camera: Camera, drawing: NDArray[np.uint8]) -> float:
    """IoU of the solid's outline, as the camera sees its 0.5 iso-surface, and the drawing's.

    Both fill their holes: what the background does not reach from the border counts as inside.

    Args:
        probability: float32 [64, 64, 64], world grid (x, y, z).
        camera: the drawing's.
        drawing: uint8 [256, 256], ink 255 on 0.
    """
    depth, _ = _core.isosurface(probability, 0.5, camera.packed, len(drawing))
    # As ink, the solid's outline is filled by the same rule as the drawing's.
    seen = silhouette(np.where(np.isfinite(depth), 255, 0).astype(np.uint8)).astype(bool)
    drawn = silhouette(drawing).astype(bool)
    return float((seen & drawn).sum() / max((seen | drawn).sum(), 1))


def pieces(probability: NDArray[np.float32]) -> list[int]:
    """Sizes in voxels of the pieces that hang together through faces, the largest first."""
    from scipy.ndimage import label

    labels, _ = label(probability > 0.5)
    return sorted(np.bincount(labels.ravel())[1:].tolist(), reverse=True)
