"""One training in several processes, on one machine or on more: what they have to agree on.

`torchrun` starts the processes and says to each who it is. Every one makes its own part of the samples that a single
process with a batch as large as all theirs would make, gradients are averaged (`DistributedDataParallel`), and so all
have the same weights after every step. What is written, printed and measured is up to the first.
"""

from __future__ import annotations

import gc
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
import torch.distributed as dist
from torch import nn
from torch.nn.parallel import DistributedDataParallel

from sketchcore.nets.precision import pick_device


@dataclass(frozen=True)
class Ranks:
    """The processes that train together, as one of them sees it.

    Attributes:
        rank: which one this is.
        world: how many there are.
        here: how many of them are on this machine.
    """

    rank: int = 0
    world: int = 1
    here: int = 1

    @property
    def first(self) -> bool:
        """Whether this one writes, prints and measures."""
        return self.rank == 0

    def wrap(self, net: nn.Module) -> nn.Module:
        """The network as it is called in training, with gradients that are the mean of all processes'.

        Its weights become those of the first. On CUDA, batch normalisation is over all processes' batches; on a CPU,
        where torch has no such layer, each normalises its own, and the first one's running statistics count.
        """
        if self.world == 1:
            return net
        if next(net.parameters()).is_cuda:
            # In place, for the whole network is never one layer.
            nn.SyncBatchNorm.convert_sync_batchnorm(net)  # type: ignore[no-untyped-call]
        return DistributedDataParallel(net)

    def mean(self, value: float) -> float:
        """The mean of a number over all processes."""
        if self.world == 1:
            return value
        total = torch.tensor(value, dtype=torch.float64)
        dist.all_reduce(total)
        return total.item() / self.world

    def told(self, value: float) -> float:
        """The first process's number, for all of them."""
        if self.world == 1:
            return value
        said = torch.tensor(value, dtype=torch.float64)
        dist.broadcast(said, 0)
        return said.item()

    @contextmanager
    def file(self, path: Path) -> Iterator[Path]:
        """A file of the first process, for all of them: machines need no folder in common.

        It must be there; for others than the first it is a copy.
        """
        if self.world == 1:
            yield path
            return
        content = torch.from_numpy(np.fromfile(path, np.uint8)) if self.first else torch.empty(0, dtype=torch.uint8)
        size = int(self.told(len(content)))
        if not self.first:
            content = torch.empty(size, dtype=torch.uint8)
        dist.broadcast(content, 0)
        if self.first:
            yield path
            return
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / path.name
            content.numpy().tofile(copy)
            yield copy

    def threads(self, asked: int | None) -> int:
        """Threads that make samples: as many as asked for; None for one a core, shared with those on this machine."""
        return asked or max(1, (os.cpu_count() or 1) // self.here)


ALONE = Ranks()
"""A process by itself."""


@contextmanager
def joined(device: str | None) -> Iterator[tuple[Ranks, torch.device]]:
    """The processes that `torchrun` started with this one, or this one alone; and what it computes on.

    Args:
        device: as for `pick_device`; each process on a machine takes a graphics processor of its own.

    Raises:
        ValueError: for a device that is not there, or fewer graphics processors than processes.
    """
    chosen = pick_device(device)
    world = int(os.environ.get("WORLD_SIZE", "1")) if "RANK" in os.environ else 1
    if world == 1:
        yield Ranks(), chosen
        return
    local, here = int(os.environ.get("LOCAL_RANK", "0")), int(os.environ.get("LOCAL_WORLD_SIZE", "1"))
    if chosen.type == "cuda":
        if here > torch.cuda.device_count():
            raise ValueError(
                f"{here} processes on a machine with {torch.cuda.device_count()} graphics processors; start as many as "
                "there are (--nproc-per-node)"
            )
        chosen = torch.device("cuda", local)
        torch.cuda.set_device(chosen)
    ours = not dist.is_initialized()  # a program that trains more than once joins by itself
    if ours:
        dist.init_process_group("cpu:gloo,cuda:nccl" if chosen.type == "cuda" else "gloo")
    try:
        yield Ranks(dist.get_rank(), world, here), chosen
        if ours:
            dist.barrier()  # nobody leaves while others still talk
    finally:
        if ours:
            gc.collect()  # what holds on to the group would take its threads along when the process ends
            dist.destroy_process_group()
