"""What a reconstruction costs: time and memory, beside the paper's (its section 6.6)."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.table import Table

from sketchcore.evaluate.accuracy import ROUNDS, VIEWS
from sketchcore.evaluate.report import Report
from sketchcore.evaluate.testset import load_testset

SHAPES = 25
PAPER = {"paper, TitanX": (140.0, 210.0, 280.0, 350.0), "paper, laptop CPU": (1000.0, 1500.0, 2200.0, 2900.0)}
"""Milliseconds for one to four views and five rounds, as the paper reports them."""


@dataclass(frozen=True)
class Cost(Report):
    """What `measure_cost` measured.

    Attributes:
        milliseconds: a reconstruction from one to four drawings with their views, at most five rounds: median.
        means: the same, but the mean, to which shapes that settle late contribute.
        rounds: how many of the five were run, before the solid had settled: mean.
        first_call: seconds from `import sketchcore` to the first solid, from one drawing, in a fresh process.
        peak: megabytes (10^6 bytes) of memory that a process held at most, which did that and then all
            reconstructions timed here: the interpreter and everything that was imported included.
        threads: how many cores it computed on.
        shapes: how many shapes were reconstructed.
    """

    milliseconds: tuple[float, ...]
    means: tuple[float, ...]
    rounds: tuple[float, ...]
    first_call: float
    peak: float
    threads: int
    shapes: int


def measure_cost(
    weights: str | os.PathLike[str] | None = None,
    shapes: int = SHAPES,
    repetitions: int = 3,
    progress: Callable[[int, int], None] | None = None,
) -> Cost:
    """Measures the shipped settings in a fresh process, on the first shapes of the test set.

    Numbers of views take turns, so that what disturbs the machine disturbs all of them alike. Drawings are at hand as
    arrays; the first reconstruction of each shape from each number of them is not timed.

    Args:
        weights: path to weights; None for those inside the package.
        shapes: how many.
        repetitions: how often each number of views is timed on each shape, at least 1.
        progress: called as `progress(done, total)` after each shape.

    Raises:
        ValueError: for a number of shapes or repetitions that makes no sense.
        FileNotFoundError: if there are no such weights.
        RuntimeError: if the process fails otherwise, with what it printed.
    """
    if repetitions < 1:
        raise ValueError(f"repetitions must be at least 1, got {repetitions}")
    if weights is not None and not Path(weights).is_file():
        raise FileNotFoundError(f"no weights at {os.fspath(weights)}")
    objects = [
        {"shape": example.shape.to_json(), "cameras": [camera.packed.tolist() for camera in example.cameras[:VIEWS]]}
        for example in load_testset(shapes)
    ]
    task = {
        "model": None if weights is None else str(Path(weights).resolve()),
        "repetitions": repetitions,
        "objects": objects,
    }
    figures = _figures(json.dumps(task), progress)
    return Cost(
        milliseconds=tuple(1e3 * statistics.median(times) for times in figures["seconds"]),
        means=tuple(1e3 * statistics.mean(times) for times in figures["seconds"]),
        rounds=tuple(statistics.mean(counts) for counts in figures["rounds"]),
        first_call=figures["first_call"],
        peak=figures["peak"] / 1e6,
        threads=figures["threads"],
        shapes=len(objects),
    )


def _figures(task: str, progress: Callable[[int, int], None] | None) -> dict[str, Any]:
    """What the process measures: it writes `[done, total]` after each shape, and the figures in the end, as JSON."""
    # The same package as this one, wherever it lies; and no other script beside it.
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    command = [sys.executable, "-P", str(Path(__file__).with_name("cost_process.py"))]
    figures: dict[str, Any] = {}
    with (
        tempfile.TemporaryFile("w+") as wanted,
        tempfile.TemporaryFile("w+") as complaints,
    ):
        wanted.write(task)
        wanted.seek(0)
        with subprocess.Popen(
            command, stdin=wanted, stdout=subprocess.PIPE, stderr=complaints, text=True, env=environment
        ) as process:
            assert process.stdout is not None
            for line in process.stdout:
                said = json.loads(line)
                if isinstance(said, dict):
                    figures = said
                elif progress is not None:
                    progress(*said)
        if process.returncode:
            complaints.seek(0)
            raise RuntimeError(f"the process that measures failed:\n{complaints.read().strip()}")
    return figures


def cost_as_table(cost: Cost) -> Table:
    """Time by number of views, beside the paper's; first call and memory below."""
    table = Table(title=f"Time of a reconstruction, at most {ROUNDS} rounds, {cost.shapes} shapes")
    table.add_column("")
    for n in range(1, VIEWS + 1):
        table.add_column(f"{n} view{'s' if n > 1 else ''}", justify="right")
    cores = f"{cost.threads} thread{'s' if cost.threads > 1 else ''}"
    table.add_row(f"sketchcore, CPU, {cores}: median", *(f"{ms:.0f} ms" for ms in cost.milliseconds))
    table.add_row("mean", *(f"{ms:.0f} ms" for ms in cost.means))
    table.add_row("rounds until it settled", *(f"{rounds:.1f}" for rounds in cost.rounds))
    for name, times in PAPER.items():
        table.add_row(name, *(f"{ms:.0f} ms" for ms in times))
    table.caption = (
        f"first call {cost.first_call:.1f} s, imports and weights included; "
        f"at most {cost.peak:.0f} MB of memory, everything included"
    )
    return table
