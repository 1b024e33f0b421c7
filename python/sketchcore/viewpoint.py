"""Which of the eight three-quarter viewpoints a drawing was made from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sketchcore.camera import QUARTER_VIEWS, VIEWPOINTS, pack_cameras
from sketchcore.nets.models import Model
from sketchcore.nets.sketches import Sketches
from sketchcore.outline import outline_iou


def guess_viewpoint(model: Model, drawing: NDArray[np.uint8]) -> list[str]:
    """The names of the eight three-quarter viewpoints, most plausible first.

    A viewpoint is as plausible as the solid that is predicted from it fills the drawing's outline when seen from it.

    Args:
        model: the network.
        drawing: uint8 [256, 256], ink 255 on 0.
    """

    def plausibility(name: str) -> float:
        camera = VIEWPOINTS[name]
        volume = next(model.rounds(Sketches(drawing[None], pack_cameras([camera])), 0))
        return outline_iou(volume, camera, drawing)

    return sorted(QUARTER_VIEWS, key=plausibility, reverse=True)
