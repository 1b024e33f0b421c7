"""What a reconstruction costs: that all of it is measured, and of the network asked for. No figure is asserted."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import FrozenInstanceError
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from sketchcore.evaluate import cost_process
from sketchcore.evaluate.cost import PAPER, ROUNDS, Cost, cost_as_table, measure_cost

COST = Cost((101.4, 150.0, 199.6, 251.0), (111.4, 160.0, 209.6, 261.0), (2, 3, 2, 2), 2.345, 654.3, 2, 25)


def test_every_number_of_views_is_timed() -> None:
    told: list[tuple[int, int]] = []
    cost = measure_cost(shapes=2, repetitions=1, progress=lambda done, total: told.append((done, total)))
    assert told == [(1, 2), (2, 2)]
    assert cost.shapes == 2
    assert len(cost.milliseconds) == len(cost.means) == len(cost.rounds) == 4
    assert all(ms > 0 for ms in cost.milliseconds)
    assert all(1 <= n <= ROUNDS for n in cost.rounds)
    assert cost.first_call > 0
    assert cost.peak > 100, "torch alone takes more"
    assert cost.threads >= 1
    assert json.loads(json.dumps(cost.to_dict()))["peak"] == cost.peak


def test_a_cost_is_a_fact() -> None:
    with pytest.raises(FrozenInstanceError):
        COST.peak = 1.0  # type: ignore[misc]


def test_the_table_has_all_figures_beside_the_papers() -> None:
    console = Console(width=120, record=True, file=StringIO())
    table = cost_as_table(COST)
    console.print(table)
    text = console.export_text()
    assert table.row_count == 3 + len(PAPER)
    for figure in (
        "101 ms",
        "251 ms",
        "261 ms",
        "140 ms",
        "350 ms",
        "1000 ms",
        "2900 ms",
        "2.3 s",
        "654 MB",
        "2 threads",
    ):
        assert figure in text


def test_a_process_knows_its_own_peak_and_not_its_parents() -> None:
    held = np.ones(10**8, np.uint8)
    assert cost_process.peak_memory() > len(held)
    code = "from runpy import run_path; import sys; print(run_path(sys.argv[1])['peak_memory']())"
    done = subprocess.run(
        [sys.executable, "-c", code, cost_process.__file__], capture_output=True, text=True, check=True
    )
    assert 10**6 < int(done.stdout) < len(held)


def test_wrong_arguments_and_what_fails_are_told(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="repetitions must be at least 1, got 0"):
        measure_cost(repetitions=0)
    with pytest.raises(FileNotFoundError, match="no weights at"):
        measure_cost(tmp_path / "none.safetensors", shapes=1)
    (tmp_path / "broken.safetensors").write_bytes(b"no weights")
    (tmp_path / "broken.json").write_text("{}")
    with pytest.raises(RuntimeError, match=r"(?s)process that measures failed:.*corrupt"):
        measure_cost(tmp_path / "broken.safetensors", shapes=1)
