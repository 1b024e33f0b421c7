"""A drawing understood as an image: features for every pixel and depth of its frustum."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from sketchcore.nets.blocks import Attention, Block, twice
from sketchcore.nets.config import CompactConfig
from sketchcore.nets.convolution import Conv2d
from sketchcore.nets.lift import BINS, PLANE


class DrawingEncoder(nn.Module):
    """A residual U-Net between 64^2 and 8^2 pixels, told the camera's rotation."""

    def __init__(self, config: CompactConfig) -> None:
        super().__init__()
        stem, (w32, w16, w8), code, groups = config.stem, config.image, 64, config.groups
        self.condition = nn.Sequential(nn.Linear(9, code), nn.ReLU(), nn.Linear(code, code), nn.ReLU())
        self.into = Conv2d(3 * 16, stem, 3, padding=1)
        self.down32 = nn.Conv2d(stem, w32, 3, stride=2, padding=1)
        self.encode32 = Block(Conv2d, w32, groups, code)
        self.down16 = nn.Conv2d(w32, w16, 3, stride=2, padding=1)
        self.encode16 = Block(Conv2d, w16, groups, code)
        self.down8 = nn.Conv2d(w16, w8, 3, stride=2, padding=1)
        self.encode8 = Block(Conv2d, w8, groups, code)
        self.attention = Attention(w8, 8 * 8)
        self.up16 = nn.Conv2d(w8, w16, 1)
        self.decode16 = Block(Conv2d, w16, groups, code)
        self.up32 = nn.Conv2d(w16, w32, 1)
        self.decode32 = Block(Conv2d, w32, groups, code)
        self.up64 = nn.Conv2d(w32, stem, 1)
        self.fine = Conv2d(2 * stem, stem, 3, padding=1)
        self.out = nn.Conv2d(stem, BINS * config.features, 1)

    def forward(self, drawing: Tensor, fields: Tensor, rotation: Tensor) -> Tensor:
        """Describes each drawing by itself.

        Args:
            drawing: float [D, 256, 256], ink 1 on 0.
            fields: float [D, 2, 256, 256] in 0..1, its signed silhouette distance and nearness to ink.
            rotation: float [D, 3, 3], its camera's.

        Returns:
            float32 [D, 64 * 64 * 16, features]: a row for each depth of each pixel.
        """
        code = self.condition(rotation.flatten(1))
        image = F.pixel_unshuffle(torch.cat([drawing[:, None], fields], dim=1), 4)
        x64 = F.relu(self.into(image.contiguous(memory_format=torch.channels_last)))
        x32 = self.encode32(self.down32(x64), code)
        x16 = self.encode16(self.down16(F.relu(x32)), code)
        x8 = self.attention(self.encode8(self.down8(F.relu(x16)), code))
        y16 = self.decode16(x16 + twice(self.up16(F.relu(x8))), code)
        y32 = self.decode32(x32 + twice(self.up32(F.relu(y16))), code)
        y64 = F.relu(twice(self.up64(F.relu(y32))))
        y64 = F.relu(self.fine(torch.cat([y64, x64], dim=1)))
        out: Tensor = self.out(y64).float().permute(0, 2, 3, 1).reshape(len(drawing), PLANE * PLANE * BINS, -1)
        return out
