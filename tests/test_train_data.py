"""Training on meshes: each network learns from them, and says so."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
import trimesh

import sketchcore as sk
from sketchcore.datagen.prepare import Preparation, prepare
from sketchcore.nets.weights import load_weights
from sketchcore.train import Run, train

TINY = {"stem": 8, "image": (16, 16, 16), "features": 8, "fused": 8, "world": (8, 16, 16), "groups": 2}


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder, out = tmp_path_factory.mktemp("meshes"), tmp_path_factory.mktemp("data") / "boxes"
    for i in range(6):
        trimesh.creation.box((1.0, 0.3 + 0.1 * i, 0.7)).export(folder / f"{i}.ply")
    prepare(folder, out, Preparation(up="y", front="x", split=(0.5, 0.5, 0)), jobs=1)
    return out


def test_a_run_learns_from_meshes(data: Path, tmp_path: Path) -> None:
    options: dict[str, Any] = {"options": TINY, "changes": {"batch": 2, "warmup": 2}}
    [progress] = train(Run(tmp_path / "a", steps=2, data=data, **options), quiet=True)
    assert progress.step == 2
    assert progress.iou is not None
    _, config = load_weights(tmp_path / "a" / "weights.safetensors")
    assert config["training"]["data"]["name"] == "boxes"
    assert len(config["training"]["data"]["fingerprint"]) == 16
    [resumed] = train(Run(tmp_path / "a", steps=3, data=data, **options), resume=True, quiet=True)
    assert resumed.step == 3
    with pytest.raises(ValueError, match="resume it with its own preset, grammar and data"):
        train(Run(tmp_path / "a", steps=4, **options), resume=True, quiet=True)
    begun = Run(tmp_path / "b", steps=1, data=data, begin=tmp_path / "a" / "weights.safetensors", changes={"batch": 2})
    [progress] = train(begun, quiet=True)
    assert progress.began is not None
    assert progress.began["training"]["data"] == config["training"]["data"]


@pytest.mark.parametrize(("preset", "options"), [("paper", {"width": 4}), ("distance", TINY)])
def test_other_networks_and_truths_do_as_well(preset: str, options: dict[str, Any], data: Path, tmp_path: Path) -> None:
    stages = train(Run(tmp_path, preset, steps=1, data=data, options=options, changes={"batch": 2}), quiet=True)
    assert all(stage.step == 1 for stage in stages)
    assert sk.load_model(tmp_path / "weights.safetensors") is not None


def test_data_that_a_run_cannot_learn_from_is_refused(data: Path, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="make one by sketchcore prepare"):
        train(Run(tmp_path / "a", steps=1, data=tmp_path), quiet=True)
    with pytest.raises(ValueError, match="is measured on shapes, and meshes are none"):
        train(Run(tmp_path / "a", "fractional", steps=1, data=data), quiet=True)
    folder = tmp_path / "one"
    folder.mkdir()
    trimesh.creation.box().export(folder / "box.stl")
    prepare(folder, tmp_path / "few", Preparation(split=(1, 0, 0)), jobs=1)
    with pytest.raises(ValueError, match="no objects in its split 'val'"):
        train(Run(tmp_path / "a", steps=1, data=tmp_path / "few"), quiet=True)
    assert not (tmp_path / "a").exists()
