"""sketchcore turns line drawings into solid 3D shapes, and makes the data that such networks learn from.

    import sketchcore as sk

    solid = sk.reconstruct("chair.png", "quarter-037")        # one drawing, one viewpoint
    solid = solid.update("chair-back.png", "quarter-217")     # one more
    solid.save("chair.glb")

    batch = sk.generate(seed=0, count=64, views=2)            # drawings, voxels, cameras: no files, no end

How a shape travels, and where each step lives:

    shape -> datagen            random shapes, drawings and volumes            (rust/src/grammar.rs ... batch.rs)
    drawing, camera             a picture as the networks want it, and where it was drawn from
    linestyle, strokes          how lines are put down, and drawings as strokes     (rust/src/style.rs ... brush.rs)
    grids                       voxels, drawings, resampling, carving          (rust/src/voxel.rs ... resample.rs)
    nets                        the paper's networks, and the compact one that ships
    rounds                      the paper's iterative update over all drawings
    reconstruction              the main verb; viewpoint guesses where a drawing was made from
    volume, mesh                what leaves the package
    train, evaluate, cli        how the weights were made and measured; the command line
"""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from sketchcore.camera import QUARTER_VIEWS, VIEWPOINTS, Camera
from sketchcore.datagen.generate import Batch, generate
from sketchcore.datagen.grammars import GRAMMARS, Grammar, find_grammar
from sketchcore.grids import (
    LINES,
    buffers,
    carve,
    draw,
    frustum,
    silhouette,
    to_camera_grid,
    to_world_grid,
    voxelize,
)
from sketchcore.linestyle import STYLES, LineStyle
from sketchcore.shape import Cuboid, Cylinder, Frustum, Shape, Torus, Wedge
from sketchcore.volume import iou

if TYPE_CHECKING:
    from sketchcore.datagen import dataset as datasets
    from sketchcore.drawing import load_drawing
    from sketchcore.reconstruction import Reconstruction, load, load_model, reconstruct

__version__ = version("sketchcore")

__all__ = [
    "GRAMMARS",
    "LINES",
    "QUARTER_VIEWS",
    "STYLES",
    "VIEWPOINTS",
    "Batch",
    "Camera",
    "Cuboid",
    "Cylinder",
    "Frustum",
    "Grammar",
    "LineStyle",
    "Reconstruction",
    "Shape",
    "Torus",
    "Wedge",
    "buffers",
    "carve",
    "datasets",
    "draw",
    "find_grammar",
    "frustum",
    "generate",
    "iou",
    "load",
    "load_drawing",
    "load_model",
    "reconstruct",
    "silhouette",
    "to_camera_grid",
    "to_world_grid",
    "voxelize",
]

# What needs torch or image libraries is imported when it is first asked for: making data takes neither.
_LATER = {
    "Reconstruction": "sketchcore.reconstruction",
    "load": "sketchcore.reconstruction",
    "load_model": "sketchcore.reconstruction",
    "reconstruct": "sketchcore.reconstruction",
    "load_drawing": "sketchcore.drawing",
}


def __getattr__(name: str) -> Any:
    if name == "datasets":
        return import_module("sketchcore.datagen.dataset")
    if name in _LATER:
        return getattr(import_module(_LATER[name]), name)
    raise AttributeError(f"module 'sketchcore' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
