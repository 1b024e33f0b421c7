"""A data set of meshes that somebody else prepared: its index and an object, two files in one input."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random

import numpy as np
import trimesh

from harness import SCRATCH, Target
from mutations import dump, of_bytes, of_json, of_safetensors
from sketchcore.datagen.cleaning import place
from sketchcore.datagen.prepared import VERSION, MeshObject, Prepared, load_found, save_object

_FOLDER = SCRATCH / "dataset"


def attempt(data: bytes) -> None:
    """Input: the index's size in four bytes, the index, the object."""
    size = int.from_bytes(data[:4], "little")
    (_FOLDER / "objects").mkdir(parents=True, exist_ok=True)
    (_FOLDER / "dataset.json").write_bytes(data[4 : 4 + size])
    (_FOLDER / "objects" / "box.safetensors").write_bytes(data[4 + size :])
    load_found(_FOLDER / "objects" / "box.safetensors")
    batch = Prepared(_FOLDER).batch("train", 0, 1, frusta=True)
    assert batch.world.max() <= 1


def _input(index: bytes, item: bytes) -> bytes:
    return len(index).to_bytes(4, "little") + index + item


def seeds() -> list[bytes]:
    """A data set of one box."""
    box = trimesh.creation.box((1.0, 2.0, 0.5))
    made = place(np.asarray(box.vertices, np.float64), np.asarray(box.faces, np.int64), "y", "x")
    path = Path(SCRATCH / "box.safetensors")
    save_object(path, MeshObject(made.vertices, made.faces, made.world), made.found)
    entry = {"file": "box.safetensors", "source": "box.obj", "sha256": "ab" * 32, "split": "train", **made.found}
    index = {"format": VERSION, "options": {"up": "y", "split": [0.8, 0.1, 0.1]}, "objects": [entry]}
    return [_input(dump(index), path.read_bytes())]


def mutate(data: bytes, random: Random) -> bytes:
    """The index as JSON, or the object's header or numbers."""
    size = int.from_bytes(data[:4], "little")
    index, item = data[4 : 4 + size], data[4 + size :]
    if random.random() < 0.4:
        try:
            return _input(dump(of_json(json.loads(index), random)), item)
        except (ValueError, RecursionError):
            return _input(of_bytes(index, random), item)
    return _input(index, of_safetensors(item, random))


TARGET = Target(attempt, seeds, mutate, (ValueError, FileNotFoundError), megabytes=512)
