"""Solids as sessions keep them: bytes under a key, and which drawings they belong to."""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from sketchcore.grids import SIDE

Solid = NDArray[np.uint8]
"""uint8 [64, 64, 64], world grid (x, y, z), probability of occupancy * 255. Read only."""

_REMEMBERED = 16
"""Solids that no document needs, and that undo would have to make again."""


class Solids:
    """A table of solids by key, and of what they were made of. Not for several threads at once.

    Attributes:
        volumes: key -> solid. Keys are made of what is in them, so a key's solid never changes.
    """

    def __init__(self, volumes: Mapping[str, Solid]) -> None:
        self.volumes = {key: as_solid(volume) for key, volume in volumes.items()}
        self._made_of: OrderedDict[str, str] = OrderedDict()

    def add(self, solid: Solid, made_of: str) -> str:
        """Keeps a solid that was made of certain drawings; returns its key."""
        key = key_of(solid)
        self.volumes[key] = solid
        self.learn(made_of, key)
        return key

    def learn(self, made_of: str, key: str) -> None:
        """Says what a solid was made of."""
        self._made_of[made_of] = key
        self._made_of.move_to_end(made_of)

    def of(self, made_of: str) -> str | None:
        """The key of the solid that was made of certain drawings; None if it is not known any more."""
        return self._made_of.get(made_of)

    def keep(self, needed: Collection[str]) -> None:
        """Drops all solids but those needed, and the last few that may be wanted again."""
        spare = [made_of for made_of, key in self._made_of.items() if key not in needed]
        for made_of in spare[: max(0, len(spare) - _REMEMBERED)]:
            del self._made_of[made_of]
        kept = {*needed, *self._made_of.values()}
        self.volumes = {key: volume for key, volume in self.volumes.items() if key in kept}


def as_solid(volume: NDArray[np.generic]) -> Solid:
    """A volume as sessions keep it; floats in [0, 1] are multiplied by 255.

    Raises:
        ValueError: for another shape, NaN, or values outside [0, 1].
        TypeError: for another dtype.
    """
    array = np.asarray(volume)
    if array.shape != (SIDE,) * 3:
        raise ValueError(f"a solid must have shape [64, 64, 64], got {list(array.shape)}")
    if array.dtype == np.uint8:
        if not array.flags.writeable and array.flags.c_contiguous:
            return array.view(np.uint8)
        solid = array.astype(np.uint8, order="C")
    elif array.dtype.kind == "f":
        values = array.astype(np.float32)
        if not ((values >= 0) & (values <= 1)).all():
            raise ValueError("the probabilities of a solid must lie in [0, 1], without NaN")
        solid = np.ascontiguousarray(np.rint(values * 255).astype(np.uint8))
    else:
        raise TypeError(f"a solid is uint8 or float, got {array.dtype}")
    solid.setflags(write=False)
    return solid


def key_of(solid: Solid) -> str:
    """What a solid is known by: 32 hexadecimal digits that its values alone decide."""
    return hashlib.sha256(solid.tobytes()).hexdigest()[:32]
