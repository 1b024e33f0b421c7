"""Samples as files, for those who want to look at them or to use them elsewhere."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from sketchcore.atomic import replacing
from sketchcore.datagen.generate import Batch, generate
from sketchcore.datagen.grammars import Grammar
from sketchcore.mesh import save_mesh
from sketchcore.solidmesh import require_manifold

_CHUNK = 16
MESH_SUFFIXES = ("obj", "glb", "ply", "stl")


def write_samples(
    folder: Path,
    seed: int,
    count: int,
    *,
    first: int = 0,
    views: int = 1,
    config: Mapping[str, Any] | None = None,
    grammar: str | Grammar | None = None,
    progress: Callable[[int], None] | None = None,
) -> None:
    """Writes samples `first` ... `first + count - 1`, each as one .npz and a .png for each drawing, dark on light.

    The .npz holds uint8 `drawings` [views, 256, 256], `world` [64, 64, 64] and `frusta` [views, 64, 64, 64], float64
    `cameras` [views, 15] (`Camera.packed`) and `shape` (its JSON).

    Args:
        folder: made if it does not exist.
        seed: as for `generate`, like `count`, `first`, `views` and `config`.
        count: how many.
        first: index of the first.
        views: drawings a sample.
        config: what differs from the default config.
        grammar: as for `generate`.
        progress: called with the number of samples written so far.

    Raises:
        ValueError: as `generate` does.
        OSError: if a file cannot be written.
    """
    generate(
        seed, 0, first=first, views=views, config=config, grammar=grammar
    )  # says what is wrong before a folder is made
    folder.mkdir(parents=True, exist_ok=True)
    for done in range(0, count, _CHUNK):
        part = min(_CHUNK, count - done)
        batch = generate(seed, part, first=first + done, views=views, config=config, grammar=grammar)
        for i in range(part):
            _write(folder, first + done + i, batch, i)
            if progress is not None:
                progress(done + i + 1)


def write_meshes(
    folder: Path,
    seed: int,
    count: int,
    *,
    first: int = 0,
    config: Mapping[str, Any] | None = None,
    grammar: str | Grammar | None = None,
    suffix: str = "obj",
    progress: Callable[[int], None] | None = None,
) -> None:
    """Writes the shapes of samples `first` ... `first + count - 1` as watertight meshes, INDEX.SUFFIX.

    Args:
        folder: made if it does not exist.
        seed: as for `generate`, like `count`, `first`, `config` and `grammar`.
        count: how many.
        first: index of the first.
        config: what differs from the default config.
        grammar: as for `generate`.
        suffix: "obj", "glb", "ply" or "stl".
        progress: called with the number of meshes written so far.

    Raises:
        ValueError: as `generate` does, and for another suffix.
        ImportError: without manifold3d.
        OSError: if a file cannot be written.
    """
    if suffix not in MESH_SUFFIXES:
        raise ValueError(f"meshes are written as {', '.join(MESH_SUFFIXES)}; got {suffix!r}")
    generate(seed, 0, first=first, config=config, grammar=grammar)
    require_manifold()
    folder.mkdir(parents=True, exist_ok=True)
    for i in range(count):
        (shape,) = generate(seed, 1, first=first + i, config=config, grammar=grammar).shapes
        save_mesh(shape.to_mesh(), folder / f"{first + i:09d}.{suffix}")
        if progress is not None:
            progress(i + 1)


def _write(folder: Path, index: int, batch: Batch, i: int) -> None:
    name = f"{index:09d}"
    with replacing(folder / f"{name}.npz") as fresh, fresh.open("wb") as file:
        np.savez_compressed(
            file,
            drawings=batch.drawings[i],
            world=batch.world[i],
            frusta=batch.frusta[i],
            cameras=batch.packed_cameras[i],
            shape=np.array(batch.shapes[i].to_json()),
        )
    for view, drawing in enumerate(batch.drawings[i]):
        with replacing(folder / f"{name}-{view}.png") as fresh:
            Image.fromarray(255 - drawing).save(fresh, format="PNG")
