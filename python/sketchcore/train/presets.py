"""What a training run consists of: constants, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

from sketchcore.datagen.grammars import find_grammar

STAGES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"compact": ("compact",), "paper": ("single", "updater"), "multiscale": ("multiscale",)}
)
"""For each network, what is trained one after the other, each in an equal part of the time."""
TRUTHS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "compact": ("binary", "fractional", "distance"),
        "paper": ("binary", "fractional"),
        "multiscale": ("binary", "fractional"),
    }
)
"""For each network, what it can be told to be right (`truth.py`): in the world grid, or in camera grids."""


@dataclass(frozen=True)
class Preset:
    """Constants of a training run.

    Attributes:
        network: a name from `STAGES`.
        truth: what the network is told to be right, one of its `TRUTHS`.
        batch: samples a step.
        rate: learning rate of AdamW.
        muon: learning rate of Muon for all matrices, which AdamW then leaves alone; 0 for none.
        betas: Adam's decay rates.
        weight_decay: decoupled weight decay.
        warmup: steps over which the rate rises from 0.
        cooldown: last share of the run over which the rate falls to 0; 0 keeps it fixed.
        average: decay of the exponential moving average of the weights that is evaluated and saved; 0 for none.
        clip: largest norm of the gradient; 0 for no limit.
        grammar: what shapes are of, as `sketchcore.generate` takes it; None for abstract ones.
        generator: what differs from the generator's default config.
        threads: threads that make samples; None for one a core.
        minutes: how long a run takes that is not told, over all the pieces that it is trained in; None if it must be.

    Raises:
        ValueError: for an unknown network, a truth that is not one of its, or an unknown grammar.
    """

    network: str
    truth: str
    batch: int
    rate: float
    betas: tuple[float, float]
    muon: float = 0.0
    weight_decay: float = 0.0
    warmup: int = 0
    cooldown: float = 0.0
    average: float = 0.0
    clip: float = 0.0
    grammar: str | None = None
    generator: Mapping[str, Any] = field(default_factory=dict)
    threads: int | None = 1
    minutes: float | None = None

    def __post_init__(self) -> None:
        if self.network not in STAGES:
            raise ValueError(f"unknown network {self.network!r}; the networks are {', '.join(STAGES)}")
        if self.grammar is not None:
            find_grammar(self.grammar)
        if self.truth not in TRUTHS[self.network]:
            known = ", ".join(TRUTHS[self.network])
            raise ValueError(f"the network {self.network!r} has no truth {self.truth!r}; it takes {known}")

    @property
    def stages(self) -> tuple[str, ...]:
        """What is trained, one after the other, each in an equal part of the time."""
        return STAGES[self.network]

    @property
    def task(self) -> dict[str, str]:
        """What is learnt: a checkpoint goes on with nothing else."""
        shapes = {} if self.grammar is None else {"grammar": self.grammar}
        return {"network": self.network, "truth": self.truth, **shapes}


# Section 4.4: Adam with these constants, the single view first. Its 1,000,000 iterations are `--steps`.
PAPER = Preset(network="paper", truth="fractional", batch=8, rate=2e-4, betas=(0.5, 0.999))

COMPACT = Preset(
    network="compact",
    truth="binary",
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
        "grammar": {
            "steps": [1, 10],
            "wedges": 0.2,
            "slabs": 0.3,
            "fitted": 0.5,
            "chamfered": 0.5,
            "regular": 0.4,
            "bores": {"share": 0.15},
            "sheets": {"share": 0.1},
            "bars": {"share": 0.1},
        },
        "free": {"share": 0.25, "elevation": [0.0, 60.0]},
        "hand": {"share": 0.7},
        "styles": {"share": 0.4},
    },
)

# What is asked of drawings and cameras does not depend on the grammar.
_DRAWN = {name: part for name, part in COMPACT.generator.items() if name != "grammar"}

ALTERNATIVES: Mapping[str, Preset] = MappingProxyType(
    {
        "compact": COMPACT,
        "fractional": replace(COMPACT, truth="fractional"),
        "distance": replace(COMPACT, truth="distance"),
        "paper-matched": replace(COMPACT, network="paper", truth="fractional"),
        "multiscale": replace(COMPACT, network="multiscale", truth="fractional"),
    }
)
"""What is compared: the same samples and optimisers for all, and to be given the same minutes."""

PRESETS: Mapping[str, Preset] = MappingProxyType(
    {
        "paper": PAPER,
        **ALTERNATIVES,
        "laptop": replace(COMPACT, minutes=60.0),
        "gpu": replace(COMPACT, batch=64, threads=None, minutes=25.0),
        "chair": replace(COMPACT, grammar="chair", generator=_DRAWN),
        "vase": replace(COMPACT, grammar="vase", generator=_DRAWN),
    }
)


def grammar_changes(preset: str, grammar: str | None) -> dict[str, Any]:
    """What differs from a preset that is trained on another grammar's shapes: its name, and no entries of the old one.

    Raises:
        ValueError: for an unknown grammar; an unknown preset is left to who takes it.
    """
    if grammar is None or preset not in PRESETS:
        return {}
    find_grammar(grammar)
    generator = {name: part for name, part in PRESETS[preset].generator.items() if name != "grammar"}
    return {"grammar": grammar, "generator": generator}
