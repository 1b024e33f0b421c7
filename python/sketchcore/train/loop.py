"""The training loop: one for every preset, on what the machine has, killed and resumed at any moment."""

from __future__ import annotations

import copy
import math
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import torch
from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar
from torch import Tensor, nn

from sketchcore.nets.compact import CompactConfig, CompactNet
from sketchcore.nets.models import CompactModel, Model, PaperModel
from sketchcore.nets.precision import pick_device
from sketchcore.nets.unet import PaperNet
from sketchcore.nets.weights import save_weights
from sketchcore.train.chains import ChainStage
from sketchcore.train.checkpoint import Checkpoint, Progress, load_checkpoint, save_checkpoint
from sketchcore.train.heldout import heldout_iou
from sketchcore.train.optimizers import make_optimizers
from sketchcore.train.papertrain import SingleStage, UpdaterStage
from sketchcore.train.presets import PRESETS, Preset


class Stage(Protocol):
    """One network's training: makes its own samples."""

    samples: int

    @property
    def model(self) -> nn.Module:
        """The network that is trained."""
        ...

    def step(self) -> Tensor:
        """The loss of the next batch."""
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
        steps: optimiser steps for each stage, over all runs that it is resumed in.
        seed: of the generator and of the initial weights.
        device: None for CUDA where there is one, else the CPU.
        save_every: seconds between checkpoints.
        evaluate_every: seconds between measurements of the held-out IoU.
        options: what differs from the network's default configuration; for tiny networks in tests.
        changes: what differs from the preset.
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

    def __post_init__(self) -> None:
        if self.preset not in PRESETS:
            raise ValueError(f"unknown preset {self.preset!r}; the presets are {', '.join(PRESETS)}")
        if (self.minutes is None) == (self.steps is None):
            raise ValueError("say either minutes or steps")
        if (self.minutes or self.steps or 0) <= 0:
            raise ValueError("minutes or steps must be more than 0")
        if not 0 <= self.seed < 2**63:
            raise ValueError(f"seed must lie between 0 and 2^63 - 1, got {self.seed}")

    @property
    def constants(self) -> Preset:
        """The preset with this run's changes."""
        return replace(PRESETS[self.preset], **(self.changes or {}))


def train(run: Run, resume: bool = False, quiet: bool = False) -> list[Progress]:
    """Trains a preset's networks and writes `weights.safetensors` with its config beside it.

    Args:
        run: what to train.
        resume: go on from the checkpoints in `run.out`.
        quiet: no progress bar.

    Returns:
        how far each stage came.

    Raises:
        FileExistsError: if `run.out` holds checkpoints already, without `resume`.
        FileNotFoundError: with `resume`, if it holds none.
        ValueError: for a run or a checkpoint that makes no sense.
        FloatingPointError: if the loss is no longer finite; the last checkpoint stands.
    """
    run.out.mkdir(parents=True, exist_ok=True)
    stages = run.constants.stages
    checkpoints = {name: run.out / f"{name}.checkpoint.safetensors" for name in stages}
    existing = [path for path in checkpoints.values() if path.exists()]
    if existing and not resume:
        raise FileExistsError(f"{existing[0]} exists; go on from it with --resume, or name another folder")
    if resume and not existing:
        raise FileNotFoundError(f"no checkpoint in {run.out}; start without --resume")
    device = pick_device(run.device)
    trained: dict[str, nn.Module] = {}
    results = []
    for index, name in enumerate(stages):
        found = load_checkpoint(checkpoints[name]) if checkpoints[name].exists() else None
        # A later stage that has begun shows that this one is done.
        begun = any(checkpoints[later].exists() for later in stages[index + 1 :])
        stage = _stage(run, name, device, found, trained)
        try:
            loop = _Loop(run, name, stage, device, found, trained, checkpoints[name])
            results.append(loop.progress if begun else loop.go(share=1 / len(stages), quiet=quiet))
        finally:
            stage.close()
        trained[name] = loop.average
        _save_weights(run, trained, results)
    return results


def _stage(run: Run, name: str, device: torch.device, found: Checkpoint | None, trained: dict[str, nn.Module]) -> Stage:
    torch.manual_seed(run.seed)
    samples = found.progress.samples if found else 0
    width = (run.options or {}).get("width", 64)
    if name == "single":
        return SingleStage(run.constants, run.seed, device, samples, width)
    if name == "updater":
        single = trained["single"]
        assert isinstance(single, PaperNet)
        return UpdaterStage(run.constants, run.seed, device, samples, width, single)
    return ChainStage(run.constants, run.seed, device, samples, CompactConfig(**(run.options or {})))


