"""Drawings brought to where their cameras would show the object: in place, in size, and in the direction seen from.

A drawing that is made freehand is off centre, too small, or seen from a little elsewhere. What `nets/registration.py`
says of it is undone: the drawing is moved and scaled, the camera is turned. What is as good as right stays as it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image

from sketchcore.camera import Camera
from sketchcore.nets.precision import autocast, unit
from sketchcore.nets.registration import UNITS, RegistrationNet, describe, origin, rotated

_LOOKS = 2
"""The second look is at a drawing that is nearly in place, and so more exact."""
_MIN_SCALE, _MIN_SHIFT, _MIN_TURN = 0.05, 4.0, 2.5
"""Below these (logarithm, pixels, degrees) a drawing stays: the networks are used to as much, and an estimate is no
better."""


@dataclass(frozen=True)
class Registration:
    """How a drawing lies to the camera that it claims.

    Attributes:
        scale: how many times as large it is as the camera would show the object.
        shift: float64 [2], how far the object's centre is from where the camera shows it, pixels right and down.
        turn: float64 [3], how the camera that it was made from is turned about the object's centre, degrees about the
            camera's x, y and z axes.
    """

    scale: float
    shift: NDArray[np.float64]
    turn: NDArray[np.float64]

    @property
    def moved(self) -> bool:
        """Whether the drawing is to be moved and scaled."""
        return abs(np.log(self.scale)) > _MIN_SCALE or float(np.hypot(*self.shift)) > _MIN_SHIFT

    @property
    def turned(self) -> bool:
        """Whether the camera is to be turned."""
        return float(np.linalg.norm(self.turn)) > _MIN_TURN


def register(
    net: RegistrationNet, drawing: NDArray[np.uint8], camera: Camera
) -> tuple[NDArray[np.uint8], Camera, Registration]:
    """The drawing in its place, the camera that it was made from, and what was found.

    Args:
        net: the registration network.
        drawing: uint8 [256, 256], ink 255 on 0.
        camera: that the drawing claims to be made from.
    """
    placed, seen_from = drawing, camera
    found = Registration(1.0, np.zeros(2), np.zeros(3))
    for _ in range(_LOOKS):
        found = _chained(found, _estimate(net, placed, seen_from))
        placed, seen_from = placed_by(found, drawing, camera), rotated(camera, found.turn)
    return (
        placed if found.moved else drawing,
        seen_from if found.turned else camera,
        found,
    )


def placed_by(found: Registration, drawing: NDArray[np.uint8], camera: Camera) -> NDArray[np.uint8]:
    """The drawing as it would be without its scale and shift: uint8 [256, 256], ink 255 on 0."""
    scale, center = found.scale, origin(camera) + 0.5
    offset = center + found.shift - scale * center
    # Lines that shrink grow faint, and are brought back.
    image = Image.fromarray(drawing).transform(
        drawing.shape, Image.Transform.AFFINE, (scale, 0, offset[0], 0, scale, offset[1]), Image.Resampling.BICUBIC
    )
    return (np.asarray(image, np.float32) * np.float32(max(scale, 1.0))).clip(0, 255).astype(np.uint8)


@torch.inference_mode()
def _estimate(net: RegistrationNet, drawing: NDArray[np.uint8], camera: Camera) -> Registration:
    device = next(net.parameters()).device
    with autocast(device):
        mean, _ = net(unit(drawing[None], device), torch.from_numpy(describe(camera))[None].to(device))
    values = mean[0].double().cpu().numpy() * np.array(UNITS)
    return Registration(float(np.exp(values[0])), values[1:3], values[3:])


def _chained(first: Registration, then: Registration) -> Registration:
    """What was found in two looks, the second one at the drawing as the first one placed it."""
    return Registration(first.scale * then.scale, first.shift + first.scale * then.shift, first.turn + then.turn)
