"""A report as a table for the terminal and as a plot."""

from __future__ import annotations

import os
from pathlib import Path

from rich.table import Table

from sketchcore.atomic import replacing
from sketchcore.evaluate.measure import ROUNDS, Figure, Report


def as_table(report: Report) -> Table:
    """IoU by row and number of views; 95 % intervals in brackets for all figures."""
    table = Table(title=f"IoU on the first {report.shapes} shapes of the fixed test set, world grid")
    table.add_column("")
    for n in range(len(report.carving)):
        table.add_column(f"{n + 1} view{'s' if n else ''}", justify="right")
    for r in range(ROUNDS + 1):
        name = "network, first prediction" if r == 0 else f"network, round {r}"
        table.add_row(name, *(_cell(by_round[r]) for by_round in report.network))
    table.add_row("carving, the same drawings", *map(_cell, report.carving))
    table.add_row("carving, front / top / right / back", *map(_cell, report.orthogonal))
    table.caption = (
        f"ceiling of one camera grid {_cell(report.ceiling)}; viewpoint found (up to the half turn) "
        f"{_cell(report.viewpoint)}; {report.seconds:.2f} s a shape"
    )
    return table


def _cell(figure: Figure) -> str:
    return f"{figure.mean:.3f} [{figure.low:.3f}, {figure.high:.3f}]"


def save_plot(report: Report, path: str | os.PathLike[str]) -> None:
    """IoU against the number of views, and against rounds, as a PNG.

    Raises:
        ValueError: if the path does not end in .png.
        FileNotFoundError: if the folder does not exist.
    """
    if Path(path).suffix.lower() != ".png":
        raise ValueError(f"a plot is written as .png, got {path}")
    from matplotlib.figure import Figure as Canvas

    canvas = Canvas(figsize=(10, 4), layout="constrained")
    left, right = canvas.subplots(1, 2, sharey=True)
    views = list(range(1, len(report.carving) + 1))
    lines = {
        f"network, round {ROUNDS}": [by_round[-1] for by_round in report.network],
        "carving, same drawings": report.carving,
        "carving, orthogonal views": report.orthogonal,
    }
    for label, figures in lines.items():
        means = [f.mean for f in figures]
        left.plot(views, means, marker="o", label=label)
        left.fill_between(views, [f.low for f in figures], [f.high for f in figures], alpha=0.2)
    left.axhline(report.ceiling.mean, color="grey", linestyle=":", label="ceiling of one camera grid")
    left.set(xlabel="drawings", ylabel="IoU, world grid", xticks=views, ylim=(0, 1))
    left.legend(fontsize="small")
    for n, by_round in zip(views, report.network, strict=True):
        right.plot(range(ROUNDS + 1), [f.mean for f in by_round], marker="o", label=f"{n} drawings")
    right.set(xlabel="round")
    right.legend(fontsize="small")
    canvas.suptitle(f"{report.shapes} shapes of the fixed test set")
    with replacing(path) as fresh:
        canvas.savefig(fresh, dpi=120)
