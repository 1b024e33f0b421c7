"""Solid shapes as a sequence of cuboids and cylinders, added or subtracted (paper, section 4.1)."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

_OPS = ("add", "subtract")
_AXES = ("x", "y", "z")


def _triple(value: Sequence[float], name: str) -> tuple[float, float, float]:
    array = np.asarray(value, dtype=np.float64)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise ValueError(f"{name} must be three finite numbers, got {value!r}")
    return float(array[0]), float(array[1]), float(array[2])


def _check(center: Sequence[float], half: Sequence[float], op: str) -> tuple[Any, Any]:
    if op not in _OPS:
        raise ValueError(f"op must be 'add' or 'subtract', got {op!r}")
    checked = _triple(half, "half")
    if min(checked) <= 0:
        raise ValueError(f"half sizes must be more than 0, got {checked}")
    return _triple(center, "center"), checked


@dataclass(frozen=True)
class Cuboid:
    """An axis-aligned box.

    Attributes:
        center: world x, y, z.
        half: half of the extent along x, y, z, each more than 0.
        op: "add" or "subtract".
    """

    center: tuple[float, float, float]
    half: tuple[float, float, float]
    op: str = "add"

    def __post_init__(self) -> None:
        center, half = _check(self.center, self.half, self.op)
        object.__setattr__(self, "center", center)
        object.__setattr__(self, "half", half)


@dataclass(frozen=True)
class Cylinder:
    """A cylinder along one world axis; its cross-section may be an ellipse.

    Attributes:
        center: world x, y, z.
        half: half of the extent along x, y, z, each more than 0: two radii, and half the length along `axis`.
        axis: "x", "y" or "z".
        op: "add" or "subtract".
    """

    center: tuple[float, float, float]
    half: tuple[float, float, float]
    axis: str = "y"
    op: str = "add"

    def __post_init__(self) -> None:
        if self.axis not in _AXES:
            raise ValueError(f"axis must be 'x', 'y' or 'z', got {self.axis!r}")
        center, half = _check(self.center, self.half, self.op)
        object.__setattr__(self, "center", center)
        object.__setattr__(self, "half", half)


Primitive = Cuboid | Cylinder


@dataclass(frozen=True)
class Shape:
    """Primitives in order: a point is inside when the *last* primitive that contains it is additive.

    Attributes:
        primitives: `Cuboid` and `Cylinder`, at least one.

    Raises:
        ValueError: for no primitives.
        TypeError: for anything that is no primitive.
    """

    primitives: tuple[Primitive, ...]

    def __init__(self, primitives: Iterable[Primitive]) -> None:
        items = tuple(primitives)
        if not items:
            raise ValueError("a Shape needs at least one primitive")
        for item in items:
            if not isinstance(item, Cuboid | Cylinder):
                raise TypeError(f"a Shape is made of Cuboid and Cylinder, got {type(item).__name__}")
        object.__setattr__(self, "primitives", items)

    @property
    def packed(self) -> NDArray[np.float64]:
        """float64 [n, 8], the form the Rust core takes: kind, op, center, half.

        Kind is 0 for a cuboid, 1, 2 or 3 for a cylinder along x, y or z; op is 1 to add, 0 to subtract.
        """
        rows = [
            (
                1.0 + _AXES.index(item.axis) if isinstance(item, Cylinder) else 0.0,
                float(item.op == "add"),
                *item.center,
                *item.half,
            )
            for item in self.primitives
        ]
        return np.array(rows, dtype=np.float64)

    @classmethod
    def from_packed(cls, packed: NDArray[np.float64]) -> Shape:
        """The shape of packed rows (see `packed`)."""
        items: list[Primitive] = []
        for row in packed.tolist():
            kind, op = int(row[0]), "add" if row[1] else "subtract"
            center, half = (row[2], row[3], row[4]), (row[5], row[6], row[7])
            items.append(Cylinder(center, half, _AXES[kind - 1], op) if kind else Cuboid(center, half, op))
        return cls(items)

    def to_json(self) -> str:
        """The shape as JSON: `{"primitives": [{"kind": "cuboid", "center": ..., "half": ..., "op": ...}]}`."""
        return json.dumps({"primitives": [_as_dict(item) for item in self.primitives]})

    @classmethod
    def from_json(cls, text: str | dict[str, Any]) -> Shape:
        """The shape of a JSON text, or of the dictionary that one holds; other keys of it are ignored.

        Raises:
            ValueError: if the text is no JSON, or a primitive lacks an entry or has a wrong one.
        """
        data = json.loads(text) if isinstance(text, str) else text
        if not isinstance(data, dict) or not isinstance(data.get("primitives"), list):
            raise ValueError('a shape in JSON is {"primitives": [...]}')
        return cls(_from_dict(item, index) for index, item in enumerate(data["primitives"]))


def _as_dict(item: Primitive) -> dict[str, Any]:
    entry: dict[str, Any] = {"kind": "cylinder" if isinstance(item, Cylinder) else "cuboid"}
    if isinstance(item, Cylinder):
        entry["axis"] = item.axis
    return entry | {"center": list(item.center), "half": list(item.half), "op": item.op}


def _from_dict(item: Any, index: int) -> Primitive:
    try:
        op = item.get("op", "add")
        if item["kind"] == "cuboid":
            return Cuboid(item["center"], item["half"], op)
        if item["kind"] == "cylinder":
            return Cylinder(item["center"], item["half"], item["axis"], op)
    except KeyError as missing:
        raise ValueError(f"primitive {index} has no {missing}") from None
    except (AttributeError, TypeError, ValueError) as error:
        raise ValueError(f"primitive {index}: {error}") from None
    raise ValueError(f"primitive {index} has kind {item['kind']!r}; the kinds are 'cuboid' and 'cylinder'")
