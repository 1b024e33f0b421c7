"""The scenes that ship with the app, and the drawings that its first-run example plays, as if a person had made them.

    python examples/app_scenes.py [FOLDER]     writes NAME.sketchcore and tour.json (into the package)

Each object is drawn from two or three viewpoints: the visible lines of boxes, cylinders and wedges, with a hand that
is not quite steady. The drawings go through a session as a person's would: strokes, reconstruction, freeze, place. What
the networks make of them is what is kept; the shapes themselves are thrown away.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from skimage.measure import approximate_polygon

import sketchcore as sk
from sketchcore.app.document import Placement
from sketchcore.app.ink import Stroke
from sketchcore.app.session import Session
from sketchcore.app.sessionfile import write_session
from sketchcore.grids import draw
from sketchcore.shape import Cuboid, Cylinder, Primitive, Shape, Wedge
from sketchcore.strokes import trace

PACKAGE = Path(__file__).parents[1] / "python" / "sketchcore" / "app" / "scenes"
_WOBBLE = 0.45
"""Pixels that the hand strays by, at most about."""


@dataclass(frozen=True)
class Thing:
    """An object, the viewpoints that it is drawn from, and where it goes: center, scale, quarter turns."""

    name: str
    primitives: tuple[Primitive, ...]
    viewpoints: tuple[str, ...]
    placement: Placement


def gable(y: float, height: float, half_x: float, half_z: float) -> tuple[Primitive, ...]:
    """A roof that slopes to both sides of z = 0: two wedges, back to back."""
    middle = y + height / 2
    return tuple(
        Wedge((0, middle, side * half_z / 2), (half_x, height / 2, half_z / 2), "x", (-1, -side)) for side in (-1, 1)
    )


HOUSE = Thing(
    "House",
    (
        Cuboid((0, -0.16, 0), (0.34, 0.2, 0.26)),
        *gable(0.04, 0.26, 0.4, 0.36),
        Cuboid((-0.2, 0.22, 0), (0.05, 0.16, 0.05)),
    ),
    ("quarter-052", "right", "front"),
    Placement((-0.12, -0.2, -0.1), 0.6),
)
TREE = Thing(
    "Tree",
    (Cylinder((0, -0.25, 0), (0.05, 0.16, 0.05)), Cylinder((0, 0.12, 0), (0.24, 0.26, 0.24))),
    ("quarter-052", "right"),
    Placement((0.28, -0.26, 0.26), 0.4),
)
SHED = Thing(
    "Shed",
    (Cuboid((0, -0.12, 0), (0.3, 0.22, 0.3)), Wedge((0, 0.2, 0), (0.36, 0.1, 0.34), "z", (-1, -1))),
    ("quarter-322", "right"),
    Placement((0.28, -0.36, -0.28), 0.3),
)
TABLE = Thing(
    "Table",
    (
        Cuboid((0, 0.14, 0), (0.41, 0.04, 0.28)),
        *(Cuboid((x * 0.34, -0.1, z * 0.21), (0.04, 0.22, 0.04)) for x in (-1, 1) for z in (-1, 1)),
    ),
    ("quarter-037", "right", "front"),
    Placement((0, -0.2, 0), 1.0),
)
MUG = Thing(
    "Mug",
    (
        Cylinder((0, 0, 0), (0.28, 0.36, 0.28)),
        Cuboid((0.33, 0, 0), (0.1, 0.2, 0.05)),
        Cuboid((0.3, 0, 0), (0.07, 0.13, 0.06), "subtract"),
        Cylinder((0, 0, 0), (0.28, 0.36, 0.28)),
        Cylinder((0, 0.1, 0), (0.22, 0.3, 0.22), op="subtract"),
    ),
    ("quarter-322", "right", "top"),
    Placement((0.16, 0.088, 0.1), 0.3, 1),
)
BOOKS = Thing(
    "Books",
    (
        Cuboid((0, -0.16, 0), (0.4, 0.09, 0.28)),
        Cuboid((-0.02, 0.01, 0), (0.34, 0.08, 0.24)),
        Cuboid((0.03, 0.15, 0), (0.26, 0.06, 0.2)),
    ),
    ("quarter-037", "right"),
    Placement((-0.18, 0.06, -0.08), 0.32),
)
ENGINE = Thing(
    "Engine",
    (
        Cuboid((0, -0.15, 0), (0.41, 0.05, 0.16)),
        Cylinder((0.1, 0.02, 0), (0.28, 0.13, 0.13), "x"),
        Cuboid((-0.26, 0.09, 0), (0.13, 0.22, 0.16)),
        Cylinder((0.28, 0.2, 0), (0.05, 0.1, 0.05)),
        *(Cylinder((x, -0.22, 0), (0.09, 0.09, 0.18), "z") for x in (-0.25, 0.0, 0.25)),
    ),
    ("quarter-037", "right", "front"),
    Placement((0.22, -0.28, 0), 0.5),
)
WAGON = Thing(
    "Wagon",
    (
        Cuboid((0, -0.02, 0), (0.38, 0.16, 0.2)),
        Cuboid((0, 0.06, 0), (0.33, 0.1, 0.15), "subtract"),
        *(Cylinder((x, -0.22, 0), (0.09, 0.09, 0.2), "z") for x in (-0.22, 0.22)),
    ),
    ("quarter-037", "right", "top"),
    Placement((-0.25, -0.28, 0), 0.46),
)
SCENES: dict[str, tuple[str, tuple[Thing, ...]]] = {
    "house": ("House with a slanted roof", (HOUSE, TREE, SHED)),
    "table": ("Table with books and a mug", (TABLE, BOOKS, MUG)),
    "train": ("Toy train", (ENGINE, WAGON)),
}
TOUR = Thing("Tour", HOUSE.primitives, ("quarter-052", "right"), Placement())


def lines(thing: Thing, viewpoint: str, random: np.random.Generator) -> list[NDArray[np.float64]]:
    """The visible lines from a viewpoint, [n, 2] in pixels, drawn by a hand: long ones first, not quite straight."""
    drawing = draw(Shape(thing.primitives), sk.VIEWPOINTS[viewpoint])
    found = [line + 0.5 for line in trace(drawing) if len(line) > 3]
    found.sort(key=len, reverse=True)
    return [_by_hand(line, random) for line in found]


def _by_hand(line: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.float64]:
    corners = approximate_polygon(line, 0.8)  # type: ignore[no-untyped-call]
    reach = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    at = np.linspace(0, reach[-1], max(3, int(reach[-1] / 3)))
    points = np.stack([np.interp(at, reach, corners[:, i]) for i in range(2)], axis=1)
    phase, slow = random.uniform(0, 2 * np.pi, 2), random.uniform(0.04, 0.09, 2)
    return points + _WOBBLE * random.uniform(0.3, 1, 2) * np.sin(at[:, None] * slow + phase)


def build(things: tuple[Thing, ...], name: str) -> Session:
    """A session in which every thing was drawn, reconstructed, frozen and placed."""
    random = np.random.default_rng(7)
    session = Session()
    session.call(name)
    for thing in things:
        for viewpoint in thing.viewpoints:
            session.add_strokes(viewpoint, [Stroke.of(line.tolist()) for line in lines(thing, viewpoint, random)])
        order = session.order()
        made = sk.reconstruct(list(order.drawings), list(order.viewpoints))
        session.accept(made.probability, order)
        part = session.freeze(thing.name)
        session.place(part.id, thing.placement)
    return session


def tour() -> list[dict[str, Any]]:
    """The drawings of the first-run example."""
    random = np.random.default_rng(3)
    return [
        {"viewpoint": view, "strokes": [line.round(1).tolist() for line in lines(TOUR, view, random)]}
        for view in TOUR.viewpoints
    ]


def main(folder: Path) -> None:
    """Writes everything."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "tour.json").write_text(json.dumps(tour()))
    for name, (label, things) in SCENES.items():
        path = folder / f"{name}.sketchcore"
        path.write_bytes(write_session(build(things, label)))
        print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else PACKAGE)
