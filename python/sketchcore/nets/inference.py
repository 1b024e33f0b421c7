"""`CompactNet` as a reconstruction runs it by torch, on a GPU: weights cast once, and nothing computed twice.

The first layer of the decoder is linear in what was read, in the evidence and in the prior. The prior alone changes
from round to round, so what the layer makes of all else is kept. On the CPU the same is done without torch
(`native.py`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import deepcopy

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from sketchcore.nets.cells import Cells
from sketchcore.nets.compact import CompactNet, read_inputs
from sketchcore.nets.decoder import EVIDENCE, fold
from sketchcore.nets.lift import COARSE, lift
from sketchcore.nets.precision import fast_dtype, place, unit
from sketchcore.nets.sketches import Sketches

PAIR = 2
"""Drawings that are encoded side by side: more are no faster, and each takes 10 MB meanwhile."""


class CompactInference:
    """A network whose weights no longer change. It answers as the network does, up to rounding.

    Args:
        net: the network; it stays as it is.
        device: where to compute.
        dtype: what to convolve in; None for what is held to be fastest there.
    """

    def __init__(self, net: CompactNet, device: torch.device, dtype: torch.dtype | None = None) -> None:
        self.device = device
        self.dtype = fast_dtype(device) if dtype is None else dtype
        cast = {id(p): nn.Parameter(p.detach().to(device, self.dtype), False) for p in net.parameters()}
        self._net = place(deepcopy(net, cast), device).eval()
        self._reading = [p.detach().to(device, torch.float32) for p in (net.reading.weight, net.reading.bias)]
        layers = (net.decoder.into, net.decoder.shortcut)
        weight = torch.cat([layer.weight.detach().flatten(1) for layer in layers]).to(device, torch.float32).t()
        bias = torch.cat([layer.bias.detach() for layer in layers if layer.bias is not None])
        seen, self._evidence, prior, where = torch.split(weight, [2 * net.config.fused, 8 * EVIDENCE, 8, 3])
        self._seen, self._prior = seen.to(self.dtype), prior.to(self.dtype)
        places = net.decoder.place.detach().to(device, torch.float32).flatten(0, 2)
        self._where = torch.addmm(bias.to(device, torch.float32), places, where)

    @torch.inference_mode()
    def read(self, samples: Sequence[Sketches]) -> list[Tensor]:
        """What does not change from round to round: the decoder's first layers, but for the prior.

        Returns:
            for each object [32 * 32 * 16, width of the decoder's first layer + 8].
        """
        inputs = read_inputs(samples, self.device)
        cameras, counts = inputs["cameras"], inputs["counts"]
        rotations = torch.from_numpy(cameras[:, 3:12]).to(self.device, self.dtype).view(-1, 3, 3)
        drawings, fields = (inputs[name].to(self.dtype) for name in ("drawings", "fields"))
        each = torch.empty(len(cameras), math.prod(COARSE), len(self._reading[1]), device=self.device)
        for first in range(0, len(cameras), PAIR):
            some = slice(first, first + PAIR)
            lifted = lift(self._net.encoder(drawings[some], fields[some], rotations[some]), cameras[some])
            each[some] = F.linear(lifted, *self._reading).relu_()
        out = []
        for own, sketches in zip(torch.split(each, counts), samples, strict=True):
            seen = torch.cat([own.mean(dim=0), own.amax(dim=0)], dim=-1).to(self.dtype)
            evidence = fold(unit(sketches.evidence, self.device)[None]).flatten(0, 3)
            kept = torch.addmm(self._where, evidence, self._evidence).to(self.dtype)
            out.append(torch.addmm(kept, seen, self._seen))
        return out

    @torch.inference_mode()
    def decide(self, readings: Sequence[Tensor], prior: Cells | None, counts: Sequence[int]) -> Cells:
        """Occupancy from what was read and a prior, as `Passes.decide` says."""
        decoder, read, batch = self._net.decoder, torch.stack(list(readings)), len(readings)
        if prior is not None:
            known = torch.from_numpy(np.ascontiguousarray(prior)).to(self.device, self.dtype)
            read = read + known.view(batch, -1, 8) @ self._prior
        x, shortcut = (
            part.contiguous().view(batch, *COARSE, -1).permute(0, 4, 1, 2, 3)
            for part in torch.split(read, [read.shape[-1] - 8, 8], dim=-1)
        )
        condition = [[float(prior is not None), count / 4] for count in counts]
        code = decoder.condition(torch.tensor(condition, dtype=self.dtype, device=self.device))
        cells: Cells = decoder.fuse(x, shortcut, code).permute(0, 2, 3, 4, 1).float().sigmoid().cpu().numpy()
        return cells
