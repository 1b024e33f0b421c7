"""Weights that a training run begins with, instead of random ones: those of another run, on other shapes or lines."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from sketchcore.nets.weights import PRETRAINED, load_weights
from sketchcore.train.presets import Preset


@dataclass(frozen=True)
class Beginning:
    """What stored weights give a run.

    Attributes:
        states: state dictionary of each stage that the weights have.
        record: the weights' config: which network, of which options, and how it was trained.
    """

    states: dict[str, dict[str, Tensor]]
    record: dict[str, Any]


def read_beginning(path: Path, preset: Preset) -> Beginning:
    """Reads weights for a run of a preset.

    Args:
        path: of the weights; "pretrained" for those inside the package.
        preset: what is trained.

    Raises:
        FileNotFoundError: if there are none.
        ValueError: if they are no weights, or another network's than the preset's.
    """
    weights, config = load_weights(PRETRAINED if path == Path("pretrained") else path)
    state = {name: torch.from_numpy(array) for name, array in weights.items()}
    if config.get("network") != preset.network:
        raise ValueError(
            f"{path} holds a network {config.get('network')!r}, and this preset trains {preset.network!r}; "
            "take a preset of that network"
        )
    stages = preset.stages
    states = {stages[0]: state}
    if len(stages) > 1:
        parts = {stage: f"{stage}." for stage in stages}
        states = {
            stage: {name.removeprefix(prefix): t for name, t in state.items() if name.startswith(prefix)}
            for stage, prefix in parts.items()
        }
    return Beginning({stage: part for stage, part in states.items() if part}, config)
