"""The training loop: one for every preset, on what the machine has, killed and resumed at any moment."""

from __future__ import annotations

import copy
import math
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import torch
from torch import Tensor, nn

from sketchcore.atomic import sweep
from sketchcore.datagen.prepared import Prepared
from sketchcore.nets.compact import CompactNet
from sketchcore.nets.config import CompactConfig
from sketchcore.nets.multiscale import MultiscaleNet
from sketchcore.nets.storing import save_weights
from sketchcore.nets.unet import PaperNet
from sketchcore.train.bar import TrainingBar
from sketchcore.train.beginning import read_beginning
from sketchcore.train.chains import ChainStage
from sketchcore.train.checkpoint import Checkpoint, Progress, load_checkpoint, save_checkpoint
from sketchcore.train.distributed import Ranks, joined
from sketchcore.train.optimizers import make_optimizers
from sketchcore.train.papertrain import SingleStage, UpdaterStage
from sketchcore.train.presets import PRESETS, Preset

Network = CompactNet | PaperNet | MultiscaleNet


class Stage(Protocol):
    """One network's training: makes its own samples.

    Attributes:
        forward: what is called for the network in training (`Ranks.wrap`).
        samples: how many shapes have been seen, by all processes.
    """

    forward: nn.Module
    samples: int

    @property
    def model(self) -> Network:
        """The network that is trained."""
        ...

    @property
    def waited(self) -> float:
        """Seconds that were spent waiting for samples."""
        ...

    def step(self) -> Tensor:
        """The loss of the next batch."""
        ...

    def under_way(self) -> dict[str, Tensor]:
        """What it had begun, for a checkpoint."""
        ...

    def measure(self, net: nn.Module) -> float:
        """The held-out IoU of a network like the model."""
        ...

    def close(self) -> None:
        """Lets go of threads."""
        ...


@dataclass(frozen=True)
class Run:
    """What to train, for how long, and where to.

    Attributes:
        out: folder for weights, configs and checkpoints.
        preset: a name from `PRESETS`.
        minutes: time for this run, all stages together; or
        steps: optimiser steps for each stage, over all runs that it is resumed in. Neither for the preset's minutes,
            over all runs as well.
        seed: of the generator and of the initial weights.
        device: None for CUDA where there is one, else the CPU.
        save_every: seconds between checkpoints.
        evaluate_every: seconds between measurements of the held-out IoU.
        options: what differs from the network's default configuration; for tiny networks in tests.
        changes: what differs from the preset.
        begin: weights to begin with instead of random ones, "pretrained" for those inside the package; the options
            are theirs then.
        data: data set of meshes (`sketchcore prepare`) to learn from instead of the grammar's shapes.
    """

    out: Path
    preset: str = "compact"
    minutes: float | None = None
    steps: int | None = None
    seed: int = 0
    device: str | None = None
    save_every: float = 60.0
    evaluate_every: float = 300.0
    options: dict[str, Any] | None = None
    changes: dict[str, Any] | None = None
    begin: Path | None = None
    data: Path | None = None

    def __post_init__(self) -> None:
        if self.preset not in PRESETS:
            raise ValueError(f"unknown preset {self.preset!r}; the presets are {', '.join(PRESETS)}")
        if self.minutes is not None and self.steps is not None:
            raise ValueError("say either minutes or steps, not both")
        if self.minutes is None and self.steps is None and self.constants.minutes is None:
            timed = ", ".join(name for name, preset in PRESETS.items() if preset.minutes is not None)
            raise ValueError(f"say either minutes or steps; only {timed} know how long they take")
        if any(given is not None and given <= 0 for given in (self.minutes, self.steps)):
            raise ValueError("minutes or steps must be more than 0")
        if not 0 <= self.seed < 2**63:
            raise ValueError(f"seed must lie between 0 and 2^63 - 1, got {self.seed}")
        if self.begin is not None and self.options is not None:
            raise ValueError("say either the weights to begin with or the options of new ones, not both")

    @property
    def constants(self) -> Preset:
        """The preset with this run's changes."""
        return replace(PRESETS[self.preset], **(self.changes or {}))

    def meshes(self) -> Prepared | None:
        """The data set, if there is one, looked at.

        Raises:
            FileNotFoundError: if it is not there.
            ValueError: if it is none, has no meshes to train on or to measure with, or none of the preset's truth.
        """
        if self.data is None:
            return None
        if (self.constants.network, self.constants.truth) == ("compact", "fractional"):
            raise ValueError(
                "the truth 'fractional' is measured on shapes, and meshes are none; take the preset compact"
            )
        data = Prepared(self.data)
        data.require("train", "val")
        return data


