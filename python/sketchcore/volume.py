"""World volumes: how alike two of them are, and the files that keep them (`.npz`, `.binvox`)."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sketchcore.atomic import replacing
from sketchcore.untrusted import Archive, check_size, parse_array

_PROBABILITY = "probability"
MAX_UNPACKED = 2**28
"""Bytes of all arrays of an `.npz` file together."""
MAX_BINVOX = 2**28
"""Bytes of a `.binvox` file."""
_MAX_ARRAYS = 64


def as_probability(volume: ArrayLike) -> NDArray[np.float32]:
    """A volume as float32 [x, y, z], a cube of any size; booleans and 0/1 integers become 0 and 1.

    Raises:
        ValueError: if it is no cube, or a value is NaN or outside [0, 1].
    """
    array = np.asarray(volume)
    if array.ndim != 3 or not array.shape[0] == array.shape[1] == array.shape[2] > 0:
        raise ValueError(f"a volume must be a cube [n, n, n], such as [64, 64, 64]; got {list(array.shape)}")
    if array.dtype.kind not in "biuf":
        raise ValueError(f"a volume must hold numbers or booleans, got dtype {array.dtype}")
    if array.dtype.kind == "f" and np.isnan(array).any():
        raise ValueError("a volume has NaN in it; every value must lie in [0, 1]")
    low, high = array.min(), array.max()
    if low < 0 or high > 1:
        raise ValueError(f"a volume's values must lie in [0, 1], got {low:g} to {high:g}")
    return array.astype(np.float32)


def _occupied(volume: ArrayLike) -> NDArray[np.bool_]:
    return np.asarray(np.asarray(volume) > 0.5)


def iou(a: ArrayLike, b: ArrayLike) -> float:
    """Intersection over union of a > 0.5 and b > 0.5, in [0, 1]; 1.0 when both are empty.

    Args:
        a: probabilities, 0/1 integers or booleans, any shape.
        b: the same, of the same shape.

    Raises:
        ValueError: if the shapes differ.
    """
    first, second = _occupied(a), _occupied(b)
    if first.shape != second.shape:
        raise ValueError(f"iou compares volumes of one shape, got {list(first.shape)} and {list(second.shape)}")
    union = int(np.count_nonzero(first | second))
    return int(np.count_nonzero(first & second)) / union if union else 1.0


def save_npz(path: str | os.PathLike[str], probability: ArrayLike, **extras: ArrayLike) -> None:
    """Write a volume and anything that belongs to it to a compressed `.npz`, whole or not at all.

    Args:
        path: the file, taken as it is (no suffix is added).
        probability: [n, n, n] in [0, 1], stored as float32.
        **extras: further arrays by name, of any dtype but `object`; packed cameras [n, 15] for one.

    Raises:
        ValueError: for a volume that is none (see `as_probability`), or an extra of dtype `object`.
    """
    arrays = {name: np.asarray(extra) for name, extra in extras.items()}
    for name, array in arrays.items():
        if array.dtype.hasobject:
            raise ValueError(f"extra {name!r} has dtype object; store numbers, booleans or strings")
    arrays[_PROBABILITY] = as_probability(probability)
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, allow_pickle=False, **arrays)


def load_npz(path: str | os.PathLike[str]) -> dict[str, NDArray[Any]]:
    """What `save_npz` wrote: "probability", float32 [n, n, n], and the extras by name.

    Raises:
        FileNotFoundError: if there is no such file.
        ValueError: if the file is damaged, holds no volume, or unpacks to more than 256 MiB.
    """
    check_size(path, MAX_UNPACKED, "volume")
    arrays: dict[str, NDArray[Any]] = {}
    try:
        with Path(path).open("rb") as stream:
            archive, left = Archive(stream, "an .npz file", _MAX_ARRAYS), MAX_UNPACKED
            for entry in archive.names:
                content = archive.read(entry, left)
                left -= len(content)
                name = entry.removesuffix(".npy")
                arrays[name] = parse_array(content, f"its array {name[:40]!r}")
        if _PROBABILITY not in arrays:
            raise ValueError(f"it must have an array 'probability', it has {', '.join(arrays)[:80] or 'none'}")
        arrays[_PROBABILITY] = as_probability(arrays[_PROBABILITY])
    except ValueError as error:
        raise ValueError(f"{path} is no .npz file of a volume, or is damaged: {error}") from error
    return arrays


def save_binvox(path: str | os.PathLike[str], volume: ArrayLike) -> None:
    """Write `volume > 0.5` as `.binvox`, whole or not at all; the grid spans [-1/2, 1/2]^3 of the world.

    The format is Patrick Min's (https://www.patrickmin.com/binvox/binvox.html): a header in text, then runs
    of (value, length) bytes; x varies slowest and y fastest.

    Args:
        path: the file, taken as it is.
        volume: [n, n, n] in [0, 1].

    Raises:
        ValueError: for a volume that is none (see `as_probability`).
    """
    occupied = as_probability(volume) > 0.5
    n = len(occupied)
    flat = occupied.transpose(0, 2, 1).ravel()
    starts = np.flatnonzero(np.r_[True, flat[1:] != flat[:-1]])
    lengths = np.diff(np.r_[starts, flat.size])
    pieces = (lengths + 254) // 255  # a run's length is one byte
    runs = np.empty((int(pieces.sum()), 2), dtype=np.uint8)
    runs[:, 0] = np.repeat(flat[starts], pieces)
    runs[:, 1] = 255
    runs[np.cumsum(pieces) - 1, 1] = lengths - 255 * (pieces - 1)
    header = f"#binvox 1\ndim {n} {n} {n}\ntranslate -0.5 -0.5 -0.5\nscale 1\ndata\n"
    with replacing(path) as temporary:
        temporary.write_bytes(header.encode("ascii") + runs.tobytes())


def load_binvox(path: str | os.PathLike[str]) -> NDArray[np.float32]:
    """The grid of a `.binvox` file, float32 [x, y, z], 0 or 1; its translation and scale are not applied.

    Raises:
        FileNotFoundError: if there is no such file.
        ValueError: if the header is wrong, the grid no cube, or the runs do not fill it exactly; for more than 256 MiB.
    """
    check_size(path, MAX_BINVOX, "volume")
    header, found, body = Path(path).read_bytes().partition(b"\ndata\n")
    lines = header.decode("ascii", "replace").split("\n")
    if not found or lines[0].split() not in (["#binvox", "1"], ["#binvox", "2"]):
        raise ValueError(f"{path} must start with '#binvox 1' or '#binvox 2', and have a line 'data' after the header")
    dims = next((line.split()[1:] for line in lines if line.startswith("dim ")), [])
    if len(dims) != 3 or len(set(dims)) != 1 or not dims[0].isdecimal() or not 0 < int(dims[0]) <= 1024:
        raise ValueError(f"{path} must have a line such as 'dim 64 64 64', a cube up to 1024; got {str(dims)[:80]}")
    n = int(dims[0])
    if len(body) % 2:
        raise ValueError(f"{path} is truncated: its runs must be pairs of bytes, got {len(body)} bytes")
    runs = np.frombuffer(body, dtype=np.uint8).reshape(-1, 2)
    total = int(runs[:, 1].sum(dtype=np.int64))
    if total != n**3:
        raise ValueError(f"{path} is truncated or damaged: its runs must fill {n**3} voxels, got {total}")
    flat = np.repeat(runs[:, 0] > 0, runs[:, 1])  # version 2 has values above 1
    return np.ascontiguousarray(flat.reshape(n, n, n).transpose(0, 2, 1), dtype=np.float32)
