"""The optimisers of a preset: AdamW alone, or Muon for everything that is a matrix and AdamW for the rest."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

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


class FilterMuon(torch.optim.Optimizer):
    """Muon (Jordan and others, 2024) for filters of any dimension, each seen as a matrix: a row for each output.

    It does what `torch.optim.Muon` does, which orthogonalises in bfloat16 wherever it runs: on a CPU that has no
    instructions for it, that takes thirty times as long as in float32.

    Args:
        filters: parameters of two dimensions or more, dense in memory, channels first or last.
        lr: rate, comparable with AdamW's.
        weight_decay: decoupled weight decay.
        momentum: decay of the mean gradient, which is Nesterov's.
    """

    def __init__(
        self, filters: Iterable[nn.Parameter], lr: float, weight_decay: float = 0.0, momentum: float = 0.95
    ) -> None:
        self._filters: Sequence[nn.Parameter] = list(filters)
        self._last = [f.detach().movedim(1, -1).is_contiguous() for f in self._filters]
        pairs = zip(self._filters, self._last, strict=True)
        matrices = [nn.Parameter(_matrix(f.detach(), last)) for f, last in pairs]
        for parameter, matrix in zip(self._filters, matrices, strict=True):
            if parameter.data_ptr() != matrix.data_ptr():
                raise ValueError(f"a filter of shape {list(parameter.shape)} is not dense in memory")
        super().__init__(matrices, {"lr": lr, "weight_decay": weight_decay, "momentum": momentum})

    @torch.no_grad()
    def step(self, closure: None = None) -> None:  # type: ignore[override]
        """One step on the gradients of the filters."""
        [group] = self.param_groups
        rate, momentum = group["lr"], group["momentum"]
        for parameter, matrix, last in zip(self._filters, group["params"], self._last, strict=True):
            if parameter.grad is None:
                continue
            gradient = _matrix(parameter.grad, last)
            state = self.state[matrix]
            if not state:
                state["momentum_buffer"] = torch.zeros_like(gradient)
            mean = state["momentum_buffer"]
            mean.lerp_(gradient, 1 - momentum)
            matrix.mul_(1 - rate * group["weight_decay"])
            update = orthogonal(gradient.lerp(mean, momentum))
            matrix.add_(update, alpha=-rate * 0.2 * math.sqrt(max(matrix.shape)))

    def zero_grad(self, set_to_none: bool = True) -> None:
        """Forgets the gradients of the filters."""
        for parameter in self._filters:
            parameter.grad = None


def orthogonal(matrix: Tensor) -> Tensor:
    """Roughly the matrix whose singular values are all 1, and its singular vectors those of the given one.

    Five steps of Newton and Schulz with Muon's coefficients: singular values come out between 0.6 and 1.3, but for
    those that are near 0.
    """
    tall = matrix.shape[0] > matrix.shape[1]
    x = (matrix.T if tall else matrix).to(torch.bfloat16 if matrix.is_cuda else torch.float32)
    x = x / x.norm().clamp(min=1e-7)
    for _ in range(5):
        gram = x @ x.T
        x = torch.addmm(x, torch.addmm(gram, gram, gram, beta=-4.7750, alpha=2.0315), x, beta=3.4445)
    return (x.T if tall else x).to(matrix.dtype)


def _matrix(tensor: Tensor, last: bool) -> Tensor:
    return (tensor.movedim(1, -1) if last else tensor).reshape(len(tensor), -1)
