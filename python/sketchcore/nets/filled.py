"""A torch network with given weights, and nothing allocated that they do not ask for."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.overrides import TorchFunctionMode

from sketchcore.untrusted import reason

Net = TypeVar("Net", bound=nn.Module)


def filled(make: Callable[[], Net], weights: Mapping[str, NDArray[Any]], kind: str) -> Net:
    """A network with its weights: these very arrays, which are not copied.

    It is made without memory first. So a config can ask for no more than is in the file of its weights.

    Raises:
        ValueError: if the network cannot be made, or its weights are others.
    """
    state = {name: torch.from_numpy(array) for name, array in weights.items()}
    try:
        with torch.device("meta"), _Unfilled():
            expected = make().state_dict()
    except (TypeError, ValueError, RuntimeError, ArithmeticError) as error:
        raise ValueError(
            f"the config is wrong, or of another version of the network {kind!r}: {reason(error)}"
        ) from error
    for name, like in expected.items():
        given = state.get(name)
        if given is None:
            raise ValueError(f"the weights do not fit the network of their config: there is no {name}")
        if given.shape != like.shape or given.is_floating_point() != like.is_floating_point():
            sides, has = list(like.shape), f"{list(given.shape)[:8]} of {given.dtype}"
            raise ValueError(f"the weights do not fit the network of their config: {name} must be {sides}, got {has}")
    if unknown := sorted(set(state) - set(expected)):
        raise ValueError(f"the weights do not fit the network of their config: it has no {unknown[0][:80]}")
    with _Unfilled():
        net = make()
    net.load_state_dict(state, assign=True)
    return net


class _Unfilled(TorchFunctionMode):
    """Networks are made without their random beginnings: memory that is never written to takes no room."""

    def __torch_function__(self, func: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        if func in _FILLS or getattr(func, "__module__", None) == "torch.nn.init":
            return args[0] if args else kwargs["tensor"]
        return func(*args, **(kwargs or {}))


_FILLS = {Tensor.uniform_, Tensor.normal_, Tensor.zero_, Tensor.fill_}
