"""The parts of an evaluation: how each is measured, shown and plotted."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

from rich.table import Table

from sketchcore.atomic import replacing
from sketchcore.evaluate import present
from sketchcore.evaluate.accuracy import measure_accuracy
from sketchcore.evaluate.advice import measure_advice
from sketchcore.evaluate.convergence import measure_convergence
from sketchcore.evaluate.cost import cost_as_table, measure_cost
from sketchcore.evaluate.drawings import measure_drawings
from sketchcore.evaluate.failures import measure_failures
from sketchcore.evaluate.plots import plot_accuracy, plot_convergence, plot_robustness
from sketchcore.evaluate.robustness import measure_robustness
from sketchcore.reconstruction import load_model


@dataclass(frozen=True)
class Part:
    """One part.

    Attributes:
        measure: makes its report.
        table: shows it.
        takes: which of the options "shapes", "data", "align", "folders", "out", and "weights" instead of a model,
            `measure` has.
        plot: writes it as a PNG; None where there is nothing to plot.
    """

    measure: Callable[..., Any]
    table: Callable[[Any], Table]
    takes: tuple[str, ...] = ("shapes",)
    plot: Callable[[Any, Path], None] | None = None


PARTS: Mapping[str, Part] = MappingProxyType(
    {
        "accuracy": Part(
            measure_accuracy, present.accuracy_table, takes=("shapes", "data", "align"), plot=plot_accuracy
        ),
        "convergence": Part(measure_convergence, present.convergence_table, plot=plot_convergence),
        "robustness": Part(measure_robustness, present.robustness_table, plot=plot_robustness),
        "cost": Part(measure_cost, cost_as_table, takes=("shapes", "weights")),
        "drawings": Part(measure_drawings, present.drawings_table, takes=("folders", "out")),
        "failures": Part(measure_failures, present.failures_table, takes=("shapes", "out")),
        "advice": Part(measure_advice, present.advice_table),
    }
)


def measure_part(
    name: str,
    weights: str | os.PathLike[str] | None = None,
    shapes: int | None = None,
    folders: Sequence[Path] | None = None,
    out: Path | None = None,
    progress: Callable[[int, int], None] | None = None,
    data: Path | None = None,
    align: bool = True,
) -> Any:
    """The report of a part.

    Args:
        name: from `PARTS`.
        weights: path to weights; None for those in the package.
        shapes: the first so many of the test set; None for as many as the part takes by itself.
        folders: of drawings, for the part "drawings" alone.
        out: folder for the pictures of the parts "drawings" and "failures"; made where it is missing.
        progress: called as `progress(done, total)`.
        data: data set of meshes, for the part "accuracy" alone.
        align: move drawings that are plainly out of place; False for the part "accuracy" alone.

    Raises:
        ValueError: for arguments that the part does not take, or lacks.
        OSError: if the folder cannot be made.
    """
    part = PARTS[name]
    if folders and "folders" not in part.takes:
        raise ValueError(f"{name} takes no --drawings; those are for the part drawings")
    if data is not None and "data" not in part.takes:
        raise ValueError(f"{name} takes no --data: it is measured on the fixed test set; accuracy takes it")
    if not align and "align" not in part.takes:
        raise ValueError(f"{name} takes no --no-align; accuracy takes it")
    if shapes is not None and "shapes" not in part.takes:
        raise ValueError(f"{name} takes no --shapes: it is not measured on the test set")
    if not folders and "folders" in part.takes:
        raise ValueError(f"{name} takes one or more --drawings FOLDER")
    if out is not None:
        out.mkdir(exist_ok=True)
    options: dict[str, Any] = {
        "shapes": shapes,
        "data": data,
        "align": align,
        "folders": folders,
        "out": out,
        "weights": weights,
    }
    given = {option: options[option] for option in part.takes if options[option] is not None}
    if "weights" not in part.takes:
        given["model"] = load_model(weights)
    return part.measure(progress=progress, **given)


def write_part(name: str, report: Any, folder: Path) -> None:
    """Writes a report as NAME.json and, where it can be plotted, NAME.png."""
    with replacing(folder / f"{name}.json") as fresh:
        Path(fresh).write_text(json.dumps(report.to_dict()) + "\n")
    plot = PARTS[name].plot
    if plot is not None:
        plot(report, folder / f"{name}.png")
