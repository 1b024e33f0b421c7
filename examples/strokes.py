"""The drawings of this folder, stroke by stroke, as if freehand: this script is the source of the PNG files.

No line renderer made these drawings, and no hidden line was computed. Each is a list of strokes, chosen one
by one: which edges are seen, in which order the pen goes round them, and at which other line a half hidden
edge stops. A person would first put down a few construction lines in perspective; here, *guide points* stand
for them. A pen that is not very steady then follows the strokes.

    python examples/strokes.py [FOLDER]     writes the drawings and examples.json (into this folder)

A drawing's strokes are text, part by part, a comma between them; each is the points that the pen passes:

    b011 l001           a straight stroke between two guide points
    a:b^c:d             the place on paper where line a-b crosses line c-d, so an edge stops at what hides it
    rim(20..377)        along a circle or ellipse, between two angles in degrees
    ... twice           gone over a second time          ... halves      put down in two goes

Corners of a box carry its letter and low (0) or high (1) in x, y and z: `s110` is a corner of box `s`.
World: y up, the object's front looks along +x, its plane of symmetry is z = 0, its largest side 1/1.2.
"""

from __future__ import annotations

import json
import math
import re
import sys
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageChops, ImageDraw

Array = NDArray[np.float64]

# Guide points: what construction lines give a person
VIEWS = {  # azimuth from +x towards +z, and elevation, in degrees (a few of sketchcore.VIEWPOINTS)
    "quarter-037": (37.5, 38.0),
    "quarter-052": (52.5, 38.0),
    "quarter-322": (322.5, 38.0),
    "right": (90.0, 0.0),
}
DISTANCE, FOV = 2.0, 45.0
H = 0.5 / 1.2  # half of the largest side


@dataclass(frozen=True)
class Ring:
    """An ellipse in the world: `center` + cos `u` + sin `v`."""

    center: tuple[float, float, float]
    u: tuple[float, float, float]
    v: tuple[float, float, float]

    def at(self, degrees: Array) -> Array:
        a = np.radians(np.asarray(degrees, dtype=np.float64))[..., None]
        return np.array(self.center) + np.cos(a) * np.array(self.u) + np.sin(a) * np.array(self.v)


def box(letter: str, low: tuple[float, ...], high: tuple[float, ...]) -> dict:
    ends = (low, high)
    return {f"{letter}{i}{j}{k}": (ends[i][0], ends[j][1], ends[k][2]) for i, j, k in product((0, 1), repeat=3)}


def profile(points: dict[str, tuple[float, float]], **sides: float) -> dict:
    """Repeat a side's outline at several z: point `p` at side `_n` is `p_n`."""
    return {name + side: (x, y, z) for name, (x, y) in points.items() for side, z in sides.items()}


def level(x: float, y: float, radius: float) -> Ring:
    """Make a horizontal circle; degrees from +x towards +z."""
    return Ring((x, y, 0.0), (radius, 0.0, 0.0), (0.0, 0.0, radius))


def upright(x: float, y: float, z: float, rx: float, ry: float) -> Ring:
    """Make an ellipse parallel to the plane of symmetry; degrees from +x upwards."""
    return Ring((x, y, z), (rx, 0.0, 0.0), (0.0, ry, 0.0))


@dataclass(frozen=True)
class Drawing:
    """One sheet of paper: what is drawn, from where, and with which hand and pen."""

    file: str
    view: str
    guides: dict
    strokes: dict[str, str]
    size: tuple[int, int] = (800, 800)
    slip: tuple[float, float, float] = (0.0, 0.0, 0.0)  # degrees: azimuth, elevation, roll misjudged
    pen: float = 3.6  # width in pixels on paper 800 pixels wide
    wobble: float = 1.0
    ink: int = 20  # grey level of a firm stroke
    grain: float = 0.0  # how much the paper's tooth breaks the line
    paper: str = "white"  # or "grey": a photographed sheet, or "clear": ink on nothing


