"""Where results go: a fresh array, or the caller's own, so that loops need not allocate."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

Number = TypeVar("Number", bound=np.generic)


def destination(out: object, shape: tuple[int, ...], dtype: type[Number], name: str = "out") -> NDArray[Number]:
    """`out`, checked; or a fresh array that is not filled, if it is None.

    Raises:
        ValueError: for another shape, or an array that is not C-contiguous or not writeable.
        TypeError: for another dtype, or what is no array.
    """
    if out is None:
        return np.empty(shape, dtype)
    if not isinstance(out, np.ndarray) or out.dtype != dtype:
        raise TypeError(f"{name} must be a {np.dtype(dtype)} array")
    if out.shape != shape:
        raise ValueError(f"{name} must have shape {list(shape)}, got {list(out.shape)}")
    if not (out.flags.c_contiguous and out.flags.writeable):
        raise ValueError(f"{name} must be C-contiguous and writeable")
    return out
