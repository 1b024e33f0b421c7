"""Fuzzes targets, one after the other, and prints a line of JSON for each; it goes on after whatever is found.

    python fuzz/run.py                          all targets, a minute each, with atheris
    python fuzz/run.py --minutes 30 mesh        one of them
    python fuzz/run.py --inputs 300 --plain     valid inputs and deterministic changes of them; no atheris needed

Inputs that were found are kept in fuzz/findings/TARGET, each with a text that says what happened.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
TARGETS = sorted(path.stem for path in (HERE / "targets").glob("[a-z]*.py"))
PATIENCE = 90.0
"""Seconds without a sign of life, after which the process is ended and the input counts as a hang."""
AGAIN = 75
"""Exit code of a process that wants to be followed by another."""


def fuzz(name: str, engine: str, budget: float, seed: int, findings: Path) -> dict[str, Any]:
    """Fuzzes a target; a process that dies is told of, and followed by another."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = used.ru_utime + used.ru_stime
    memory = Path("/dev/shm")  # files that are synced to a disk would be what takes longest
    folder = Path(tempfile.mkdtemp(prefix=f"sketchcore-fuzz-{name}-", dir=memory if memory.is_dir() else None))
    began, executions, peak, deaths, processes = time.monotonic(), 0, 0, 0, 0
    while True:
        left = budget - (time.monotonic() - began) if engine == "atheris" else budget
        for old in ("count", "current"):
            (folder / old).unlink(missing_ok=True)
        code, death = _watched(name, folder, engine, seed + processes, max(1, int(left)))
        processes += 1
        count = json.loads((folder / "count").read_text()) if (folder / "count").exists() else {}
        executions, peak = executions + count.get("executions", 0), max(peak, count.get("peak_mb", 0))
        if code == AGAIN and time.monotonic() < began + budget:
            continue
        if death is None:
            break
        deaths += 1
        shutil.copy(folder / "current", folder / f"death-{deaths}.input")
        (folder / f"death-{deaths}.txt").write_text(death)
        if engine == "plain" or time.monotonic() > began + budget or deaths == 100:
            break
    found = sorted(folder.glob("*.input"))
    if found:
        (findings / name).mkdir(parents=True, exist_ok=True)
        for path in found:
            for file in (path, path.with_suffix(".txt")):
                shutil.copy(file, findings / name / file.name)
    shutil.rmtree(folder)
    seconds = round(time.monotonic() - began, 1)
    row = {"target": name, "engine": engine, "executions": executions, "seconds": seconds, "findings": len(found)}
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    row |= {"cpu_seconds": round(used.ru_utime + used.ru_stime - spent, 1), "processes": processes}
    return row | {"peak_mb": peak, "found": [path.stem for path in found]}


def _watched(name: str, folder: Path, engine: str, seed: int, budget: int) -> tuple[int, str | None]:
    """Runs the child; its exit code, and how it died, if it did."""
    arguments = [sys.executable, str(HERE / "child.py"), name, str(folder), engine, str(seed), str(budget)]
    one = dict.fromkeys(("OMP_NUM_THREADS", "RAYON_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    scratch = folder / "scratch"
    scratch.mkdir(exist_ok=True)
    with (folder / "log").open("wb") as log:
        child = subprocess.Popen(arguments, stdout=log, stderr=log, env=os.environ | one | {"TMPDIR": str(scratch)})
        current, last, silent = folder / "current", 0, 0.0
        while child.poll() is None:
            time.sleep(0.2)
            now = current.stat().st_mtime_ns if current.exists() else 0
            # Counted, not read off a clock: that goes on while a machine is suspended.
            last, silent = now, silent + 0.2 if now == last else 0.0
            if now and silent > PATIENCE:
                child.kill()
                child.wait()
                return child.returncode, f"no sign of life for {PATIENCE:g} seconds"
    if child.returncode in (0, AGAIN):
        return child.returncode, None
    return child.returncode, f"exit code {child.returncode}\n" + (folder / "log").read_text(errors="replace")[-4000:]


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("targets", nargs="*", default=TARGETS, metavar="TARGET", help=", ".join(TARGETS))
    parser.add_argument("--minutes", type=float, default=1.0, help="for each target; or")
    parser.add_argument("--seconds", type=float, help="for each target")
    parser.add_argument("--plain", action="store_true", help="without atheris: so many inputs, the same each time")
    parser.add_argument("--inputs", type=int, default=300, help="of a plain run, for each target")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--findings", type=Path, default=HERE / "findings")
    told = parser.parse_args()
    if unknown := set(told.targets) - set(TARGETS):
        parser.error(f"no target {', '.join(sorted(unknown))}; the targets are {', '.join(TARGETS)}")
    found = 0
    for name in told.targets:
        budget = told.inputs if told.plain else told.seconds or 60 * told.minutes
        row = fuzz(name, "plain" if told.plain else "atheris", budget, told.seed, told.findings)
        found += row["findings"]
        print(json.dumps(row), flush=True)
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
