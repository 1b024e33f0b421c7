"""A mean over shapes, and how sure it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

RESAMPLES = 10_000


@dataclass(frozen=True)
class Figure:
    """A mean over the test set with its 95 % bootstrap interval."""

    mean: float
    low: float
    high: float

    @classmethod
    def of(cls, values: NDArray[np.float64]) -> Figure:
        """The mean of one value a shape; shapes are drawn again with replacement, always in the same way.

        Of differences between two values a shape it is the paired bootstrap.

        Raises:
            ValueError: for no values.
        """
        if len(values) == 0:
            raise ValueError("a mean needs at least one value")
        random = np.random.default_rng(0)
        picks = random.integers(0, len(values), (RESAMPLES, len(values)))
        low, high = np.quantile(values[picks].mean(axis=1), [0.025, 0.975])
        return cls(float(values.mean()), float(low), float(high))

    def __str__(self) -> str:
        return f"{self.mean:.3f} [{self.low:.3f}, {self.high:.3f}]"
