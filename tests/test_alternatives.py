"""The alternatives: one table, the same samples and optimisers, weights that load; and the presets with a time."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

import sketchcore as sk
from sketchcore.cli import app
from sketchcore.nets import compactmodel
from sketchcore.nets.unet import PaperNet
from sketchcore.nets.weights import load_weights
from sketchcore.train import ALTERNATIVES, PRESETS, Preset, Run, chains, papertrain, train
from sketchcore.train.chains import start_chain
from sketchcore.train.checkpoint import Progress, load_checkpoint
from sketchcore.train.heldout import heldout_iou
from sketchcore.train.loop import move_average
from sketchcore.train.papertrain import SingleStage, UpdaterStage
from sketchcore.train.presets import STAGES, TRUTHS
from sketchcore.train.truth import WORLD_TRUTHS

CPU = torch.device("cpu")
TINY: dict[str, dict[str, Any]] = {
    "compact": {"stem": 8, "image": (16, 16, 16), "features": 8, "fused": 8, "world": (8, 16, 16), "groups": 2},
    "paper": {"width": 4},
    "multiscale": {"width": 4},
}


@pytest.fixture(autouse=True)
def _few_heldout_shapes(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (chains, papertrain):
        monkeypatch.setattr(module, "heldout_iou", partial(heldout_iou, shapes=2))
    # What a network says after two steps is in thousands of pieces, and joining them takes seconds.
    monkeypatch.setattr(compactmodel, "join_pieces", lambda volume: volume)


def tiny(out: Path, name: str, **arguments: Any) -> Run:
    changes = {"batch": 2, "warmup": 2}
    return Run(out, name, options=TINY[PRESETS[name].network], changes=changes, **arguments)


def test_alternatives_differ_in_network_and_truth_alone() -> None:
    compact = ALTERNATIVES["compact"]
    for name, preset in ALTERNATIVES.items():
        same = [f.name for f in fields(Preset) if f.name not in ("network", "truth")]
        assert all(getattr(preset, field) == getattr(compact, field) for field in same), name
    assert len({(p.network, p.truth) for p in ALTERNATIVES.values()}) == len(ALTERNATIVES) == 5
    assert {p.network for p in ALTERNATIVES.values()} == set(STAGES)
    assert {p.truth for p in ALTERNATIVES.values()} == set(WORLD_TRUTHS)
    assert ALTERNATIVES.keys() <= PRESETS.keys()


def test_all_see_the_same_shapes_and_the_same_first_drawings() -> None:
    started = [start_chain(ALTERNATIVES["distance"], 6, index) for index in (4, 5)]
    changed = replace(ALTERNATIVES["multiscale"], batch=2)
    single = SingleStage(changed, 6, CPU, 4, PaperNet(width=1))
    updater = UpdaterStage(changed, 6, CPU, 4, PaperNet(width=1))
    try:
        for stage in (single, updater):
            batch = next(stage._batches)
            for i, chain in enumerate(started):
                np.testing.assert_array_equal(batch.drawings[i, 0], chain.sketches.drawings[0])
                np.testing.assert_array_equal(batch.packed_cameras[i, 0], chain.sketches.cameras[0])
    finally:
        single.close()
        updater.close()


@pytest.mark.parametrize("name", list(ALTERNATIVES))
def test_every_alternative_trains_resumes_and_is_measured(tmp_path: Path, name: str) -> None:
    stages = ALTERNATIVES[name].stages
    before = train(tiny(tmp_path, name, steps=2), quiet=True)
    assert [progress.stage for progress in before] == list(stages)
    assert all(progress.iou is not None and 0 <= progress.waited < progress.seconds for progress in before)
    weights, _ = load_weights(tmp_path / "weights.safetensors")
    after = train(tiny(tmp_path, name, steps=3), resume=True, quiet=True)
    run = tiny(tmp_path, name, steps=4)
    truth = "fractional" if run.constants.truth == "binary" else "binary"
    otherwise = replace(run, changes={**(run.changes or {}), "truth": truth})
    with pytest.raises(ValueError, match="learns other things"):
        train(otherwise, resume=True, quiet=True)
    assert after[-1].step == 3
    assert after[-1].samples > before[-1].samples
    assert load_checkpoint(tmp_path / f"{stages[-1]}.checkpoint.safetensors").progress == after[-1]
    again, config = load_weights(tmp_path / "weights.safetensors")
    assert any(not np.array_equal(weights[key], again[key]) for key in weights)
    assert (config["network"], config["training"]["preset"]) == (ALTERNATIVES[name].network, name)
    assert config["training"]["truth"] == ALTERNATIVES[name].truth
    assert config["training"]["runs"][-1]["waited"] == after[-1].waited
    model = sk.load_model(tmp_path / "weights.safetensors", device="cpu")
    drawings = list(sk.generate(0, 1, views=2).drawings[0])
    solid = sk.reconstruct(drawings, ["quarter-037", "top"], iterations=1, model=model)
    assert np.isfinite(solid.probability).all()


def test_running_statistics_are_averaged_like_weights() -> None:
    model, average = torch.nn.BatchNorm1d(3), torch.nn.BatchNorm1d(3)
    model(torch.tensor([[1.0, 2.0, 3.0], [3.0, 6.0, 9.0]]))
    with torch.no_grad():
        model.weight.fill_(5.0)
    expected = {name: 0.75 * average.state_dict()[name] + 0.25 * now for name, now in model.state_dict().items()}
    move_average(average, model, 0.75)
    assert int(average.num_batches_tracked) == int(model.num_batches_tracked) == 1
    for name in ("weight", "bias", "running_mean", "running_var"):
        torch.testing.assert_close(average.state_dict()[name], expected[name])
    torch.testing.assert_close(average.running_mean, torch.tensor([0.05, 0.1, 0.15]))


def test_averaged_weights_of_a_normalised_network_predict_what_it_learnt(tmp_path: Path) -> None:
    run = tiny(tmp_path, "multiscale", steps=12)
    train(run, quiet=True)
    found = load_checkpoint(tmp_path / "multiscale.checkpoint.safetensors")
    for key in ("scale3.1.running_mean", "scale1.convolutions.1.running_var"):
        start, now, mean = 0.0 if "mean" in key else 1.0, found.model[key], found.average[key]
        assert (mean - start).abs().max() > 0.1 * (now - start).abs().max() > 0


def test_presets_with_a_time_need_none_and_share_it_over_pieces(tmp_path: Path) -> None:
    assert {name for name, preset in PRESETS.items() if preset.minutes} == {"laptop", "gpu"}
    laptop = Run(tmp_path, "laptop", options=TINY["compact"], changes={"batch": 2, "minutes": 0.02})
    [first] = train(laptop, quiet=True)
    assert first.seconds >= 1.2
    [second] = train(laptop, resume=True, quiet=True)
    assert (second.step, second.seconds) == (first.step, first.seconds), "the time is over"
    [more] = train(replace(laptop, minutes=0.01), resume=True, quiet=True)
    assert more.step > first.step
    assert more.seconds >= first.seconds + 0.6


def test_progress_tells_the_speed_and_the_share_of_the_time_waited() -> None:
    progress = Progress("compact", step=5, samples=60, seconds=10.0, waited=2.5)
    assert progress.speed() == "6.0 samples/s (waited 25 %)"
    assert Progress("compact").speed() == "0.0 samples/s (waited 0 %)"


@pytest.mark.parametrize("network", list(TRUTHS))
def test_unknown_networks_and_truths_are_refused(network: str) -> None:
    constants = {"batch": 2, "rate": 1e-3, "betas": (0.9, 0.99)}
    for truth in TRUTHS[network]:
        assert Preset(network, truth, **constants).stages == STAGES[network]
    unknown = "depth" if network == "compact" else "distance"
    with pytest.raises(ValueError, match=f"{network!r} has no truth {unknown!r}; it takes binary, fractional"):
        Preset(network, unknown, **constants)
    with pytest.raises(ValueError, match="networks are compact, paper, multiscale"):
        Preset("vgg", "binary", **constants)


def test_the_command_line_names_every_preset(tmp_path: Path) -> None:
    shown = CliRunner().invoke(app, ["train", "--help"], env={"COLUMNS": "200"}).stdout
    assert [name for name in PRESETS if name not in shown] == []
    refused = CliRunner().invoke(app, ["train", "--preset", "big", "--steps", "1", "-o", str(tmp_path)])
    assert refused.exit_code == 1
    assert ", ".join(PRESETS) in refused.stderr
