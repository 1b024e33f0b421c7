"""The paper's training: the single view on exact drawings, then the updater on its predictions (section 4.4)."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from sketchcore import _core
from sketchcore.datagen.generate import Batch, generate
from sketchcore.nets.models import PaperModel
from sketchcore.nets.precision import autocast, place, unit
from sketchcore.nets.unet import PaperNet, paper_loss
from sketchcore.train.presets import Preset


class _Batches:
    """Batches of new samples, each made while the one before is trained on."""

    def __init__(self, preset: Preset, seed: int, first: int, views: int) -> None:
        self._arguments = (preset, seed, views)
        self._next_index = first
        self._thread = ThreadPoolExecutor(max_workers=1)
        self._coming = self._order()

    def _order(self) -> Future[Batch]:
        preset, seed, views = self._arguments
        first, self._next_index = self._next_index, self._next_index + preset.batch
        return self._thread.submit(
            generate, seed, preset.batch, first=first, views=views, config=preset.generator, threads=1
        )

    def __iter__(self) -> Iterator[Batch]:
        while True:
            ready, self._coming = self._coming.result(), self._order()
            yield ready

    def close(self) -> None:
        self._thread.shutdown()


class SingleStage:
    """The stage "single": one drawing from one of the eight three-quarter views, and its camera grid.

    Attributes:
        model: the network that is trained.
        samples: how many shapes have been used.
    """

    def __init__(self, preset: Preset, seed: int, device: torch.device, samples: int, width: int) -> None:
        self.model = place(PaperNet(width=width), device)
        self.samples = 0
        self._device = device
        self._source = _Batches(preset, seed, samples, views=1)
        self._batches = iter(self._source)

    def step(self) -> Tensor:
        """One batch; returns the loss."""
        batch = next(self._batches)
        self.samples += len(batch.world)
        drawing = unit(batch.drawings, self._device)
        with autocast(self._device):
            logits = self.model(drawing)
        return paper_loss(logits.float(), unit(batch.frusta[:, 0], self._device))

    def close(self) -> None:
        """Stops the thread."""
        self._source.close()


class UpdaterStage:
    """The stage "updater": a drawing, and what the trained single view predicted from another one.

    Attributes:
        model: the network that is trained.
        samples: how many shapes have been used.
    """

    def __init__(
        self, preset: Preset, seed: int, device: torch.device, samples: int, width: int, single: PaperNet
    ) -> None:
        self.model = place(PaperNet(updater=True, width=width), device)
        self.samples = 0
        self._single = PaperModel(single, None, device)
        self._device = device
        self._source = _Batches(preset, seed, samples, views=2)
        self._batches = iter(self._source)

    def step(self) -> Tensor:
        """One batch; returns the loss."""
        batch = next(self._batches)
        self.samples += len(batch.world)
        prior = torch.from_numpy(self._priors(batch)).to(self._device)
        drawing = unit(batch.drawings[:, 1:], self._device)
        with autocast(self._device):
            logits = self.model(drawing, prior)
        return paper_loss(logits.float(), unit(batch.frusta[:, 1], self._device))

    def _priors(self, batch: Batch) -> NDArray[np.float32]:
        """The single view's predictions from drawing 0, in the camera grids of drawing 1."""
        predictions = np.stack([self._single.predict(drawings[0], None) for drawings in batch.drawings])
        world = np.zeros_like(predictions)
        _core.to_world_grid(predictions, np.ascontiguousarray(batch.packed_cameras[:, 0]), world)
        return _core.to_camera_grid(world, np.ascontiguousarray(batch.packed_cameras[:, 1]))

    def close(self) -> None:
        """Stops the thread."""
        self._source.close()
