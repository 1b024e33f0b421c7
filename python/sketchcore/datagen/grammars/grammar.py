"""A grammar: a frozen dataclass whose fields are its amplitudes and shares, and a method that builds one shape."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sketchcore import _core
from sketchcore.datagen.grammars.parts import Dice, Parts


@dataclass(frozen=True)
class Grammar:
    """Shapes of one class. A new grammar is a subclass with fields of its own, each with a default, and `grow`.

    A field whose default is a float is a share between 0 and 1, one whose default is a pair is a range (least, most),
    one whose default is a dictionary has weights. Configs are checked by that.

    Attributes:
        cover: the world grid covers this much of the largest side.
        min_occupancy: least share of the world grid that is occupied.
        min_extent: smallest extent along any axis, in voxels.
        attempts: how often to try before giving up.

    Raises:
        ValueError: for an entry that is out of range, or of another form than its default.
    """

    cover: float = 1.2
    min_occupancy: float = 0.004
    min_extent: int = 6
    attempts: int = 200

    def __post_init__(self) -> None:
        limits = {"cover": (1.0, 10.0), "min_occupancy": (0.0, 0.999), "min_extent": (1, 63), "attempts": (1, 10**6)}
        for field in fields(self):
            value, default = getattr(self, field.name), _default(field)
            where = f"{self.name()}.{field.name}"
            if isinstance(default, Mapping):
                _check_weights(where, value, default)
            elif isinstance(default, tuple):
                object.__setattr__(self, field.name, _as_range(where, value))
            elif field.name in limits or isinstance(default, float):
                least, most = limits.get(field.name, (0.0, 1.0))
                if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
                    raise ValueError(f"{where} must lie between {least} and {most}, got {value!r}")

    @classmethod
    def name(cls) -> str:
        """The grammar's name, in small letters."""
        return cls.__name__.lower()

    def grow(self, parts: Parts, dice: Dice) -> None:
        """Builds one shape: y up, its front along +x, symmetric about z = 0, in any unit and anywhere."""
        raise NotImplementedError

    def draw(self, seed: int, index: int) -> NDArray[np.float64]:
        """Shape number `index` of a seed, by the 120 % rule: packed rows, see `Shape.packed`.

        A function of (grammar, seed, index) alone. Shapes that are empty, in pieces or dust are drawn again.

        Raises:
            RuntimeError: if none was acceptable.
        """
        dice = Dice(seed, index)
        for _ in range(self.attempts):
            parts = Parts()
            self.grow(parts, dice)
            if parts.rows:
                fitted = _core.fit(np.array(parts.rows), self.cover, self.min_occupancy, self.min_extent)
                if fitted is not None:
                    return fitted
        raise RuntimeError(
            f"the grammar {self.name()!r} found no acceptable shape in {self.attempts} attempts: they were empty, in "
            "pieces or too thin"
        )

    def changed(self, config: Mapping[str, Any]) -> Self:
        """The grammar with some of its entries changed; entries of dictionaries one by one.

        Raises:
            ValueError: for an entry that it does not have, or a wrong value.
        """
        known = {field.name: _default(field) for field in fields(self)}
        for key in config:
            if key not in known:
                raise ValueError(f"the grammar {self.name()!r} has no {key!r}; it has {', '.join(known)}")
        entries = {field.name: getattr(self, field.name) for field in fields(self)} | dict(config)
        for key, value in config.items():
            if isinstance(known[key], Mapping) and isinstance(value, Mapping):
                entries[key] = {**getattr(self, key), **value}
        return type(self)(**entries)

    def to_dict(self) -> dict[str, Any]:
        """All entries, as `changed` takes them."""
        return asdict(self)


def _default(field: Any) -> Any:
    return field.default_factory() if callable(field.default_factory) else field.default


def _as_range(where: str, value: Any) -> tuple[Any, Any]:
    numbers = isinstance(value, Sequence) and all(isinstance(v, int | float) for v in value)
    if not numbers or len(value) != 2 or not -np.inf < value[0] <= value[1] < np.inf:
        raise ValueError(f"{where} must be (least, most), got {value!r}")
    return value[0], value[1]


def _check_weights(where: str, value: Any, default: Mapping[str, float]) -> None:
    if not isinstance(value, Mapping) or not set(value) <= set(default):
        raise ValueError(f"{where} has weights for {', '.join(default)}; got {value!r}")
    if not all(v >= 0 for v in value.values()) or not sum(value.values()) > 0:
        raise ValueError(f"{where}: weights must be 0 or more, and not all 0; got {value!r}")