CHAIR = {
    **box("s", (-0.24, -0.06, -0.24), (0.24, 0.03, 0.24)),  # seat
    **box("b", (-0.24, 0.03, -0.24), (-0.15, H, 0.24)),  # back
    **box("n", (0.16, -H, 0.16), (0.24, -0.06, 0.24)),  # near leg; the far one is hidden behind it
    **box("l", (-0.24, -H, 0.16), (-0.16, -0.06, 0.24)),  # left leg
    **box("r", (0.16, -H, -0.24), (0.24, -0.06, -0.16)),  # right leg
}
CHAIR_STROKES = {
    "back": """b011 l001 halves, b011 b111, b111 b110 twice, b011 b010, b010 b110,
               b111 b101, b110 b100, b101 b100""",
    "seat": "b101 s111, s111 s110 twice, b100 s110, l111 n011, n110 r111",
    "near leg": "s111 n101 halves, n011 n001, n110 n100, n001 n101 n100",
    "left leg": "l111 l101, l001 l101 l100, l100 l100:l110^l111:n011",
    "right leg": "s110 r100, r111 r101, r001:r011^n110:r111 r001, r001 r101 r100",
}

HOUSE = {
    **profile({"foot": (H, -0.38), "eave": (H, 0.0)}, _l=0.30, _n=-0.30),  # front: left, near corner
    **profile({"foot": (-H, -0.38), "eave": (-H, 0.0)}, _r=-0.30),  # and the far end, on the right
    **{"top_n": (H, 0.34, 0.0), "top_r": (-H, 0.34, 0.0)},
    **box("c", (-0.17, 0.20, -0.08), (-0.02, 0.41, 0.08)),  # chimney, and where it meets the roof
    **{"c_top": (-0.02, 0.34, 0.0), "c_front": (-0.02, 0.249, -0.08), "c_back": (-0.17, 0.249, -0.08)},
    **box("d", (0.33, -0.345, -0.10), (H, -0.03, 0.10)),  # doorway, a step up
}
HOUSE_STROKES = {
    "gable": "foot_l foot_n, foot_n eave_n twice, eave_l foot_l, eave_l top_n, top_n eave_n twice",
    "side": "eave_n eave_r halves, foot_n foot_r halves, eave_r foot_r",
    "roof": "top_r eave_r, top_n c_top, c_back:c010^top_n:top_r top_r",
    "chimney": """c_top c_front, c_front c_back, c110 c_front, c010 c_back, c111 c111:c101^top_n:top_r,
                  c111 c110, c110 c010, c010 c011, c011 c111""",
    "doorway": """d101 d111 d110, d110 d100, d100 d101, d101 d001,
                  d001:d011^d111:d110 d001, d001 d001:d000^d100:d110""",
}

MUG = {
    "rim": level(-0.1365, 0.35, 0.28),
    "lip": level(-0.1365, 0.35, 0.225),
    "foot": level(-0.1365, -0.35, 0.28),
    "high": level(-0.1365, 0.24, 0.28),  # where the handle grows out of the wall
    "low": level(-0.1365, -0.15, 0.28),
    "out": upright(0.14, 0.0, 0.05, 0.2765, 0.24),  # handle: near side, outer and inner edge
    "in": upright(0.14, 0.0, 0.05, 0.1865, 0.15),
    "outfar": upright(0.14, 0.0, -0.05, 0.2765, 0.24),
    "infar": upright(0.14, 0.0, -0.05, 0.1865, 0.15),
    **{f"wall{k}": (0.102, y, -0.146) for k, y in enumerate((0.35, 0.165, -0.06, -0.22))},
}
MUG_STROKES = {
    "rim": "rim(160..520), lip(40..404)",
    "wall": "rim(129..129) foot(129..129), foot(131..-12), wall0 wall1, wall2 wall3",
    "handle": """out(92..-92), in(91..-91), out(90..90) in(90..90), in(-90..-90) out(-90..-90),
                 high(10..-10), outfar(90..-33), low(10..-10), infar(-90..-40)""",
}

