"""Networks ready for use: what the iterative update calls, whichever architecture is behind it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from sketchcore import _core
from sketchcore.nets.compact import CompactConfig, CompactNet, compact_inputs
from sketchcore.nets.precision import autocast, pick_device, place
from sketchcore.nets.unet import PaperNet


@dataclass(frozen=True)
class Sketches:
    """The drawings of one object, with their cameras.

    Attributes:
        drawings: uint8 [n, 256, 256], ink 255 on 0.
        cameras: float64 [n, 15], packed.
    """

    drawings: NDArray[np.uint8]
    cameras: NDArray[np.float64]

    @cached_property
    def fields(self) -> NDArray[np.uint8]:
        """uint8 [n, 256, 256, 2]: silhouette and nearness to ink (`rust/src/evidence.rs`)."""
        return _core.evidence_fields(self.drawings)


class Model(Protocol):
    """A network, or a pair of them, that predicts one drawing's camera grid.

    Attributes:
        symmetric: whether its shapes are symmetric about z = 0.
        latest_only: whether it hands on the latest prediction alone (the paper) or the mean (`Consensus`).
        device: where it computes.
    """

    symmetric: bool
    latest_only: bool
    device: torch.device

    def predict(self, sketches: Sketches, view: int, prior: NDArray[np.float32] | None) -> NDArray[np.float32]:
        """float32 [64, 64, 64] (depth, row, col): the probability of occupancy in drawing `view`'s camera grid.

        `prior` is of that grid too, or None for the first prediction.
        """
        ...


class CompactModel:
    """`CompactNet`, for the first drawing and for every further one."""

    symmetric = True
    latest_only = False

    def __init__(self, net: CompactNet, device: torch.device) -> None:
        self.net = place(net, device).eval()
        self.device = device

    @torch.inference_mode()
    def predict(self, sketches: Sketches, view: int, prior: NDArray[np.float32] | None) -> NDArray[np.float32]:
        evidence = _core.evidence(sketches.fields, sketches.cameras, view, self.symmetric)
        one = slice(view, view + 1)
        inputs = compact_inputs(
            sketches.drawings[one],
            sketches.fields[one],
            evidence[None],
            np.zeros_like(evidence[:1], np.float32) if prior is None else prior[None],
            sketches.cameras[one],
            np.array([len(sketches.drawings)]),
            np.array([prior is not None]),
            self.device,
        )
        with autocast(self.device):
            logits = self.net(**inputs)
        return _array(logits[0].float().sigmoid())


class PaperModel:
    """The paper's single-view network and its updater."""

    symmetric = False
    latest_only = True

    def __init__(self, single: PaperNet, updater: PaperNet | None, device: torch.device) -> None:
        self.single = place(single, device).eval()
        self.updater = None if updater is None else place(updater, device).eval()
        self.device = device

    @torch.inference_mode()
    def predict(self, sketches: Sketches, view: int, prior: NDArray[np.float32] | None) -> NDArray[np.float32]:
        drawing = torch.from_numpy(sketches.drawings[view]).to(self.device).float()[None, None] / 255
        with autocast(self.device):
            if prior is None:
                logits = self.single(drawing)
            elif self.updater is None:
                raise ValueError("these weights hold the single-view network alone; train the updater as well")
            else:
                logits = self.updater(drawing, torch.from_numpy(prior).to(self.device)[None])
        return _array(PaperNet.probability(logits.float())[0])


def _array(tensor: Tensor) -> NDArray[np.float32]:
    array: NDArray[np.float32] = tensor.contiguous().cpu().numpy()
    return array


def build_model(
    state: dict[str, Tensor], config: dict[str, Any], device: str | torch.device | None = None
) -> CompactModel | PaperModel:
    """The model of stored weights (`nets/weights.py`).

    Raises:
        ValueError: if the config names no known network, or the weights do not fit it.
    """
    chosen = pick_device(device)
    kind = config.get("network")
    if kind == "compact":
        options = dict(config.get("options", {}))
        tuples: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in options.items()}
        net = CompactNet(CompactConfig(**tuples))
        _fill(net, state)
        return CompactModel(net, chosen)
    if kind == "paper":
        parts = {name.split(".", 1)[0] for name in state}
        nets = {part: PaperNet(updater=part == "updater", **config.get("options", {})) for part in sorted(parts)}
        if "single" not in nets or not parts <= {"single", "updater"}:
            raise ValueError(f"weights of the network 'paper' hold 'single' and 'updater', got {sorted(parts)}")
        for part, net_ in nets.items():
            _fill(net_, {k.split(".", 1)[1]: v for k, v in state.items() if k.startswith(f"{part}.")})
        return PaperModel(nets["single"], nets.get("updater"), chosen)
    raise ValueError(f"unknown network {kind!r} in the config; 'compact' and 'paper' are known")


def _fill(net: nn.Module, state: dict[str, Tensor]) -> None:
    try:
        net.load_state_dict(state)
    except RuntimeError as error:
        raise ValueError(f"the weights do not fit the network of their config: {error}") from error
