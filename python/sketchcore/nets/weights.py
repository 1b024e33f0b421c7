"""Weights from disk: `NAME.safetensors` with the config that rebuilds their network beside it, `NAME.json`.

Nothing is ever pickled, so opening a stranger's weights runs no code of theirs. `nets/storing.py` writes them.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from importlib.resources import files
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from safetensors import deserialize

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
_STORED = {
    "F16": np.float16,
    "BF16": np.uint16,  # the upper half of a float32, which NumPy does not know
    "F32": np.float32,
    "F64": np.float64,
    "I64": np.int64,
    "I32": np.int32,
    "U8": np.uint8,
    "BOOL": np.bool_,
}


def load_weights(path: str | os.PathLike[str]) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Reads what `save_weights` wrote. torch is not imported.

    Args:
        path: the .safetensors file; its config is looked for beside it.

    Returns:
        The arrays of the state dict by name, floating-point ones as float32 and integer ones as stored; the config.

    Raises:
        FileNotFoundError: if the weights or their config are missing.
        ValueError: if the suffix is wrong, either file is truncated, corrupt, of another kind or too large (weights
            2 GiB, their header 16 MiB, the config 1 MiB), or a weight is not finite.
    """
    path = checked_path(path)
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
    arrays = _arrays(path)
    refuse_non_finite((name for name, array in arrays.items() if not np.isfinite(array).all()), f"in {path}")
    return arrays, config


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    damaged = f"weights {path} are truncated, corrupt or no safetensors file"
    with path.open("rb") as file:
        if int.from_bytes(file.read(8), "little") > MAX_HEADER:
            raise ValueError(f"{damaged}: their header would have more than {MAX_HEADER // 2**20} MiB")
    try:
        stored = deserialize(path.read_bytes())  # type: ignore[no-untyped-call]
    except MemoryError:
        raise
    except Exception as error:  # what is wrong with a file, the library says in its own ways
        raise ValueError(f"{damaged}: {reason(error)}") from error
    arrays = {}
    for name, entry in stored:
        dtype = _STORED.get(entry["dtype"])
        if dtype is None:
            raise ValueError(f"weights {path} hold {name[:80]} as {entry['dtype']}; networks have F16 to F64")
        array = np.frombuffer(entry["data"], dtype).reshape(entry["shape"])
        if entry["dtype"] == "BF16":
            array = (array.astype(np.uint32) << 16).view(np.float32)
        arrays[name] = array.astype(np.float32 if array.dtype.kind == "f" else array.dtype)
    return arrays


def checked_path(path: str | os.PathLike[str]) -> Path:
    """The path of weights.

    Raises:
        ValueError: if its suffix is another one.
    """
    path = Path(path)
    if path.suffix != SUFFIX:
        raise ValueError(f"weights are stored as {SUFFIX}, got {path.name!r}")
    return path


def refuse_non_finite(names: Iterable[str], where: str) -> None:
    """Raises a ValueError that names the weights with such entries, if there are any."""
    if bad := sorted(names):
        more = f" and {len(bad) - 3} more" if len(bad) > 3 else ""
        raise ValueError(f"weights {where} have NaN or infinite entries: {', '.join(bad[:3])}{more}")
