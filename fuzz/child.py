"""One process that tries inputs on one target until its time or its number is up; `run.py` starts it and watches it.

Into its folder go `current`, the input being tried, which is what is left of it when it dies; `count`, how many were
tried, and the most memory; and each finding, KEY.input with KEY.txt.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
import time
from pathlib import Path
from random import Random

from harness import Finding, Target, judge, limit_memory, megabytes, peak_megabytes
from run import AGAIN

GROWTH = 256
"""Megabytes by which a process may grow before another takes over: under atheris some of what is compared leaks."""


class Trial:
    """Tries inputs and keeps what was found."""

    def __init__(self, target: Target, folder: Path) -> None:
        self.target, self.folder, self.tried = target, folder, 0
        self._told = 0.0
        self._began = self._limited = megabytes()

    def begin(self) -> None:
        """Limits the memory from now on."""
        limit_memory(self.target.megabytes)
        self._began = self._limited = megabytes()

    def attempt(self, data: bytes) -> None:
        """One input."""
        (self.folder / "current").write_bytes(data)
        finding = judge(self.target, data)
        self.tried += 1
        if finding is not None:
            self._keep(finding, data)
        if time.monotonic() > self._told + 0.5:
            self.tell()
        now = megabytes()
        if now > self._began + GROWTH:
            self.tell()
            os._exit(AGAIN)
        if now > self._limited + GROWTH // 8:  # what has leaked is no input's
            limit_memory(self.target.megabytes)
            self._limited = now

    def tell(self) -> None:
        """Says how far it is."""
        self._told = time.monotonic()
        count = {"executions": self.tried, "peak_mb": peak_megabytes()}
        (self.folder / "count").write_text(json.dumps(count))

    def _keep(self, finding: Finding, data: bytes) -> None:
        path = self.folder / f"{finding.key}.input"
        if not path.exists() or path.stat().st_size > len(data):
            path.write_bytes(data)
            path.with_suffix(".txt").write_text(finding.text, errors="backslashreplace")


def load(name: str) -> Target:
    """The target of a name, its modules instrumented if atheris is there."""
    target: Target = importlib.import_module(f"targets.{name}").TARGET
    return target


def main() -> None:
    """NAME FOLDER ENGINE SEED BUDGET: seconds for the engine "atheris", a number of inputs for "plain"."""
    name, folder, engine, seed, budget = sys.argv[1:]
    if engine == "atheris":
        import atheris

        with atheris.instrument_imports(include=["sketchcore", "trimesh.exchange", "trimesh.scene", "PIL"]):
            target = load(name)
    else:
        target = load(name)
    trial, seeds, random = Trial(target, Path(folder)), target.seeds(), Random(int(seed))
    for data in seeds:
        trial.attempt(data)
    trial.begin()
    if engine == "plain":
        for data in seeds:
            trial.attempt(data)
        while trial.tried < int(budget):
            data = random.choice(seeds)
            for _ in range(random.choice((1, 1, 2, 4))):
                data = target.mutate(data, random)
            trial.attempt(data)
        trial.tell()
        return
    corpus = Path(folder) / "corpus"
    corpus.mkdir(exist_ok=True)
    for number, data in enumerate(seeds):
        (corpus / f"seed-{number:03d}").write_bytes(data)

    def mutate(data: bytes, most: int, chance: int) -> bytes:
        if chance % 4 == 0:
            return bytes(atheris.Mutate(data, len(data)))
        return target.mutate(data, Random(chance))[:most]

    options = [f"-max_total_time={budget}", f"-seed={seed}", "-max_len=1000000", "-rss_limit_mb=0", "-timeout=3600"]
    options += [f"-artifact_prefix={folder}/", "-len_control=0", "-print_final_stats=0", "-verbosity=0", "-reload=0"]
    atheris.Setup([sys.argv[0], *options, str(corpus)], trial.attempt, custom_mutator=mutate)
    try:
        atheris.Fuzz()
    finally:
        trial.tell()


if __name__ == "__main__":
    main()
