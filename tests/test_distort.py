"""Faulty drawings: each fault does what its strength says."""

from __future__ import annotations

import numpy as np
import pytest

import sketchcore as sk
from sketchcore.evaluate.distort import STRENGTHS, distorted, faulty_style
from sketchcore.evaluate.testset import load_testset
from sketchcore.strokes import trace

BOX = sk.Shape([sk.Cuboid((0, 0, 0), (0.4, 0.3, 0.35))])
CAMERA = sk.VIEWPOINTS["quarter-052"]


def _ink(drawing: np.ndarray) -> np.ndarray:
    return np.argwhere(drawing >= 64).astype(float)


def _drawn(name: str, strength: int, seed: int = 0) -> np.ndarray:
    return distorted(BOX, CAMERA, {name: strength}, np.random.default_rng(seed))


def _from_lines(drawing: np.ndarray) -> np.ndarray:
    """Each ink pixel's distance to the clean drawing's nearest one."""
    clean = _ink(sk.draw(BOX, CAMERA))
    return np.array([np.hypot(*(clean - p).T).min() for p in _ink(drawing)])


def test_no_fault_is_the_clean_drawing() -> None:
    assert np.array_equal(distorted(BOX, CAMERA, {}, np.random.default_rng(0)), sk.draw(BOX, CAMERA))


@pytest.mark.parametrize("name", STRENGTHS)
def test_every_fault_changes_the_drawing_the_same_way_for_the_same_seed(name: str) -> None:
    for strength in (1, 2, 3):
        drawing = _drawn(name, strength)
        assert drawing.shape == (256, 256)
        assert drawing.dtype == np.uint8
        assert np.array_equal(drawing, _drawn(name, strength))
        assert not np.array_equal(drawing, sk.draw(BOX, CAMERA))


@pytest.mark.parametrize("strength", [1, 2, 3])
def test_wobble_strays_as_far_as_it_says(strength: int) -> None:
    amount = STRENGTHS["wobble"][strength - 1]
    farthest = max(_from_lines(_drawn("wobble", strength, seed)).max() for seed in range(4))
    assert 0.5 * amount < farthest < amount + 1.5


@pytest.mark.parametrize("strength", [1, 2, 3])
def test_gaps_leave_out_their_share(strength: int) -> None:
    total = len(_ink(sk.LineStyle(antialias=True).redraw(sk.draw(BOX, CAMERA))))
    shares = [1 - len(_ink(_drawn("gaps", strength, seed))) / total for seed in range(4)]
    # A pen's end is round: each gap is shorter by its width.
    assert np.mean(shares) == pytest.approx(STRENGTHS["gaps"][strength - 1], abs=0.07)


@pytest.mark.parametrize("strength", [1, 2, 3])
def test_overshoot_reaches_as_far_as_it_says(strength: int) -> None:
    amount = STRENGTHS["overshoot"][strength - 1]
    assert 0.7 * amount < _from_lines(_drawn("overshoot", strength)).max() < amount + 2


def test_oversketching_draws_more_ink_further_apart() -> None:
    strays = [np.quantile(_from_lines(_drawn("over-sketching", s)), 0.95) for s in (1, 2, 3)]
    assert strays[0] < 2 < strays[1] < 4 < strays[2] < 9


@pytest.mark.parametrize("strength", [1, 2, 3])
def test_width_scale_and_shift(strength: int) -> None:
    clean = _ink(sk.draw(BOX, CAMERA))
    wide = _drawn("width", strength)
    assert wide.sum() / 255 / len(clean) == pytest.approx(STRENGTHS["width"][strength - 1], rel=0.2)
    small = _ink(_drawn("scale", strength))
    assert np.ptp(small, axis=0) == pytest.approx(STRENGTHS["scale"][strength - 1] * np.ptp(clean, axis=0), abs=2.5)
    moved = _ink(_drawn("shift", strength))
    middle = (moved.min(axis=0) + moved.max(axis=0)) / 2 - (clean.min(axis=0) + clean.max(axis=0)) / 2
    assert np.hypot(*middle) == pytest.approx(STRENGTHS["shift"][strength - 1], abs=1.5)


def test_turned_and_widened_cameras() -> None:
    for seed, example in enumerate(load_testset(5)):
        camera = example.cameras[1]
        other = faulty_style({"viewpoint": 3}).camera(camera, seed)
        assert np.linalg.norm(other.position) == pytest.approx(np.linalg.norm(camera.position))
        forward = np.clip(camera.rotation[2] @ other.rotation[2], -1, 1)
        assert np.degrees(np.arccos(forward)) == pytest.approx(20, abs=1e-3)
        assert camera.rotation @ camera.position == pytest.approx(other.rotation @ other.position)
        wide = faulty_style({"field of view": 3}).camera(camera, seed)
        assert abs(wide.fov_degrees / camera.fov_degrees - 1) == pytest.approx(0.35)

        def size(c: sk.Camera) -> float:
            return float(-(c.rotation @ c.position)[2] * np.tan(np.radians(c.fov_degrees / 2)))

        assert size(wide) == pytest.approx(size(camera))


def test_wrong_faults_are_refused() -> None:
    with pytest.raises(ValueError, match="1, 2 or 3"):
        distorted(BOX, CAMERA, {"wobble": 4}, np.random.default_rng(0))
    with pytest.raises(KeyError):
        distorted(BOX, CAMERA, {"smudge": 1}, np.random.default_rng(0))


def test_all_faults_together_still_make_a_drawing() -> None:
    for seed, example in enumerate(load_testset(3)):
        drawing = distorted(example.shape, example.cameras[0], dict.fromkeys(STRENGTHS, 3), np.random.default_rng(seed))
        assert len(trace(drawing)) > 3
