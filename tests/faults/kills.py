"""What the scripts in this folder share: processes that are killed at random moments, as a power cut would."""

from __future__ import annotations

import argparse
import json
import random
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any


def kill_within(process: Any, seconds: float) -> bool:
    """Sends SIGKILL after a random part of some seconds; false if the process had ended by itself before.

    Args:
        process: of `subprocess` or of `multiprocessing`.
        seconds: the longest that it may live.
    """
    ended = (lambda: process.poll() is not None) if hasattr(process, "poll") else (lambda: not process.is_alive())
    moment = time.monotonic() + random.uniform(0, seconds)
    while time.monotonic() < moment and not ended():
        time.sleep(min(0.005, max(0.0, moment - time.monotonic())))
    if ended():
        return False
    process.kill()
    (process.wait if hasattr(process, "poll") else process.join)()
    return True


def main(fault: Callable[[int, Path], dict[str, Any]], about: str) -> None:
    """Runs a fault as a script: so many kills in a fresh folder; prints what came of it as a row of JSON."""
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0, help="of the moments")
    told = parser.parse_args()
    random.seed(told.seed)
    began = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        row = fault(told.kills, Path(folder))
    print(json.dumps(row | {"seconds": round(time.monotonic() - began)}), flush=True)
