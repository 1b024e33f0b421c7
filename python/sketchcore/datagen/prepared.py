"""A folder of meshes as a data set: what `sketchcore prepare` wrote, and samples of it.

    DATASET/dataset.json                 objects, their splits, and what was done to them
    DATASET/objects/NAME.safetensors     vertices float32 [n, 3], faces int32 [m, 3], world uint8 [64, 64, 8]

`world` is packed: bit z % 8 of byte z // 8 (`numpy.packbits`, little), 32 kB an object.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import load, save

from sketchcore import _core
from sketchcore.atomic import write_atomically
from sketchcore.datagen.generate import Batch
from sketchcore.grids import CREASE_DEGREES
from sketchcore.untrusted import check_size, parse_json, reason

INDEX = "dataset.json"
OBJECTS = "objects"
SPLITS = ("train", "val", "test")
VERSION = 2
MAX_OBJECT = 2**30
"""Bytes of an object's file."""


@dataclass(frozen=True)
class MeshObject:
    """One object of a data set, in the world.

    Attributes:
        vertices: float32 [n, 3].
        faces: int32 [m, 3].
        world: uint8 [64, 64, 64], 0 or 1.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    world: NDArray[np.uint8]

    @property
    def packed(self) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Vertices and faces, as the Rust core takes them."""
        return self.vertices.astype(np.float64), self.faces.astype(np.int64)

    def frusta(self, cameras: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Its camera grids, as thin and hollow as its world, for packed cameras [n, 15]: uint8 [n, 64, 64, 64]."""
        solid, world = _core.voxelize_mesh(*self.packed) > 0, self.world > 0
        if (solid & ~world).any():
            return _seen(world, cameras)
        cells: NDArray[np.uint8] = _core.mesh_frusta(*self.packed, cameras, 2)
        if (thin := world & ~solid).any():
            np.maximum(cells, _seen(thin, cameras), out=cells)
        return cells


def _seen(voxels: NDArray[np.bool_], cameras: NDArray[np.float64]) -> NDArray[np.uint8]:
    worlds = np.repeat(voxels[None].astype(np.float32), len(cameras), axis=0)
    shares: NDArray[np.uint8] = np.rint(255 * _core.to_camera_grid(worlds, cameras)).astype(np.uint8)
    return shares


def save_object(path: Path, item: MeshObject, found: Mapping[str, Any]) -> None:
    """Writes an object, whole or not at all, and what is known of it."""
    packed = np.packbits(item.world, axis=2, bitorder="little")
    arrays: dict[str, NDArray[Any]] = {"vertices": item.vertices, "faces": item.faces, "world": packed}
    write_atomically(path, save(arrays, metadata={"found": json.dumps(dict(found))}))


def load_object(path: Path) -> MeshObject:
    """Reads an object.

    Raises:
        FileNotFoundError: if there is none.
        ValueError: if the file is none, damaged, or larger than 1 GiB.
    """
    check_size(path, MAX_OBJECT, "object of a data set")
    try:
        arrays = load(path.read_bytes())
        vertices, faces, packed = (arrays[name] for name in ("vertices", "faces", "world"))
        if packed.dtype != np.uint8 or packed.shape != (64, 64, 8):
            raise ValueError(f"its world must be uint8 [64, 64, 8], got {packed.dtype} {list(packed.shape)}")
        if vertices.dtype != np.float32 or faces.dtype != np.int32:
            raise ValueError(f"it must have float32 vertices and int32 faces, got {vertices.dtype} and {faces.dtype}")
        if vertices.shape[1:] != (3,) or faces.shape[1:] != (3,):
            raise ValueError(f"its vertices and faces must be [n, 3], got {vertices.shape} and {faces.shape}")
        return MeshObject(vertices, faces, np.unpackbits(packed, axis=2, bitorder="little"))
    except MemoryError:
        raise
    except Exception as error:  # what dtypes and sizes numpy cannot have, it says in its own ways
        raise ValueError(f"{path} is no object of a data set, or is damaged: {reason(error)}") from error


def load_found(path: Path) -> dict[str, Any] | None:
    """What is known of an object that was written before; None if it is missing or damaged."""
    try:
        data = path.read_bytes()
        length = int.from_bytes(data[:8], "little")
        told = parse_json(parse_json(data[8 : 8 + length], "the header")["__metadata__"]["found"], "what was found")
        load_object(path)
    except (OSError, KeyError, TypeError, ValueError):
        return None
    return dict(told) if isinstance(told, dict) else None


class Prepared:
    """A data set of meshes.

    Sample i is a function of (data set, split, seed, i): it takes the i-th object of an endless sequence that goes
    through all of the split, each time in another order, and is drawn as the generator draws its shapes.

    Attributes:
        folder: where it is.
        fingerprint: hash of the objects in all splits; with seed and index it names a sample.

    Args:
        folder: what `sketchcore prepare` wrote into.

    Raises:
        FileNotFoundError: if there is no data set.
        ValueError: if it is none.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(folder)
        index = self.folder / INDEX
        if not index.is_file():
            raise FileNotFoundError(f"no data set in {self.folder}: make one by sketchcore prepare MESHES -o DATASET")
        try:
            data = parse_json(index.read_bytes(), "the index")
            if data["format"] != VERSION:
                raise ValueError(f"its format is {data['format']}, this version reads {VERSION}")
            objects = {split: [item for item in data["objects"] if item["split"] == split] for split in SPLITS}
            self._files = {split: [_name(item["file"]) for item in items] for split, items in objects.items()}
            named = sorted((item["file"], item["split"], item["sha256"]) for item in data["objects"])
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{index} is no data set of sketchcore prepare: {reason(error)}") from error
        self.fingerprint = hashlib.sha256(json.dumps(named).encode()).hexdigest()[:16]

    def __repr__(self) -> str:
        sizes = ", ".join(f"{len(self._files[split])} {split}" for split in SPLITS)
        return f"Prepared({str(self.folder)!r}: {sizes})"

    def count(self, split: str) -> int:
        """How many objects a split has.

        Raises:
            ValueError: for none of `SPLITS`.
        """
        if split not in SPLITS:
            raise ValueError(f"the splits are {', '.join(SPLITS)}; got {split!r}")
        return len(self._files[split])

    def require(self, *splits: str) -> None:
        """Raises ValueError if one of these splits has no objects."""
        for split in splits:
            if self.count(split) == 0:
                raise ValueError(
                    f"{self.folder} has no objects in its split {split!r}; prepare more meshes, or with other shares "
                    "(--split TRAIN,VAL,TEST)"
                )

    def load(self, split: str, number: int) -> MeshObject:
        """One object of a split."""
        return load_object(self.folder / OBJECTS / self._files[split][number])

    def name(self, split: str, number: int) -> str:
        """What an object is called."""
        return self._files[split][number].removesuffix(".safetensors")

    def choose(self, split: str, seed: int, index: int) -> int:
        """Which object of the split sample `index` is of."""
        count = self.count(split)
        return int(_order(count, seed, index // count)[index % count])

    def batch(
        self,
        split: str,
        seed: int,
        count: int,
        *,
        first: int = 0,
        views: int = 1,
        config: Mapping[str, Any] | None = None,
        frusta: bool = False,
    ) -> Batch:
        """Samples `first` ... of a split, as `sketchcore.generate` makes them of random shapes.

        Args:
            split: one of `SPLITS`.
            seed: 0 ... 2^64 - 1.
            count: how many.
            first: index of the first.
            views: drawings a sample, 1 to 13.
            config: what differs from the generator's default config; its grammar is not used.
            frusta: also measure the camera grids, which takes longest; without, they are [count, 0, 64, 64, 64].

        Returns:
            a batch without shapes.

        Raises:
            ValueError: for an argument out of range, an empty split, or an object that is damaged.
        """
        self.require(split)
        text = json.dumps(dict(config or {}))
        drawings = np.empty((count, views, 256, 256), np.uint8)
        world = np.empty((count, 64, 64, 64), np.uint8)
        cells = np.empty((count, views if frusta else 0, 64, 64, 64), np.uint8)
        cameras = np.empty((count, views, 15))
        for i in range(count):
            item = self.load(split, self.choose(split, seed, first + i))
            world[i] = item.world
            cameras[i] = _core.draw_mesh_views(*item.packed, CREASE_DEGREES, text, seed, first + i, drawings[i])
            if frusta:
                cells[i] = item.frusta(cameras[i])
        return Batch(drawings, world, cells, cameras, ())


def _name(file: object) -> str:
    """The name of a file beside others: the index may come from anywhere."""
    if not isinstance(file, str) or not re.fullmatch(r"[A-Za-z0-9_-]{1,120}\.safetensors", file):
        raise ValueError(f"the file of an object is a plain name that ends in .safetensors, got {file!r:.80}")
    return file


@lru_cache(maxsize=4)
def _order(count: int, seed: int, epoch: int) -> NDArray[np.int64]:
    return np.random.default_rng((seed, epoch)).permutation(count)
