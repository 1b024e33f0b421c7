"""Networks of three classes on shapes that none was trained on: docs/results/classes.json, classes.png.

Run as `python docs/classes.py CHAIRS VASES`: two data sets that `sketchcore prepare` made of real meshes, all in their
test split. The table is printed as well. Drawings are exact, so each is taken where it is.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import sketchcore as sk
from sketchcore.datagen.prepared import Prepared
from sketchcore.evaluate.figure import Figure
from sketchcore.evaluate.testset import Example, load_meshes, load_testset
from sketchcore.picture import shade

ROOT = Path(__file__).parents[1]
NETWORKS = {"abstract": None, "chair": ROOT / "weights/chair.safetensors", "vase": ROOT / "weights/vase.safetensors"}
VIEWS = (1, 2, 3)
ABSTRACT = 40
SHOWN = 4


def ious(examples: list[Example], network: Path | None) -> NDArray[np.float64]:
    """[examples, views], after up to five rounds."""
    model = sk.load_model(network)
    return np.array(
        [
            [
                sk.iou(
                    sk.reconstruct(
                        list(example.drawings[:views]), list(example.cameras[:views]), model=model, align=False
                    ).probability,
                    example.world,
                )
                for views in VIEWS
            ]
            for example in examples
        ]
    )


def row(example: Example, networks: list[Path | None]) -> NDArray[np.uint8]:
    """Its drawing, its mesh's voxels, and what each network makes of the drawing, from there and from behind."""
    camera = example.cameras[0]
    behind = sk.Camera.orbit(float(np.degrees(np.arctan2(camera.position[2], camera.position[0]))) + 150, 25)
    solids = [example.world.astype(np.float32)]
    for network in networks:
        made = sk.reconstruct(example.drawings[0], camera, model=sk.load_model(network), align=False)
        solids.append(made.probability)
    tiles = [255 - example.drawings[0]]
    for solid in solids:
        tiles += [shade(solid, camera, 192), shade(solid, behind, 192)]
    tiles[0] = np.asarray(Image.fromarray(tiles[0]).resize((192, 192), Image.Resampling.BOX))
    return np.hstack(tiles)


def main(chairs: str, vases: str) -> None:
    """Measures, prints and draws."""
    sets: dict[str, list[Example]] = {
        "abstract": list(load_testset(ABSTRACT)),
        "chair": list(load_meshes(Prepared(chairs))),
        "vase": list(load_meshes(Prepared(vases))),
    }
    table = {name: {kind: ious(examples, path) for kind, examples in sets.items()} for name, path in NETWORKS.items()}
    report = {
        name: {
            kind: {
                "shapes": len(values),
                "iou": [str(Figure.of(column)) for column in values.T],
                "more than abstract": [str(Figure.of(column)) for column in (values - table["abstract"][kind]).T],
            }
            for kind, values in kinds.items()
        }
        for name, kinds in table.items()
    }
    print(json.dumps(report, indent=2))
    results = ROOT / "docs/results"
    (results / "classes.json").write_text(json.dumps(report, indent=2) + "\n")
    rows = []
    for kind in ("chair", "vase"):
        # Spread over what the class's own network makes of them, from worst to best.
        order = np.argsort(table[kind][kind][:, 0])
        picks = order[(np.linspace(0.1, 0.9, SHOWN) * (len(order) - 1)).astype(int)]
        rows += [row(sets[kind][i], [NETWORKS["abstract"], NETWORKS[kind]]) for i in picks]
    Image.fromarray(np.vstack(rows)).save(results / "classes.png", optimize=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
