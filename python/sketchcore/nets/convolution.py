"""Convolutions of 3 cells a side whose gradients, on the CPU, are made by the project's own kernels.

The kernels (`rust/src/convolution/`) multiply less than the formula does, forwards and backwards. What they are not
made for, torch does: other devices, types and shapes, and CPUs with units for products of bfloat16 matrices.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from sketchcore import _core
from sketchcore.nets.precision import has_own_convolutions


class _Layer(nn.Module):
    """What layers for images and for volumes share."""

    weight: Tensor
    bias: Tensor | None

    def rectified(self, x: Tensor) -> Tensor:
        """The layer after a rectifier, at the cost of the layer alone where the kernels do both."""
        if self._is_own(x):
            return _convolve(x, self.weight, self.bias, True)
        out: Tensor = super().forward(F.relu(x))
        return out

    def forward(self, x: Tensor) -> Tensor:
        if self._is_own(x):
            return _convolve(x, self.weight, self.bias, False)
        out: Tensor = super().forward(x)
        return out

    def _is_own(self, x: Tensor) -> bool:
        layer: Any = self
        axes = self.weight.dim() - 2
        return (
            has_own_convolutions(x.device)
            and x.dtype == self.weight.dtype == torch.float32
            and x.dim() == axes + 2
            and not torch.is_autocast_enabled(x.device.type)
            and layer.kernel_size == (3,) * axes
            and layer.stride == layer.padding == layer.dilation == (1,) * axes
            and layer.groups == 1
            and layer.padding_mode == "zeros"
        )


class Conv2d(_Layer, nn.Conv2d):
    """`nn.Conv2d`."""


class Conv3d(_Layer, nn.Conv3d):
    """`nn.Conv3d`."""


def _convolve(x: Tensor, weight: Tensor, bias: Tensor | None, rectify: bool) -> Tensor:
    out: Tensor = _Convolution.apply(x, weight, bias, rectify)
    return out


class _Convolution(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, x: Tensor, weight: Tensor, bias: Tensor | None, rectify: bool) -> Tensor:
        ctx.save_for_backward(x, weight)
        ctx.rectify = rectify
        shift = None if bias is None else _array(bias)
        return _channels_second(_core.convolve(_channels_last(x), _array(weight), shift, rectify=rectify))

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, Tensor | None, Tensor | None, None]:
        x, weight = ctx.saved_tensors
        gradient = _channels_last(gradients[0])
        by_x = by_weight = by_bias = None
        if ctx.needs_input_grad[0]:
            was = _channels_last(x) if ctx.rectify else None
            by_x = _channels_second(_core.convolve_transposed(gradient, _array(weight), rectified=was))
        if ctx.needs_input_grad[1]:
            by_weight = torch.from_numpy(_core.filter_gradient(_channels_last(x), gradient, rectify=ctx.rectify))
        if ctx.needs_input_grad[2]:
            by_bias = torch.from_numpy(gradient).flatten(0, -2).sum(dim=0)
        return by_x, by_weight, by_bias, None


def _array(x: Tensor) -> Any:
    return x.detach().contiguous().numpy()


def _channels_last(x: Tensor) -> Any:
    """As an array; tensors that lie channels last are not copied."""
    return _array(x.movedim(1, -1))


def _channels_second(array: Any) -> Tensor:
    return torch.from_numpy(array).movedim(-1, 1)
