"""Which device to compute on, and in which precision and layout."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

Net = TypeVar("Net", bound=nn.Module)


def pick_device(device: str | torch.device | None = None) -> torch.device:
    """The device asked for; CUDA where there is one, else the CPU, when none is.

    Raises:
        ValueError: for a CUDA device on a machine that has none, or a name that torch does not know.
    """
    if device is None:
        return torch.device("cuda" if torch.cuda.is_available() else "cpu")
    try:
        chosen = torch.device(device)
    except RuntimeError as error:
        raise ValueError(f"unknown device {device!r}; 'cpu' and 'cuda' are known") from error
    if chosen.type == "cuda" and not torch.cuda.is_available():
        raise ValueError("no CUDA device is available here; leave device out to use the CPU")
    return chosen


def has_fast_bfloat16(device: torch.device) -> bool:
    """Whether bfloat16 convolutions are faster than float32 ones: CUDA, and CPUs with AVX-512 bf16 or AMX."""
    if device.type == "cuda":
        return bool(torch.cuda.is_bf16_supported())
    checks = ("_is_avx512_bf16_supported", "_is_amx_tile_supported")
    return device.type == "cpu" and any(bool(getattr(torch.cpu, c, bool)()) for c in checks)


def has_own_convolutions(device: torch.device) -> bool:
    """Whether the kernels' convolutions, in float32, are faster than torch's: on CPUs without AMX."""
    return device.type == "cpu" and not bool(getattr(torch.cpu, "_is_amx_tile_supported", bool)())


def fast_dtype(device: torch.device) -> torch.dtype:
    """The type in which convolutions are fastest: bfloat16 or float32."""
    return torch.bfloat16 if has_fast_bfloat16(device) else torch.float32


def autocast(device: torch.device, enabled: bool = True) -> torch.autocast:
    """A context in which convolutions run in bfloat16 where that is faster."""
    return torch.autocast(device.type, torch.bfloat16, enabled=enabled and has_fast_bfloat16(device))


def place(net: Net, device: torch.device) -> Net:
    """The network on a device, laid out channels last, which is what convolutions are fastest on."""
    net = net.to(device)
    for module in net.modules():
        if isinstance(module, nn.Conv3d):
            module.to(memory_format=torch.channels_last_3d)
        elif isinstance(module, nn.Conv2d | nn.ConvTranspose2d):
            module.to(memory_format=torch.channels_last)
    return net


def unit(array: NDArray[np.uint8], device: torch.device) -> Tensor:
    """Bytes as a float32 tensor in 0..1 on a device."""
    return torch.from_numpy(np.ascontiguousarray(array)).to(device).float() / 255