SIDE = {
    **{"tail": (-H, -0.12), "end": (-H, 0.06), "boot": (-0.30, 0.06), "back": (-0.25, 0.23)},
    **{"roof": (0.05, 0.23), "glass": (0.17, 0.06), "hood": (H, 0.02), "nose": (H, -0.12)},
}
CAR = {
    **profile({**SIDE, "belly": (0.07, -0.12)}, _n=-0.19, _f=0.19),
    "wheel": upright(0.24, -0.12, -0.25, 0.12, 0.12),
    "tread": upright(0.24, -0.12, -0.19, 0.12, 0.12),
    "wheel2": upright(-0.25, -0.12, -0.25, 0.12, 0.12),
    "tread2": upright(-0.25, -0.12, -0.19, 0.12, 0.12),
    "farwheel": upright(0.24, -0.12, 0.25, 0.12, 0.12),
}
CAR_STROKES = {
    "front": "hood_n hood_f, hood_f nose_f, nose_f nose_n twice, nose_n hood_n",
    "bonnet": "hood_n glass_n, hood_f glass_f, glass_f glass_n",
    "cabin": """glass_n roof_n, glass_f roof_f, roof_f roof_n twice, roof_n back_n, roof_f back_f,
                back_f back_n, back_n boot_n""",
    "boot": "boot_n end_n, end_n end_n:end_f^back_n:boot_n, end_n tail_n",
    "front wheel": """wheel(100..456), tread(105..-50), tread(105..105) wheel(108..108),
                      tread(-50..-50) wheel(-54..-54), nose_n tread(0..0)""",
    "rear wheel": """wheel2(70..428), tread2(105..-50), tread2(105..105) wheel2(108..108),
                     tread2(-50..-50) wheel2(-54..-54), belly_n tread2(0..0)""",
    "far wheel": "farwheel(38..115)",
}

CAR_SIDE = {
    **profile(SIDE, _n=0.19),
    "wheel": upright(0.24, -0.12, 0.25, 0.12, 0.12),
    "wheel2": upright(-0.25, -0.12, 0.25, 0.12, 0.12),
}
CAR_SIDE_STROKES = {
    "wheels": "wheel(80..438), wheel2(120..476)",
    "body": """end_n tail_n, end_n boot_n, boot_n back_n, back_n roof_n twice, roof_n glass_n, glass_n hood_n,
               hood_n nose_n""",
    "belly": "nose_n wheel(0..0), tail_n wheel2(180..180), wheel2(0..0) wheel(180..180) halves",
}

PENCIL = {"size": (1000, 1000), "pen": 3.2, "ink": 60, "grain": 0.5, "paper": "grey"}
INK = {"size": (640, 640), "pen": 4.0, "paper": "clear"}
DRAWINGS = {
    "chair": [Drawing("chair.png", "quarter-037", CHAIR, CHAIR_STROKES, slip=(1.5, -1.5, 0.6))],
    "house": [Drawing("house.png", "quarter-322", HOUSE, HOUSE_STROKES, slip=(-1.0, 1.5, -0.7), **PENCIL)],
    "mug": [Drawing("mug.png", "quarter-052", MUG, MUG_STROKES, slip=(1.0, 1.0, -0.8), **INK)],
    "car": [
        Drawing("car-quarter.png", "quarter-322", CAR, CAR_STROKES, slip=(1.5, 1.0, 0.5), wobble=1.2),
        Drawing("car-right.png", "right", CAR_SIDE, CAR_SIDE_STROKES, (800, 640), (-1.0, 1.0, 0.4)),
    ],
}


