"""Reconstructs the example drawings: out/NAME.glb, and out/NAME.png to look at."""

from __future__ import annotations

import json
import time
from pathlib import Path

import sketchcore as sk
from sketchcore.outline import outline_iou, pieces
from sketchcore.picture import save_picture

HERE = Path(__file__).parent
OUT = HERE.parent / "out"


def main() -> None:
    OUT.mkdir(exist_ok=True)
    for example in json.loads((HERE / "examples.json").read_text()):
        drawings = [HERE / d["file"] for d in example["drawings"]]
        views = [d["view"] for d in example["drawings"]]
        started = time.perf_counter()
        solid = sk.reconstruct(drawings, views, align=True)
        seconds = time.perf_counter() - started
        path = OUT / f"{example['name']}.glb"
        solid.save(path)
        save_picture(solid, path.with_suffix(".png"))
        seen = zip(solid.views, solid.drawings, strict=True)
        overlaps = ", ".join(f"{outline_iou(solid.probability, *pair):.2f}" for pair in seen)
        print(
            f"{path.relative_to(HERE.parent)} and .png: {seconds:.1f} s, pieces: {len(pieces(solid.probability))}, "
            f"outline overlap with each drawing: {overlaps}"
        )


if __name__ == "__main__":
    main()
