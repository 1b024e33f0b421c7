"""The paper's U-Net (section 4 and appendix): from a drawing, and the updater's prior, to a camera grid.

A camera grid's depth slices are the channels of an image, so the network is a 2D one from end to end::

    drawing 1x256 -> conv1 64x128 -> conv2 128x64 -> conv3 256x32 -> conv4 512x16 -> ... -> conv8 512x1
                                        + prior 64x64   |               |                     |
    logits 2x64x64 <- deconv6 128x64 <- deconv5 256x32 <+ deconv4 512x16 <+ ...  <- deconv1 512x2

The appendix's layer figure is not in its source; the layers here are pix2pix's (Isola et al. 2017) with the
decoder cut at 64x64, which gives the voxel grid that the paper describes.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

IMAGE = 256
GRID = 64
ENCODER = (1, 2, 4, 8, 8, 8, 8, 8)
"""Channels of conv1 to conv8, in units of the width."""
DECODER = (8, 8, 8, 8, 4)
"""Channels of deconv1 to deconv5, in units of the width; deconv6 has a channel a slice and class."""
DROPOUT_LAYERS = 3


class PaperNet(nn.Module):
    """The single-view network, or the updater, of the paper.

    All convolutions are 4x4 with stride 2. All but the first and the last are batch normalised, and so need
    no bias. ReLUs are leaky (0.2) in the encoder, plain in the decoder. Training drops half of what deconv1
    to deconv3 put out; evaluation, unlike pix2pix's, drops nothing and so is deterministic.

    At width 64 the convolutions hold 54,133,760 weights, in the updater 54,395,904 (biases and batch norm
    apart). `get_submodule("encoder.conv3")` and the like address a layer.

    Attributes:
        updater: whether the network takes a prior volume.
        width: the argument.
        encoder: layers `conv1` ... `conv8`, by name.
        decoder: layers `deconv1` ... `deconv6`, by name.

    Args:
        updater: build the updater instead of the single-view network.
        width: channels of the first layer, 64 in the paper; the others follow in proportion.

    Raises:
        ValueError: if the width is less than 1.
    """

    def __init__(self, updater: bool = False, *, width: int = 64) -> None:
        super().__init__()
        if type(width) is not int or width < 1:
            raise ValueError(f"width must be a whole number, at least 1, got {width!r:.80}")
        self.updater = updater
        self.width = width
        self.encoder = nn.ModuleDict()
        self.decoder = nn.ModuleDict()

        encoded = [width * factor for factor in ENCODER]
        inputs = [1, *encoded[:-1]]
        inputs[2] += GRID * updater
        for i, (before, after) in enumerate(zip(inputs, encoded, strict=True), start=1):
            self.encoder[f"conv{i}"] = _conv(before, after, normalised=i > 1)

        decoded = [width * factor for factor in DECODER]
        skipped = [0, *encoded[-2:1:-1]]  # conv7 ... conv3 join the outputs of deconv1 ... deconv5
        for i, after in enumerate(decoded, start=1):
            before = skipped[i - 1] + (decoded[i - 2] if i > 1 else encoded[-1])
            self.decoder[f"deconv{i}"] = _deconv(before, after, dropped=i <= DROPOUT_LAYERS)
        before = skipped[-1] + decoded[-1]
        self.decoder["deconv6"] = nn.ConvTranspose2d(before, 2 * GRID, 4, stride=2, padding=1)
        self.apply(_initialise)

    def forward(self, drawing: Tensor, prior: Tensor | None = None) -> Tensor:
        """Predict the camera grid of a drawing.

        Args:
            drawing: float32 [B, 1, 256, 256] in 0..1 (row 0 on top), ink 1 on 0.
            prior: for the updater, float32 [B, 64, 64, 64] (depth, row, col) in the drawing's camera grid:
                probabilities of occupancy, not thresholded. None for the single-view network.

        Returns:
            float32 [B, 2, 64, 64, 64] (class, depth, row, col): logits; class 0 is empty, class 1 occupied.

        Raises:
            ValueError: if a shape or kind of number is wrong, the prior is missing or one too many, or the
                batch in training is a single sample (its bottleneck has nothing to be normalised over).
        """
        self._check(drawing, prior)
        x = drawing
        features: list[Tensor] = []
        for name, conv in self.encoder.items():
            x = conv(x)
            features.append(x)
            if name == "conv2" and prior is not None:
                x = torch.cat([x, prior.to(x.dtype)], dim=1)
        features.pop()  # conv8's output, which x is
        for name, deconv in self.decoder.items():
            x = deconv(x if name == "deconv1" else torch.cat([x, features.pop()], dim=1))
        return x.reshape(-1, 2, GRID, GRID, GRID)

    @staticmethod
    def probability(logits: Tensor) -> Tensor:
        """Turn logits [B, 2, 64, 64, 64] into occupancy probabilities [B, 64, 64, 64] (depth, row, col)."""
        return logits.softmax(dim=1)[:, 1]

    def describe(self) -> dict[str, object]:
        """The arguments as plain data, for the file beside the weights; updater and single view share them."""
        return {"width": self.width}

    def _check(self, drawing: Tensor, prior: Tensor | None) -> None:
        check_drawing(drawing)
        batch = drawing.shape[0]
        if self.training and batch < 2:
            raise ValueError(
                f"training needs a batch of at least 2 (batch norm at 1x1), got {batch}; "
                "call eval() to predict a single drawing"
            )
        if prior is None:
            if self.updater:
                raise ValueError("the updater needs a prior volume; the network without one is PaperNet()")
            return
        if not self.updater:
            raise ValueError("the single-view network takes no prior; PaperNet(updater=True) does")
        if prior.shape != (batch, GRID, GRID, GRID) or not prior.is_floating_point():
            raise ValueError(
                f"prior must be float [{batch}, {GRID}, {GRID}, {GRID}] (depth, row, col), "
                f"got {prior.dtype} {list(prior.shape)}"
            )


def paper_loss(logits: Tensor, truth: Tensor) -> Tensor:
    """Average the paper's multinomial log loss, here against fractional truth, over voxels and batch.

    Args:
        logits: [B, 2, 64, 64, 64] (class, depth, row, col), as `PaperNet` returns them.
        truth: float [B, 64, 64, 64] in [0, 1], the share of each cell that is inside.

    Returns:
        float32 scalar, -mean(truth log p + (1 - truth) log(1 - p)), natural logarithm.

    Raises:
        ValueError: if the shapes do not belong together.
    """
    if logits.ndim != 5 or logits.shape[1] != 2 or truth.shape != logits[:, 0].shape:
        raise ValueError(
            f"logits [B, 2, D, H, W] need truth [B, D, H, W], got {list(logits.shape)} and {list(truth.shape)}"
        )
    # A softmax over two classes is the logistic function of their difference.
    empty, occupied = logits.float().unbind(dim=1)
    return F.binary_cross_entropy_with_logits(occupied - empty, truth.float())


def check_drawing(drawing: Tensor) -> None:
    """Refuse what is no batch of drawings for a network that predicts camera grids.

    Raises:
        ValueError: unless it is float [B, 1, 256, 256].
    """
    if drawing.shape[1:] != (1, IMAGE, IMAGE) or not drawing.is_floating_point():
        raise ValueError(
            f"drawing must be float [B, 1, {IMAGE}, {IMAGE}] with ink 1 on 0, got {drawing.dtype} {list(drawing.shape)}"
        )


def _conv(before: int, after: int, *, normalised: bool) -> nn.Sequential:
    """Halve an image: [B, before, 2n, 2n] -> [B, after, n, n]."""
    conv = nn.Conv2d(before, after, 4, stride=2, padding=1, bias=not normalised)
    norm = [nn.BatchNorm2d(after)] if normalised else []
    return nn.Sequential(conv, *norm, nn.LeakyReLU(0.2))


def _deconv(before: int, after: int, *, dropped: bool) -> nn.Sequential:
    """Double an image: [B, before, n, n] -> [B, after, 2n, 2n]."""
    deconv = nn.ConvTranspose2d(before, after, 4, stride=2, padding=1, bias=False)
    dropout = [nn.Dropout(0.5)] if dropped else []
    return nn.Sequential(deconv, nn.BatchNorm2d(after), *dropout, nn.ReLU())


def _initialise(module: nn.Module) -> None:
    """Weights as in pix2pix: normal with deviation 0.02, around 0, or around 1 in batch norm; biases 0."""
    if isinstance(module, nn.Conv2d | nn.ConvTranspose2d | nn.BatchNorm2d):
        nn.init.normal_(module.weight, 1.0 if isinstance(module, nn.BatchNorm2d) else 0.0, 0.02)
        if module.bias is not None:
            nn.init.zeros_(module.bias)
