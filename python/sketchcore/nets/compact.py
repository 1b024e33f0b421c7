"""The network whose weights ship: drawings are understood as images, then lifted into the world and fused there.

It differs from the paper's pair of networks (`unet.py`) in where it thinks. An encoder describes each drawing by
features at every pixel and depth of its frustum. Each cell of the world grid reads them at its projection, from every
drawing and, since shapes are symmetric about z = 0, at its mirror image's as well. A decoder then works in the world,
where all drawings meet: any number of them takes one pass. Handed its own output as the prior, it takes a further
round.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional as F

from sketchcore.nets.config import CompactConfig
from sketchcore.nets.decoder import WorldDecoder
from sketchcore.nets.encoder import DrawingEncoder
from sketchcore.nets.lift import COARSE, lift
from sketchcore.nets.precision import unit
from sketchcore.nets.sketches import Sketches


class CompactNet(nn.Module):
    """Drawings, evidence and prior in, occupancy of the half world grid z > 0 out.

    With the default configuration 9.6 M parameters; 2.8 GFLOP a drawing and 10.4 a pass (`torch.utils.flop_counter`).
    """

    def __init__(self, config: CompactConfig | None = None) -> None:
        super().__init__()
        self.config = config or CompactConfig()
        self.encoder = DrawingEncoder(self.config)
        self.reading = nn.Linear(2 * self.config.features, self.config.fused)
        self.decoder = WorldDecoder(self.config)

    def read(self, drawings: Tensor, fields: Tensor, cameras: NDArray[np.float64], counts: Sequence[int]) -> Tensor:
        """What every cell reads from all drawings of its sample; it does not change from round to round.

        Args:
            drawings: float [D, 256, 256], ink 1 on 0, those of the first sample first.
            fields: float [D, 2, 256, 256] in 0..1, `_core.evidence_fields`.
            cameras: float64 [D, 15], packed.
            counts: drawings of each sample; they add up to D.

        Returns:
            float [B, 32, 32, 16, 2 * fused]: the mean over a sample's drawings, then the largest.
        """
        rotations = torch.tensor(cameras[:, 3:12].reshape(-1, 3, 3), dtype=drawings.dtype, device=drawings.device)
        features = self.encoder(drawings, fields, rotations)
        each = F.relu(self.reading(lift(features, cameras)))
        fused = [torch.cat([own.mean(dim=0), own.amax(dim=0)], dim=-1) for own in torch.split(each, list(counts))]
        return torch.stack(fused).view(len(fused), *COARSE, -1)

    def decide(
        self, readings: Tensor, evidence: Tensor, prior: Tensor, has_prior: Tensor, counts: Sequence[int]
    ) -> Tensor:
        """Occupancy from what was read, the evidence and a prior.

        Args:
            readings: float [B, 32, 32, 16, 2 * fused], from `read`.
            evidence: float [B, 3, 64, 64, 32] in 0..1, `_core.evidence` of each sample's drawings.
            prior: float [B, 64, 64, 32], probability of occupancy; zeros where there is none.
            has_prior: float [B], 1 where there is one.
            counts: drawings of each sample.

        Returns:
            float32 [B, 64, 64, 32] (x, y, z), logits of occupancy.
        """
        number = torch.tensor(counts, device=has_prior.device, dtype=has_prior.dtype) / 4
        out: Tensor = self.decoder(readings, evidence, prior, torch.stack([has_prior, number], dim=1))
        return out

    def forward(
        self,
        drawings: Tensor,
        fields: Tensor,
        cameras: NDArray[np.float64],
        counts: Sequence[int],
        evidence: Tensor,
        prior: Tensor,
        has_prior: Tensor,
    ) -> Tensor:
        """`read`, then `decide`."""
        return self.decide(self.read(drawings, fields, cameras, counts), evidence, prior, has_prior, counts)

    def describe(self) -> dict[str, object]:
        """The configuration as plain data, for the file beside the weights."""
        return asdict(self.config)


def read_inputs(samples: Sequence[Sketches], device: torch.device) -> dict[str, Any]:
    """The arguments of `CompactNet.read` for the drawings of several objects."""
    return {
        "drawings": unit(np.concatenate([s.drawings for s in samples]), device),
        "fields": unit(np.concatenate([s.fields for s in samples]), device).permute(0, 3, 1, 2),
        "cameras": np.concatenate([s.cameras for s in samples]),
        "counts": [len(s) for s in samples],
    }
