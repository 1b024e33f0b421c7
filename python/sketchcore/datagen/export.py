"""A data set as WebDataset shards: made in one process or on many machines, and resumed after a kill."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from sketchcore.datagen.engines import ENGINES
from sketchcore.datagen.generate import default_config, generate
from sketchcore.datagen.grammars import Grammar, find_grammar
from sketchcore.datagen.manifest import Shard, begin, shard_name, whole_shards, write_manifest, write_sidecar
from sketchcore.datagen.places import open_place
from sketchcore.datagen.shards import write_shard


@dataclass(frozen=True)
class Export:
    """What is exported: samples `first` ... `first + count - 1` of a data set, in so many shards.

    Attributes:
        seed: as for `sketchcore.generate`, like `count`, `first`, `views`, `config` and `grammar`.
        count: how many samples.
        shards: how many files; the samples are shared evenly among them, in order.
        first: index of the first sample.
        views: drawings a sample.
        config: what differs from the default config.
        grammar: what shapes are of.

    Raises:
        ValueError: for an argument that `generate` refuses, or fewer samples than shards.
    """

    seed: int
    count: int
    shards: int
    first: int = 0
    views: int = 1
    config: Mapping[str, Any] = field(default_factory=dict)
    grammar: str | Grammar | None = None

    def __post_init__(self) -> None:
        if not 1 <= self.shards <= self.count:
            raise ValueError(
                f"{self.count} samples go into 1 to {self.count} shards, got {self.shards}"
                if self.count > 0
                else f"count must be at least 1, got {self.count}"
            )
        if self.first + self.count > 2**64:
            raise ValueError(f"samples are numbered to 2^64 - 1; first {self.first} leaves no {self.count}")
        # Says now what is wrong with the others.
        generate(self.seed, 0, first=self.first, views=self.views, config=self.config, grammar=self.grammar)

    def range(self, number: int) -> tuple[int, int]:
        """The first sample of a shard, and how many it has."""
        start, end = (self.count * n // self.shards for n in (number, number + 1))
        return self.first + start, end - start

    def describe(self) -> dict[str, Any]:
        """All that the samples depend on: the whole config, and the hash of a grammar's file."""
        about: dict[str, Any] | None = None
        grammar = None if self.grammar is None else find_grammar(self.grammar)
        if grammar is not None:
            about = {"name": grammar.name()}
            if isinstance(self.grammar, str) and self.grammar.endswith(".py"):
                about["sha256"] = hashlib.sha256(Path(self.grammar).read_bytes()).hexdigest()
        numbers = {name: getattr(self, name) for name in ("seed", "first", "count", "shards", "views")}
        return numbers | {"grammar": about, "config": _merged(default_config(grammar), self.config)}


def _merged(base: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    merged = dict(base)
    for name, value in changes.items():
        within = isinstance(value, Mapping) and isinstance(merged.get(name), Mapping)
        merged[name] = _merged(merged[name], value) if within else value
    return merged


def make_shard(
    task: Export,
    url: str,
    number: int,
    *,
    threads: int | None = 1,
    progress: Callable[[int], object] | None = None,
) -> Shard:
    """Makes one shard, which appears whole, and then the file beside it.

    Args:
        task: what is exported.
        url: where to.
        number: of the shard.
        threads: that make samples; None for one a core.
        progress: called with the number of samples written so far.

    Raises:
        OSError: if it cannot be written; it is not there then.
    """
    place, name = open_place(url), shard_name(number)
    first, count = task.range(number)
    with place.writing(name) as path:
        write_shard(
            path,
            task.seed,
            first,
            count,
            views=task.views,
            config=task.config,
            grammar=task.grammar,
            threads=threads,
            progress=progress,
        )
        with path.open("rb") as file:
            shard = Shard(name, first, count, path.stat().st_size, hashlib.file_digest(file, "sha256").hexdigest())
    write_sidecar(place, shard)
    return shard


def export(
    task: Export,
    url: str | os.PathLike[str],
    *,
    engine: str = "local",
    workers: int | None = None,
    verify: bool = False,
    progress: Callable[[int], object] | None = None,
) -> dict[str, Any]:
    """Writes a data set as WebDataset shards (docs/export.md). What is there already, whole, is kept.

    The bytes do not depend on the engine or on the number of workers.

    Args:
        task: what to export.
        url: folder, or a URL that fsspec opens (s3://bucket/name, ...); made if need be.
        engine: "local" for this process, "processes" for several, "ray" for a Ray cluster.
        workers: shards that are made at a time; None for one a core. Not for "local", which makes samples on all cores.
        verify: check shards that are there by their hashes, and not by their sizes alone.
        progress: called with the number of samples that are there so far.

    Returns:
        the manifest, which is written last.

    Raises:
        ValueError: for an unknown engine, a URL that cannot be opened, or one that holds another export.
        OSError: if something cannot be written; shards that are there stay.
        RuntimeError: if workers died too often.
    """
    if engine != "local" and engine not in ENGINES:
        raise ValueError(f"unknown engine {engine!r}; the engines are local, {', '.join(ENGINES)}")
    if workers is not None and workers < 1:
        raise ValueError(f"workers must be at least 1, or None for one a core; got {workers}")
    place, about = open_place(url), task.describe()
    if engine != "local" and not place.shared:
        raise ValueError(f"{place.url} is in the memory of one process; take the engine local, or another place")
    begin(place, about)
    place.sweep()
    expected = {shard_name(number): task.range(number) for number in range(task.shards)}
    whole = whole_shards(place, expected, verify)
    missing = [number for number, name in enumerate(expected) if name not in whole]
    done = sum(shard.count for shard in whole.values())

    def show(more: int) -> None:
        if progress is not None:
            progress(done + more)

    show(0)
    if engine == "local":
        for number in missing:
            done += make_shard(task, place.url, number, threads=None, progress=show).count
    else:
        # A grammar's file may be on this machine alone.
        sent = replace(task, grammar=find_grammar(task.grammar)) if engine == "ray" and task.grammar else task
        for shard in ENGINES[engine](partial(make_shard, sent, place.url), missing, workers):
            done += shard.count
            show(0)
    place.sweep()
    whole = whole_shards(place, expected)
    if lost := [name for name in expected if name not in whole]:
        raise RuntimeError(
            f"{place.url} lacks {len(lost)} shards that were made, {lost[0]} first; do all workers see the same folder?"
        )
    return write_manifest(place, about, [whole[name] for name in expected])
