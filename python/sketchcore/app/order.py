"""What a session asks of those who reconstruct, and what they say of how far they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Progress:
    """How far a reconstruction is.

    Attributes:
        round: that was last handed back; 0 is the first prediction.
        rounds: that will be run at most.
        working: whether a thread is at it.
        waiting: whether it waits for one.
    """

    round: int = 0
    rounds: int = 0
    working: bool = False
    waiting: bool = False


@dataclass(frozen=True)
class Order:
    """What is to be reconstructed.

    Attributes:
        part: id of the current part.
        print: of its drawings: the same as long as they have the same ink.
        drawings: uint8 [256, 256] each, ink 255 on 0, a three-quarter one first.
        viewpoints: their names.
    """

    part: str
    print: str
    drawings: tuple[NDArray[np.uint8], ...]
    viewpoints: tuple[str, ...]
