"""The slow twin of the kernel that heeds outlines, by NumPy and SciPy, written from what ARCHITECTURE.md says."""

import numpy as np
from scipy.ndimage import gaussian_filter

from reference import to_camera_grid, to_world_grid


def heed(volume, depths, views, hull):
    """The half grid z > 0, float64; and which of its voxels are too near a frustum's border to be compared."""
    known = np.clip(volume[:, :, 32:].astype(np.float64), 1 / (1 + np.exp(12)), 1 - 1 / (1 + np.exp(12)))
    logits = np.log(known / (1 - known))
    above = np.concatenate([logits[:, :, ::-1], logits], axis=2) + 12  # nothing is outside
    missing, close = np.zeros((64, 64, 64)), np.zeros((64, 64, 64), bool)
    for pixels, camera in zip(depths, views, strict=True):
        along = to_camera_grid(above, camera).max(axis=0) - 12
        asked = np.minimum(0.6 * (pixels - 0.5), 0.4)
        lack = gaussian_filter(np.where(pixels > 0, np.clip(asked - along, 0, 2), 0), 0.5)
        seen, margin = to_world_grid(np.broadcast_to(lack, (64, 64, 64)), camera, np.zeros((64, 64, 64)))
        missing, close = np.maximum(missing, seen), close | (margin < 0.51)
    missing, close = (
        both(a[:, :, 32:], a[:, :, 31::-1]) for both, a in ((np.maximum, missing), (np.logical_or, close))
    )
    logits = logits + np.where(hull >= 120, missing, 0) - np.where(hull < 112, np.clip(logits + 0.4, 0, 2), 0)
    return 1 / (1 + np.exp(-logits)), close
