"""The optimisers of a preset: AdamW alone, or Muon for everything that is a matrix and AdamW for the rest."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import torch
from torch import Tensor, nn

from sketchcore.train.presets import Preset

SMALLEST = 32
"""Rows and columns that make orthogonalising a matrix worth its while."""


def make_optimizers(model: nn.Module, preset: Preset) -> list[torch.optim.Optimizer]:
    """The optimisers that share a network's parameters among them; their rates are those of `preset`."""
    parameters = list(model.parameters())
    matrices = [p for p in parameters if preset.muon and _is_matrix(p)]
    chosen = {id(p) for p in matrices}
    rest = [p for p in parameters if id(p) not in chosen]
    adam = torch.optim.AdamW(rest, lr=preset.rate, betas=preset.betas, eps=1e-8, weight_decay=preset.weight_decay)
    if not matrices:
        return [adam]
    return [FilterMuon(matrices, lr=preset.muon, weight_decay=preset.weight_decay), adam]


def _is_matrix(parameter: Tensor) -> bool:
    rows = parameter.shape[0] if parameter.dim() >= 2 else 0
    return rows >= SMALLEST and parameter.numel() >= SMALLEST * rows


class FilterMuon(torch.optim.Muon):
    """`torch.optim.Muon` for filters of any dimension, each seen as a matrix: a row for each output.

    Args:
        filters: parameters of two dimensions or more, dense in memory, channels first or last.
        options: those of `torch.optim.Muon`; rates are made comparable with AdamW's.
    """

    def __init__(self, filters: Iterable[nn.Parameter], **options: Any) -> None:
        self._filters: Sequence[nn.Parameter] = list(filters)
        self._last = [f.detach().movedim(1, -1).is_contiguous() for f in self._filters]
        pairs = zip(self._filters, self._last, strict=True)
        self._matrices = [nn.Parameter(_matrix(f.detach(), last)) for f, last in pairs]
        for parameter, matrix in zip(self._filters, self._matrices, strict=True):
            if parameter.data_ptr() != matrix.data_ptr():
                raise ValueError(f"a filter of shape {list(parameter.shape)} is not dense in memory")
        super().__init__(self._matrices, adjust_lr_fn="match_rms_adamw", **options)

    def step(self, closure: Any = None) -> Any:
        """One step on the gradients of the filters."""
        for parameter, matrix, last in zip(self._filters, self._matrices, self._last, strict=True):
            matrix.grad = None if parameter.grad is None else _matrix(parameter.grad, last)
        return super().step(closure)  # type: ignore[no-untyped-call]

    def zero_grad(self, set_to_none: bool = True) -> None:
        """Forgets the gradients of the filters."""
        for parameter in self._filters:
            parameter.grad = None


def _matrix(tensor: Tensor, last: bool) -> Tensor:
    return (tensor.movedim(1, -1) if last else tensor).reshape(len(tensor), -1)
