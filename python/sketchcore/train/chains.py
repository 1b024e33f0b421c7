"""Training the compact network as it will be used: one shape's drawings, then rounds on its own output.

A chain predicts from a shape's drawings without a prior and hands the detached result to its next round, so that the
network meets its own output. A batch holds chains at different depths; one that has run its course is replaced by a
new shape.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from sketchcore.datagen.prepared import Prepared
from sketchcore.nets.compact import CompactConfig, CompactNet, read_inputs
from sketchcore.nets.models import CompactModel
from sketchcore.nets.precision import autocast, place, unit
from sketchcore.nets.sketches import Sketches
from sketchcore.train.ahead import Ahead
from sketchcore.train.heldout import heldout_iou
from sketchcore.train.loss import distance_loss, occupancy_loss
from sketchcore.train.presets import Preset
from sketchcore.train.samples import training_samples
from sketchcore.train.truth import WORLD_TRUTHS

DRAWINGS = (0.4, 0.25, 0.2, 0.15)
"""Shares of the chains with one, two, three and four drawings."""
PASSES = (0.75, 0.15, 0.1)
"""Shares of the chains with one, two and three passes."""
CHAINS = ("index", "depth", "prior")
"""What a checkpoint keeps of each chain; drawings and truth are made again from its index."""


@dataclass
class Chain:
    """One shape on its way: its drawings, its truth, and what was predicted so far.

    Attributes:
        sketches: its drawings.
        truth: float32 [64, 64, 32], of the half grid z > 0 (`truth.py`).
        length: passes it goes through.
        depth: passes it went through.
        prior: float32 [64, 64, 32], the latest prediction; zeros before the first.
        index: its number, which says what it is of.
    """

    sketches: Sketches
    truth: NDArray[np.float32]
    length: int
    depth: int
    prior: NDArray[np.float32]
    index: int = 0


def start_chain(preset: Preset, seed: int, index: int, data: Prepared | None = None) -> Chain:
    """Chain number `index` of a seed; how many drawings and passes it has depends on these two alone.

    Of a shape that the generator makes, or of a mesh from the training split of a data set.
    """
    random = np.random.default_rng((seed, index))
    views = 1 + int(random.choice(len(DRAWINGS), p=DRAWINGS))
    length = 1 + int(random.choice(len(PASSES), p=PASSES))
    batch = training_samples(preset, seed, index, 1, views, data)
    chain = Chain(
        Sketches(batch.drawings[0], batch.packed_cameras[0]),
        WORLD_TRUTHS[preset.truth](batch, 0),
        length,
        0,
        np.zeros((64, 64, 32), np.float32),
        index,
    )
    _ = chain.sketches.evidence  # on the thread that makes the chain
    return chain


class ChainStage:
    """The stage "compact": one pass of every chain in the batch a step.

    Attributes:
        model: the network that is trained.
        samples: how many shapes have been started.
    """

    def __init__(
        self,
        preset: Preset,
        seed: int,
        device: torch.device,
        samples: int,
        config: CompactConfig,
        data: Prepared | None = None,
        under_way: Mapping[str, Tensor] | None = None,
    ) -> None:
        """Starts the threads that make chains, and the first ones.

        Args:
            preset: constants.
            seed: of the shapes.
            device: where to train.
            samples: how many shapes were started before.
            config: of the network.
            data: data set of meshes; None for the preset's grammar.
            under_way: what `under_way` said when the run was left, to go on with the same chains. If it is of another
                number of chains than the preset's batch, new ones are started.
        """
        self.model = place(CompactNet(config), device)
        self._device, self._grammar, self._data = device, preset.grammar, data
        self._loss = distance_loss if preset.truth == "distance" else occupancy_loss
        self.samples = 0
        self._chains = Ahead(partial(start_chain, preset, seed, data=data), samples, 2 * preset.batch, preset.threads)
        if under_way and len(under_way["index"]) == preset.batch:
            self._batch = [
                replace(start_chain(preset, seed, int(index), data), depth=int(depth), prior=prior.numpy())
                for index, depth, prior in zip(*(under_way[name] for name in CHAINS), strict=True)
            ]
        else:
            self._batch = [self._next() for _ in range(preset.batch)]

    @property
    def waited(self) -> float:
        """Seconds that were spent waiting for chains."""
        return self._chains.waited

    def _next(self) -> Chain:
        self.samples += 1
        return next(self._chains)

    def step(self) -> Tensor:
        """One pass of every chain; returns the loss."""
        for i, chain in enumerate(self._batch):
            if chain.depth >= chain.length:
                self._batch[i] = self._next()
        truth = torch.from_numpy(np.stack([c.truth for c in self._batch])).to(self._device)
        with autocast(self._device):
            logits = self.model(**compact_inputs(self._batch, self._device))
        loss = self._loss(logits, truth)
        predictions = logits.detach().float().sigmoid().cpu().numpy()
        for chain, prediction in zip(self._batch, predictions, strict=True):
            chain.prior = prediction
            chain.depth += 1
        return loss

    def under_way(self) -> dict[str, Tensor]:
        """The chains of the batch: what it takes to go on with them as if nothing had happened."""
        chains = self._batch
        columns = [c.index for c in chains], [c.depth for c in chains], np.stack([c.prior for c in chains])
        return {name: torch.as_tensor(column) for name, column in zip(CHAINS, columns, strict=True)}

    def measure(self, net: nn.Module) -> float:
        """The held-out IoU of a network like the model: from one drawing and from three, after a round."""
        assert isinstance(net, CompactNet)
        model = CompactModel(net, self._device)
        scores = heldout_iou(model, views=(1, 3), grammar=self._grammar, data=self._data)
        return sum(scores) / len(scores)

    def close(self) -> None:
        """Stops the threads."""
        self._chains.close()


def compact_inputs(chains: list[Chain], device: torch.device) -> dict[str, Any]:
    """The arguments of `CompactNet.forward` for a batch of chains."""
    sketches = [c.sketches for c in chains]
    return {
        **read_inputs(sketches, device),
        "evidence": unit(np.stack([s.evidence for s in sketches]), device),
        "prior": torch.from_numpy(np.stack([c.prior for c in chains])).to(device),
        "has_prior": torch.tensor([float(c.depth > 0) for c in chains], device=device),
    }