class _Loop:
    """One stage: optimiser, moving average, checkpoints."""

    def __init__(
        self,
        run: Run,
        name: str,
        stage: Stage,
        device: torch.device,
        found: Checkpoint | None,
        trained: dict[str, nn.Module],
        path: Path,
    ) -> None:
        self.run, self.stage, self.device, self.trained, self.path = run, stage, device, trained, path
        self.constants = run.constants
        self.progress = found.progress if found else Progress(name)
        c = self.constants
        if found:
            stage.model.load_state_dict(found.model)
        self.optimizers = make_optimizers(stage.model, c)
        self.rates = [optimizer.param_groups[0]["lr"] for optimizer in self.optimizers]
        self.average = copy.deepcopy(stage.model).eval().requires_grad_(False) if c.average else stage.model
        if found:
            if c.average:
                self.average.load_state_dict(found.average)
            for number, optimizer in enumerate(self.optimizers):
                optimizer.load_state_dict({**optimizer.state_dict(), "state": found.moments.get(number, {})})

    def go(self, share: float, quiet: bool) -> Progress:
        """Trains to the end of the stage's share of the run."""
        started = time.monotonic()
        before = replace(self.progress)
        limit = self.run.minutes * 60 * share if self.run.minutes else None
        saved = evaluated = started

        def done() -> float:
            if limit is not None:
                return (time.monotonic() - started) / limit
            assert self.run.steps is not None
            return self.progress.step / self.run.steps

        with _TrainingBar(before.stage, quiet) as bar:
            try:
                while (part := done()) < 1:
                    loss = self._step(part)
                    now = time.monotonic()
                    self.progress.step += 1
                    self.progress.samples = before.samples + self.stage.samples
                    self.progress.seconds = before.seconds + now - started
                    bar.show(part, loss, self.stage.samples / (now - started), self.progress)
                    if now - evaluated > self.run.evaluate_every:
                        self.progress.iou = self._evaluate()
                        bar.report(self.progress)
                        evaluated = time.monotonic()
                    if now - saved > self.run.save_every:
                        self._save()
                        saved = now
            except KeyboardInterrupt:
                self._save()
                raise
            self.progress.iou = self._evaluate()
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
        value = float(loss.detach())
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
            with torch.no_grad():
                pairs = zip(self.average.parameters(), self.stage.model.parameters(), strict=True)
                for mean, weight in pairs:
                    mean.lerp_(weight, 1 - decay)
        return value

    def _evaluate(self) -> float:
        self.average.eval()
        name, net = self.progress.stage, self.average
        model: Model
        if isinstance(net, CompactNet):
            model = CompactModel(net, self.device)
            scores = heldout_iou(model, views=(1, 3))
            return sum(scores) / len(scores)
        assert isinstance(net, PaperNet)
        single = net if name == "single" else self.trained["single"]
        assert isinstance(single, PaperNet)
        model = PaperModel(single, net if name == "updater" else None, self.device)
        # The single view alone has nothing to update with.
        return heldout_iou(model, views=(1,) if name == "single" else (2,), rounds=int(name == "updater"))[0]

    def _save(self) -> None:
        average = self.average.state_dict() if self.constants.average else {}
        moments = [optimizer.state_dict()["state"] for optimizer in self.optimizers]
        save_checkpoint(self.path, self.stage.model.state_dict(), average, moments, self.progress)


def _save_weights(run: Run, trained: dict[str, nn.Module], results: list[Progress]) -> None:
    if run.preset == "paper":
        state = {f"{part}.{k}": v for part, net in trained.items() for k, v in net.state_dict().items()}
        options = {"width": (run.options or {}).get("width", 64)}
    else:
        state = dict(trained["compact"].state_dict())
        net = trained["compact"]
        assert isinstance(net, CompactNet)
        options = net.describe()
    constants = {**asdict(run.constants), "generator": dict(run.constants.generator)}
    config = {
        "network": run.preset,
        "options": options,
        "training": {"seed": run.seed, **constants, "runs": [asdict(p) for p in results]},
    }
    save_weights(run.out / "weights.safetensors", state, config)


class _TrainingBar:
    """A progress bar with samples/s and held-out IoU, and a line for each measurement; nothing when quiet."""

    def __init__(self, title: str, quiet: bool) -> None:
        self._bar = Bar(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.percentage:3.0f} %  {task.fields[note]}"),
            TimeRemainingColumn(),
            console=Console(stderr=True, quiet=quiet),
        )
        self._task = self._bar.add_task(title, total=1.0, note="")
        self._loss = float("nan")

    def __enter__(self) -> _TrainingBar:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def show(self, part: float, loss: float, rate: float, progress: Progress) -> None:
        """After a step: how far, the loss (smoothed), new shapes a second."""
        self._loss = loss if math.isnan(self._loss) else 0.98 * self._loss + 0.02 * loss
        iou = "..." if progress.iou is None else f"{progress.iou:.3f}"
        note = f"loss {self._loss:.3f}  {rate:.1f} samples/s  held-out IoU {iou}"
        self._bar.update(self._task, completed=part, note=note)

    def report(self, progress: Progress) -> None:
        """A line that stays, after a measurement."""
        self._bar.console.print(
            f"{progress.stage}: step {progress.step:,}, {progress.samples:,} samples, "
            f"{progress.seconds / 60:.1f} minutes, loss {self._loss:.3f}, held-out IoU {progress.iou:.3f}"
        )
