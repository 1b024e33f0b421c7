"""The paper's rounds and the viewpoint guess, with models that are known exactly."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

import sketchcore as sk
from sketchcore.camera import pack_cameras
from sketchcore.nets.sketches import Sketches
from sketchcore.rounds import Volume, crossing, update_rounds, visit
from sketchcore.viewpoint import guess_camera, guess_viewpoint

VIEWS = ["quarter-037", "front", "top"]
SHAPE = sk.Shape([sk.Cuboid((0, -0.1, 0), (0.3, 0.2, 0.2)), sk.Cylinder((0.1, 0.15, 0), (0.1, 0.1, 0.1))])


class Scripted:
    """Answers drawing k with a constant volume of value `values[k]`, and keeps a record."""

    def __init__(self, values: list[float]) -> None:
        self.values = values
        self.calls: list[tuple[int, bool]] = []

    def __call__(self, view: int, prior: Volume | None) -> Volume:
        self.calls.append((view, prior is not None))
        return np.full((64, 64, 64), self.values[view], np.float32)


class Oracle:
    """Knows the true camera grid of a drawing that was made from its camera; is unsure of any other."""

    device = torch.device("cpu")

    def first_predictions(self, samples: Sequence[Sketches]) -> Iterator[Volume]:
        return (next(self.rounds(sketches, 0)) for sketches in samples)

    def in_place(self, sketches: Sketches, always: bool = False) -> Sketches:
        return sketches

    def first(self, drawings: int) -> float:
        return 3.5

    def rounds(self, sketches: Sketches, iterations: int, start: Volume | None = None) -> Iterator[Volume]:
        return update_rounds(lambda view, prior: self.answer(sketches, view), sketches.cameras, iterations, start)

    def answer(self, sketches: Sketches, view: int) -> Volume:
        camera = sk.Camera.from_packed(sketches.cameras[view])
        truth = sk.frustum(SHAPE, camera).astype(np.float32) / 255
        same = np.array_equal(sk.draw(SHAPE, camera), sketches.drawings[view])
        return truth if same else 0.6 * truth


def cameras(names: list[str]) -> NDArray[np.float64]:
    return pack_cameras([sk.VIEWPOINTS[name] for name in names])


def test_the_first_drawing_starts_and_every_round_ends_with_it() -> None:
    predict = Scripted([0.1, 0.2, 0.3])
    volumes = list(update_rounds(predict, cameras(VIEWS), 2))
    assert len(volumes) == 3
    assert [view for view, _ in predict.calls] == [0, 1, 2, 0, 1, 2, 0]
    assert [prior for _, prior in predict.calls] == [False] + [True] * 6


def test_one_drawing_is_refined_by_itself() -> None:
    predict = Scripted([0.1])
    assert len(list(update_rounds(predict, cameras(VIEWS[:1]), 5))) == 6
    assert [prior for _, prior in predict.calls] == [False] + [True] * 5


def test_a_volume_known_before_is_the_first_prior() -> None:
    predict = Scripted([0.1])
    next(update_rounds(predict, cameras(VIEWS[:1]), 0, np.zeros((64, 64, 64), np.float32)))
    assert predict.calls == [(0, True)]


def test_each_prediction_takes_the_place_of_the_one_before() -> None:
    first, *_, last = update_rounds(Scripted([0.1, 0.2]), cameras(VIEWS[:2]), 1)
    assert first[32, 32, 32] == pytest.approx(0.1, abs=1e-5)
    assert last[32, 32, 32] == pytest.approx(0.1, abs=1e-5)


def test_voxels_outside_a_frustum_keep_what_they_had() -> None:
    near = sk.Camera.orbit(0.0, 0.0)
    narrow = sk.Camera(near.position, near.rotation, fov_degrees=10.0)
    seen = visit(Scripted([0.8, 0.2]), pack_cameras([near, narrow]), 1, np.full((64, 64, 64), 0.8, np.float32))
    assert seen[32, 60, 32] == pytest.approx(0.8, abs=1e-5), "the narrow camera sees the middle alone"
    assert seen[32, 32, 32] == pytest.approx(0.2, abs=1e-5)


def test_an_oracle_reaches_the_ceiling_of_the_grid() -> None:
    truth = sk.voxelize(SHAPE)
    views = [sk.VIEWPOINTS[name] for name in VIEWS]
    sketches = Sketches(np.stack([sk.draw(SHAPE, camera) for camera in views]), cameras(VIEWS))
    *_, volume = Oracle().rounds(sketches, 1)
    assert sk.iou(volume, truth) > 0.93


def test_the_viewpoint_of_an_oracle_is_found() -> None:
    for name in sk.QUARTER_VIEWS:
        assert guess_viewpoint(Oracle(), sk.draw(SHAPE, sk.VIEWPOINTS[name]))[0] == name


@pytest.mark.parametrize("view", sk.QUARTER_VIEWS[::3])
def test_a_drawing_from_a_viewpoint_is_left_there(view: str) -> None:
    camera = sk.VIEWPOINTS[view]
    assert guess_camera(Oracle(), sk.draw(SHAPE, camera)) == (view, camera)


@pytest.mark.parametrize(
    ("azimuth", "elevation", "fov"), [(-75.0, 22.0, 28.0), (-57.0, 17.0, 39.0), (-35.0, 26.0, 30.0), (-20.0, 7.0, 45.0)]
)
def test_a_drawing_from_elsewhere_is_traced_to_its_camera(azimuth: float, elevation: float, fov: float) -> None:
    camera = sk.Camera.orbit(azimuth, elevation, fov_degrees=fov)
    name, found = guess_camera(Oracle(), sk.draw(SHAPE, camera))
    assert name == max(sk.QUARTER_VIEWS, key=lambda n: camera.rotation[2] @ sk.VIEWPOINTS[n].rotation[2])
    assert np.degrees(np.arccos(found.rotation[2] @ camera.rotation[2])) < 2
    assert found.fov_degrees == pytest.approx(fov, abs=4)


def test_nobody_draws_one_face_alone() -> None:
    for azimuth in (90.0, 180.0):
        _, found = guess_camera(Oracle(), sk.draw(SHAPE, sk.Camera.orbit(azimuth, 4.0, fov_degrees=28)))
        across = np.abs(found.position[[0, 2]])
        assert across.min() > 0.2 * across.max()


def test_what_crosses_is_counted_against_what_is_occupied() -> None:
    before = np.zeros((64, 64, 64), np.float32)
    before[:10, 0, 0] = 0.6
    after = before.copy()
    after[:2, 0, 0] = 0.5  # one half is outside
    after[20, 0, 0] = 0.51
    after[30, 0, 0] = 0.5
    assert crossing(before, after) == pytest.approx(3 / 9)
    assert crossing(before, before) == 0
    assert crossing(before, np.zeros_like(before)) == 10, "of nothing, as of one voxel"
