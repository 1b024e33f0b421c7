"""Weights on disk: `NAME.safetensors` with the config that rebuilds their network beside it, `NAME.json`.

Nothing is ever pickled, so opening a stranger's weights runs no code of theirs.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any, cast

import torch
from safetensors.torch import load_file, save
from torch import Tensor

from sketchcore.atomic import replacing
from sketchcore.untrusted import check_size, parse_json, reason

SUFFIX = ".safetensors"
PRETRAINED = cast(Path, files("sketchcore") / "pretrained" / "compact.safetensors")
"""The weights inside the package."""
MAX_BYTES = 2**31
"""Of a file of weights."""
MAX_HEADER = 2**24
"""Bytes of its header, which says what tensors there are."""
MAX_CONFIG = 2**20
"""Bytes of the config."""
_STORED = (
    torch.float16,
    torch.bfloat16,
    torch.float32,
    torch.float64,
    torch.int64,
    torch.int32,
    torch.uint8,
    torch.bool,
)


def save_weights(
    path: str | os.PathLike[str],
    state_dict: Mapping[str, Tensor],
    config: Mapping[str, Any],
    dtype: torch.dtype | None = torch.float16,
) -> None:
    """Write weights and their config; each file appears whole or not at all.

    Stored are all tensors of the state dict under their names: floating-point ones (weights, biases, running
    statistics) rounded to `dtype`, integer buffers (`num_batches_tracked`) as they are. The config becomes
    UTF-8 JSON in the file of the same stem that ends in .json; its tuples come back as lists. The config is
    replaced first, then the weights.

    Args:
        path: file to write, ending in .safetensors, in a folder that exists.
        state_dict: tensors by name, on any device, in any memory layout.
        config: what rebuilds the network; JSON values only.
        dtype: floating-point type to store (float16, bfloat16, ...); None keeps each tensor's own.

    Raises:
        ValueError: if the suffix is wrong, the dtype is no floating-point type, a weight is not finite or too
            large for the dtype, or the config holds a NaN or an infinite number. Nothing is written then.
        TypeError: if the config holds what JSON cannot. Nothing is written then.
        FileNotFoundError: if the folder does not exist.
    """
    path = _checked(path)
    if dtype is not None and not dtype.is_floating_point:
        raise ValueError(f"weights are stored in a floating-point dtype or None, got {dtype}")
    text = json.dumps(dict(config), indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    stored = {
        name: tensor.detach().to(
            "cpu",
            dtype if tensor.is_floating_point() else None,
            copy=True,  # tied weights are stored twice: safetensors refuses shared memory
            memory_format=torch.contiguous_format,
        )
        for name, tensor in state_dict.items()
    }
    _refuse_non_finite(stored, f"to be stored as {dtype or 'they are'}")
    with replacing(path) as weights, replacing(path.with_suffix(".json")) as beside:
        beside.write_bytes(text.encode())  # both fit on the disk, or neither takes its place
        weights.write_bytes(save(stored))


def load_weights(path: str | os.PathLike[str]) -> tuple[dict[str, Tensor], dict[str, Any]]:
    """Read what `save_weights` wrote.

    Args:
        path: the .safetensors file; its config is looked for beside it.

    Returns:
        The state dict on the CPU, floating-point tensors as float32 and integer ones as stored; the config.

    Raises:
        FileNotFoundError: if the weights or their config are missing.
        ValueError: if the suffix is wrong, either file is truncated, corrupt, of another kind or too large (weights
            2 GiB, their header 16 MiB, the config 1 MiB), or a weight is not finite.
    """
    path = _checked(path)
    config_path = path.with_suffix(".json")
    if not path.is_file():
        raise FileNotFoundError(f"no weights at {path}")
    check_size(path, MAX_BYTES, "file of weights")
    if not config_path.is_file():
        raise FileNotFoundError(f"weights {path} need their config beside them; {config_path} is missing")
    check_size(config_path, MAX_CONFIG, "config")
    config = parse_json(config_path.read_bytes(), f"config {config_path}")
    if not isinstance(config, dict):
        raise ValueError(f"config {config_path} must be a JSON object, got {type(config).__name__}")
    stored = _tensors(path)
    _refuse_non_finite(stored, f"in {path}")
    return {name: _widened(stored.pop(name)) for name in list(stored)}, config


def _tensors(path: Path) -> dict[str, Tensor]:
    damaged = f"weights {path} are truncated, corrupt or no safetensors file"
    with path.open("rb") as file:
        if int.from_bytes(file.read(8), "little") > MAX_HEADER:
            raise ValueError(f"{damaged}: their header would have more than {MAX_HEADER // 2**20} MiB")
    try:
        stored: dict[str, Tensor] = load_file(path)
    except MemoryError:
        raise
    except Exception as error:  # what dtypes and sizes torch cannot have, it says in its own ways
        raise ValueError(f"{damaged}: {reason(error)}") from error
    for name, tensor in stored.items():
        if tensor.dtype not in _STORED:
            raise ValueError(f"weights {path} hold {name[:80]} as {tensor.dtype}; networks have float16 to float64")
    return stored


def _widened(tensor: Tensor) -> Tensor:
    return tensor.float() if tensor.is_floating_point() else tensor


def _checked(path: str | os.PathLike[str]) -> Path:
    path = Path(path)
    if path.suffix != SUFFIX:
        raise ValueError(f"weights are stored as {SUFFIX}, got {path.name!r}")
    return path


def _refuse_non_finite(tensors: Mapping[str, Tensor], where: str) -> None:
    bad = sorted(name for name, t in tensors.items() if t.is_floating_point() and not t.isfinite().all())
    if bad:
        more = f" and {len(bad) - 3} more" if len(bad) > 3 else ""
        raise ValueError(f"weights {where} have NaN or infinite entries: {', '.join(bad[:3])}{more}")
