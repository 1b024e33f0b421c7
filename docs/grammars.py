"""docs/grammars.png: chairs, vases and the bottles of the example, each shape from its own sample of seed 0.

Run from the repository's root: python docs/grammars.py
"""

from pathlib import Path

import numpy as np
from PIL import Image

import sketchcore as sk

COLUMNS, EDGE = 10, 24
ROWS = (("chair", 3), ("vase", 2), ("examples/bottles.py", 1))


def main() -> None:
    """Three-quarter views, dark on light, in two colours."""
    rows = []
    for grammar, count in ROWS:
        shapes = [sk.find_grammar(grammar).draw(0, i) for i in range(count * COLUMNS)]
        tiles = [255 - sk.draw(sk.Shape.from_packed(shape), sk.VIEWPOINTS["quarter-037"]) for shape in shapes]
        tiles = [tile[EDGE:-EDGE, EDGE:-EDGE] for tile in tiles]
        rows += [np.hstack(tiles[i : i + COLUMNS]) for i in range(0, len(tiles), COLUMNS)]
    Image.fromarray(np.vstack(rows)).convert("1").save(Path("docs/grammars.png"), optimize=True)


if __name__ == "__main__":
    main()
