"""Networks side by side: the same shapes, paired."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sketchcore.evaluate.accuracy import TESTSET
from sketchcore.evaluate.figure import Figure
from sketchcore.evaluate.report import Report


@dataclass(frozen=True)
class Comparison(Report):
    """What `compare` found.

    Attributes:
        shapes: how many all the reports have.
        networks: name -> [views], IoU after the last round.
        differences: name -> [views], what it has more than the first network; of all but that one.
    """

    shapes: int
    networks: dict[str, list[Figure]]
    differences: dict[str, list[Figure]]


def compare(reports: Sequence[str | os.PathLike[str]]) -> Comparison:
    """Compares networks by the accuracy reports that `sketchcore evaluate accuracy --json` wrote of each.

    Args:
        reports: files, each named after its network; the first one is what the others are measured against.

    Raises:
        FileNotFoundError: for a report that does not exist.
        ValueError: for fewer than two, two of the same name, a file that is no such report, or other shapes.
    """
    names = [Path(report).stem for report in reports]
    if len(names) < 2 or len(set(names)) < len(names):
        raise ValueError(f"a comparison takes two or more reports of different names, got {names}")
    each, sources = [], set()
    for report in reports:
        try:
            read = json.loads(Path(report).read_text())
            values = np.array(read["each"], np.float64)
            shapes, views = values.shape
            sources.add(read.get("source", TESTSET))
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{report} was not written by sketchcore evaluate accuracy --json: {error!r}") from error
        each.append(values)
    if len(sources) > 1:
        raise ValueError(
            f"networks are compared on the same shapes; these were measured on {', '.join(sorted(sources))}"
        )
    shapes = min(len(values) for values in each)
    views = min(values.shape[1] for values in each)
    each = [values[:shapes, :views] for values in each]
    return Comparison(
        shapes,
        {n: [Figure.of(column) for column in v.T] for n, v in zip(names, each, strict=True)},
        {n: [Figure.of(column) for column in (v - each[0]).T] for n, v in zip(names[1:], each[1:], strict=True)},
    )
