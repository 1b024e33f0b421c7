"""Training the compact network as it will be used: in chains of passes over one shape's drawings.

A chain predicts from its first drawing without a prior, hands the detached result on to the next drawing, and so on,
over all drawings and then again: every pass both trains the network and makes the next pass's prior, so that the
network meets its own output at every depth. A batch holds chains at different depths; one that has run its course
is replaced by a new shape.
"""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from queue import Queue
from threading import Event, Thread

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from sketchcore import _core
from sketchcore.consensus import Consensus
from sketchcore.datagen.generate import generate
from sketchcore.nets.compact import CompactConfig, CompactNet, compact_inputs, compact_loss
from sketchcore.nets.precision import autocast, place
from sketchcore.train.presets import Preset

DRAWINGS = (0.4, 0.25, 0.2, 0.15)
"""Shares of the chains with one, two, three and four drawings."""


@dataclass
class Chain:
    """One shape on its way: its drawings, what they say, and what was predicted so far."""

    drawings: NDArray[np.uint8]
    fields: NDArray[np.uint8]
    frusta: NDArray[np.uint8]
    cameras: NDArray[np.float64]
    length: int
    depth: int = 0
    consensus: Consensus = field(default_factory=lambda: Consensus(symmetric=True))

    @property
    def view(self) -> int:
        """Which drawing is next."""
        return self.depth % len(self.drawings)


def start_chain(preset: Preset, seed: int, index: int) -> Chain:
    """Chain number `index` of a seed; how many drawings and passes it has depends on these two alone."""
    random = np.random.default_rng((seed, index))
    views = 1 + int(random.choice(len(DRAWINGS), p=DRAWINGS))
    length = views + int(random.integers(0, views + 2))
    batch = generate(seed, 1, first=index, views=views, config=preset.generator, threads=1)
    return Chain(
        batch.drawings[0],
        _core.evidence_fields(batch.drawings[0]),
        batch.frusta[0],
        batch.packed_cameras[0],
        length,
    )


class ChainSource:
    """Makes chains ahead of time on a thread of its own, in order of their index."""

    def __init__(self, preset: Preset, seed: int, first: int) -> None:
        self._made: Queue[Chain | Exception] = Queue(maxsize=2 * preset.batch)
        self._closed = Event()
        self._thread = Thread(target=self._run, args=(preset, seed, first), daemon=True)
        self._thread.start()

    def _run(self, preset: Preset, seed: int, first: int) -> None:
        index = first
        while not self._closed.is_set():
            try:
                self._made.put(start_chain(preset, seed, index))
            except Exception as error:  # handed to the consumer, which raises it
                self._made.put(error)
                return
            index += 1

    def __iter__(self) -> Iterator[Chain]:
        while True:
            made = self._made.get()
            if isinstance(made, Exception):
                raise made
            yield made

    def close(self) -> None:
        """Stops the thread."""
        self._closed.set()
        while self._thread.is_alive():
            while not self._made.empty():
                self._made.get()
            self._thread.join(0.05)


class ChainStage:
    """The stage "compact": one pass of every chain in the batch a step.

    Attributes:
        model: the network that is trained.
        samples: how many shapes have been started.
    """

    def __init__(self, preset: Preset, seed: int, device: torch.device, samples: int, config: CompactConfig) -> None:
        self.model = place(CompactNet(config), device)
        self._device = device
        self.samples = 0
        self._source = ChainSource(preset, seed, first=samples)
        self._chains = iter(self._source)
        self._batch = [self._next() for _ in range(preset.batch)]
        # Depths are spread from the start, so that no step trains one depth alone.
        for i, chain in enumerate(self._batch):
            chain.length = 1 + i % chain.length
        self._threads = ThreadPoolExecutor(max_workers=torch.get_num_threads())

    def _next(self) -> Chain:
        self.samples += 1
        return next(self._chains)

    def step(self) -> Tensor:
        """One pass of every chain; returns the loss."""
        for i, chain in enumerate(self._batch):
            if chain.depth >= chain.length:
                self._batch[i] = self._next()
        chains = self._batch
        inputs, truth = self._gather(chains)
        with autocast(self._device):
            logits = self.model(**inputs)
        loss = compact_loss(logits, truth)
        probability = logits.detach().float().sigmoid().contiguous().cpu().numpy()
        cameras = np.stack([c.cameras[c.view] for c in chains])
        world = np.stack([_volume(c) for c in chains])
        _core.to_world_grid(probability, cameras, world)
        for chain, prediction in zip(chains, world, strict=True):
            chain.consensus.add(chain.view, prediction)
            chain.depth += 1
        return loss

    def _gather(self, chains: list[Chain]) -> tuple[dict[str, Tensor], Tensor]:
        evidence = self._threads.map(lambda c: _core.evidence(c.fields, c.cameras, c.view, True), chains)
        cameras = np.stack([c.cameras[c.view] for c in chains])
        prior = _core.to_camera_grid(np.stack([_volume(c) for c in chains]), cameras)
        frusta = np.stack([c.frusta[c.view] for c in chains])
        inputs = compact_inputs(
            np.stack([c.drawings[c.view] for c in chains]),
            np.stack([c.fields[c.view] for c in chains]),
            np.stack(list(evidence)),
            prior,
            cameras,
            np.array([len(c.drawings) for c in chains]),
            np.array([c.consensus.volume is not None for c in chains]),
            self._device,
        )
        return inputs, torch.from_numpy(frusta).to(self._device).float() / 255

    def close(self) -> None:
        """Stops the threads."""
        self._source.close()
        self._threads.shutdown()


def _volume(chain: Chain) -> NDArray[np.float32]:
    volume = chain.consensus.volume
    return np.zeros((64, 64, 64), np.float32) if volume is None else volume
