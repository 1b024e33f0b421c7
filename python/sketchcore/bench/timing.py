"""Medians of interleaved repetitions."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

_LEAST = 2e-3
"""One measurement repeats a call until it takes this long, in seconds: the clock and its call cost nothing then."""


def medians(calls: Sequence[Callable[[], object]], repetitions: int) -> list[float]:
    """Seconds a call: the median over repetitions, in each of which all calls have their turn.

    What disturbs the machine for a while disturbs all of them alike. The first call of each is not counted.

    Raises:
        ValueError: for less than one repetition.
    """
    if repetitions < 1:
        raise ValueError(f"repetitions must be at least 1, got {repetitions}")
    counts = []
    for call in calls:
        call()
        counts.append(max(1, int(_LEAST / _seconds(call, 1))))
    turns = [[_seconds(*turn) for turn in zip(calls, counts, strict=True)] for _ in range(repetitions)]
    return [float(seconds) for seconds in np.median(turns, axis=0)]


def _seconds(call: Callable[[], object], count: int) -> float:
    started = time.perf_counter()
    for _ in range(count):
        call()
    return (time.perf_counter() - started) / count
