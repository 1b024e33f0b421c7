"""The generator as a torch data set, split over ranks and workers without talking."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import torch
from torch import Tensor
from torch.utils.data import IterableDataset, get_worker_info

from sketchcore.datagen.generate import generate
from sketchcore.datagen.grammars import Grammar, find_grammar


class Generated(IterableDataset[dict[str, Tensor]]):
    """Samples `first`, `first + 1`, ... of the data set that (config, seed) names, each made when it is asked for.

    Rank r of n takes every n-th sample, and worker w of m of a `DataLoader` every m-th of those: together they make
    each sample once. Making a sample takes milliseconds and releases the interpreter, so `num_workers=0` is often
    enough; with workers use `multiprocessing_context="spawn"` or "forkserver", since forking a process whose Rust
    threads run is not safe.

    Args:
        seed: as for `sketchcore.generate`.
        count: how many samples over all ranks and workers; None for no end.
        first: index of the first.
        views: drawings a sample, 1 to 13.
        config: what differs from `sketchcore.datagen.default_config(grammar)`.
        grammar: as for `sketchcore.generate`.
        rank: this process's number; None asks torch.distributed, and is 0 without it.
        ranks: how many processes there are; None likewise.

    Yields:
        dictionaries of uint8 tensors "drawings" [views, 256, 256], "world" [64, 64, 64], "frusta"
        [views, 64, 64, 64], float64 "cameras" [views, 15] (`Camera.packed`) and int64 "index" [].
    """

    def __init__(
        self,
        seed: int = 0,
        *,
        count: int | None = None,
        first: int = 0,
        views: int = 1,
        config: Mapping[str, Any] | None = None,
        grammar: str | Grammar | None = None,
        rank: int | None = None,
        ranks: int | None = None,
    ) -> None:
        if (rank is None) != (ranks is None):
            raise ValueError("say both rank and ranks, or neither")
        if rank is not None and ranks is not None and not 0 <= rank < ranks:
            raise ValueError(f"rank must lie between 0 and ranks - 1, got {rank} of {ranks}")
        self.seed, self.count, self.first, self.views = seed, count, first, views
        self.config, self.grammar = dict(config or {}), None if grammar is None else find_grammar(grammar)
        self.rank, self.ranks = rank, ranks
        generate(seed, 0, first=first, views=views, config=self.config, grammar=self.grammar)  # says now what is wrong

    def __iter__(self) -> Iterator[dict[str, Tensor]]:
        rank, ranks = self._place()
        worker = get_worker_info()
        part, parts = (worker.id, worker.num_workers) if worker else (0, 1)
        offset, stride = rank + ranks * part, ranks * parts
        end = None if self.count is None else self.first + self.count
        index = self.first + offset
        while end is None or index < end:
            yield self._sample(index)
            index += stride

    def _place(self) -> tuple[int, int]:
        if self.rank is not None and self.ranks is not None:
            return self.rank, self.ranks
        if torch.distributed.is_available() and torch.distributed.is_initialized():
            return torch.distributed.get_rank(), torch.distributed.get_world_size()
        return 0, 1

    def _sample(self, index: int) -> dict[str, Tensor]:
        chosen: dict[str, Any] = {"config": self.config, "grammar": self.grammar}
        batch = generate(self.seed, 1, first=index, views=self.views, threads=1, **chosen)
        return {
            "drawings": torch.from_numpy(batch.drawings[0]),
            "world": torch.from_numpy(batch.world[0]),
            "frusta": torch.from_numpy(batch.frusta[0]),
            "cameras": torch.from_numpy(batch.packed_cameras[0]),
            "index": torch.tensor(index),
        }