def train(run: Run, resume: bool = False, quiet: bool = False) -> list[Progress]:
    """Trains a preset's networks and writes `weights.safetensors` with its config beside it.

    Started by `torchrun`, several processes train together (`distributed.py`); the first one writes.

    Args:
        run: what to train.
        resume: go on from the checkpoints in `run.out`.
        quiet: no progress bar.

    Returns:
        how far each stage came.

    Raises:
        FileExistsError: if `run.out` holds checkpoints already, without `resume`.
        FileNotFoundError: with `resume`, if it holds none.
        ValueError: for a run, a checkpoint or weights to begin with that make no sense.
        FloatingPointError: if the loss is no longer finite; the last checkpoint stands.
    """
    with joined(run.device) as (ranks, device):
        return _train(run, resume, quiet or not ranks.first, ranks, device)


def _train(run: Run, resume: bool, quiet: bool, ranks: Ranks, device: torch.device) -> list[Progress]:
    if resume and run.begin is not None:
        raise ValueError("a resumed run goes on from its checkpoint; leave out the weights to begin with")
    beginning = None if run.begin is None else read_beginning(run.begin, run.constants)
    data = run.meshes()
    task = run.constants.task | ({} if data is None else {"data": data.fingerprint})
    run.out.mkdir(parents=True, exist_ok=True)
    stages = run.constants.stages
    checkpoints = {name: run.out / f"{name}.checkpoint.safetensors" for name in stages}
    exists = {name: bool(ranks.told(path.exists())) for name, path in checkpoints.items()}
    existing = [checkpoints[name] for name in stages if exists[name]]
    if existing and not resume:
        raise FileExistsError(f"{existing[0]} exists; go on from it with --resume, or name another folder")
    if resume and not existing:
        raise FileNotFoundError(f"no checkpoint in {run.out}; start without --resume")
    if ranks.first:
        for path in (*checkpoints.values(), run.out / "weights.safetensors", run.out / "weights.json"):
            sweep(path)
    trained: dict[str, Network] = {}
    results = []
    for index, name in enumerate(stages):
        found = None
        if exists[name]:
            with ranks.file(checkpoints[name]) as file:
                found = load_checkpoint(file)
        if found and found.task != task:
            learnt, asked = (", ".join(t.values()) for t in (found.task, task))
            raise ValueError(
                f"{checkpoints[name]} learns other things ({learnt}) than the preset {run.preset} ({asked}); "
                "resume it with its own preset, grammar and data, or name another folder"
            )
        # A later stage that has begun shows that this one is done.
        begun = any(exists[later] for later in stages[index + 1 :])
        progress = found.progress if found else Progress(name, began=beginning.record if beginning else None)
        stage = _stage(run, progress, device, trained, data, ranks, found)
        try:
            if beginning and name in beginning.states:
                _fill(stage.model, beginning.states[name])
            loop = _Loop(run, stage, found, progress, checkpoints[name], task, ranks)
            results.append(loop.progress if begun else loop.go(share=1 / len(stages), quiet=quiet))
        finally:
            stage.close()
        trained[name] = loop.average
        if ranks.first:
            _save_weights(run, trained, results, data, ranks)
    return results


def _stage(
    run: Run,
    progress: Progress,
    device: torch.device,
    trained: dict[str, Network],
    data: Prepared | None,
    ranks: Ranks,
    found: Checkpoint | None,
) -> Stage:
    torch.manual_seed(run.seed)
    name, samples = progress.stage, progress.samples
    constants, options = run.constants, run.options or (progress.began or {}).get("options", {})
    if name == "compact":
        config, under_way = CompactConfig.of_options(options), found.under_way if found else None
        return ChainStage(constants, run.seed, device, samples, config, data, ranks, under_way)
    if name == "updater":
        single = trained["single"]
        assert isinstance(single, PaperNet)
        return UpdaterStage(constants, run.seed, device, samples, single, data, ranks)
    net = PaperNet(**options) if name == "single" else MultiscaleNet(**options)
    return SingleStage(constants, run.seed, device, samples, net, data, ranks)


def _fill(net: Network, state: dict[str, Tensor]) -> None:
    try:
        net.load_state_dict(state)
    except RuntimeError as error:
        raise ValueError(f"the weights to begin with do not fit the network of their config: {error}") from error


