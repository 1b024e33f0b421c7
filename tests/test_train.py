"""Training: it learns, it survives a kill, it goes on where it stopped, and says what is wrong."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

import sketchcore as sk
from sketchcore.nets.compact import CompactNet
from sketchcore.nets.precision import place
from sketchcore.nets.weights import load_weights
from sketchcore.train import PRESETS, Run, train
from sketchcore.train.beginning import read_beginning
from sketchcore.train.chains import ChainStage, start_chain
from sketchcore.train.checkpoint import load_checkpoint
from sketchcore.train.loop import _Loop
from sketchcore.train.optimizers import FilterMuon, make_optimizers, orthogonal
from sketchcore.train.presets import grammar_changes

TINY = {"stem": 8, "image": (16, 16, 16), "features": 8, "fused": 8, "world": (8, 16, 16), "groups": 2}


def tiny(out: Path, **changes: Any) -> Run:
    return Run(out, options=TINY, changes={"batch": 2, "warmup": 2}, **changes)


def test_the_papers_constants() -> None:
    paper = PRESETS["paper"]
    assert (paper.rate, paper.betas, paper.stages) == (2e-4, (0.5, 0.999), ("single", "updater"))
    assert (paper.weight_decay, paper.warmup, paper.cooldown, paper.average, paper.clip) == (0, 0, 0, 0, 0)
    assert paper.generator == {}
    assert (paper.muon, paper.truth) == (0, "fractional")


def test_a_short_run_leaves_weights_that_load(tmp_path: Path) -> None:
    [progress] = train(tiny(tmp_path, steps=3), quiet=True)
    assert progress.step == 3
    assert progress.samples >= 2
    assert progress.iou is not None
    assert 0 <= progress.waited < progress.seconds
    _, config = load_weights(tmp_path / "weights.safetensors")
    assert config["network"] == "compact"
    assert config["training"]["runs"][0]["step"] == 3
    solid = sk.reconstruct(
        sk.generate(0, 1).drawings[0, 0], "quarter-037", iterations=1, model=tmp_path / "weights.safetensors"
    )
    assert solid.probability.shape == (64, 64, 64)


def test_resuming_goes_on_where_it_stopped(tmp_path: Path) -> None:
    train(tiny(tmp_path, steps=2), quiet=True)
    before = load_checkpoint(tmp_path / "compact.checkpoint.safetensors")
    [progress] = train(tiny(tmp_path, steps=4), resume=True, quiet=True)
    after = load_checkpoint(tmp_path / "compact.checkpoint.safetensors")
    assert progress.step == after.progress.step == 4
    assert progress.samples > before.progress.samples
    assert progress.seconds > before.progress.seconds
    assert float(after.moments[1][0]["step"]) == 4
    assert any(not torch.equal(before.model[k], after.model[k]) for k in before.model)


def test_a_finished_run_resumed_changes_no_weight(tmp_path: Path) -> None:
    train(tiny(tmp_path, steps=2), quiet=True)
    before, _ = load_weights(tmp_path / "weights.safetensors")
    train(tiny(tmp_path, steps=2), resume=True, quiet=True)
    after, _ = load_weights(tmp_path / "weights.safetensors")
    assert all(np.array_equal(before[k], after[k]) for k in before)


def test_a_run_begins_with_the_weights_of_another(tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    train(tiny(first, steps=2), quiet=True)
    weights, config = load_weights(first / "weights.safetensors")
    begun = Run(second, steps=1, begin=first / "weights.safetensors", changes={"batch": 2, "rate": 1e-9, "muon": 1e-9})
    [progress] = train(begun, quiet=True)
    assert progress.step == 1
    assert progress.began == config
    after, told = load_weights(second / "weights.safetensors")
    assert told["options"] == config["options"]
    assert told["training"]["runs"][0]["began"]["training"]["runs"][0]["step"] == 2
    assert all(np.allclose(after[name], weights[name], atol=2e-3) for name in weights)
    [resumed] = train(Run(second, steps=2, changes={"batch": 2}), resume=True, quiet=True)
    assert resumed.step == 2
    assert resumed.began == config, "a resumed run knows its options and its beginning"


def test_the_weights_inside_the_package_are_known_by_name() -> None:
    begun = read_beginning(Path("pretrained"), PRESETS["chair"])
    assert begun.record["network"] == "compact"
    assert set(begun.states) == {"compact"}


def test_weights_that_a_run_cannot_begin_with_are_refused(tmp_path: Path) -> None:
    train(tiny(tmp_path / "a", steps=1), quiet=True)
    weights = tmp_path / "a" / "weights.safetensors"
    for preset in ("paper", "multiscale"):
        with pytest.raises(ValueError, match="take a preset of that network"):
            train(Run(tmp_path / "b", preset, steps=1, begin=weights), quiet=True)
    with pytest.raises(ValueError, match="leave out the weights"):
        train(Run(tmp_path / "a", steps=2, begin=weights), resume=True, quiet=True)
    with pytest.raises(ValueError, match="not both"):
        Run(tmp_path / "b", steps=1, begin=weights, options={"stem": 8})
    with pytest.raises(FileNotFoundError, match="no weights"):
        train(Run(tmp_path / "b", steps=1, begin=tmp_path / "none.safetensors"), quiet=True)
    assert not (tmp_path / "b").exists()


def test_the_paper_preset_trains_both_networks(tmp_path: Path) -> None:
    run = Run(tmp_path, "paper", steps=2, options={"width": 4}, changes={"batch": 2})
    single, updater = train(run, quiet=True)
    assert (single.stage, updater.stage) == ("single", "updater")
    assert single.step == updater.step == 2
    model = sk.load_model(tmp_path / "weights.safetensors")
    drawings = sk.generate(0, 1, views=2).drawings[0]
    solid = sk.reconstruct(list(drawings), ["quarter-037", "top"], iterations=1, model=model)
    assert np.isfinite(solid.probability).all()
    single_again, updater_again = train(
        Run(tmp_path, "paper", steps=3, options={"width": 4}, changes={"batch": 2}), resume=True, quiet=True
    )
    assert single_again.step == 2, "the single view is what the updater was trained on: it stays"
    assert updater_again.step == 3


KILLED = """
import sys
from pathlib import Path
from sketchcore.train import Run, train
tiny = {"stem": 8, "image": (16, 16, 16), "features": 8, "fused": 8, "world": (8, 16, 16), "groups": 2}
run = Run(Path(sys.argv[1]), steps=10_000, save_every=0.0, options=tiny, changes={"batch": 2})
train(run, resume=len(sys.argv) > 2, quiet=True)
"""


def test_muon_takes_the_matrices_and_adam_the_rest() -> None:
    net = place(CompactNet(), torch.device("cpu"))
    muon, adam = make_optimizers(net, PRESETS["compact"])
    assert isinstance(muon, FilterMuon)
    by_muon = sum(p.numel() for p in muon.param_groups[0]["params"])
    by_adam = sum(p.numel() for p in adam.param_groups[0]["params"])
    assert by_muon + by_adam == sum(p.numel() for p in net.parameters())
    assert by_muon > 0.97 * (by_muon + by_adam)


@pytest.mark.parametrize("sides", [(32, 100), (100, 32), (40, 40)])
def test_orthogonalised_matrices_keep_their_singular_vectors(sides: tuple[int, int]) -> None:
    matrix = torch.randn(sides, generator=torch.Generator().manual_seed(1))
    u, values, v = torch.linalg.svd(matrix.double(), full_matrices=False)
    values /= values.norm()
    for _ in range(5):
        values = 3.4445 * values - 4.7750 * values**3 + 2.0315 * values**5
    torch.testing.assert_close(orthogonal(matrix).double(), u @ torch.diag(values) @ v, rtol=0, atol=1e-4)
    assert values.min() > 0.6
    assert values.max() < 1.3


@pytest.mark.parametrize("layout", [torch.contiguous_format, torch.channels_last])
def test_a_filter_moves_as_its_matrix_would(layout: torch.memory_format, monkeypatch: pytest.MonkeyPatch) -> None:
    torch.manual_seed(0)
    # Of its own, the peer orthogonalises in bfloat16.
    monkeypatch.setattr("torch.optim._muon._zeropower_via_newtonschulz", lambda matrix, *_: orthogonal(matrix))
    start, gradient = torch.randn(48, 40, 3, 3), torch.randn(48, 40, 3, 3)
    kernel = torch.nn.Parameter(start.clone(memory_format=layout))
    order = (0, 2, 3, 1) if layout == torch.channels_last else (0, 1, 2, 3)
    matrix = torch.nn.Parameter(start.permute(order).reshape(48, -1).clone())
    ours = FilterMuon([kernel], lr=0.1, weight_decay=0.02)
    peer = torch.optim.Muon([matrix], lr=0.1, weight_decay=0.02, adjust_lr_fn="match_rms_adamw")
    for _ in range(3):
        kernel.grad, matrix.grad = gradient, gradient.permute(order).reshape(48, -1)
        ours.step()
        peer.step()
    torch.testing.assert_close(kernel.detach().permute(order).reshape(48, -1), matrix.detach())
    assert (kernel - start).abs().max() > 0.01
    ours.zero_grad()
    assert kernel.grad is None


def test_a_filter_that_is_a_view_is_refused() -> None:
    kernel = torch.nn.Parameter(torch.randn(64, 40, 3, 6)[..., :3])
    with pytest.raises(ValueError, match="not dense in memory"):
        FilterMuon([kernel], lr=0.1)


def test_a_killed_run_is_resumed(tmp_path: Path) -> None:
    checkpoint = tmp_path / "compact.checkpoint.safetensors"
    step = 0
    for attempt in range(2):
        arguments = [sys.executable, "-c", KILLED, str(tmp_path), *(["resume"] if attempt else [])]
        process = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        deadline = time.monotonic() + 120
        while time.monotonic() < deadline:
            if checkpoint.exists() and load_checkpoint(checkpoint).progress.step > step + 2:
                break
            assert process.poll() is None, process.stderr and process.stderr.read()
            time.sleep(0.05)
        os.kill(process.pid, signal.SIGKILL)
        process.communicate()
        found = load_checkpoint(checkpoint)
        assert found.progress.step > step
        step = found.progress.step
    [progress] = train(tiny(tmp_path, steps=step + 1), resume=True, quiet=True)
    assert progress.step == step + 1


def test_ctrl_c_saves_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    step, calls = ChainStage.step, []

    def interrupted(stage: ChainStage) -> torch.Tensor:
        calls.append(1)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return step(stage)

    monkeypatch.setattr(ChainStage, "step", interrupted)
    with pytest.raises(KeyboardInterrupt):
        train(tiny(tmp_path, steps=9), quiet=True)
    assert load_checkpoint(tmp_path / "compact.checkpoint.safetensors").progress.step == 2


EXACT = {
    "compact": (TINY, {"batch": 3, "warmup": 2, "threads": 2}),
    "paper": ({"width": 4}, {"batch": 2}),
}


@pytest.mark.parametrize("preset", EXACT)
def test_a_run_that_was_stopped_ends_in_the_same_weights(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, preset: str
) -> None:
    for module in ("chains", "papertrain"):
        monkeypatch.setattr(f"sketchcore.train.{module}.heldout_iou", lambda *_, **__: [0.0])
    options, changes = EXACT[preset]
    whole, parts = (Run(tmp_path / name, preset, steps=9, options=options, changes=changes) for name in ("a", "b"))
    train(whole, quiet=True)
    save, saves = _Loop._save, []

    def stopped(loop: _Loop) -> None:
        save(loop)
        saves.append(1)
        if len(saves) in stops:
            raise KeyboardInterrupt

    stops = (2, 5, 11)
    monkeypatch.setattr(_Loop, "_save", stopped)
    parts = replace(parts, save_every=0.0)
    for stop in stops:
        with pytest.raises(KeyboardInterrupt):
            train(parts, resume=stop != stops[0], quiet=True)
    monkeypatch.setattr(_Loop, "_save", save)
    train(parts, resume=True, quiet=True)
    assert (whole.out / "weights.safetensors").read_bytes() == (parts.out / "weights.safetensors").read_bytes()
    for name in PRESETS[preset].stages:
        one, two = (load_checkpoint(run.out / f"{name}.checkpoint.safetensors") for run in (whole, parts))
        assert one.progress.samples == two.progress.samples
        assert all(torch.equal(one.model[key], two.model[key]) for key in one.model)
        assert all(torch.equal(one.under_way[key], two.under_way[key]) for key in one.under_way)
        for number, moments in one.moments.items():
            for index, states in moments.items():
                assert all(torch.equal(t, two.moments[number][index][key]) for key, t in states.items())


def test_a_checkpoint_of_another_batch_starts_new_chains(tmp_path: Path) -> None:
    train(tiny(tmp_path, steps=2), quiet=True)
    before = load_checkpoint(tmp_path / "compact.checkpoint.safetensors").progress
    assert before.samples >= 2
    [after] = train(replace(tiny(tmp_path, steps=3), changes={"batch": 3}), resume=True, quiet=True)
    assert after.samples == before.samples + 3


def test_a_chain_is_a_function_of_seed_and_index() -> None:
    preset = PRESETS["compact"]
    one, two = start_chain(preset, 5, 9), start_chain(preset, 5, 9)
    assert one.length == two.length
    np.testing.assert_array_equal(one.sketches.drawings, two.sketches.drawings)
    np.testing.assert_array_equal(one.sketches.cameras, two.sketches.cameras)
    chains = [start_chain(preset, 5, i) for i in range(30)]
    assert {len(c.sketches) for c in chains} == {1, 2, 3, 4}
    assert {c.length for c in chains} == {1, 2, 3}


@pytest.mark.parametrize("name", ["chair", "vase"])
def test_the_presets_of_classes_train_on_their_shapes(tmp_path: Path, name: str) -> None:
    preset = PRESETS[name]
    chain = start_chain(preset, 5, 9)
    expected = sk.generate(5, 1, first=9, views=len(chain.sketches), config=preset.generator, grammar=name)
    np.testing.assert_array_equal(chain.truth, expected.world[0, :, :, 32:])
    np.testing.assert_array_equal(chain.sketches.drawings, expected.drawings[0])
    train(replace(tiny(tmp_path, steps=1), preset=name), quiet=True)
    config = json.loads((tmp_path / "weights.json").read_text())
    assert config["training"]["grammar"] == name
    assert "grammar" not in config["training"]["generator"]
    with pytest.raises(ValueError, match="resume it with its own preset, grammar and data"):
        train(tiny(tmp_path, steps=2), resume=True, quiet=True)


def test_any_preset_trains_on_another_grammars_shapes() -> None:
    changes = grammar_changes("gpu", "vase")
    preset = replace(PRESETS["gpu"], **changes)
    assert preset.grammar == "vase"
    assert preset.generator == PRESETS["vase"].generator
    assert grammar_changes("gpu", None) == {}
    with pytest.raises(ValueError, match="unknown grammar 'jar'"):
        grammar_changes("gpu", "jar")


def test_wrong_runs_say_what_would_be_right(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=f"presets are {', '.join(PRESETS)}$"):
        Run(tmp_path, "big", steps=1)
    with pytest.raises(ValueError, match="either minutes or steps; only laptop, gpu know"):
        Run(tmp_path)
    with pytest.raises(ValueError, match="either minutes or steps, not both"):
        Run(tmp_path, minutes=1, steps=1)
    for given in ({"steps": -1}, {"minutes": 0.0}):
        with pytest.raises(ValueError, match="more than 0"):
            Run(tmp_path, "laptop", **given)
    with pytest.raises(ValueError, match="seed must lie"):
        Run(tmp_path, steps=1, seed=2**63)
    with pytest.raises(FileNotFoundError, match="start without --resume"):
        train(tiny(tmp_path, steps=1), resume=True, quiet=True)
    (tmp_path / "compact.checkpoint.safetensors").write_bytes(b"no checkpoint")
    with pytest.raises(FileExistsError, match="--resume"):
        train(tiny(tmp_path, steps=1), quiet=True)
    with pytest.raises(ValueError, match="is no checkpoint"):
        train(tiny(tmp_path, steps=1), resume=True, quiet=True)


def test_the_config_beside_the_weights_is_json(tmp_path: Path) -> None:
    train(tiny(tmp_path, steps=1), quiet=True)
    config = json.loads((tmp_path / "weights.json").read_text())
    assert config["training"]["muon"] == PRESETS["compact"].muon
    assert config["options"]["image"] == [16, 16, 16]
