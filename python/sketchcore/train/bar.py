"""What is shown while a network trains."""

from __future__ import annotations

import math

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from sketchcore.train.checkpoint import Progress


class TrainingBar:
    """A progress bar with samples/s, waiting and held-out IoU, and a line for each measurement; nothing when quiet."""

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

    def __enter__(self) -> TrainingBar:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def show(self, part: float, loss: float, progress: Progress) -> None:
        """After a step: how far, the loss (smoothed), new shapes a second, the share of the time waited for them."""
        self._loss = loss if math.isnan(self._loss) else 0.98 * self._loss + 0.02 * loss
        iou = "..." if progress.iou is None else f"{progress.iou:.3f}"
        note = f"loss {self._loss:.3f}  {progress.speed()}  held-out IoU {iou}"
        self._bar.update(self._task, completed=part, note=note)

    def report(self, progress: Progress) -> None:
        """A line that stays, after a measurement."""
        self._bar.console.print(
            f"{progress.stage}: step {progress.step:,}, {progress.samples:,} samples, "
            f"{progress.seconds / 60:.1f} minutes, {progress.speed()}, loss {self._loss:.3f}, "
            f"held-out IoU {progress.iou:.3f}"
        )
