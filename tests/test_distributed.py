"""Training in two processes: as one with the doubled batch, and it goes on in any number."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from sketchcore.nets.weights import load_weights
from sketchcore.train import PRESETS, Run, train
from sketchcore.train.chains import plan_batches, plan_chain
from sketchcore.train.checkpoint import load_checkpoint
from sketchcore.train.distributed import ALONE, Ranks, joined
from sketchcore.train.loop import _Loop
from sketchcore.train.papertrain import _batches

TINY = {"stem": 8, "image": (16, 16, 16), "features": 8, "fused": 8, "world": (8, 16, 16), "groups": 2}

RANK = """
import gc, json, os, sys
from pathlib import Path
import torch
from sketchcore.train import Run, chains, papertrain, train
from sketchcore.train.loop import _Loop

chains.heldout_iou = papertrain.heldout_iou = lambda *_, **__: [0.5, 0.5]  # what is measured is tested elsewhere
torch.distributed.init_process_group("gloo")
out, rank, tasks = Path(sys.argv[1]), os.environ["RANK"], json.loads(sys.argv[2])
step, losses = _Loop._step, []

def recorded(loop, part):
    losses.append(step(loop, part))
    return losses[-1]

_Loop._step = recorded
for task in tasks:
    folder = out if rank == "0" else out / "elsewhere"  # machines have no folder in common
    changes = {"batch": task.get("batch", 1), "warmup": 2}
    run = Run(folder / task["name"], task["preset"], options=task["options"], changes=changes,
              steps=task.get("steps"), minutes=task.get("minutes"))
    progress = train(run, resume=task.get("resume", False), quiet=True)
    said = {"losses": losses, "steps": [p.step for p in progress], "samples": [p.samples for p in progress]}
    (out / f"{task['name']}.{rank}.json").write_text(json.dumps(said))
    losses = []
