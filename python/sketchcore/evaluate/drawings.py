"""Drawings made by people: no truth is known, but each has an outline, and eyes."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from sketchcore.evaluate.report import Report
from sketchcore.nets.model import Model
from sketchcore.outline import outline_iou, pieces
from sketchcore.picture import save_picture
from sketchcore.reconstruction import reconstruct

SUFFIXES = (".png", ".jpg", ".jpeg", ".webp")
INDEX = "examples.json"


@dataclass(frozen=True)
class Drawn:
    """One object that a person drew.

    Attributes:
        name: of the object.
        views: name of each drawing's viewpoint, or of the one that was guessed.
        guessed: whether it was.
        outline: IoU of the solid's outline and the drawing's, for each drawing.
        pieces: how many the solid is in.
    """

    name: str
    views: list[str]
    guessed: bool
    outline: list[float]
    pieces: int


@dataclass(frozen=True)
class Drawings(Report):
    """What `measure_drawings` found: one entry an object."""

    objects: list[Drawn]


def measure_drawings(
    model: Model,
    folders: Sequence[str | os.PathLike[str]],
    out: str | os.PathLike[str] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Drawings:
    """Reconstructs the drawings of some folders, moved to where they belong.

    A folder may hold `examples.json`, a list of `{"name": ..., "drawings": [{"file": ..., "view": ...}, ...]}`;
    otherwise each image in it is a drawing of an object of its own, whose viewpoint is guessed.

    Args:
        model: the network.
        folders: where the drawings lie.
        out: where to write a picture of each, NAME.png, from four sides; None for nowhere.
        progress: called as `progress(done, total)` after each object.

    Raises:
        FileNotFoundError: for a folder that does not exist.
        ValueError: for a folder without drawings, an index that makes no sense.
    """
    jobs = [job for folder in folders for job in _jobs(Path(folder))]
    objects = []
    for i, (name, files, views) in enumerate(jobs):
        solid = reconstruct(files, views, align=True, model=model)
        seen = zip(solid.views, solid.drawings, strict=True)
        overlaps = [outline_iou(solid.probability, camera, drawing) for camera, drawing in seen]
        shown = views or [str(solid.guessed)]
        objects.append(Drawn(name, shown, views is None, overlaps, len(pieces(solid.probability))))
        if out is not None:
            save_picture(solid, Path(out) / f"{name}.png")
        if progress is not None:
            progress(i + 1, len(jobs))
    return Drawings(objects)


def _jobs(folder: Path) -> list[tuple[str, list[Path], list[str] | None]]:
    if not folder.is_dir():
        raise FileNotFoundError(f"there is no folder {folder}")
    if (folder / INDEX).exists():
        try:
            return [
                (e["name"], [folder / d["file"] for d in e["drawings"]], [d["view"] for d in e["drawings"]])
                for e in json.loads((folder / INDEX).read_text())
            ]
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{folder / INDEX} is no list of named objects with drawings: {error!r}") from error
    images = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
    if not images:
        raise ValueError(f"{folder} holds no drawings ({', '.join(SUFFIXES)})")
    return [(path.stem, [path], None) for path in images]
