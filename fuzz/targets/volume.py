"""Volumes as files: what `sketchcore.load` reads. First byte: 0 for .npz, 1 for .binvox."""

from __future__ import annotations

import io
from random import Random

import numpy as np

import sketchcore as sk
from harness import SCRATCH, Target
from mutations import of_bytes, of_zip
from sketchcore.camera import VIEWPOINTS
from sketchcore.reconstruction import Reconstruction
from sketchcore.volume import save_npz


def attempt(data: bytes) -> None:
    """Reads a file."""
    path = SCRATCH / ("volume.binvox" if data[:1] == b"\1" else "volume.npz")
    path.write_bytes(data[1:])
    solid = sk.load(path)
    assert solid.probability.shape == (64, 64, 64)
    assert 0 <= solid.probability.min() <= solid.probability.max() <= 1
    assert len(solid.views) == len(solid.drawings)


def _written(path_suffix: str, solid: Reconstruction) -> bytes:
    path = SCRATCH / f"written{path_suffix}"
    solid.save(path)
    return path.read_bytes()


def seeds() -> list[bytes]:
    """A ball with its drawing and camera, without, as bits, and other arrays."""
    ball = (np.linalg.norm(np.indices((64,) * 3) / 63 - 0.5, axis=0) < 0.3).astype(np.float32)
    drawings = np.zeros((1, 256, 256), np.uint8)
    whole = Reconstruction(ball, (VIEWPOINTS["front"],), (0.1,), drawings)
    save_npz(SCRATCH / "extra.npz", ball[:4, :4, :4], text=np.array("abc"))
    objects = io.BytesIO()
    np.savez(objects, probability=np.array([{}], dtype=object))
    small = b"#binvox 1\ndim 2 2 2\ntranslate 0 0 0\nscale 1\ndata\n\x01\x08"
    return [
        b"\0" + _written(".npz", whole),
        b"\0" + _written(".npz", Reconstruction(ball)),
        b"\0" + (SCRATCH / "extra.npz").read_bytes(),
        b"\0" + objects.getvalue(),
        b"\1" + _written(".binvox", whole),
        b"\1" + small,
    ]


def mutate(data: bytes, random: Random) -> bytes:
    """Arrays inside the archive, or bytes."""
    if data[:1] == b"\1":
        return b"\1" + of_bytes(data[1:], random)
    return b"\0" + of_zip(data[1:], random, _array)


def _array(name: str, content: bytes, random: Random) -> bytes:
    """Mostly the header of an .npy, which says dtype and shape."""
    if random.random() < 0.3:
        return of_bytes(content, random)
    size = int.from_bytes(content[8:10], "little")
    header = of_bytes(content[10 : 10 + size], random)
    return content[:8] + len(header).to_bytes(2, "little") + header + content[10 + size :]


TARGET = Target(attempt, seeds, mutate, (ValueError,), megabytes=512)
