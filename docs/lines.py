"""Makes docs/lines.png: a chair and a lamp in every style, and with several kinds of lines."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

import sketchcore as sk

CHAIR = sk.Shape(
    [
        sk.Cuboid((0, -0.02, 0), (0.25, 0.03, 0.25)),
        *(sk.Cuboid((x, -0.24, z), (0.03, 0.2, 0.03)) for x in (-0.2, 0.2) for z in (-0.2, 0.2)),
        sk.Cuboid((-0.22, 0.2, 0), (0.03, 0.22, 0.25)),
        sk.Cuboid((-0.22, 0.2, 0), (0.05, 0.12, 0.15), "subtract"),
        *(sk.Cylinder((-0.22, 0.2, z), (0.02, 0.13, 0.02)) for z in (-0.08, 0, 0.08)),
    ]
)
LAMP = sk.Shape(
    [
        sk.Cylinder((0, -0.33, 0), (0.25, 0.05, 0.25)),
        sk.Cylinder((0, -0.05, 0), (0.06, 0.3, 0.06)),
        sk.Cylinder((0, 0.25, 0), (0.28, 0.13, 0.28)),
        sk.Cylinder((0, 0.25, 0), (0.22, 0.2, 0.22), "y", "subtract"),
        sk.Cylinder((0, 0, 0), (0.2, 0.05, 0.05), "x"),
    ]
)
KINDS = (
    ("contours", "pen"),
    ("creases", "pen"),
    (("all", "hidden"), "pen"),
    (("all", "hatching"), "pen"),
    (("all", "hidden", "hatching"), "pencil"),
)


def main() -> None:
    """Two rows a shape: styles, then kinds."""
    rows = []
    for seed, (shape, view) in enumerate(((CHAIR, "quarter-037"), (LAMP, "quarter-052"))):
        camera = sk.VIEWPOINTS[view]
        styles = [sk.draw(shape, camera, style=style, seed=seed) for style in sk.STYLES]
        kinds = [sk.draw(shape, camera, lines=lines, style=style, seed=seed) for lines, style in KINDS]
        rows += [np.hstack([drawing[25:225, 28:228] for drawing in row]) for row in (styles, kinds)]
    Image.fromarray(255 - np.vstack(rows)).save(Path(__file__).with_suffix(".png"), optimize=True)


if __name__ == "__main__":
    main()
