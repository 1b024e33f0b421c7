"""The paper's single-view network and its updater, one drawing after the other (`rounds.py`)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import torch
from numpy.typing import NDArray

from sketchcore.nets.precision import autocast, place, unit
from sketchcore.nets.sketches import Sketches
from sketchcore.nets.unet import PaperNet
from sketchcore.rounds import FIRST, Volume, update_rounds


class PaperModel:
    """A `Model` by `PaperNet`, which knows one drawing at a time."""

    def __init__(self, single: PaperNet, updater: PaperNet | None, device: torch.device) -> None:
        self.single = place(single, device).eval()
        self.updater = None if updater is None else place(updater, device).eval()
        self.device = device

    def first_predictions(self, samples: Sequence[Sketches]) -> Iterator[Volume]:
        for sketches in samples:
            yield next(self.rounds(sketches, 0))

    def in_place(self, sketches: Sketches, always: bool = False) -> Sketches:
        return sketches

    def first(self, drawings: int) -> float:
        return FIRST

    def rounds(self, sketches: Sketches, iterations: int, start: Volume | None = None) -> Iterator[Volume]:
        return update_rounds(
            lambda view, prior: self.predict(sketches.drawings[view], prior), sketches.cameras, iterations, start
        )

    @torch.inference_mode()
    def predict(self, drawing: NDArray[np.uint8], prior: Volume | None) -> Volume:
        """Occupancy of one drawing's camera grid, float32 [64, 64, 64] (depth, row, col), given a prior in it or None.

        Raises:
            ValueError: for a prior, if there is no updater.
        """
        image = unit(drawing[None, None], self.device)
        with autocast(self.device):
            if prior is None:
                logits = self.single(image)
            elif self.updater is None:
                raise ValueError("these weights hold the single-view network alone; train the updater as well")
            else:
                logits = self.updater(image, torch.from_numpy(prior).to(self.device)[None])
        volume: Volume = PaperNet.probability(logits.float())[0].contiguous().cpu().numpy()
        return volume