torch.distributed.barrier()
gc.collect()
torch.distributed.destroy_process_group()
"""


def two_processes(out: Path, *tasks: dict[str, Any]) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    shared = {"WORLD_SIZE": "2", "LOCAL_WORLD_SIZE": "2", "MASTER_ADDR": "127.0.0.1", "MASTER_PORT": str(port)}
    processes = [
        subprocess.Popen(
            [sys.executable, "-c", RANK, str(out), json.dumps(tasks)],
            env=os.environ | shared | {"RANK": rank, "LOCAL_RANK": rank, "OMP_NUM_THREADS": "1"},
            stderr=subprocess.PIPE,
        )
        for rank in ("0", "1")
    ]
    try:
        for process in processes:
            _, said = process.communicate(timeout=200)
            assert process.returncode == 0, said.decode()
    finally:
        for process in processes:
            process.kill()
            process.communicate()


def test_two_processes_train_as_one_with_the_doubled_batch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    losses: list[float] = []
    step = _Loop._step
    monkeypatch.setattr(_Loop, "_step", lambda loop, part: losses.append(step(loop, part)) or losses[-1])

    def run(name: str, steps: int) -> Run:
        return Run(tmp_path / name, steps=steps, options=TINY, changes={"batch": 2, "warmup": 2})

    [alone] = train(run("alone", 8), quiet=True)
    expected = list(losses)
    train(run("moved", 3), quiet=True)
    compact = {"preset": "compact", "options": TINY}
    two_processes(
        tmp_path,
        {"name": "together", "steps": 8, **compact},
        {"name": "moved", "steps": 6, "resume": True, **compact},
        {"name": "timed", "minutes": 0.01, **compact},
        {"name": "paper", "preset": "paper", "options": {"width": 4}, "batch": 2, "steps": 2},
    )
    first, second = (json.loads((tmp_path / f"together.{rank}.json").read_text()) for rank in (0, 1))
    assert first == second
    assert first["samples"] == [alone.samples], "the chains of one process, and no others"
    # The same up to the order of sums: what bfloat16 makes of it grows from step to step.
    np.testing.assert_allclose(first["losses"], expected, rtol=0.02)
    np.testing.assert_allclose(first["losses"][0], expected[0], rtol=1e-4)
    assert not list((tmp_path / "elsewhere").rglob("*.safetensors")), "the first process alone writes"
    _, config = load_weights(tmp_path / "together" / "weights.safetensors")
    assert config["training"]["processes"] == 2

    # One process, then two, then one again.
    assert load_checkpoint(tmp_path / "moved" / "compact.checkpoint.safetensors").progress.step == 6
    losses.clear()
    [progress] = train(run("moved", 7), resume=True, quiet=True)
    assert (progress.step, len(losses)) == (7, 1)

    timed = [json.loads((tmp_path / f"timed.{rank}.json").read_text()) for rank in (0, 1)]
    assert timed[0]["steps"] == timed[1]["steps"], "all end at the same step, though clocks differ"
    paper = json.loads((tmp_path / "paper.1.json").read_text())
    assert (paper["steps"], paper["samples"]) == ([2, 2], [8, 8])


@pytest.mark.slow
def test_torchrun_starts_the_module(tmp_path: Path) -> None:
    train(Run(tmp_path / "tiny", steps=1, options=TINY, changes={"batch": 1}), quiet=True)
    command = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node", "2"]
    command += ["--rdzv-backend", "c10d", "--rdzv-endpoint", "localhost:0"]
    begin = str(tmp_path / "tiny" / "weights.safetensors")
    command += ["-m", "sketchcore.train", "--steps", "1", "--from", begin, "-o", str(tmp_path / "run"), "--json"]
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    made = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=300, check=False)
    assert made.returncode == 0, made.stderr
    [told] = json.loads(made.stdout)  # by one process
    assert (told["step"], told["samples"]) == (1, 2 * PRESETS["compact"].batch)
    assert (tmp_path / "run" / "weights.safetensors").exists()


@pytest.mark.parametrize("world", [1, 2, 3])
def test_processes_share_the_chains_that_one_would_start(world: int) -> None:
    size, first = 6, 40
    steps = list(islice(plan_batches(3, first, [0] * size), 30))
    indices = [index for starts in steps for _, index in starts]
    assert indices == list(range(first, first + len(indices)))
    assert [slot for slot, _ in steps[0]] == list(range(size))
    running = {}
    for number, starts in enumerate(steps):
        for slot, index in starts:
            assert running.get(slot, number) == number, "a slot is free when its chain has run its course"
            running[slot] = number + plan_chain(3, index)[1]
        assert all(end > number for end in running.values())
    each = size // world
    parts = [[i for s in steps for slot, i in s if slot // each == rank] for rank in range(world)]
    assert sorted(i for part in parts for i in part) == indices


def test_processes_share_the_papers_batches() -> None:
    preset = PRESETS["paper"]
    whole = _batches(preset, 1, 4, 1, None, ALONE)
    halves = [_batches(preset, 1, 4, 1, None, Ranks(rank, 2)) for rank in (0, 1)]
    try:
        one, two = next(whole), next(whole)
        np.testing.assert_array_equal(next(halves[0]).drawings, one.drawings)
        np.testing.assert_array_equal(next(halves[1]).drawings, two.drawings)
    finally:
        for each in (whole, *halves):
            each.close()


def test_a_process_by_itself_asks_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RANK", raising=False)
    monkeypatch.setenv("WORLD_SIZE", "2")  # some schedulers say so to everyone
    with joined("cpu") as (ranks, device):
        assert (ranks, device) == (ALONE, torch.device("cpu"))
    net = torch.nn.Linear(1, 1)
    assert ALONE.wrap(net) is net
    assert (ALONE.told(0.25), ALONE.mean(0.5)) == (0.25, 0.5)
    assert Ranks(1, 4, 1000).threads(None) == 1
