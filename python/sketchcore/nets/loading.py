"""Models of stored weights. torch is imported where it is needed: the compact network does without it on the CPU."""

from __future__ import annotations

import ctypes
import sys
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from sketchcore.nets.compactmodel import CompactModel
from sketchcore.nets.config import CompactConfig
from sketchcore.nets.model import Model
from sketchcore.nets.native import CompactNative
from sketchcore.nets.passes import Passes
from sketchcore.untrusted import reason

if TYPE_CHECKING:
    import torch

    from sketchcore.nets.compact import CompactNet


def build_model(
    weights: Mapping[str, NDArray[Any]], config: Mapping[str, Any], device: str | torch.device | None = None
) -> Model:
    """The model of stored weights (`nets/weights.py`).

    Raises:
        ValueError: if the config names no known network, the weights do not fit it, or there is no such device.
    """
    kind, options = config.get("network"), config.get("options", {})
    if not isinstance(options, dict):
        raise ValueError(f"the options of a network are an object in the config, got {type(options).__name__}")
    if kind == "compact":
        try:
            widths = CompactConfig.of_options(options)
        except (TypeError, ValueError) as error:
            raise ValueError(
                f"the config is wrong, or of another version of the network {kind!r}: {reason(error)}"
            ) from error
        return CompactModel(_compact(weights, widths, device))
    if kind == "paper":
        return _paper(weights, options, device)
    if kind == "multiscale":
        from sketchcore.nets.filled import filled
        from sketchcore.nets.multiscale import MultiscaleNet
        from sketchcore.nets.precision import pick_device
        from sketchcore.nets.singleview import SingleViewModel

        return SingleViewModel(filled(lambda: MultiscaleNet(**options), weights, kind), pick_device(device))
    raise ValueError(f"unknown network {kind!r:.80} in the config; 'compact', 'paper' and 'multiscale' are known")


def passes_of(net: CompactNet, device: torch.device) -> Passes:
    """The passes of a network that was trained, computed as they are after it was stored."""
    if device.type == "cpu":
        return CompactNative({name: t.detach().cpu().numpy() for name, t in net.state_dict().items()}, net.config)
    from sketchcore.nets.inference import CompactInference

    return CompactInference(net, device)


def on_cpu(device: str | torch.device | None) -> bool:
    """Whether a device is the CPU. torch is asked only where it might be another one.

    Raises:
        ValueError: if there is no such device.
    """
    if str(device) == "cpu" or (device is None and not _has_driver()):
        return True
    from sketchcore.nets.precision import pick_device

    return pick_device(device).type == "cpu"


def _has_driver() -> bool:
    """Whether the machine has a driver for CUDA."""
    try:
        ctypes.CDLL("nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1")
    except OSError:
        return False
    return True


def _compact(weights: Mapping[str, NDArray[Any]], config: CompactConfig, device: str | torch.device | None) -> Passes:
    if on_cpu(device):
        return CompactNative(weights, config)
    from sketchcore.nets.compact import CompactNet
    from sketchcore.nets.filled import filled
    from sketchcore.nets.inference import CompactInference
    from sketchcore.nets.precision import pick_device

    return CompactInference(filled(lambda: CompactNet(config), weights, "compact"), pick_device(device))


def _paper(weights: Mapping[str, NDArray[Any]], options: Mapping[str, Any], device: str | torch.device | None) -> Model:
    from sketchcore.nets.filled import filled
    from sketchcore.nets.papermodel import PaperModel
    from sketchcore.nets.precision import pick_device
    from sketchcore.nets.unet import PaperNet

    parts = sorted({name.split(".", 1)[0] for name in weights})
    if parts not in (["single"], ["single", "updater"]):
        raise ValueError(f"weights of the network 'paper' hold 'single' and 'updater', got {parts[:5]}")
    single, *updater = (
        filled(
            partial(PaperNet, **{**options, "updater": part == "updater"}),
            {name.removeprefix(f"{part}."): t for name, t in weights.items() if name.startswith(f"{part}.")},
            "paper",
        )
        for part in parts
    )
    return PaperModel(single, updater[0] if updater else None, pick_device(device))
