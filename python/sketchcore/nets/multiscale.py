"""The multi-scale network of Eigen and Fergus (ICCV 2015), made to output a camera grid: one to compare with.

A drawing's depth slices are the channels of an image, as in `unet.py`. The first scale sees the whole drawing
through fully connected layers; each further one adds finer image features and predicts anew::

    scale 1   drawing -> five convolutions -> 16384 -> fully connected 1024 -> 64x8x8 -> bilinear 64x32x32
    scale 2   drawing -> 96x32x32, with scale 1 -> three convolutions -> logits 128x32x32 -> bilinear 128x64x64
    scale 3   drawing -> 96x64x64, with scale 2 -> two convolutions -> logits 128x64x64

Delanoy et al. compared their single view with it, "modified to output a multi-channel image". Unlike the
published network, this one

* has 2 x 64 channels where that had a depth, and the loss of `unet.py`;
* takes one channel of 256x256 pixels, and works at half the published resolution throughout (8, 32 and 64 cells a side
  are 1/32, 1/8 and 1/4 of the drawing, not 1/16, 1/4 and 1/2), so that its last scale is the grid;
* is trained from nothing, so its convolutions are batch normalised, where that started from AlexNet or VGG trained on
  ImageNet; its first scale has AlexNet's layers, with 1024 units in the fully connected one instead of 4096;
* is trained in one go, by the loss of the last scale alone, where that trained the third one after the others.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from sketchcore.nets.unet import GRID, check_drawing

COARSEST = 8
"""Cells along each side of what scale 1 puts out."""


class MultiscaleNet(nn.Module):
    """Three scales, each a stack of convolutions; a drawing in, a camera grid out.

    With the default width 26.1 M parameters; 10.3 GFLOP a drawing (`torch.utils.flop_counter`).

    Attributes:
        width: the argument.

    Args:
        width: channels of the stacks of scales 2 and 3; all others are in proportion. 64 as published.

    Raises:
        ValueError: if the width is not an even number of at least 2.
    """

    def __init__(self, width: int = 64) -> None:
        super().__init__()
        if type(width) is not int or width < 2 or width % 2:
            raise ValueError(f"width must be an even number of at least 2, got {width!r:.80}")
        self.width = width
        image = 3 * width // 2
        self.scale1 = _WholeImage(width, image)
        self.image2 = _image_features(image, pool=4)
        self.scale2 = _stack(width + image, width, hidden=3)
        self.image3 = _image_features(image, pool=2)
        self.scale3 = _stack(2 * GRID + image, width, hidden=2)

    def forward(self, drawing: Tensor) -> Tensor:
        """Predict the camera grid of a drawing.

        Args:
            drawing: float32 [B, 1, 256, 256] in 0..1 (row 0 on top), ink 1 on 0.

        Returns:
            float32 [B, 2, 64, 64, 64] (class, depth, row, col): logits; class 0 is empty, class 1 occupied.

        Raises:
            ValueError: for another shape or kind of number.
        """
        check_drawing(drawing)
        x = self.scale2(torch.cat([_finer(self.scale1(drawing), 4), self.image2(drawing)], dim=1))
        x = self.scale3(torch.cat([_finer(x, 2), self.image3(drawing)], dim=1))
        logits: Tensor = x.reshape(-1, 2, GRID, GRID, GRID)
        return logits

    def describe(self) -> dict[str, object]:
        """The arguments as plain data, for the file beside the weights."""
        return {"width": self.width}


class _WholeImage(nn.Module):
    """Scale 1: AlexNet's convolutions, then two fully connected layers: [B, 1, 256, 256] -> [B, width, 8, 8]."""

    def __init__(self, width: int, image: int) -> None:
        super().__init__()
        self.width = width
        self.convolutions = nn.Sequential(
            *_convolution(1, image, 11, stride=4),
            nn.MaxPool2d(3, 2, padding=1),
            *_convolution(image, 4 * width, 5),
            nn.MaxPool2d(3, 2, padding=1),
            *_convolution(4 * width, 6 * width, 3),
            *_convolution(6 * width, 6 * width, 3),
            *_convolution(6 * width, 4 * width, 3),
            nn.MaxPool2d(3, 2, padding=1),
        )
        self.connected = nn.Sequential(
            nn.Linear(4 * width * COARSEST**2, 16 * width),
            nn.ReLU(),
            nn.Dropout(0.5),
            nn.Linear(16 * width, width * COARSEST**2),
            nn.ReLU(),
        )

    def forward(self, drawing: Tensor) -> Tensor:
        x: Tensor = self.connected(self.convolutions(drawing).flatten(1))
        return x.view(-1, self.width, COARSEST, COARSEST)


def _image_features(channels: int, pool: int) -> nn.Sequential:
    """What a later scale sees by itself: [B, 1, 2n, 2n] -> [B, channels, n/pool, n/pool]."""
    return nn.Sequential(*_convolution(1, channels, 9, stride=2), nn.MaxPool2d(pool))


def _stack(before: int, width: int, hidden: int) -> nn.Sequential:
    """Hidden convolutions of 5x5, then one to logits: [B, before, n, n] -> [B, 128, n, n]."""
    inputs = [before, *[width] * (hidden - 1)]
    layers = [layer for channels in inputs for layer in _convolution(channels, width, 5)]
    return nn.Sequential(*layers, nn.Conv2d(width, 2 * GRID, 5, padding=2))


def _convolution(before: int, after: int, size: int, stride: int = 1) -> list[nn.Module]:
    conv = nn.Conv2d(before, after, size, stride=stride, padding=size // 2, bias=False)
    return [conv, nn.BatchNorm2d(after), nn.ReLU()]


def _finer(x: Tensor, times: int) -> Tensor:
    return F.interpolate(x, scale_factor=times, mode="bilinear", align_corners=False)
