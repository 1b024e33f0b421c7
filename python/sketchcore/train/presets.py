"""What a training run consists of: constants, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any


@dataclass(frozen=True)
class Preset:
    """Constants of a training run.

    Attributes:
        stages: networks trained one after the other, each in an equal part of the time.
        batch: samples a step.
        rate: learning rate of AdamW.
        muon: learning rate of Muon for all matrices, which AdamW then leaves alone; 0 for none.
        betas: Adam's decay rates.
        weight_decay: decoupled weight decay.
        warmup: steps over which the rate rises from 0.
        cooldown: last share of the run over which the rate falls to 0; 0 keeps it fixed.
        average: decay of the exponential moving average of the weights that is evaluated and saved; 0 for none.
        clip: largest norm of the gradient; 0 for no limit.
        generator: what differs from the generator's default config.
    """

    stages: tuple[str, ...]
    batch: int
    rate: float
    betas: tuple[float, float]
    muon: float = 0.0
    weight_decay: float = 0.0
    warmup: int = 0
    cooldown: float = 0.0
    average: float = 0.0
    clip: float = 0.0
    generator: Mapping[str, Any] = field(default_factory=dict)


PRESETS: Mapping[str, Preset] = MappingProxyType(
    {
        # Section 4.4: Adam with these constants, the single view first. Its 1,000,000 iterations are `--steps`.
        "paper": Preset(stages=("single", "updater"), batch=8, rate=2e-4, betas=(0.5, 0.999)),
        "compact": Preset(
            stages=("compact",),
            batch=16,
            rate=1e-3,
            betas=(0.9, 0.98),
            muon=2e-3,
            weight_decay=0.02,
            warmup=40,
            cooldown=0.3,
            average=0.998,
            clip=1.0,
            generator={
                "grammar": {"steps": [1, 10], "wedges": 0.2, "slabs": 0.3, "fitted": 0.5, "chamfered": 0.4},
                "free": {"share": 0.25},
                "hand": {"share": 0.7},
            },
        ),
    }
)
