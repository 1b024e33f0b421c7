"""What the compact network is trained on."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional as F


def occupancy_loss(logits: Tensor, truth: Tensor, *, log_weight: float = 10.0, outline_weight: float = 2.0) -> Tensor:
    """Log loss of voxels, log loss of the outlines along x, y and z, and one minus the soft IoU; mean over the batch.

    Where the place of a thin part is uncertain, no voxel is more likely than not, and the part goes missing. The
    outlines' loss sees the most likely voxel of each line alone: something has to be there.

    Fractions have a soft IoU, too: the smaller of two is what they share, the larger what they cover.

    Args:
        logits: float [B, 64, 64, 32] (x, y, z).
        truth: float [B, 64, 64, 32] in 0..1, occupancy.
        log_weight: factor of the voxels' log loss (a mean over voxels of which few are occupied).
        outline_weight: factor of the outlines' log loss (a mean over lines).
    """
    logits = logits.float()
    log_loss = F.binary_cross_entropy_with_logits(logits, truth)
    outlines = [F.binary_cross_entropy_with_logits(logits.amax(dim=axis), truth.amax(dim=axis)) for axis in (1, 2, 3)]
    p = logits.sigmoid()
    both = torch.minimum(p, truth).sum(dim=(1, 2, 3))
    either = torch.maximum(p, truth).sum(dim=(1, 2, 3))
    overlap = (both + 1) / (either + 1)
    return log_weight * log_loss + outline_weight * torch.stack(outlines).mean() + (1 - overlap).mean()


def distance_loss(distance: Tensor, truth: Tensor) -> Tensor:
    """The mean error of signed distances, in voxels: an absolute value, since doubt has two sides and no middle.

    Args:
        distance: float [B, 64, 64, 32] (x, y, z), predicted.
        truth: float [B, 64, 64, 32], truncated (`truth.py`).
    """
    return F.l1_loss(distance.float(), truth)
