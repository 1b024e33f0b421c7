"""Lines along the world's axes, and the cameras that they speak for."""

from __future__ import annotations

import numpy as np
import pytest

import sketchcore as sk
from sketchcore.directions import Directions

BOX = sk.Shape([sk.Cuboid((0.0, 0.0, 0.0), (0.4, 0.25, 0.3))])


@pytest.mark.parametrize("camera", [sk.VIEWPOINTS["quarter-052"], sk.Camera.orbit(-60.0, 12.0, fov_degrees=28)])
def test_the_edges_of_a_box_run_along_the_axes_that_its_camera_sees(camera: sk.Camera) -> None:
    directions = Directions.of(sk.draw(BOX, camera))
    assert directions.agreement(camera) > 0.85
    for right, down in ((12, 0), (-12, 0), (0, 15), (0, -15)):
        assert directions.agreement(camera.turned(right, down)) < directions.agreement(camera) - 0.1


def test_a_direction_is_that_of_the_line() -> None:
    drawing = np.zeros((256, 256), np.uint8)
    for x in range(40, 200):
        drawing[100 + x // 4, x] = 255
    directions = Directions.of(drawing)
    middle = np.abs(directions.places[:, 0] - 120) < 60
    slope = directions.along[middle, 1] / directions.along[middle, 0]
    assert slope == pytest.approx(0.25, abs=0.06)
    assert directions.weights[middle].min() > 0.9


def test_lines_that_run_along_no_axis_speak_for_no_camera() -> None:
    camera = sk.Camera.orbit(0.0, 0.0)
    drawing = np.zeros((256, 256), np.uint8)
    for x in range(60, 190):
        drawing[x, x] = 255  # halfway between upright and level, and not towards the middle
        drawing[x, min(x + 40, 255)] = 255
    # The axis that points at the eye vanishes in the middle: of it, ink on a diagonal through there does run.
    through = Directions.of(np.triu(np.tril(drawing)))
    beside = Directions.of(np.triu(drawing, 20))
    assert through.agreement(camera) > 0.9
    assert beside.agreement(camera) < 0.3


def test_without_ink_nothing_agrees() -> None:
    assert Directions.of(np.zeros((256, 256), np.uint8)).agreement(sk.VIEWPOINTS["top"]) == 0.0
