"""Checkpoints of a training run: everything that it takes to go on, in one file that is either old or new, whole."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import safe_open
from safetensors.torch import save
from torch import Tensor

from sketchcore.atomic import write_atomically
from sketchcore.untrusted import parse_json, reason


@dataclass
class Progress:
    """How far a stage has come, over all the pieces it was trained in.

    Attributes:
        stage: the stage's name.
        step: optimiser steps.
        samples: shapes seen.
        seconds: time spent.
        waited: of these, seconds that were spent waiting for samples.
        iou: latest held-out IoU, if it was measured.
        began: the config of the weights that it began with, if any were given.
    """

    stage: str
    step: int = 0
    samples: int = 0
    seconds: float = 0.0
    waited: float = 0.0
    iou: float | None = None
    began: dict[str, Any] | None = None

    def check(self) -> None:
        """Refuses what cannot be gone on with.

        Raises:
            ValueError: for counts that are no counts.
        """
        counts = (self.step, self.samples, self.seconds, self.waited)
        if not isinstance(self.stage, str) or not all(type(n) in (int, float) and n >= 0 for n in counts):
            raise ValueError("its progress must have a stage by name, and counts that are 0 or more")

    def speed(self) -> str:
        """Samples a second, and the share of the time that was spent waiting for them, in words."""
        seconds = max(self.seconds, 1e-9)
        return f"{self.samples / seconds:.1f} samples/s (waited {100 * self.waited / seconds:.0f} %)"


def save_checkpoint(
    path: Path,
    model: dict[str, Tensor],
    average: dict[str, Tensor],
    moments: Sequence[Mapping[int, Mapping[str, Any]]],
    progress: Progress,
    task: Mapping[str, str],
    under_way: Mapping[str, Tensor],
) -> None:
    """Writes all that a run goes on from, atomically, as safetensors: see `Checkpoint`.

    The state of torch's random numbers on the CPU is kept too: dropout goes on with it.
    """
    tensors = {f"model.{name}": t for name, t in model.items()}
    tensors |= {f"average.{name}": t for name, t in average.items()}
    for number, states in enumerate(moments):
        for index, state in states.items():
            tensors |= {f"optimizer.{number}.{index}.{name}": torch.as_tensor(t) for name, t in state.items()}
    tensors |= {f"under_way.{name}": t for name, t in under_way.items()}
    tensors["random.cpu"] = torch.get_rng_state()
    stored = {name: t.detach().cpu().contiguous().clone() for name, t in tensors.items()}
    said = {"progress": json.dumps(asdict(progress)), "task": json.dumps(dict(task))}
    write_atomically(path, save(stored, metadata=said))


@dataclass
class Checkpoint:
    """What `save_checkpoint` wrote.

    Attributes:
        model: state dictionary of the weights, and
        average: of their average.
        moments: by optimiser and parameter.
        progress: how far the stage has come.
        task: what is learnt.
        under_way: what the stage had begun (`ChainStage.under_way`).
        random: state of torch's random numbers; None in a checkpoint from before it was kept.
    """

    model: dict[str, Tensor]
    average: dict[str, Tensor]
    moments: dict[int, dict[int, dict[str, Tensor]]]
    progress: Progress
    task: dict[str, str]
    under_way: dict[str, Tensor]
    random: Tensor | None


def load_checkpoint(path: Path) -> Checkpoint:
    """Reads a checkpoint.

    Raises:
        FileNotFoundError: if there is none.
        ValueError: if the file is none.
    """
    if not path.is_file():
        raise FileNotFoundError(f"no checkpoint at {path}; start without --resume")
    kinds: dict[str, dict[str, Tensor]] = {"model": {}, "average": {}, "under_way": {}, "random": {}}
    moments: dict[int, dict[int, dict[str, Tensor]]] = {}
    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata() or {}
            said = {name: parse_json(metadata[name], name) for name in ("progress", "task")}
            progress, task = Progress(**said["progress"]), dict(said["task"])
            progress.check()
            for key in file.keys():  # noqa: SIM118, a safetensors file is no mapping
                kind, name = key.split(".", 1)
                if kind == "optimizer":
                    number, index, moment = name.split(".", 2)
                    of_parameter = moments.setdefault(int(number), {}).setdefault(int(index), {})
                    of_parameter[moment] = file.get_tensor(key)
                else:
                    kinds[kind][name] = file.get_tensor(key)
    except MemoryError:
        raise
    except Exception as error:  # what dtypes and sizes torch cannot have, it says in its own ways
        raise ValueError(f"{path} is no checkpoint of sketchcore train: {reason(error)}") from error
    under_way, random = kinds["under_way"], kinds["random"].get("cpu")
    return Checkpoint(kinds["model"], kinds["average"], moments, progress, task, under_way, random)
