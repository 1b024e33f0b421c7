"""Hints on composition: silence on usual drawings, a sentence on what novices do."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

import sketchcore as sk
from sketchcore.app.hints import composition
from sketchcore.strokes import render

SHAPE = sk.Shape([sk.Cuboid((0, 0, 0), (0.4, 0.3, 0.35)), sk.Cylinder((0, 0.35, 0), (0.15, 0.06, 0.15), "y")])
DRAWING = sk.draw(SHAPE, sk.VIEWPOINTS["quarter-037"])


def moved(drawing: np.ndarray, scale: float = 1.0, right: int = 0, down: int = 0) -> np.ndarray:
    side = round(256 * scale)
    sheet = Image.new("L", (256, 256))
    first = (256 - side) // 2
    sheet.paste(Image.fromarray(drawing).resize((side, side)), (first + right, first + down))
    return np.where(np.asarray(sheet) > 64, 255, 0).astype(np.uint8)


def test_usual_drawings_are_left_alone() -> None:
    batch = sk.generate(11, 40, views=3, threads=1)
    names = list(sk.VIEWPOINTS)
    places = np.stack([sk.VIEWPOINTS[name].position for name in names])
    hinted = 0
    for drawings, cameras in zip(batch.drawings, batch.cameras, strict=True):
        for drawing, camera in zip(drawings, cameras, strict=True):
            viewpoint = names[int(np.linalg.norm(places - camera.position, axis=1).argmin())]
            hinted += bool(composition(drawing, viewpoint))
    assert hinted <= 6  # of 120


@pytest.mark.parametrize(
    ("drawing", "viewpoint", "words"),
    [
        (np.zeros((256, 256), np.uint8), "top", "Nothing is drawn"),
        (moved(DRAWING, 0.4), "quarter-037", "too small"),
        (moved(DRAWING, 1.2), "quarter-037", "too large"),
        (moved(DRAWING, 1.8), "quarter-037", "over the border"),
        (moved(DRAWING, right=40), "quarter-037", "too far to the right:"),
        (moved(DRAWING, right=-40), "quarter-037", "too far to the left:"),
        (moved(DRAWING, 0.7, right=-40, down=50), "quarter-037", "too far down and to the left:"),
        (moved(DRAWING, 0.7, down=-50), "quarter-037", "too far up:"),
        (moved(sk.draw(SHAPE, sk.VIEWPOINTS["front"]), right=25), "front", "off centre"),
    ],
)
def test_what_novices_do_is_named(drawing: np.ndarray, viewpoint: str, words: str) -> None:
    hints = composition(drawing, viewpoint)
    assert any(words in hint for hint in hints), hints


def test_an_open_outline_is_named() -> None:
    square = [(60, 60), (200, 60), (200, 200), (60, 200), (60, 130)]
    drawing = render([np.array(square, float)], 2.0)
    assert any("open" in hint for hint in composition(drawing, "front"))
    closed = render([np.array([*square, (60, 60)], float)], 2.0)
    assert composition(closed, "front") == []
    hasty = render([np.array([*square[:-1], (60, 66)], float)], 2.0)
    assert composition(hasty, "front") == []  # silhouettes close that by themselves


def test_what_is_no_drawing_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown viewpoint"):
        composition(DRAWING, "below")
    with pytest.raises(ValueError, match="shape"):
        composition(DRAWING[:100], "top")
    with pytest.raises(TypeError, match="uint8"):
        composition(DRAWING / 255, "top")
