"""Which of the eight three-quarter viewpoints a drawing was made from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sketchcore.camera import QUARTER_VIEWS, VIEWPOINTS, pack_cameras
from sketchcore.nets.models import Model
from sketchcore.nets.sketches import Sketches


def guess_viewpoint(model: Model, drawing: NDArray[np.uint8]) -> list[str]:
    """The names of the eight three-quarter viewpoints, most plausible first.

    A viewpoint is as plausible as the network's first prediction from it is sure of itself.

    Args:
        model: the network.
        drawing: uint8 [256, 256], ink 255 on 0.
    """

    def plausibility(name: str) -> float:
        sketches = Sketches(drawing[None], pack_cameras([VIEWPOINTS[name]]))
        return expected_iou(next(model.rounds(sketches, 0)))

    return sorted(QUARTER_VIEWS, key=plausibility, reverse=True)


def expected_iou(probability: NDArray[np.float32]) -> float:
    """The IoU that a prediction, cut at one half, has by its own account: about E|A and B| / E|A or B|."""
    inside = probability > 0.5
    sure = float(probability[inside].sum())
    either = float(inside.sum()) + float(probability[~inside].sum())
    return sure / either if either > 0 else 0.0
