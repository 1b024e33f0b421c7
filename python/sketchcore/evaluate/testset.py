"""The fixed test set: 500 abstract shapes, four cameras each. No network is trained on it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sketchcore.camera import QUARTER_VIEWS, VIEWPOINTS, Camera
from sketchcore.datagen.prepared import MeshObject, Prepared
from sketchcore.grids import draw, frustum, voxelize
from sketchcore.shape import Shape

if TYPE_CHECKING:
    import trimesh

TOTAL = 500
"""Shapes in the test set."""
ORTHOGONAL = ("front", "top", "right", "back")
"""Viewpoints of the second kind of carving, in the paper's order (section 6.5)."""


@dataclass(frozen=True)
class Example:
    """One shape of a test set.

    Attributes:
        shape: its primitives, or its mesh.
        cameras: four, the first one of the eight three-quarter views.
        viewpoint: name of the first camera's viewpoint.
    """

    shape: Shape | trimesh.Trimesh
    cameras: tuple[Camera, ...]
    viewpoint: str

    @cached_property
    def world(self) -> NDArray[np.uint8]:
        """uint8 [64, 64, 64], the truth in the world grid."""
        return voxelize(self.shape)

    @cached_property
    def drawings(self) -> NDArray[np.uint8]:
        """uint8 [4, 256, 256], exact drawings from the cameras."""
        return np.stack([draw(self.shape, camera) for camera in self.cameras])

    @cached_property
    def orthogonal(self) -> tuple[NDArray[np.uint8], list[Camera]]:
        """Drawings from front, top, right and back, and their cameras."""
        cameras = [VIEWPOINTS[name] for name in ORTHOGONAL]
        return np.stack([draw(self.shape, camera) for camera in cameras]), cameras

    def frustum(self, view: int) -> NDArray[np.float32]:
        """float32 [64, 64, 64] in 0..1, the truth in a camera's grid."""
        return frustum(self.shape, self.cameras[view]).astype(np.float32) / np.float32(255)


@dataclass(frozen=True)
class ShapeExample(Example):
    """One shape of the fixed test set."""

    shape: Shape


@dataclass(frozen=True)
class MeshExample(Example):
    """One mesh of a data set; its truth is what it was prepared as, thin parts filled."""

    item: MeshObject

    @cached_property
    def world(self) -> NDArray[np.uint8]:
        """uint8 [64, 64, 64], the truth in the world grid."""
        return self.item.world

    def frustum(self, view: int) -> NDArray[np.float32]:
        """float32 [64, 64, 64] in 0..1, the truth in a camera's grid."""
        cells: NDArray[np.uint8] = self.item.frusta(self.cameras[view].packed[None])[0]
        return cells.astype(np.float32) / np.float32(255)


def count_shapes(shapes: int | None) -> int:
    """How many shapes those are: all for None.

    Raises:
        ValueError: for a number outside 1 ... 500.
    """
    if shapes is not None and not 1 <= shapes <= TOTAL:
        raise ValueError(f"shapes must lie between 1 and {TOTAL}, got {shapes}")
    return TOTAL if shapes is None else shapes


def load_testset(
    shapes: int | None = None, progress: Callable[[int, int], None] | None = None
) -> Iterator[ShapeExample]:
    """The first `shapes` examples; all 500 for None.

    `progress` is called as `progress(done, total)` whenever the caller is done with one and asks for more.

    Raises:
        ValueError: for a number outside 1 ... 500.
    """
    count = count_shapes(shapes)
    data = json.loads((files("sketchcore.evaluate") / "abstract-500.json").read_text())
    lens = (float(data["fov_degrees"]), float(data["near"]), float(data["far"]))
    names = list(VIEWPOINTS)
    for done, entry in enumerate(data["shapes"][:count], start=1):
        cameras = tuple(Camera(c["position"], c["rotation"], *lens) for c in entry["cameras"])
        yield ShapeExample(Shape.from_json(entry), cameras, names[entry["cameras"][0]["viewpoint"]])
        if progress is not None:
            progress(done, count)


def load_meshes(
    data: Prepared, shapes: int | None = None, progress: Callable[[int, int], None] | None = None
) -> Iterator[MeshExample]:
    """The first `shapes` objects of a data set's test split, all for None, each with four cameras of its own.

    The cameras are the generator's: the first one of the eight viewpoints, the others distinct ones of the 13, each
    displaced.

    Raises:
        ValueError: for a number of shapes outside 1 ... the split's, or an empty split.
    """
    import trimesh

    data.require("test")
    total = data.count("test")
    if shapes is not None and not 1 <= shapes <= total:
        raise ValueError(f"shapes must lie between 1 and {total}, the objects in the test split; got {shapes}")
    count = shapes or total
    for i in range(count):
        item = data.load("test", data.choose("test", 0, i))
        mesh = trimesh.Trimesh(item.vertices, item.faces, process=False, validate=False)
        cameras = data.batch("test", 0, 1, first=i, views=4).cameras[0]
        # Displaced cameras are turned as their viewpoints are.
        off = {name: abs(VIEWPOINTS[name].rotation - cameras[0].rotation).max() for name in QUARTER_VIEWS}
        yield MeshExample(mesh, tuple(cameras), min(off, key=lambda name: off[name]), item)
        if progress is not None:
            progress(i + 1, count)
