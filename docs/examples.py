"""Makes docs/examples.png: each example's first drawing, and the solid from there, from behind and from the side."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
from PIL import Image

import sketchcore as sk
from sketchcore.picture import shade

EXAMPLES = Path(__file__).parents[1] / "examples"


def main() -> None:
    """Reconstructs them all as `make demo` does."""
    rows = []
    for example in json.loads((EXAMPLES / "examples.json").read_text()):
        drawings = example["drawings"]
        solid = sk.reconstruct([EXAMPLES / d["file"] for d in drawings], [d["view"] for d in drawings], align=True)
        x, _, z = solid.views[0].position
        behind = sk.Camera.orbit(math.degrees(math.atan2(z, x)) + 150, 30)
        cameras = (solid.views[0], behind, sk.VIEWPOINTS["right"])
        rows.append(np.hstack([255 - solid.drawings[0], *(shade(solid.probability, camera) for camera in cameras)]))
    Image.fromarray(np.vstack(rows)).save(Path(__file__).with_suffix(".png"), optimize=True)


if __name__ == "__main__":
    main()
