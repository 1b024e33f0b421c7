"""What the networks for images and for volumes are made of."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from sketchcore.nets.config import HEADS
from sketchcore.nets.convolution import Conv2d, Conv3d


class Block(nn.Module):
    """Two convolutions of 3 cells a side around a normalisation per sample that a code scales and shifts.

    Args:
        convolution: `Conv2d` or `Conv3d`.
        width: channels.
        groups: groups of the normalisation.
        code: numbers of the code.
    """

    def __init__(self, convolution: type[Conv2d] | type[Conv3d], width: int, groups: int, code: int) -> None:
        super().__init__()
        self.conv1 = convolution(width, width, 3, padding=1, bias=False)
        self.norm = nn.GroupNorm(groups, width)
        self.film = nn.Linear(code, 2 * width)
        self.conv2 = convolution(width, width, 3, padding=1)
        for zero in (self.film.weight, self.film.bias, self.conv2.weight):
            nn.init.zeros_(zero)

    def forward(self, x: Tensor, code: Tensor) -> Tensor:
        film = self.film(code)
        scale, shift = film.view(*film.shape, *[1] * (x.dim() - 2)).chunk(2, dim=1)
        h = self.norm(self.conv1.rectified(x))
        out: Tensor = x + self.conv2.rectified(h * (1 + scale) + shift)
        return out


class Attention(nn.Module):
    """Self-attention over all cells of a coarse image or volume.

    Args:
        width: channels.
        cells: how many cells there are.
    """

    def __init__(self, width: int, cells: int) -> None:
        super().__init__()
        self.norm = nn.LayerNorm(width)
        self.place = nn.Parameter(nn.init.normal_(torch.empty(1, cells, width), std=0.02))
        self.into = nn.Linear(width, 3 * width)
        self.out = nn.Linear(width, width)
        nn.init.zeros_(self.out.weight)

    def forward(self, x: Tensor) -> Tensor:
        cells = x.flatten(2).transpose(1, 2)
        batch, count, width = cells.shape
        parts = self.into(self.norm(cells + self.place)).view(batch, count, 3, HEADS, -1)
        q, k, v = parts.permute(2, 0, 3, 1, 4)
        seen = F.scaled_dot_product_attention(q, k, v).transpose(1, 2).reshape(batch, count, width)
        out: Tensor = x + self.out(seen).transpose(1, 2).reshape(x.shape)
        return out


def twice(x: Tensor) -> Tensor:
    """Every cell of an image or volume doubled along each side."""
    return F.interpolate(x, scale_factor=2, mode="nearest")
