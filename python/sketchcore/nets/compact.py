"""The network whose weights ship: one small residual U-Net for the first drawing and for every further one.

It differs from the paper's pair of networks (`unet.py`) in what it is told. Beside the drawing and the prior it
gets the *evidence* of all drawings in its own camera grid (`sketchcore.evidence`), so that a new drawing counts
from the first pass on; and the camera's rotation, since the plane of symmetry is known in the world.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F

SLICES = 64
CONDITIONS = 11
"""Entries of the condition: rotation row by row (9), 1 where there is a prior, number of drawings / 4."""


@dataclass(frozen=True)
class CompactConfig:
    """Widths (channels) and depths (residual blocks) of `CompactNet`, by resolution.

    Attributes:
        stem: channels at 64^2.
        widths: channels at 32^2, 16^2 and 8^2.
        blocks: residual blocks at 32^2, 16^2 and 8^2; on the way up as many again at 32^2 and 16^2.
        groups: groups of each group normalisation.
    """

    stem: int = 64
    widths: tuple[int, int, int] = (128, 256, 320)
    blocks: tuple[int, int, int] = (1, 2, 2)
    groups: int = 8


class Block(nn.Module):
    """Two 3x3 convolutions around a normalisation per sample that the condition scales and shifts."""

    def __init__(self, width: int, groups: int, condition: int) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(width, width, 3, padding=1, bias=False)
        self.norm = nn.GroupNorm(groups, width)
        self.film = nn.Linear(condition, 2 * width)
        self.conv2 = nn.Conv2d(width, width, 3, padding=1)
        nn.init.zeros_(self.film.weight)
        nn.init.zeros_(self.film.bias)
        nn.init.zeros_(self.conv2.weight)

    def forward(self, x: Tensor, condition: Tensor) -> Tensor:
        scale, shift = self.film(condition)[:, :, None, None].chunk(2, dim=1)
        h = self.norm(self.conv1(F.relu(x)))
        out: Tensor = x + self.conv2(F.relu(h * (1 + scale) + shift))
        return out


class Attention(nn.Module):
    """Self-attention over the cells of the coarsest grid, and one token more that holds the condition."""

    def __init__(self, width: int, condition: int, heads: int = 8) -> None:
        super().__init__()
        self.heads = heads
        self.norm = nn.LayerNorm(width)
        self.token = nn.Linear(condition, width)
        self.place = nn.Parameter(0.02 * torch.randn(1, 64, width))
        self.into = nn.Linear(width, 3 * width)
        self.out = nn.Linear(width, width)
        nn.init.zeros_(self.out.weight)

    def forward(self, x: Tensor, condition: Tensor) -> Tensor:
        b, c, h, w = x.shape
        cells = x.flatten(2).transpose(1, 2)
        tokens = torch.cat([cells + self.place, self.token(condition)[:, None]], dim=1)
        parts = self.into(self.norm(tokens)).view(b, -1, 3, self.heads, c // self.heads)
        q, k, v = parts.permute(2, 0, 3, 1, 4)
        seen = F.scaled_dot_product_attention(q, k, v)[:, :, :-1]
        change = self.out(seen.transpose(1, 2).reshape(b, h * w, c))
        out: Tensor = x + change.transpose(1, 2).reshape(b, c, h, w)
        return out


class CompactNet(nn.Module):
    """Drawing, evidence and prior in, occupancy of the drawing's camera grid out.

    About 10 M parameters and 5.6 GFLOP a pass with the default configuration.
    """

    def __init__(self, config: CompactConfig | None = None) -> None:
        super().__init__()
        self.config = config or CompactConfig()
        c = self.config
        stem, (w32, w16, w8), code = c.stem, c.widths, 64
        self.condition = nn.Sequential(nn.Linear(CONDITIONS, code), nn.ReLU(), nn.Linear(code, code), nn.ReLU())
        self.image = nn.Conv2d(3 * 16, stem, 3, padding=1)
        self.volumes = nn.Conv2d(3 * SLICES, stem, 1)
        self.joined = nn.Conv2d(2 * stem, stem, 3, padding=1)

        def stage(width: int, count: int) -> nn.ModuleList:
            return nn.ModuleList(Block(width, c.groups, code) for _ in range(count))

        self.down32 = nn.Conv2d(stem, w32, 3, stride=2, padding=1)
        self.encode32 = stage(w32, c.blocks[0])
        self.down16 = nn.Conv2d(w32, w16, 3, stride=2, padding=1)
        self.encode16 = stage(w16, c.blocks[1])
        self.down8 = nn.Conv2d(w16, w8, 3, stride=2, padding=1)
        self.encode8 = stage(w8, c.blocks[2])
        self.attention = Attention(w8, code)
        self.up16 = nn.Conv2d(w8, w16, 1)
        self.decode16 = stage(w16, c.blocks[1])
        self.up32 = nn.Conv2d(w16, w32, 1)
        self.decode32 = stage(w32, c.blocks[0])
        self.up64 = nn.Conv2d(w32, stem, 1)
        self.fine = nn.Conv2d(2 * stem, stem, 3, padding=1)
        self.logits = nn.Conv2d(stem, SLICES, 3, padding=1)
        self.shortcut = nn.Conv2d(3 * SLICES, SLICES, 1)
        nn.init.zeros_(self.shortcut.weight)
        nn.init.constant_(self.logits.bias, -2.0)  # type: ignore[arg-type]

    def forward(
        self,
        drawing: Tensor,
        fields: Tensor,
        evidence: Tensor,
        prior: Tensor | None,
        rotation: Tensor,
        drawings: Tensor,
        has_prior: Tensor | None = None,
    ) -> Tensor:
        """Predicts the occupancy of one drawing's camera grid.

        Args:
            drawing: float [B, 256, 256], ink 1 on 0.
            fields: float [B, 2, 256, 256] in 0..1, the drawing's own evidence fields.
            evidence: float [B, 2, 64, 64, 64] in 0..1, hull and match, each (depth, row, col).
            prior: float [B, 64, 64, 64], probability of occupancy (depth, row, col); None where there is none.
            rotation: float [B, 3, 3], the camera's.
            drawings: float [B], how many drawings the evidence is of.
            has_prior: float [B], 1 or 0 for each sample of a batch that mixes both; None for all alike.

        Returns:
            float [B, 64, 64, 64], logits of occupancy (depth, row, col).
        """
        batch = drawing.shape[0]
        if prior is None:
            prior = torch.zeros_like(evidence[:, 0])
            has_prior = torch.zeros(batch, device=drawing.device)
        elif has_prior is None:
            has_prior = torch.ones(batch, device=drawing.device)
        condition = torch.cat([rotation.flatten(1), has_prior[:, None], drawings[:, None] / 4], dim=1)
        code = self.condition(condition)
        volumes = torch.cat([evidence.flatten(1, 2), prior], dim=1)
        volumes = volumes.contiguous(memory_format=torch.channels_last)
        image = F.pixel_unshuffle(torch.cat([drawing[:, None], fields], dim=1), 4)
        image = image.contiguous(memory_format=torch.channels_last)

        x64 = F.relu(torch.cat([self.image(image), self.volumes(volumes)], dim=1))
        x64 = F.relu(self.joined(x64))
        x32 = _through(self.encode32, self.down32(x64), code)
        x16 = _through(self.encode16, self.down16(F.relu(x32)), code)
        x8 = _through(self.encode8, self.down8(F.relu(x16)), code)
        x8 = self.attention(x8, code)
        y16 = _through(self.decode16, x16 + _twice(self.up16(F.relu(x8))), code)
        y32 = _through(self.decode32, x32 + _twice(self.up32(F.relu(y16))), code)
        y64 = F.relu(_twice(self.up64(F.relu(y32))))
        y64 = F.relu(self.fine(torch.cat([y64, x64], dim=1)))
        out: Tensor = self.logits(y64) + self.shortcut(volumes)
        return out

    def describe(self) -> dict[str, object]:
        """The configuration as plain data, for the file beside the weights."""
        return asdict(self.config)


def _through(blocks: nn.ModuleList, x: Tensor, code: Tensor) -> Tensor:
    for block in blocks:
        x = block(x, code)
    return x


def _twice(x: Tensor) -> Tensor:
    return F.interpolate(x, scale_factor=2, mode="nearest")


def compact_loss(logits: Tensor, truth: Tensor, *, log_weight: float = 10.0, outline_weight: float = 2.0) -> Tensor:
    """Log loss of cells, log loss of the outline, and one minus the soft IoU; the mean over the batch.

    Where the depth of a thin part is uncertain, no cell along the ray is more likely than not, and the part goes
    missing. The outline's loss sees the most likely cell of each ray alone: something has to be there.

    Args:
        logits: float [B, 64, 64, 64] (depth, row, col).
        truth: float [B, 64, 64, 64], the share of each cell that is inside, 0..1.
        log_weight: factor of the cells' log loss (a mean over cells of which few are occupied).
        outline_weight: factor of the outline's log loss (a mean over rays).
    """
    logits = logits.float()
    log_loss = F.binary_cross_entropy_with_logits(logits, truth)
    outline_loss = F.binary_cross_entropy_with_logits(logits.amax(dim=1), truth.amax(dim=1))
    p = logits.sigmoid()
    both = (p * truth).sum(dim=(1, 2, 3))
    either = (p + truth - p * truth).sum(dim=(1, 2, 3))
    return log_weight * log_loss + outline_weight * outline_loss + (1 - (both + 1) / (either + 1)).mean()


def compact_inputs(
    drawings: NDArray[np.uint8],
    fields: NDArray[np.uint8],
    evidence: NDArray[np.uint8],
    prior: NDArray[np.float32],
    cameras: NDArray[np.float64],
    counts: NDArray[np.integer],
    has_prior: NDArray[np.bool_],
    device: torch.device,
) -> dict[str, Tensor]:
    """The arguments of `CompactNet.forward` from the kernels' arrays, one entry a pass.

    Args:
        drawings: uint8 [B, 256, 256], ink 255.
        fields: uint8 [B, 256, 256, 2], the same drawings' `_core.evidence_fields`.
        evidence: uint8 [B, 2, 64, 64, 64], `_core.evidence` of all drawings in the pass's camera grid.
        prior: float32 [B, 64, 64, 64], probability in the camera grid.
        cameras: float64 [B, 15], packed.
        counts: [B], how many drawings the evidence is of.
        has_prior: [B], whether the prior means anything.
        device: where the tensors go.
    """

    def unit(array: NDArray[np.uint8]) -> Tensor:
        return torch.from_numpy(array).to(device).float() / 255

    def numbers(array: NDArray[np.generic]) -> Tensor:
        return torch.from_numpy(array).to(device).float()

    return {
        "drawing": unit(drawings),
        "fields": unit(fields).permute(0, 3, 1, 2),
        "evidence": unit(evidence),
        "prior": numbers(prior),
        "rotation": numbers(cameras[:, 3:12].reshape(-1, 3, 3)),
        "drawings": numbers(counts),
        "has_prior": numbers(has_prior),
    }
