"""A shard: samples of the generator in a tar file, in the form of WebDataset.

Its bytes depend on the samples alone (and on the versions of Pillow and zlib, which compress them).
"""

from __future__ import annotations

import gzip
import io
import json
import tarfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from sketchcore.datagen.generate import Batch, generate
from sketchcore.datagen.grammars import Grammar

SCHEMA: Mapping[str, str] = MappingProxyType(
    {
        "KEY": "the sample's index in twelve digits",
        "KEY.V.png": "drawing V = 0, 1, ..., 256 x 256, 8 bits, ink 0 on 255",
        "KEY.world.npy.gz": "uint8 [64, 64, 8]: world[x, y, z] as bits, 1 = inside; numpy.unpackbits(array, axis=2)",
        "KEY.cameras.json": "of each drawing position [3], rotation [3, 3] (rows: right, down, forward), fov_degrees, "
        "near, far",
        "KEY.shape.json": "the primitives that the shape is made of, the last writer wins",
    }
)
"""What is in a shard."""

PNG_LEVEL = 3
GZIP_LEVEL = 6
_CHUNK = 128
"""Drawings that are made at a time: their camera grids take 32 MiB."""


def write_shard(
    path: Path,
    seed: int,
    first: int,
    count: int,
    *,
    views: int = 1,
    config: Mapping[str, Any] | None = None,
    grammar: str | Grammar | None = None,
    threads: int | None = None,
    progress: Callable[[int], object] | None = None,
) -> None:
    """Writes samples `first` ... `first + count - 1` as a tar file: `SCHEMA` says what is in it.

    Args:
        path: file to write; it is there in part if this raises.
        seed: as for `generate`, like all others.
        first: index of the first sample.
        count: how many.
        views: drawings a sample.
        config: what differs from the default config.
        grammar: what shapes are of.
        threads: that make samples; None for one a core.
        progress: called with the number of samples written so far.

    Raises:
        ValueError: as `generate` does.
        OSError: if the file cannot be written.
    """
    chunk = max(1, _CHUNK // views)
    batch: Batch | None = None
    with tarfile.open(path, "w", format=tarfile.USTAR_FORMAT) as tar:
        for done in range(0, count, chunk):
            part = min(chunk, count - done)
            batch = generate(
                seed,
                part,
                first=first + done,
                views=views,
                config=config,
                grammar=grammar,
                threads=threads,
                out=batch if batch is not None and len(batch.world) == part else None,
            )
            for i in range(part):
                for name, data in _members(first + done + i, batch, i):
                    member = tarfile.TarInfo(name)  # of no date and nobody
                    member.size = len(data)
                    tar.addfile(member, io.BytesIO(data))
            if progress is not None:
                progress(done + part)


def _members(index: int, batch: Batch, i: int) -> Iterator[tuple[str, bytes]]:
    key = f"{index:012d}"
    for view, drawing in enumerate(batch.drawings[i]):
        yield f"{key}.{view}.png", _png(drawing)
    packed = np.packbits(batch.world[i], axis=2)
    stored = io.BytesIO()
    np.lib.format.write_array(stored, packed, version=(1, 0), allow_pickle=False)
    yield f"{key}.world.npy.gz", gzip.compress(stored.getvalue(), GZIP_LEVEL, mtime=0)
    yield f"{key}.cameras.json", json.dumps([_camera(row) for row in batch.packed_cameras[i]]).encode()
    yield f"{key}.shape.json", batch.shapes[i].to_json().encode()


def _png(drawing: NDArray[np.uint8]) -> bytes:
    stored = io.BytesIO()
    Image.fromarray(255 - drawing).save(stored, format="PNG", compress_level=PNG_LEVEL)
    return stored.getvalue()


def _camera(packed: NDArray[np.float64]) -> dict[str, Any]:
    """What `sketchcore.Camera` takes, of a row as in `Camera.packed`."""
    position, rotation, (fov, near, far) = packed[:3], packed[3:12].reshape(3, 3), packed[12:].tolist()
    return {
        "position": position.tolist(),
        "rotation": rotation.tolist(),
        "fov_degrees": fov,
        "near": near,
        "far": far,
    }
