"""What outlines demand of the solid: to be covered where they are drawn, and empty beyond (`rust/src/outlines.rs`)."""

from __future__ import annotations

from sketchcore import _core
from sketchcore.nets.sketches import Sketches
from sketchcore.rounds import Volume


def heed_outlines(volume: Volume, sketches: Sketches) -> Volume:
    """The volume with every outline filled as far as its probabilities allow, and what lies beyond one cleared.

    Args:
        volume: float32 [64, 64, 64] (x, y, z), probability of occupancy, symmetric about z = 0.
        sketches: the drawings.

    Returns:
        float32 [64, 64, 64], symmetric as well. No logit moves by more than 2.
    """
    return _core.heed_outlines(volume, sketches.depths, sketches.cameras, sketches.evidence[0])
