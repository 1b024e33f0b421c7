"""Synthetic shapes, drawings and volumes, made by the Rust core (paper, section 4)."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sketchcore import _core
from sketchcore.camera import Camera
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
        packed_shapes: for each sample float64 [n, 8], see `Shape.packed`.
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


def default_config() -> dict[str, Any]:
    """Every amplitude and count of the generator with its default, as nested dictionaries.

    Pass what should differ to `generate`; what is left out keeps its default.
    """
    config: dict[str, Any] = json.loads(_core.default_config())
    return config


def generate(
    seed: int,
    count: int,
    *,
    first: int = 0,
    views: int = 1,
    config: Mapping[str, Any] | None = None,
    threads: int | None = None,
    out: Batch | Arrays | None = None,
) -> Batch:
    """Makes samples `first` ... `first + count - 1` of the data set that `config` and `seed` name.

    Sample i depends on (config, seed, i) alone: not on `count`, `threads` or the machine; and its first views do
    not depend on `views`. View 0 is one of the eight three-quarter viewpoints, the others are distinct ones of
    the 13, each displaced as far as the shape stays in sight.

    Args:
        seed: 0 ... 2^64 - 1.
        count: how many samples, at least 0.
        first: index of the first one, 0 ... 2^64 - 1.
        views: drawings a sample, 1 to 13.
        config: what differs from `default_config()`.
        threads: threads to use; None for one a core.
        out: a batch, or arrays (drawings, world, frusta) of its shapes and dtypes, to write into.

    Raises:
        ValueError: for an argument out of range, an unknown or wrong entry of the config, or `out` arrays of
            another shape.
        TypeError: for `out` arrays of another dtype.
        RuntimeError: if the config allows no shape.
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
    drawings, world, frusta = _arrays(out, count, views)
    text = json.dumps(dict(config or {}))
    shapes, cameras = _core.generate(text, seed, first, threads, drawings, world, frusta)
    return Batch(drawings, world, frusta, cameras, shapes)


def _arrays(out: Batch | Arrays | None, count: int, views: int) -> Arrays:
    shapes = ((count, views, 256, 256), (count, 64, 64, 64), (count, views, 64, 64, 64))
    if out is None:
        drawings, world, frusta = (np.empty(shape, np.uint8) for shape in shapes)
        return drawings, world, frusta
    arrays = (out.drawings, out.world, out.frusta) if isinstance(out, Batch) else out
    for name, array, shape in zip(("drawings", "world", "frusta"), arrays, shapes, strict=True):
        if not isinstance(array, np.ndarray) or array.dtype != np.uint8:
            raise TypeError(f"out: {name} must be a uint8 array")
        if array.shape != shape:
            raise ValueError(f"out: {name} must have shape {list(shape)}, got {list(array.shape)}")
        if not (array.flags.c_contiguous and array.flags.writeable):
            raise ValueError(f"out: {name} must be C-contiguous and writeable")
    return arrays
