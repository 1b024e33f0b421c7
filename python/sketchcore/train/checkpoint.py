"""Checkpoints of a training run: everything that it takes to go on, in one file that is either old or new, whole."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

from sketchcore.atomic import write_atomically


@dataclass
class Progress:
    """How far a stage has come, over all the pieces it was trained in.

    Attributes:
        stage: the stage's name.
        step: optimiser steps.
        samples: shapes seen.
        seconds: time spent.
        iou: latest held-out IoU, if it was measured.
        finished: whether the stage ran to its end.
    """

    stage: str
    step: int = 0
    samples: int = 0
    seconds: float = 0.0
    iou: float | None = None
    finished: bool = False


def save_checkpoint(
    path: Path,
    model: dict[str, Tensor],
    average: dict[str, Tensor],
    optimizer: dict[str, Any],
    progress: Progress,
) -> None:
    """Writes weights, their average, the optimiser's moments and the progress, atomically, as safetensors."""
    tensors = {f"model.{name}": t for name, t in model.items()}
    tensors |= {f"average.{name}": t for name, t in average.items()}
    for index, moments in optimizer["state"].items():
        tensors |= {f"optimizer.{index}.{name}": torch.as_tensor(t) for name, t in moments.items()}
    stored = {name: t.detach().cpu().contiguous().clone() for name, t in tensors.items()}
    write_atomically(path, save(stored, metadata={"progress": json.dumps(asdict(progress))}))


@dataclass
class Checkpoint:
    """What `save_checkpoint` wrote: state dictionaries, and the progress."""

    model: dict[str, Tensor]
    average: dict[str, Tensor]
    moments: dict[int, dict[str, Tensor]]
    progress: Progress


def load_checkpoint(path: Path) -> Checkpoint:
    """Reads a checkpoint.

    Raises:
        FileNotFoundError: if there is none.
        ValueError: if the file is none.
    """
    if not path.is_file():
        raise FileNotFoundError(f"no checkpoint at {path}; start without --resume")
    model: dict[str, Tensor] = {}
    average: dict[str, Tensor] = {}
    moments: dict[int, dict[str, Tensor]] = {}
    try:
        with safe_open(path, framework="pt") as file:
            progress = Progress(**json.loads(file.metadata()["progress"]))
            for key in file.keys():  # noqa: SIM118, a safetensors file is no mapping
                kind, name = key.split(".", 1)
                if kind == "optimizer":
                    index, moment = name.split(".", 1)
                    moments.setdefault(int(index), {})[moment] = file.get_tensor(key)
                else:
                    (model if kind == "model" else average)[name] = file.get_tensor(key)
    except (SafetensorError, KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is no checkpoint of sketchcore train: {error}") from error
    return Checkpoint(model, average, moments, progress)
