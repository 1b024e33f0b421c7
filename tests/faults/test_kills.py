"""A few kills of each kind; the scripts do a hundred."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from kill_export import kill_export
from kill_training import kill_training


@pytest.fixture(autouse=True)
def _moments() -> None:
    random.seed(1)


@pytest.mark.slow
def test_training_that_is_killed_ends_in_the_same_weights(tmp_path: Path) -> None:
    row = kill_training(3, tmp_path)
    assert row["kills"] == 3
    assert row["same"] == row["runs"] > 0


@pytest.mark.slow
def test_an_export_that_is_killed_leaves_whole_shards_alone(tmp_path: Path) -> None:
    row = kill_export(3, tmp_path, count=80)
    assert row["kills"] == 3
    assert row["same"] == row["runs"] > 0


@pytest.mark.slow
def test_a_server_that_is_killed_has_every_stroke(tmp_path: Path) -> None:
    pytest.importorskip("nicegui", reason="the app needs NiceGUI (pip install 'sketchcore[app]')")
    from kill_app import kill_app

    row = kill_app(2, tmp_path)
    assert row["kills"] == 2
    assert row["answered"] > 0
