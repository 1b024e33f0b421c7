"""Networks ready for use: what a reconstruction calls, whichever architecture is behind it."""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce
from typing import Any, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from sketchcore.nets.compact import CompactConfig, CompactNet, read_inputs
from sketchcore.nets.multiscale import MultiscaleNet
from sketchcore.nets.outlines import heed_outlines
from sketchcore.nets.pieces import join_pieces
from sketchcore.nets.precision import autocast, pick_device, place, unit
from sketchcore.nets.singleview import SingleViewModel
from sketchcore.nets.sketches import Sketches
from sketchcore.nets.unet import PaperNet
from sketchcore.rounds import Volume, update_rounds


class Model(Protocol):
    """What turns drawings into a volume, round after round.

    Attributes:
        device: where it computes.
    """

    device: torch.device

    def first_prediction(self, sketches: Sketches) -> Volume:
        """float32 [64, 64, 64] (x, y, z), probability of occupancy as the network says it: with nothing mended yet."""
        ...

    def rounds(self, sketches: Sketches, iterations: int, start: Volume | None = None) -> Iterator[Volume]:
        """Yields float32 [64, 64, 64] (x, y, z), probability of occupancy: the first prediction, then each round's.

        `start` is a volume that was known before the first drawing.
        """
        ...


LOOKS: tuple[tuple[int, ...], ...] = ((), (2,), (0,), (0, 2))
"""Axes that the world is mirrored along in each of four rounds, over and over."""


class CompactModel:
    """`CompactNet`: every round looks at all drawings together, and the rounds take turns at looking in a mirror.

    Mirrored, a world is seen by mirrored cameras in drawings flipped left to right. That describes the same object
    as well: about z = 0 because it is symmetric, along x because a mirrored object is an object too. The network
    answers each of the four descriptions a little differently; the volume is the mean of its latest answers, and
    each next round's prior. What is handed out has every outline filled (`outlines.py`), and its pieces joined
    (`pieces.py`).
    """

    def __init__(self, net: CompactNet, device: torch.device) -> None:
        self.net = place(net, device).eval()
        self.device = device

    def first_prediction(self, sketches: Sketches) -> Volume:
        evidence = unit(sketches.evidence[None], self.device)
        return _whole(self._decide(self._read(sketches), evidence, None, len(sketches), flip=False))

    def rounds(self, sketches: Sketches, iterations: int, start: Volume | None = None) -> Iterator[Volume]:
        answers: dict[tuple[int, ...] | None, Tensor] = {}
        mean: Tensor | None = None
        if start is not None:
            half = 0.5 * (start + start[:, :, ::-1])[:, :, 32:]
            mean = answers[None] = torch.from_numpy(np.ascontiguousarray(half, np.float32)).to(self.device)[None]
        evidence = unit(sketches.evidence[None], self.device)
        readings: dict[tuple[int, ...], Tensor] = {}
        for number in range(iterations + 1):
            look = LOOKS[number % len(LOOKS)]
            if look not in readings:
                readings[look] = self._read(reduce(Sketches.mirrored, look, sketches))
            answers[look] = self._decide(readings[look], evidence, mean, len(sketches), flip=0 in look)
            mean = torch.stack([*answers.values()]).mean(dim=0)
            yield join_pieces(heed_outlines(_whole(mean), sketches))

    @torch.inference_mode()
    def _read(self, sketches: Sketches) -> Tensor:
        with autocast(self.device):
            return self.net.read(**read_inputs([sketches], self.device))

    @torch.inference_mode()
    def _decide(self, readings: Tensor, evidence: Tensor, prior: Tensor | None, count: int, flip: bool) -> Tensor:
        """Occupancy, float [1, 64, 64, 32]; with `flip`, the readings are of a world mirrored along x."""
        has_prior = torch.full((1,), float(prior is not None), device=self.device)
        known = torch.zeros_like(evidence[:, 0]) if prior is None else prior
        if flip:
            evidence, known = evidence.flip(2), known.flip(1)
        with autocast(self.device):
            logits = self.net.decide(readings, evidence, known, has_prior, [count])
        probability = logits.float().sigmoid()
        return probability.flip(1) if flip else probability


