"""Reports as plots."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure as Canvas

from sketchcore.atomic import replacing
from sketchcore.evaluate.accuracy import ROUNDS, Accuracy
from sketchcore.evaluate.convergence import Convergence
from sketchcore.evaluate.figure import Figure
from sketchcore.evaluate.robustness import COUNTS, Robustness


def _band(axes: Axes, at: Sequence[int], figures: Sequence[Figure], label: str) -> None:
    axes.plot(at, [f.mean for f in figures], marker="o", markersize=4, label=label)
    axes.fill_between(at, [f.low for f in figures], [f.high for f in figures], alpha=0.2)


def _save(canvas: Canvas, path: str | os.PathLike[str]) -> None:
    with replacing(path) as fresh:
        canvas.savefig(fresh, dpi=120, format="png")


def _canvas(title: str, height: float = 4) -> Canvas:
    canvas = Canvas(figsize=(10, height), layout="constrained")
    canvas.suptitle(title)
    return canvas


def plot_accuracy(report: Accuracy, path: str | os.PathLike[str]) -> None:
    """IoU and the recall of concavities against the number of views, beside carving."""
    canvas = _canvas(f"{report.shapes} shapes of {report.source}, 95 % intervals")
    left, right = canvas.subplots(1, 2)
    views = range(1, len(report.carving) + 1)
    _band(left, views, [by_round[-1] for by_round in report.network], f"network, round {ROUNDS}")
    _band(left, views, report.carving, "carving, same drawings")
    _band(left, views, report.orthogonal, "carving, front / top / right / back")
    left.axhline(report.ceiling.mean, color="grey", linestyle=":", label="ceiling of one camera grid")
    left.set(xlabel="drawings", ylabel="IoU, world grid", xticks=views, ylim=(0, 1))
    left.legend(fontsize="small")
    _band(right, views, report.concavities, "network")
    right.plot(views, [0.0 for _ in views], color="tab:orange", marker="o", markersize=4, label="carving")
    right.set(xlabel="drawings", ylabel="concavities left empty", xticks=views, ylim=(-0.03, 1))
    right.legend(fontsize="small")
    _save(canvas, path)


def plot_convergence(report: Convergence, path: str | os.PathLike[str]) -> None:
    """IoU, and how much the volume still moves, against the number of rounds."""
    canvas = _canvas(f"{report.shapes} shapes of the fixed test set, 95 % intervals")
    left, right = canvas.subplots(1, 2)
    for n, (scores, changes) in enumerate(zip(report.network, report.change, strict=True), start=1):
        label = f"{n} drawing{'s' if n > 1 else ''}"
        _band(left, range(len(scores)), scores, label)
        _band(right, range(1, len(changes) + 1), changes, label)
    left.set(xlabel="round", ylabel="IoU, world grid")
    right.set(xlabel="round", ylabel="L2 change of the probabilities")
    left.legend(fontsize="small", loc="lower right")
    right.legend(fontsize="small")
    _save(canvas, path)


def plot_robustness(report: Robustness, path: str | os.PathLike[str]) -> None:
    """What each fault costs, by strength: bars for the mean, whiskers for its 95 % interval."""
    canvas = _canvas(f"{report.shapes} shapes of the fixed test set, 95 % intervals", height=7)
    kinds = list(report.drop)
    for c, axes in enumerate(canvas.subplots(len(COUNTS), 1, sharex=True, sharey=True)):
        for s in range(3):
            figures = [report.drop[kind][s][c] for kind in kinds]
            means = [f.mean for f in figures]
            whiskers = np.abs(np.array([[f.low, f.high] for f in figures]) - np.array(means)[:, None]).T
            at = np.arange(len(kinds)) + 0.27 * (s - 1)
            axes.bar(at, means, 0.25, yerr=whiskers, error_kw={"linewidth": 0.8}, label=f"strength {s + 1}")
        clean = report.clean[c].mean
        axes.set(ylabel="IoU lost", xticks=range(len(kinds)), xticklabels=kinds)
        axes.set_title(f"{COUNTS[c]} drawing{'s' if COUNTS[c] > 1 else ''}; clean {clean:.3f}", fontsize="medium")
        axes.tick_params(axis="x", rotation=20)
        axes.axhline(0.03, color="grey", linewidth=0.7, linestyle=":")
        axes.axhline(0.08, color="grey", linewidth=0.7, linestyle=":")
        axes.legend(fontsize="small")
    _save(canvas, path)
