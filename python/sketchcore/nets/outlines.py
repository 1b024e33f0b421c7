"""What every outline demands of the solid: to be covered where it is drawn, and empty beyond.

A network weighs probabilities voxel by voxel, and nothing makes it say "somewhere along this ray": where it knows that
there is something and not how deep, each voxel may stay below one half and the solid has a hole. Its probabilities
still say where along the ray the solid is most likely, so that is where it is raised.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from sketchcore import _core
from sketchcore.nets.sketches import BORDER, PIXEL, Sketches
from sketchcore.rounds import Volume

MARGIN = 0.4
"""How far beyond 0 the logits are moved, for the surface is interpolated between voxels."""
SLOPE = 0.6
"""What a logit should grow by in one pixel inside the outline, up to the margin: so that the surface ends at it."""
STROKE = 0.5
"""How far inside the ink's outer border the outline is, in pixels: lines are drawn about it."""
BLUR = 0.5
"""Cells over which what is missing is spread, since drawings err."""
LIMIT = 2.0
"""The most that a logit is moved: drawings err, and networks may know better."""
FAR = 12.0
"""Logits are between -FAR and FAR."""


def heed_outlines(volume: Volume, sketches: Sketches) -> Volume:
    """The volume with every outline filled as far as its probabilities allow, and what lies beyond one cleared.

    Args:
        volume: float32 [64, 64, 64] (x, y, z), probability of occupancy, symmetric about z = 0.
        sketches: the drawings.

    Returns:
        float32 [64, 64, 64], symmetric as well. No logit moves by more than `LIMIT`.
    """
    least = np.float32(1 / (1 + np.exp(FAR)))
    known = np.clip(volume[:, :, 32:], least, 1 - least)
    logits = np.log(known / (1 - known))
    # Zero is what lies outside the grid: there is nothing.
    above = _whole(logits + np.float32(FAR))[None]
    missing = np.zeros_like(volume)
    for pixels, camera in zip(sketches.depths, sketches.cameras, strict=True):
        along = _core.to_camera_grid(above, camera[None])[0].max(axis=0) - np.float32(FAR)
        asked = np.minimum(SLOPE * (pixels - STROKE), MARGIN)
        lack = gaussian_filter(np.clip(asked - along, 0, LIMIT) * (pixels > 0), BLUR)
        each = np.zeros_like(volume)
        spread = np.ascontiguousarray(np.broadcast_to(lack, (1, 64, 64, 64)))
        _core.to_world_grid(spread, camera[None], each[None])
        missing = np.maximum(missing, each)
    missing = np.maximum(missing[:, :, 32:], missing[:, :, 31::-1])
    hull = sketches.evidence[0]
    raised = logits + np.where(hull >= BORDER - PIXEL, missing, 0)
    cut = np.where(hull < BORDER - 2 * PIXEL, np.clip(logits + MARGIN, 0, LIMIT), 0)
    return _whole((1 / (1 + np.exp(cut - raised))).astype(np.float32))


def _whole(half: Volume) -> Volume:
    """A volume that is symmetric about z = 0, from its half z > 0."""
    return np.concatenate([half[:, :, ::-1], half], axis=2)