class PaperModel:
    """The paper's single-view network and its updater, one drawing after the other (`rounds.py`)."""

    def __init__(self, single: PaperNet, updater: PaperNet | None, device: torch.device) -> None:
        self.single = place(single, device).eval()
        self.updater = None if updater is None else place(updater, device).eval()
        self.device = device

    def first_prediction(self, sketches: Sketches) -> Volume:
        return next(self.rounds(sketches, 0))

    def rounds(self, sketches: Sketches, iterations: int, start: Volume | None = None) -> Iterator[Volume]:
        return update_rounds(
            lambda view, prior: self.predict(sketches.drawings[view], prior), sketches.cameras, iterations, start
        )

    @torch.inference_mode()
    def predict(self, drawing: NDArray[np.uint8], prior: Volume | None) -> Volume:
        """Occupancy of one drawing's camera grid, float32 [64, 64, 64] (depth, row, col), given a prior in it or None.

        Raises:
            ValueError: for a prior, if there is no updater.
        """
        image = unit(drawing[None, None], self.device)
        with autocast(self.device):
            if prior is None:
                logits = self.single(image)
            elif self.updater is None:
                raise ValueError("these weights hold the single-view network alone; train the updater as well")
            else:
                logits = self.updater(image, torch.from_numpy(prior).to(self.device)[None])
        return _array(PaperNet.probability(logits.float())[0])


def _whole(half: Tensor) -> Volume:
    """Both halves of a symmetric volume, from the one with z > 0: [1, 64, 64, 32]."""
    return _array(torch.cat([half.flip(3), half], dim=3)[0])


def _array(tensor: Tensor) -> Volume:
    array: Volume = tensor.contiguous().cpu().numpy()
    return array


def build_model(
    state: dict[str, Tensor], config: dict[str, Any], device: str | torch.device | None = None
) -> CompactModel | PaperModel | SingleViewModel:
    """The model of stored weights (`nets/weights.py`).

    Raises:
        ValueError: if the config names no known network, or the weights do not fit it.
    """
    chosen = pick_device(device)
    kind, options = config.get("network"), dict(config.get("options", {}))
    if kind == "compact":
        tuples: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in options.items()}
        try:
            net = CompactNet(CompactConfig(**tuples))
        except TypeError as error:
            raise ValueError(f"the config is of another version of the network 'compact': {error}") from error
        _fill(net, state)
        return CompactModel(net, chosen)
    if kind == "paper":
        parts = {name.split(".", 1)[0] for name in state}
        nets = {part: PaperNet(updater=part == "updater", **options) for part in sorted(parts)}
        if "single" not in nets or not parts <= {"single", "updater"}:
            raise ValueError(f"weights of the network 'paper' hold 'single' and 'updater', got {sorted(parts)}")
        for part, net_ in nets.items():
            _fill(net_, {k.split(".", 1)[1]: v for k, v in state.items() if k.startswith(f"{part}.")})
        return PaperModel(nets["single"], nets.get("updater"), chosen)
    if kind == "multiscale":
        try:
            multiscale = MultiscaleNet(**options)
        except TypeError as error:
            raise ValueError(f"the config is of another version of the network 'multiscale': {error}") from error
        _fill(multiscale, state)
        return SingleViewModel(multiscale, chosen)
    raise ValueError(f"unknown network {kind!r} in the config; 'compact', 'paper' and 'multiscale' are known")


def _fill(net: nn.Module, state: dict[str, Tensor]) -> None:
    try:
        net.load_state_dict(state)
    except RuntimeError as error:
        raise ValueError(f"the weights do not fit the network of their config: {error}") from error
