"""An export is killed at random moments and begun again: what is seen is whole, and in the end all is there.

    python tests/faults/kill_export.py --kills 100

It is the command line that is killed: half of the time one process, half of the time one with two workers.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from kills import kill_within, main

SHARDS = 8
COUNT = 400
ENGINES = (["--engine", "local"], ["--engine", "processes", "--workers", "2"])


def start(out: Path, engine: list[str], count: int) -> subprocess.Popen[bytes]:
    """The command, under way."""
    told = ["--shards", str(SHARDS), "--count", str(count), "--views", "2", "--seed", "5"]
    command = [sys.executable, "-m", "sketchcore.cli", "generate", *told, *engine, "-o", str(out)]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def finish(process: subprocess.Popen[bytes]) -> None:
    """Waits for the command.

    Raises:
        RuntimeError: if it fails.
    """
    if process.wait() != 0:
        raise RuntimeError(f"{' '.join(map(str, process.args))} failed with exit code {process.returncode}")  # type: ignore[arg-type]


def seen(folder: Path) -> dict[str, bytes]:
    """What a reader finds."""
    if not folder.is_dir():
        return {}
    return {path.name: path.read_bytes() for path in folder.iterdir() if not path.name.startswith(".")}


def kill_export(kills: int, folder: Path, count: int = COUNT) -> dict[str, Any]:
    """Kills exports of `count` samples until there were so many kills; each goes on until it is complete.

    Raises:
        AssertionError: if a shard is seen that is not whole, or a manifest before all are, or the bytes are others.
        RuntimeError: if an export that nobody killed fails.
    """
    lasts = []
    for number, engine in enumerate(ENGINES):
        began = time.monotonic()
        finish(start(folder / f"whole-{number}", engine, count))
        lasts.append(time.monotonic() - began)
    want = seen(folder / "whole-0")
    row = {"fault": "export", "kills": 0, "runs": 0, "same": 0, "whole_shards_seen": 0, "while_writing": 0}
    while row["kills"] < kills:
        out, way = folder / "data", row["runs"] % 2
        while True:
            process = start(out, ENGINES[way], count)
            if row["kills"] < kills and kill_within(process, lasts[way]):
                row["kills"] += 1
                found = seen(out)
                assert all(want[name] == data for name, data in found.items()), "every file that is seen is whole"
                assert "manifest.json" not in found or len(found) == len(want), "a manifest comes last"
                row["whole_shards_seen"] += sum(name.endswith(".tar") for name in found)
                row["while_writing"] += out.is_dir() and any(out.glob(".shard-*"))
                continue
            finish(process)
            break
        row["runs"] += 1
        assert seen(out) == want, "the bytes are those of an export that nobody killed"
        assert not list(out.glob(".*")), "nothing is left of shards that were being written"
        row["same"] += 1
        shutil.rmtree(out)
    return row


if __name__ == "__main__":
    main(kill_export, __doc__ or "")
