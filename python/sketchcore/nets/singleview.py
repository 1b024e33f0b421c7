"""A network that knows one drawing and nothing else: what comes of it, for whoever asks for rounds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from sketchcore.nets.multiscale import MultiscaleNet
from sketchcore.nets.precision import autocast, place, unit
from sketchcore.nets.sketches import Sketches
from sketchcore.nets.unet import PaperNet
from sketchcore.rounds import FIRST, Volume, visit

SingleViewNet = PaperNet | MultiscaleNet
"""A drawing in, its camera grid out: [B, 1, 256, 256] -> logits [B, 2, 64, 64, 64]."""


class SingleViewModel:
    """The camera grid of the first drawing, taken to the world grid; further drawings and rounds change nothing.

    That is how the paper compares its single view with other networks.
    """

    def __init__(self, net: SingleViewNet, device: torch.device) -> None:
        self.net = place(net, device).eval()
        self.device = device

    def first_predictions(self, samples: Sequence[Sketches]) -> Iterator[Volume]:
        for sketches in samples:
            yield next(self.rounds(sketches, 0))

    def in_place(self, sketches: Sketches, always: bool = False) -> Sketches:
        return sketches

    def first(self, drawings: int) -> float:
        return FIRST

    def rounds(self, sketches: Sketches, iterations: int, start: Volume | None = None) -> Iterator[Volume]:
        """Yields the same float32 [64, 64, 64] (x, y, z) for the first prediction and each round.

        Voxels that the first drawing's camera does not see stay as they are in `start`, or 0.
        """
        volume = visit(lambda view, _: self.predict(sketches.drawings[view : view + 1])[0], sketches.cameras, 0, start)
        for _ in range(iterations + 1):
            yield volume

    @torch.inference_mode()
    def predict(self, drawings: NDArray[np.uint8]) -> Volume:
        """Occupancy of each drawing's camera grid, float32 [n, 64, 64, 64] (depth, row, col).

        Args:
            drawings: uint8 [n, 256, 256], ink 255 on 0.
        """
        with autocast(self.device):
            logits = self.net(unit(drawings[:, None], self.device))
        occupied: Volume = PaperNet.probability(logits.float()).cpu().numpy()
        return occupied
