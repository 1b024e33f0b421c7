"""Synthetic shapes, drawings and volumes, made by the Rust core (paper, section 4)."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sketchcore import _core
from sketchcore.camera import Camera
from sketchcore.datagen.grammars import Grammar, find_grammar
from sketchcore.destination import destination
from sketchcore.shape import Shape

Arrays = tuple[NDArray[np.uint8], NDArray[np.uint8], NDArray[np.uint8]]


@dataclass(frozen=True)
class Batch:
    """What `generate` returns: `count` samples of `views` drawings each.

    Attributes:
        drawings: uint8 [count, views, 256, 256], ink 255 on 0.
        world: uint8 [count, 64, 64, 64] (x, y, z), 0 or 1.
        frusta: uint8 [count, views, 64, 64, 64] (depth, row, col), the share of a cell that is inside; 255 = all.
        packed_cameras: float64 [count, views, 15], see `Camera.packed`.
        packed_shapes: for each sample float64 [n, 8] or [n, 12], see `Shape.packed`.
    """

    drawings: NDArray[np.uint8]
    world: NDArray[np.uint8]
    frusta: NDArray[np.uint8]
    packed_cameras: NDArray[np.float64]
    packed_shapes: Sequence[NDArray[np.float64]]

    @cached_property
    def cameras(self) -> list[list[Camera]]:
        """`count` lists of `views` cameras."""
        return [[Camera.from_packed(row) for row in rows] for rows in self.packed_cameras]

    @cached_property
    def shapes(self) -> list[Shape]:
        """`count` shapes."""
        return [Shape.from_packed(rows) for rows in self.packed_shapes]


def default_config(grammar: str | Grammar | None = None) -> dict[str, Any]:
    """Every amplitude and count of the generator with its default, as nested dictionaries.

    Pass what should differ to `generate`; what is left out keeps its default.

    Args:
        grammar: whose entries are those of "grammar"; None for the abstract one.
    """
    config: dict[str, Any] = json.loads(_core.default_config())
    if grammar is not None:
        config["grammar"] = find_grammar(grammar).to_dict()
    return config


def generate(
    seed: int,
    count: int,
    *,
    first: int = 0,
    views: int = 1,
    config: Mapping[str, Any] | None = None,
    grammar: str | Grammar | None = None,
    threads: int | None = None,
    out: Batch | Arrays | None = None,
    progress: Callable[[int], object] | None = None,
) -> Batch:
    """Makes samples `first` ... `first + count - 1` of the data set that `grammar`, `config` and `seed` name.

    Sample i depends on (grammar, config, seed, i) alone: not on `count`, `threads` or the machine; and its first views
    do not depend on `views`. View 0 is one of the eight three-quarter viewpoints, the others are distinct ones of
    the 13, each displaced as far as the shape stays in sight.

    Args:
        seed: 0 ... 2^64 - 1.
        count: how many samples, at least 0.
        first: index of the first one, 0 ... 2^64 - 1.
        views: drawings a sample, 1 to 13.
        config: what differs from `default_config(grammar)`.
        grammar: what shapes are of: "chair", "vase", a Python file that defines a grammar, or a `Grammar`; None for
            abstract ones.
        threads: threads to use; None for one a core. They wait for the next call, if there is a core for each.
        out: a batch, or arrays (drawings, world, frusta) of its shapes and dtypes, to write into: a training loop
            that hands the last batch back makes no large array. Of that batch, shapes and cameras stay.
        progress: called with the number of samples finished so far, on the calling thread, at most 20 times a second
            and once at the end. An exception that it raises stops the batch.

    Ctrl-C stops a batch within a fraction of a second.

    Raises:
        ValueError: for an argument out of range, an unknown grammar, an unknown or wrong entry of the config, or `out`
            arrays of another shape.
        TypeError: for `out` arrays of another dtype, or what is no grammar.
        RuntimeError: if the config allows no shape.
        KeyboardInterrupt: at Ctrl-C, when the last thread has stopped; `out` is partly written then.
    """
    for name, value in (("seed", seed), ("first", first)):
        if not 0 <= value < 2**64:
            raise ValueError(f"{name} must lie between 0 and 2^64 - 1, got {value}")
    if count < 0:
        raise ValueError(f"count must be 0 or more, got {count}")
    if first + count > 2**64:
        raise ValueError(f"samples are numbered to 2^64 - 1; first {first} leaves none for a count of {count}")
    if not 1 <= views <= 13:
        raise ValueError(f"views must lie between 1 and 13 (there are 13 viewpoints), got {views}")
    if threads is not None and threads < 1:
        raise ValueError(f"threads must be at least 1, or None for one a core; got {threads}")
    if progress is not None and not callable(progress):
        raise TypeError(f"progress must be callable, got {type(progress).__name__}")
    drawings, world, frusta = _arrays(out, count, views)
    entries, given = dict(config or {}), None
    if grammar is not None:
        chosen = find_grammar(grammar).changed(entries.pop("grammar", {}))
        given = [chosen.draw(seed, first + i) for i in range(count)]
    text = json.dumps(entries)
    shapes, cameras = _core.generate(text, seed, first, threads, drawings, world, frusta, progress, given)
    return Batch(drawings, world, frusta, cameras, shapes)


def _arrays(out: Batch | Arrays | None, count: int, views: int) -> Arrays:
    arrays: Sequence[object] = (None,) * 3
    if out is not None:
        arrays = (out.drawings, out.world, out.frusta) if isinstance(out, Batch) else out
        if len(arrays) != 3:
            raise ValueError(f"out must be a batch or three arrays (drawings, world, frusta), got {len(arrays)}")
    drawings, world, frusta = arrays
    return (
        destination(drawings, (count, views, 256, 256), np.uint8, "out: drawings"),
        destination(world, (count, 64, 64, 64), np.uint8, "out: world"),
        destination(frusta, (count, views, 64, 64, 64), np.uint8, "out: frusta"),
    )
