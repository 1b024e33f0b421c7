"""What this machine can do at best, on one core: bytes moved and sums done in a second."""

from __future__ import annotations

import os
import platform
from dataclasses import dataclass

import numpy as np
import torch

from sketchcore.bench.timing import medians

_BYTES = 1 << 20
_SIDE = 512


@dataclass(frozen=True)
class Machine:
    """Measured, one thread.

    Attributes:
        processor: its name.
        cores: how many there are.
        bandwidth: bytes read plus bytes written a second, copying 1 MB: what a volume is, and where it lies.
        arithmetic: float32 operations a second, in a product of matrices.
    """

    processor: str
    cores: int
    bandwidth: float
    arithmetic: float

    def floor(self, moved: float, sums: float) -> float:
        """Seconds that no program can do with less, if it moves so many bytes and does so many operations."""
        return max(moved / self.bandwidth, sums / self.arithmetic)


def measure(repetitions: int) -> Machine:
    """Measures this machine. torch must have been set to one thread."""
    source = np.ones(_BYTES, np.uint8)
    target = np.empty_like(source)
    a = torch.ones(_SIDE, _SIDE)
    product = torch.empty_like(a)
    copy, multiply = medians([lambda: np.copyto(target, source), lambda: torch.mm(a, a, out=product)], repetitions)
    return Machine(_processor(), os.cpu_count() or 1, 2 * _BYTES / copy, 2 * _SIDE**3 / multiply)


def _processor() -> str:
    try:
        with open("/proc/cpuinfo") as file:
            return next(line.split(":")[1].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.processor() or platform.machine()
