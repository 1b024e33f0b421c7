"""What ships with the app: scenes as session files, and the drawings that the first-run example plays."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

_FOLDER = Path(__file__).parent / "scenes"

SCENES = {
    "house": "House with a slanted roof, a tree and a shed",
    "table": "Table with books and a mug",
    "train": "Toy train",
}
"""Name -> what people call it; NAME.sketchcore is its file."""


def read_scene(name: str) -> bytes:
    """A scene's session file.

    Raises:
        KeyError: if there is no such scene.
    """
    if name not in SCENES:
        raise KeyError(f"there is no example {name[:40]!r}; the examples are {', '.join(SCENES)}")
    return (_FOLDER / f"{name}.sketchcore").read_bytes()


def read_tour() -> list[dict[str, Any]]:
    """Two drawings of one object: [{"viewpoint", "strokes": [[[x, y], ...], ...]}, ...], pixels of the drawing."""
    drawings: list[dict[str, Any]] = json.loads((_FOLDER / "tour.json").read_text())
    return drawings
