"""A pass of the compact network by torch."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import torch

from sketchcore.nets.cells import Cells
from sketchcore.nets.compact import CompactNet
from sketchcore.nets.filled import filled
from sketchcore.nets.inference import CompactInference
from sketchcore.nets.sketches import Sketches
from sketchcore.nets.weights import PRETRAINED, load_weights


def torch_passes(
    samples: Sequence[Sketches], prior: Cells, dtype: torch.dtype
) -> tuple[Callable[[], object], Callable[[], object]]:
    """Calls that read the drawings of some objects, and that decide on them."""
    weights, _ = load_weights(PRETRAINED)
    passes = CompactInference(filled(CompactNet, weights, "compact"), torch.device("cpu"), dtype)
    readings, counts = passes.read(samples), [len(s) for s in samples]
    return lambda: passes.read(samples), lambda: passes.decide(readings, prior, counts)
