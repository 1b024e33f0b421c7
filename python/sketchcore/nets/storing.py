"""Weights to disk, as `nets/weights.py` reads them."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from typing import Any

import torch
from safetensors.torch import save
from torch import Tensor

from sketchcore.atomic import replacing
from sketchcore.nets.weights import checked_path, refuse_non_finite


def save_weights(
    path: str | os.PathLike[str],
    state_dict: Mapping[str, Tensor],
    config: Mapping[str, Any],
    dtype: torch.dtype | None = torch.float16,
) -> None:
    """Writes weights and their config; each file appears whole or not at all.

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
    path = checked_path(path)
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
    refuse_non_finite(
        (name for name, t in stored.items() if t.is_floating_point() and not t.isfinite().all()),
        f"to be stored as {dtype or 'they are'}",
    )
    with replacing(path) as weights, replacing(path.with_suffix(".json")) as beside:
        beside.write_bytes(text.encode())  # both fit on the disk, or neither takes its place
        weights.write_bytes(save(stored))
