"""What the drawings agree on: the world volume between passes of a network."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Volume = NDArray[np.float32]


class Consensus:
    """The mean of each drawing's latest prediction, in the world grid.

    The paper hands the latest prediction alone to the next drawing (section 3.2), so that the order of the drawings
    shows in the result and each pass may undo the one before. The mean of the latest prediction from every drawing
    is steadier, and as an average of several predictions more accurate than each. With `latest_only` it is the
    paper's rule.

    Args:
        symmetric: average the volume with its mirror image about z = 0 (axis 2), for shapes known to be symmetric.
        latest_only: keep nothing but the latest prediction.
    """

    def __init__(self, *, symmetric: bool, latest_only: bool = False) -> None:
        self.symmetric = symmetric
        self.latest_only = latest_only
        self._latest: dict[int, Volume] = {}
        self.volume: Volume | None = None

    def add(self, drawing: int, prediction: Volume) -> Volume:
        """Takes drawing number `drawing`'s prediction, float32 [64, 64, 64] in the world grid.

        Returns:
            the new consensus, float32 [64, 64, 64]; also kept as `volume`.
        """
        if self.latest_only:
            self._latest.clear()
        self._latest[drawing] = prediction
        mean = _mean(self._latest.values())
        if self.symmetric:
            mean = 0.5 * (mean + mean[:, :, ::-1])
        self.volume = mean
        return mean


def _mean(volumes: Iterable[Volume]) -> Volume:
    total, *rest = volumes
    if not rest:
        return total
    total = total.copy()
    for volume in rest:
        total += volume
    return total / np.float32(1 + len(rest))
