"""Consensus, rounds and viewpoint guess, with a model that is known exactly."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

import sketchcore as sk
from sketchcore.camera import pack_cameras
from sketchcore.consensus import Consensus
from sketchcore.nets.models import Sketches
from sketchcore.rounds import update_rounds
from sketchcore.viewpoint import expected_iou, guess_viewpoint

VIEWS = ["quarter-037", "front", "top"]
SHAPE = sk.Shape([sk.Cuboid((0, -0.1, 0), (0.3, 0.2, 0.2)), sk.Cylinder((0.1, 0.15, 0), (0.1, 0.1, 0.1))])


class Scripted:
    """Answers drawing k with a constant volume of value `values[k]`, and keeps a record."""

    symmetric = False
    latest_only = False
    device = torch.device("cpu")

    def __init__(self, values: list[float]) -> None:
        self.values = values
        self.calls: list[tuple[int, bool]] = []

    def predict(self, sketches: Sketches, view: int, prior: NDArray[np.float32] | None) -> NDArray[np.float32]:
        self.calls.append((view, prior is not None))
        return np.full((64, 64, 64), self.values[view], np.float32)


class Oracle(Scripted):
    """Knows the true camera grid of a drawing that was made from its camera; is unsure of any other."""

    def __init__(self) -> None:
        super().__init__([])

    def predict(self, sketches: Sketches, view: int, prior: NDArray[np.float32] | None) -> NDArray[np.float32]:
        camera = sk.Camera.from_packed(sketches.cameras[view])
        truth = sk.frustum(SHAPE, camera).astype(np.float32) / 255
        same = np.array_equal(sk.draw(SHAPE, camera), sketches.drawings[view])
        return truth if same else 0.6 * truth


def sketches(names: list[str]) -> Sketches:
    cameras = [sk.VIEWPOINTS[name] for name in names]
    return Sketches(np.stack([sk.draw(SHAPE, camera) for camera in cameras]), pack_cameras(cameras))


def test_the_first_drawing_starts_and_every_round_ends_with_it() -> None:
    model = Scripted([0.1, 0.2, 0.3])
    volumes = list(update_rounds(model, sketches(VIEWS), 2))
    assert len(volumes) == 3
    assert [view for view, _ in model.calls] == [0, 1, 2, 0, 1, 2, 0]
    assert [prior for _, prior in model.calls] == [False] + [True] * 6


def test_one_drawing_is_refined_by_itself() -> None:
    model = Scripted([0.1])
    assert len(list(update_rounds(model, sketches(VIEWS[:1]), 5))) == 6
    assert len(model.calls) == 6


def test_consensus_is_the_mean_of_the_latest_of_each_drawing() -> None:
    consensus = Consensus(symmetric=False)
    constant = [np.full((64, 64, 64), v, np.float32) for v in (0.2, 0.6, 0.4)]
    np.testing.assert_allclose(consensus.add(0, constant[0]), 0.2, rtol=1e-6)
    np.testing.assert_allclose(consensus.add(1, constant[1]), 0.4, rtol=1e-6)
    np.testing.assert_allclose(consensus.add(0, constant[2]), 0.5, rtol=1e-6)


def test_the_papers_rule_keeps_the_latest_alone() -> None:
    consensus = Consensus(symmetric=False, latest_only=True)
    consensus.add(0, np.full((64, 64, 64), 0.2, np.float32))
    np.testing.assert_allclose(consensus.add(1, np.full((64, 64, 64), 0.6, np.float32)), 0.6)


def test_a_symmetric_consensus_mirrors_z() -> None:
    volume = np.random.default_rng(0).random((64, 64, 64), np.float32)
    made = Consensus(symmetric=True).add(0, volume)
    np.testing.assert_allclose(made, made[:, :, ::-1])
    np.testing.assert_allclose(made, (volume + volume[:, :, ::-1]) / 2)


def test_voxels_outside_a_frustum_keep_what_they_had() -> None:
    near = sk.Camera.orbit(0.0, 0.0)
    narrow = sk.Camera(near.position, near.rotation, fov_degrees=10.0)
    model = Scripted([0.8, 0.2])
    pair = Sketches(sketches(VIEWS[:2]).drawings, pack_cameras([near, narrow]))
    _, volume = update_rounds(model, pair, 1)
    # The narrow camera sees the middle alone: elsewhere its prediction is what the first one left there.
    assert volume[32, 60, 32] == pytest.approx(0.8, abs=1e-5)
    assert volume[32, 32, 32] == pytest.approx(0.5, abs=1e-5)


def test_an_oracle_reaches_the_ceiling_of_the_grid() -> None:
    truth = sk.voxelize(SHAPE)
    *_, volume = update_rounds(Oracle(), sketches(VIEWS), 1)
    assert sk.iou(volume, truth) > 0.93


def test_the_viewpoint_of_an_oracle_is_found() -> None:
    for name in sk.QUARTER_VIEWS:
        assert guess_viewpoint(Oracle(), sk.draw(SHAPE, sk.VIEWPOINTS[name]))[0] == name


def test_expected_iou() -> None:
    assert expected_iou(np.zeros((4, 4, 4), np.float32)) == 0.0
    assert expected_iou(np.ones((4, 4, 4), np.float32)) == 1.0
    assert expected_iou(np.array([0.8, 0.4], np.float32)) == pytest.approx(0.8 / 1.4)
