"""The paper's training: the single view, then the updater on its predictions (section 4.4).

The multi-scale network is trained like the single view.
"""

from __future__ import annotations

from functools import partial
from itertools import count

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from sketchcore import _core
from sketchcore.datagen.generate import Batch
from sketchcore.datagen.prepared import Prepared
from sketchcore.nets.multiscale import MultiscaleNet
from sketchcore.nets.papermodel import PaperModel
from sketchcore.nets.precision import autocast, place, unit
from sketchcore.nets.singleview import SingleViewModel, SingleViewNet
from sketchcore.nets.unet import PaperNet, paper_loss
from sketchcore.train.ahead import Ahead
from sketchcore.train.distributed import ALONE, Ranks
from sketchcore.train.heldout import heldout_iou
from sketchcore.train.presets import Preset
from sketchcore.train.samples import training_samples
from sketchcore.train.truth import in_camera_grids


def _batches(preset: Preset, seed: int, first: int, views: int, data: Prepared | None, ranks: Ranks) -> Ahead[Batch]:
    """This process's part of each of the batches that all processes make together."""
    threads = ranks.threads(preset.threads)
    return Ahead(partial(_batch, preset, seed, first, views, data), count(ranks.rank, ranks.world), 1, threads)


def _batch(preset: Preset, seed: int, first: int, views: int, data: Prepared | None, number: int) -> Batch:
    first += number * preset.batch
    return training_samples(preset, seed, first, preset.batch, views, data, frusta=True)


class SingleStage:
    """The stages "single" and "multiscale": one drawing, and its camera grid.

    Attributes:
        model: the network that is trained.
        forward: what is called for it in training (`Ranks.wrap`).
        samples: how many shapes have been used, by all processes.
    """

    def __init__(
        self,
        preset: Preset,
        seed: int,
        device: torch.device,
        samples: int,
        net: SingleViewNet,
        data: Prepared | None = None,
        ranks: Ranks = ALONE,
    ) -> None:
        self.model = place(net, device)
        self.forward: nn.Module = self.model
        self.samples = 0
        self._truth, self._grammar = preset.truth, preset.grammar
        self._device, self._data, self._ranks = device, data, ranks
        self._batches = _batches(preset, seed, samples, views=1, data=data, ranks=ranks)

    @property
    def waited(self) -> float:
        """Seconds that were spent waiting for batches."""
        return self._batches.waited

    def step(self) -> Tensor:
        """One batch; returns the loss."""
        batch = next(self._batches)
        self.samples += len(batch.world) * self._ranks.world
        drawing = unit(batch.drawings, self._device)
        with autocast(self._device):
            logits = self.forward(drawing)
        return paper_loss(logits.float(), unit(in_camera_grids(self._truth, batch.frusta[:, 0]), self._device))

    def under_way(self) -> dict[str, Tensor]:
        """Nothing: each batch is new, and says by its number what is in it."""
        return {}

    def measure(self, net: nn.Module) -> float:
        """The held-out IoU of a network like the model: from one drawing."""
        assert isinstance(net, PaperNet | MultiscaleNet)
        model = SingleViewModel(net, self._device)
        return heldout_iou(model, views=(1,), rounds=0, grammar=self._grammar, data=self._data)[0]

    def close(self) -> None:
        """Stops the threads."""
        self._batches.close()


class UpdaterStage:
    """The stage "updater": a drawing, and what the trained single view predicted from another one.

    Attributes:
        model: the network that is trained.
        forward: what is called for it in training (`Ranks.wrap`).
        samples: how many shapes have been used, by all processes.
    """

    def __init__(
        self,
        preset: Preset,
        seed: int,
        device: torch.device,
        samples: int,
        single: PaperNet,
        data: Prepared | None = None,
        ranks: Ranks = ALONE,
    ) -> None:
        self.model = place(PaperNet(updater=True, width=single.width), device)
        self.forward: nn.Module = self.model
        self.samples = 0
        self._truth, self._grammar = preset.truth, preset.grammar
        self._single = single
        self._predict = SingleViewModel(single, device).predict
        self._device, self._data, self._ranks = device, data, ranks
        self._batches = _batches(preset, seed, samples, views=2, data=data, ranks=ranks)

    @property
    def waited(self) -> float:
        """Seconds that were spent waiting for batches."""
        return self._batches.waited

    def step(self) -> Tensor:
        """One batch; returns the loss."""
        batch = next(self._batches)
        self.samples += len(batch.world) * self._ranks.world
        prior = torch.from_numpy(self._priors(batch)).to(self._device)
        drawing = unit(batch.drawings[:, 1:], self._device)
        with autocast(self._device):
            logits = self.forward(drawing, prior)
        return paper_loss(logits.float(), unit(in_camera_grids(self._truth, batch.frusta[:, 1]), self._device))

    def _priors(self, batch: Batch) -> NDArray[np.float32]:
        """The single view's predictions from drawing 0, in the camera grids of drawing 1."""
        predictions = np.ascontiguousarray(self._predict(batch.drawings[:, 0]))
        world = np.zeros_like(predictions)
        _core.to_world_grid(predictions, np.ascontiguousarray(batch.packed_cameras[:, 0]), world)
        return _core.to_camera_grid(world, np.ascontiguousarray(batch.packed_cameras[:, 1]))

    def under_way(self) -> dict[str, Tensor]:
        """Nothing: each batch is new, and says by its number what is in it."""
        return {}

    def measure(self, net: nn.Module) -> float:
        """The held-out IoU of a network like the model: from two drawings, after a round."""
        assert isinstance(net, PaperNet)
        model = PaperModel(self._single, net, self._device)
        return heldout_iou(model, views=(2,), rounds=1, grammar=self._grammar, data=self._data)[0]

    def close(self) -> None:
        """Stops the threads."""
        self._batches.close()
