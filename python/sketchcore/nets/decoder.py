"""What all drawings say, understood as a volume: occupancy of the half world grid."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from sketchcore.nets.blocks import Attention, Block, twice
from sketchcore.nets.config import CompactConfig
from sketchcore.nets.convolution import Conv3d
from sketchcore.nets.lift import COARSE

EVIDENCE = 3
"""Volumes of `_core.evidence`."""


class WorldDecoder(nn.Module):
    """A residual U-Net between 32 and 8 cells along x and y, where walls are straight and floors are flat."""

    place: Tensor

    def __init__(self, config: CompactConfig) -> None:
        super().__init__()
        (w32, w16, w8), code, groups = config.world, 32, config.groups
        inputs = 2 * config.fused + 8 * (EVIDENCE + 1) + 3
        self.condition = nn.Sequential(nn.Linear(2, code), nn.ReLU())
        self.into = nn.Conv3d(inputs, w32, 1)
        self.encode32 = Block(Conv3d, w32, groups, code)
        self.down16 = nn.Conv3d(w32, w16, 2, stride=2)
        self.encode16 = Block(Conv3d, w16, groups, code)
        self.down8 = nn.Conv3d(w16, w8, 2, stride=2)
        self.encode8 = Block(Conv3d, w8, groups, code)
        self.attention = Attention(w8, 8 * 8 * 4)
        self.decode8 = Block(Conv3d, w8, groups, code)
        self.up16 = nn.Conv3d(w8, w16, 1)
        self.decode16 = Block(Conv3d, w16, groups, code)
        self.up32 = nn.Conv3d(w16, w32, 1)
        self.decode32 = Block(Conv3d, w32, groups, code)
        self.out = Conv3d(w32, 8, 3, padding=1)
        self.shortcut = nn.Conv3d(inputs, 8, 1)
        nn.init.zeros_(self.shortcut.weight)
        nn.init.constant_(self.out.bias, -2.0)  # type: ignore[arg-type]
        axes = [(np.arange(n) + 0.5) / COARSE[0] - (0.5 if n == COARSE[0] else 0.0) for n in COARSE]
        place = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).astype(np.float32)
        self.register_buffer("place", torch.from_numpy(place), persistent=False)

    def forward(self, readings: Tensor, evidence: Tensor, prior: Tensor, condition: Tensor) -> Tensor:
        """Decides on every voxel.

        Args:
            readings: float [B, 32, 32, 16, 2 * fused], of all drawings.
            evidence: float [B, 3, 64, 64, 32] in 0..1.
            prior: float [B, 64, 64, 32], probability of occupancy.
            condition: float [B, 2].

        Returns:
            float32 [B, 64, 64, 32], logits of occupancy.
        """
        code = self.condition(condition)
        place = self.place.expand(len(readings), -1, -1, -1, -1)
        parts = [readings, fold(evidence), fold(prior[:, None]), place]
        x = torch.cat([part.to(readings.dtype) for part in parts], dim=-1).permute(0, 4, 1, 2, 3)
        return unfold(self.fuse(self.into(x), self.shortcut(x), code).float())

    def fuse(self, x: Tensor, shortcut: Tensor, code: Tensor) -> Tensor:
        """All but the first layers and the last rearrangement.

        Args:
            x: float [B, width, 32, 32, 16], what `into` makes of all inputs.
            shortcut: float [B, 8, 32, 32, 16], what `shortcut` makes of them.
            code: float [B, 32], what `condition` makes of the condition.

        Returns:
            float [B, 8, 32, 32, 16], logits of the occupancy of each cell's eight voxels.
        """
        x32 = self.encode32(x, code)
        x16 = self.encode16(self.down16(F.relu(x32)), code)
        x8 = self.encode8(self.down8(F.relu(x16)), code)
        x8 = self.decode8(self.attention(x8), code)
        y16 = self.decode16(x16 + twice(self.up16(F.relu(x8))), code)
        y32 = self.decode32(x32 + twice(self.up32(F.relu(y16))), code)
        out: Tensor = self.out.rectified(y32) + shortcut
        return out


def fold(volume: Tensor) -> Tensor:
    """[B, c, 2x, 2y, 2z] to [B, x, y, z, 8c]: the eight voxels of a cell become channels."""
    b, c, x, y, z = volume.shape
    parts = volume.view(b, c, x // 2, 2, y // 2, 2, z // 2, 2).permute(0, 2, 4, 6, 1, 3, 5, 7)
    return parts.reshape(b, x // 2, y // 2, z // 2, 8 * c)


def unfold(cells: Tensor) -> Tensor:
    """[B, 8, x, y, z] to [B, 2x, 2y, 2z]: the channels of a cell become its eight voxels."""
    b, _, x, y, z = cells.shape
    return cells.reshape(b, 2, 2, 2, x, y, z).permute(0, 4, 1, 5, 2, 6, 3).reshape(b, 2 * x, 2 * y, 2 * z)
