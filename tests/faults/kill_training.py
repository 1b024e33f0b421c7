"""Training is killed at random moments and resumed: it must end in the weights of a run that nobody killed, to the bit.

    python tests/faults/kill_training.py --kills 100

A tiny network, a checkpoint after every step, so that many kills meet one being written. The held-out IoU, which says
how good a network is and changes nothing, is left out.
"""

from __future__ import annotations

import multiprocessing
import shutil
import time
from pathlib import Path
from typing import Any

from kills import kill_within, main

TINY = {"stem": 8, "image": (16, 16, 16), "features": 8, "fused": 8, "world": (8, 16, 16), "groups": 2}
STEPS = 8


def train_on(folder: Path) -> None:
    """Trains to the end, from the checkpoint if there is one."""
    import torch

    from sketchcore.train import Run, chains, train

    torch.set_num_threads(1)
    chains.heldout_iou = lambda *_, **__: [0.0]
    run = Run(folder, steps=STEPS, save_every=0.0, options=TINY, changes={"batch": 2, "warmup": 2})
    train(run, resume=(folder / "compact.checkpoint.safetensors").exists(), quiet=True)


def kill_training(kills: int, folder: Path) -> dict[str, Any]:
    """Kills runs, one after the other, until there were so many kills; each run goes on until it ends.

    Raises:
        AssertionError: if a run ends in other weights.
        RuntimeError: if a run that nobody killed fails.
    """
    # Imports once, so that what is killed is training; each run is a process of its own all the same.
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["sketchcore.train", "torch._dynamo"])

    def start(out: Path) -> Any:
        process = context.Process(target=train_on, args=(out,))
        process.start()
        return process

    def finish(process: Any) -> None:
        process.join()
        if process.exitcode != 0:
            raise RuntimeError(f"training failed with exit code {process.exitcode}")

    finish(start(folder / "warm"))
    began = time.monotonic()
    finish(start(folder / "whole"))
    lasts = time.monotonic() - began
    want = (folder / "whole" / "weights.safetensors").read_bytes()
    row = {"fault": "training", "kills": 0, "runs": 0, "same": 0, "before_first": 0, "while_writing": 0}
    while row["kills"] < kills:
        out = folder / f"run-{row['runs']}"
        while True:
            process = start(out)
            if row["kills"] < kills and kill_within(process, lasts):
                row["kills"] += 1
                row["before_first"] += not (out / "compact.checkpoint.safetensors").exists()
                row["while_writing"] += any(out.glob(".*"))
                continue
            finish(process)
            break
        row["runs"] += 1
        assert not list(out.glob(".*")), "nothing is left of files that were being written"
        assert (out / "weights.safetensors").read_bytes() == want, f"run {row['runs']} ended in other weights"
        row["same"] += 1
        shutil.rmtree(out)
    return row


if __name__ == "__main__":
    main(kill_training, __doc__ or "")