class _Loop:
    """One stage: optimiser, moving average, checkpoints."""

    def __init__(
        self,
        run: Run,
        stage: Stage,
        found: Checkpoint | None,
        progress: Progress,
        path: Path,
        task: dict[str, str],
        ranks: Ranks,
    ) -> None:
        self.run, self.stage, self.path, self.task, self.ranks = run, stage, path, task, ranks
        self.constants = run.constants
        self.progress = progress
        c = self.constants
        if found:
            stage.model.load_state_dict(found.model)
        stage.forward = ranks.wrap(stage.model)
        self.optimizers = make_optimizers(stage.model, c)
        self.rates = [optimizer.param_groups[0]["lr"] for optimizer in self.optimizers]
        self.average: Network = stage.model
        if c.average:
            self.average = copy.deepcopy(stage.model).eval().requires_grad_(False)
        if found:
            if c.average:
                self.average.load_state_dict(found.average)
            for number, optimizer in enumerate(self.optimizers):
                optimizer.load_state_dict({**optimizer.state_dict(), "state": found.moments.get(number, {})})
            if found.random is not None and ranks.world == 1:
                torch.set_rng_state(found.random)

    def go(self, share: float, quiet: bool) -> Progress:
        """Trains to the end of the stage's share of the run."""
        started = time.monotonic()
        before, waited = replace(self.progress), self.stage.waited
        saved = evaluated = started

        def done() -> float:
            if self.run.steps is not None:
                return self.progress.step / self.run.steps
            seconds = time.monotonic() - started
            if self.run.minutes is not None:
                return seconds / (60 * share * self.run.minutes)
            assert self.constants.minutes is not None
            return (before.seconds + seconds) / (60 * share * self.constants.minutes)

        with TrainingBar(before.stage, quiet) as bar:
            try:
                while (part := self.ranks.told(done())) < 1:
                    loss = self._step(part)
                    now = time.monotonic()
                    self.progress.step += 1
                    self.progress.samples = before.samples + self.stage.samples
                    self.progress.seconds = before.seconds + now - started
                    self.progress.waited = before.waited + self.stage.waited - waited
                    bar.show(part, loss, self.progress)
                    if self.ranks.first and now - evaluated > self.run.evaluate_every:
                        self.progress.iou = self.stage.measure(self.average.eval())
                        bar.report(self.progress)
                        evaluated = time.monotonic()
                    if now - saved > self.run.save_every:
                        self._save()
                        saved = now
            except KeyboardInterrupt:
                self._save()
                raise
            if self.ranks.first:
                self.progress.iou = self.stage.measure(self.average.eval())
                self._save()
                bar.report(self.progress)
        return self.progress

    def _step(self, part: float) -> float:
        c = self.constants
        self.stage.model.train()
        share = 1.0
        if c.warmup:
            share *= min(1.0, (self.progress.step + 1) / c.warmup)
        if c.cooldown:
            share *= min(1.0, (1 - part) / c.cooldown)
        for optimizer, rate in zip(self.optimizers, self.rates, strict=True):
            optimizer.param_groups[0]["lr"] = share * rate
            optimizer.zero_grad()
        loss = self.stage.step()
        value = self.ranks.mean(float(loss.detach()))
        if not math.isfinite(value):
            raise FloatingPointError(f"the loss is {value} at step {self.progress.step}; try a lower rate")
        loss.backward()  # type: ignore[no-untyped-call]
        if c.clip:
            nn.utils.clip_grad_norm_(self.stage.model.parameters(), c.clip)
        for optimizer in self.optimizers:
            optimizer.step()
        if c.average:
            # The average forgets its random beginning faster than it will forget later on.
            decay = min(c.average, (self.progress.step + 1) / (self.progress.step + 10))
            move_average(self.average, self.stage.model, decay)
        return value

    def _save(self) -> None:
        if not self.ranks.first:
            return
        average = self.average.state_dict() if self.constants.average else {}
        moments = [optimizer.state_dict()["state"] for optimizer in self.optimizers]
        model, under_way = self.stage.model.state_dict(), self.stage.under_way()
        save_checkpoint(self.path, model, average, moments, self.progress, self.task, under_way)


@torch.no_grad()
def move_average(average: nn.Module, model: nn.Module, decay: float) -> None:
    """Moves the average of weights and running statistics towards the model's; counters are the model's own."""
    for mean, now in zip(average.state_dict().values(), model.state_dict().values(), strict=True):
        if mean.is_floating_point():
            mean.lerp_(now, 1 - decay)
        else:
            mean.copy_(now)


def _save_weights(
    run: Run, trained: dict[str, Network], results: list[Progress], data: Prepared | None, ranks: Ranks
) -> None:
    constants = run.constants
    several = len(constants.stages) > 1
    states = {f"{stage}." if several else "": net.state_dict() for stage, net in trained.items()}
    config = {
        "network": constants.network,
        "options": trained[constants.stages[0]].describe(),
        "training": {
            "preset": run.preset,
            "seed": run.seed,
            **asdict(constants),
            "generator": dict(constants.generator),
            **({} if data is None else {"data": {"name": data.folder.name, "fingerprint": data.fingerprint}}),
            **({} if ranks.world == 1 else {"processes": ranks.world}),
            "runs": [asdict(progress) for progress in results],
        },
    }
    state = {prefix + name: tensor for prefix, part in states.items() for name, tensor in part.items()}
    save_weights(run.out / "weights.safetensors", state, config)
