"""Cameras that a drawing's straight lines speak for."""

from __future__ import annotations

import numpy as np
import pytest

import sketchcore as sk
from sketchcore.calibration import cameras_spoken_for, likelihoods
from sketchcore.perspective import Lines

STEPS = sk.Shape([sk.Cuboid((-0.1, -0.2, 0.0), (0.3, 0.1, 0.25)), sk.Cuboid((0.05, 0.0, 0.0), (0.15, 0.12, 0.25))])
FINE = sk.LineStyle(antialias=True)


def off(one: sk.Camera, other: sk.Camera) -> float:
    """Degrees between the ways that two cameras look."""
    return float(np.degrees(np.arccos(np.clip(one.rotation[2] @ other.rotation[2], -1, 1))))


def azimuth(camera: sk.Camera) -> float:
    return float(np.degrees(np.arctan2(camera.position[2], camera.position[0])))


@pytest.mark.parametrize("seed", range(8))
def test_a_camera_is_found_wherever_it_stands(seed: int) -> None:
    random = np.random.default_rng(seed)
    name = sk.QUARTER_VIEWS[seed]
    beside = azimuth(sk.VIEWPOINTS[name]) + random.uniform(-14, 14)
    camera = sk.Camera.orbit(beside, random.uniform(8, 40), fov_degrees=random.uniform(26, 50))
    lines = Lines.of(sk.draw(STEPS, camera, style=FINE), sk.VIEWPOINTS[name])
    found, likeliest = cameras_spoken_for(lines)
    nearest = min(found, key=lambda one: off(one, camera))
    assert off(nearest, camera) < 1.5
    assert nearest.fov_degrees == pytest.approx(camera.fov_degrees, rel=0.1)
    assert likeliest >= likelihoods(lines, [camera])[0] - 1


def test_each_camera_is_followed_by_the_one_a_quarter_turn_on_and_none_sees_one_face_alone() -> None:
    viewpoint = sk.VIEWPOINTS["quarter-142"]
    for seen_from in (viewpoint, sk.VIEWPOINTS["right"]):
        found, _ = cameras_spoken_for(Lines.of(sk.draw(STEPS, seen_from, style=FINE), viewpoint))
        assert len(found) == 40
        for one, other in zip(found[::2], found[1::2], strict=True):
            assert (azimuth(other) - azimuth(one)) % 360 == pytest.approx(90)
            assert (one.fov_degrees, one.position[1]) == pytest.approx((other.fov_degrees, other.position[1]))
            assert abs((azimuth(one) + 45) % 90 - 45) >= 12 - 1e-9
            # Upright: what is to the right is level.
            assert one.rotation[0, 1] == pytest.approx(0, abs=1e-12)


def test_what_lines_say_does_not_depend_on_the_quarter() -> None:
    lines = Lines.of(sk.draw(STEPS, sk.Camera.orbit(28, 20, fov_degrees=35)), sk.VIEWPOINTS["quarter-037"])
    found, likeliest = cameras_spoken_for(lines)
    likely = likelihoods(lines, found)
    np.testing.assert_allclose(likely[::2], likely[1::2], atol=1e-6)
    assert likely[0] == pytest.approx(likeliest) == likely.max()


def test_without_lines_there_are_cameras_all_around() -> None:
    viewpoint = sk.VIEWPOINTS["quarter-037"]
    found, likeliest = cameras_spoken_for(Lines(np.zeros((0, 2, 2)), np.zeros(0), (viewpoint,)))
    assert likeliest == 0
    assert len(found) == 40
    assert {round(camera.fov_degrees) for camera in found} == {28, 45}
