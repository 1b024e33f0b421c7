"""The compact network on the CPU, without torch: its passes in Rust (`rust/src/network.rs`), in float32."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sketchcore import _core
from sketchcore.nets.cells import Cells
from sketchcore.nets.config import CompactConfig
from sketchcore.nets.sketches import Sketches

Reading = NDArray[np.float32]
"""[16384, width of the decoder's first layer + 8]: its first layers, but for the prior."""


class CompactNative:
    """Weights that no longer change, laid out once. It answers as `CompactNet` does, up to rounding.

    Args:
        weights: arrays by the names that `CompactNet.state_dict` has; they are copied.
        config: the widths.

    Raises:
        ValueError: if the weights are not those of such a network.
    """

    def __init__(self, weights: Mapping[str, NDArray[Any]], config: CompactConfig) -> None:
        arrays = {name: np.ascontiguousarray(array) for name, array in weights.items()}
        self._net = _core.CompactNetwork(arrays, **asdict(config))

    def read(self, samples: Sequence[Sketches]) -> list[Reading]:
        return list(
            self._net.read(
                np.concatenate([s.drawings for s in samples]),
                np.concatenate([s.fields for s in samples]),
                np.concatenate([s.cameras for s in samples]),
                [len(s) for s in samples],
                np.stack([s.evidence for s in samples]),
            )
        )

    def decide(self, readings: Sequence[Reading], prior: Cells | None, counts: Sequence[int]) -> Cells:
        known = None if prior is None else np.ascontiguousarray(prior, np.float32)
        return self._net.decide(np.stack(readings), known, list(counts))