class Sheet:
    """Places a drawing's guide points on paper, about where they belong."""

    def __init__(self, drawing: Drawing, rng: np.random.Generator) -> None:
        self.drawing = drawing
        self.unit = max(drawing.size) / 800  # the square picture is as wide as the paper's longer side
        azimuth, elevation = VIEWS[drawing.view]
        a, e = math.radians(azimuth + drawing.slip[0]), math.radians(elevation + drawing.slip[1])
        roll = math.radians(drawing.slip[2])
        toward = np.array([math.cos(e) * math.cos(a), math.sin(e), math.cos(e) * math.sin(a)])
        right = np.array([math.sin(a), 0.0, -math.cos(a)])
        down = np.cross(right, toward)
        turned = math.cos(roll) * right + math.sin(roll) * down
        self.axes = np.stack([turned, np.cross(-toward, turned), -toward])
        self.eye = DISTANCE * toward
        corners = {name: p for name, p in drawing.guides.items() if not isinstance(p, Ring)}
        self.places = {n: self.project(np.array(p)) + rng.normal(0, self.unit, 2) for n, p in corners.items()}

    def project(self, world: Array) -> Array:
        x, y, z = np.moveaxis((world - self.eye) @ self.axes.T, -1, 0)
        focal = max(self.drawing.size) / 2 / math.tan(math.radians(FOV / 2))
        middle = np.array(self.drawing.size) / 2
        return middle + focal * np.stack([x / z, y / z], axis=-1)

    def points(self, word: str) -> Array:
        """Find the points of one word of a stroke, [n, 2]."""
        if ring := re.fullmatch(r"(\w+)\((-?\d+)\.\.(-?\d+)\)", word):
            first, last = int(ring[2]), int(ring[3])
            angles = np.linspace(first, last, max(1, abs(last - first) // 4))
            return self.project(self.drawing.guides[ring[1]].at(angles))
        if "^" in word:
            (a, b), (c, d) = ([self.places[n] for n in line.split(":")] for line in word.split("^"))
            s, _ = np.linalg.solve(np.stack([b - a, c - d], axis=1), c - a)
            return (a + s * (b - a))[None]
        return self.places[word][None]


def resample(path: Array, step: float) -> Array:
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    at = np.linspace(0.0, length[-1], max(2, math.ceil(length[-1] / step)))
    return np.stack([np.interp(at, length, path[:, k]) for k in (0, 1)], axis=1)


class Pen:
    """A hand that trembles slowly, bows its long strokes and seldom stops exactly at a corner."""

    FINE = 3  # drawn this much larger, then reduced

    def __init__(self, drawing: Drawing, rng: np.random.Generator) -> None:
        self.drawing, self.rng = drawing, rng
        self.unit = max(drawing.size) / 800
        self.sheet = Image.new("L", tuple(self.FINE * n for n in drawing.size), 255)

    def drift(self, travelled: Array, shortest: float, longest: float) -> Array:
        """Make a slow random curve of about unit size, over distances in pixels at 800."""
        waves = self.rng.uniform(shortest, longest, 4)
        phases = self.rng.uniform(0, 2 * math.pi, 4)
        return np.sin(2 * math.pi * travelled[:, None] / waves + phases).sum(axis=1) / math.sqrt(2)

    def past(self, path: Array, reach: float) -> Array:
        """Go on past a path's end by so many pixels, or stop short of it."""
        if reach < 0:
            return path[: len(path) - round(-reach / (0.7 * self.unit))]
        along = path[-1] - path[-2]
        return np.concatenate([path, (path[-1] + along * reach / np.linalg.norm(along))[None]])

    def stroke(self, path: Array, ends: tuple[float, float]) -> None:
        """Draw along a path; `ends` is how far, on average, the pen goes on past each end."""
        rng, unit = self.rng, self.unit
        path = resample(path, 0.7 * unit)
        reach = np.clip(rng.normal(ends, 2.5), -2.0, 9.0) * unit
        reach = np.minimum(reach, 0.08 * len(path) * 0.7 * unit)
        path = self.past(self.past(path, reach[1])[::-1], reach[0])[::-1]
        path = resample(path, 0.7 * unit)
        travelled = np.arange(len(path)) * 0.7
        t = travelled / travelled[-1]
        across = np.gradient(path, axis=0)[:, ::-1] * [-1, 1]
        across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-9)
        bow = rng.normal(0, 0.005) * min(travelled[-1], 400) * np.sin(math.pi * t)
        settle = np.minimum(1.0, 0.35 + np.minimum(t, 1 - t) * travelled[-1] / 60)  # steadier near its ends
        sway = 0.9 * self.drift(travelled, 90, 350) + 0.1 * self.drift(travelled, 25, 60)
        off = across * (bow + self.drawing.wobble * settle * sway)[:, None]
        start, stop = rng.normal(0, 1.2, (2, 2))  # how far the pen is put down beside the point meant
        path = path + unit * (off + (1 - t)[:, None] * start + t[:, None] * stop)
        press = 1.0 + 0.12 * self.drift(travelled, 60, 300) + 0.12 * np.cos(math.pi * t)
        press *= 0.6 + 0.4 * np.minimum(1.0, np.minimum(travelled + 3, travelled[::-1]) / 14)  # lands, lifts
        width = np.clip(self.drawing.pen * press, 2.3, 5.2) * unit
        tone = self.drawing.ink + 14 * self.drift(travelled, 120, 500)
        layer = Image.new("L", self.sheet.size, 255)
        nib = ImageDraw.Draw(layer)
        for (x, y), r, ink in zip(self.FINE * path, self.FINE * width / 2, tone, strict=True):
            nib.ellipse((x - r, y - r, x + r, y + r), fill=int(np.clip(ink, 0, 160)))
        self.sheet = ImageChops.darker(self.sheet, layer)

    def finish(self) -> Image.Image:
        """Return the sheet as it is kept, with its paper."""
        drawing, rng = self.drawing, self.rng
        tone = np.asarray(self.sheet.resize(drawing.size, Image.Resampling.BOX), dtype=np.float64) / 255
        cover = (1 - tone) * (1 - drawing.grain * rng.random(tone.shape) ** 2)
        if drawing.paper == "clear":
            blue = np.broadcast_to([20, 24, 60], (*tone.shape, 3))
            return Image.fromarray(np.dstack([blue, np.round(255 * cover)]).astype(np.uint8))
        paper = np.ones(tone.shape)
        if drawing.paper == "grey":  # lit from one corner
            y, x = np.mgrid[: tone.shape[0], : tone.shape[1]] / max(tone.shape)
            paper = 0.93 - 0.09 * x - 0.05 * y + rng.normal(0, 0.003, tone.shape)
        return Image.fromarray(np.round(255 * np.clip(paper * (1 - cover), 0, 1)).astype(np.uint8))


def draw(drawing: Drawing) -> Image.Image:
    """Put a drawing on paper; the same every time."""
    rng = np.random.default_rng(list(drawing.file.encode()))
    sheet, pen = Sheet(drawing, rng), Pen(drawing, rng)
    for stroke in ",".join(drawing.strokes.values()).split(","):
        words = stroke.split()
        manner = words.pop() if words[-1] in ("twice", "halves") else ""
        path = np.concatenate([sheet.points(word) for word in words])
        past = (3.0 if words[0] in sheet.places else 0.5, 3.0 if words[-1] in sheet.places else 0.5)
        if manner == "halves":
            path = resample(path, 1.0)
            stop = int(len(path) * rng.uniform(0.4, 0.6))
            pen.stroke(path[: stop + 9], (past[0], 0.0))
            pen.stroke(path[stop - 9 :], (0.0, past[1]))
        else:
            pen.stroke(path, past)
        if manner == "twice":
            pen.stroke(path, past)
    return pen.finish()


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    for drawing in (d for drawings in DRAWINGS.values() for d in drawings):
        draw(drawing).save(folder / drawing.file, optimize=True)
    listing = [
        {"name": name, "drawings": [{"file": d.file, "view": d.view} for d in drawings]}
        for name, drawings in DRAWINGS.items()
    ]
    (folder / "examples.json").write_text(json.dumps(listing, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
