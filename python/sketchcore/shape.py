"""Solid shapes as a sequence of cuboids, cylinders and wedges, added or subtracted.

Cuboids and cylinders are the paper's (section 4.1); wedges, with their slanted faces, are ours.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
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


def _check_axis(axis: str) -> None:
    if axis not in _AXES:
        raise ValueError(f"axis must be 'x', 'y' or 'z', got {axis!r}")


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
        _check_axis(self.axis)
        center, half = _check(self.center, self.half, self.op)
        object.__setattr__(self, "center", center)
        object.__setattr__(self, "half", half)


@dataclass(frozen=True)
class Wedge:
    """Half of an axis-aligned box, cut along a diagonal: a ramp, half of a gable roof, a windscreen.

    It is a prism along one world axis; its section is a right triangle.

    Attributes:
        center: world x, y, z of the box, through which the slanted face goes.
        half: half of the box's extent along x, y, z, each more than 0.
        axis: "x", "y" or "z".
        corner: the corner of the section that stays, where its right angle is: -1 or 1 along each of the two other
            axes, in the order x, y, z. Of axis "x" and corner (-1, 1), the faces at low y and at high z are whole.
        op: "add" or "subtract".

    Raises:
        ValueError: for an axis, corner or op that is none, sizes that are not more than 0, numbers that are not finite.
    """

    center: tuple[float, float, float]
    half: tuple[float, float, float]
    axis: str = "x"
    corner: tuple[int, int] = (-1, -1)
    op: str = "add"

    def __post_init__(self) -> None:
        _check_axis(self.axis)
        corner = np.asarray(self.corner, dtype=np.float64)
        if corner.shape != (2,) or not (np.abs(corner) == 1).all():
            raise ValueError(f"corner must be two signs, each -1 or 1, got {self.corner!r}")
        center, half = _check(self.center, self.half, self.op)
        object.__setattr__(self, "center", center)
        object.__setattr__(self, "half", half)
        object.__setattr__(self, "corner", (int(corner[0]), int(corner[1])))


Primitive = Cuboid | Cylinder | Wedge


@dataclass(frozen=True)
class Shape:
    """Primitives in order: a point is inside when the *last* primitive that contains it is additive.

    Attributes:
        primitives: `Cuboid`, `Cylinder` and `Wedge`, at least one.

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
            if not isinstance(item, Primitive):
                raise TypeError(f"a Shape is made of Cuboid, Cylinder and Wedge, got {type(item).__name__}")
        object.__setattr__(self, "primitives", items)

    @cached_property
    def packed(self) -> NDArray[np.float64]:
        """float64 [n, 8], the form the Rust core takes: kind, op, center, half.

        Kind is 0 for a cuboid, 1, 2 or 3 for a cylinder along x, y or z, and 4, 8 or 12 for a wedge along them, with 1
        more for a corner at the positive end of the first axis across, and 2 more for one of the second. Op is 1 to
        add, 0 to subtract. Made once, and read-only.
        """
        rows = [(_kind(item), float(item.op == "add"), *item.center, *item.half) for item in self.primitives]
        packed = np.array(rows, dtype=np.float64)
        packed.flags.writeable = False
        return packed

    @classmethod
    def from_packed(cls, packed: NDArray[np.float64]) -> Shape:
        """The shape of packed rows (see `packed`)."""
        items: list[Primitive] = []
        for row in packed.tolist():
            kind, op = int(row[0]), "add" if row[1] else "subtract"
            center, half = (row[2], row[3], row[4]), (row[5], row[6], row[7])
            if kind == 0:
                items.append(Cuboid(center, half, op))
            elif kind < 4:
                items.append(Cylinder(center, half, _AXES[kind - 1], op))
            else:
                corner = (1 if kind & 1 else -1, 1 if kind & 2 else -1)
                items.append(Wedge(center, half, _AXES[kind // 4 - 1], corner, op))
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


def _kind(item: Primitive) -> float:
    if isinstance(item, Cuboid):
        return 0.0
    axis = _AXES.index(item.axis)
    if isinstance(item, Cylinder):
        return 1.0 + axis
    return 4.0 + 4 * axis + (item.corner[0] > 0) + 2 * (item.corner[1] > 0)


def _as_dict(item: Primitive) -> dict[str, Any]:
    entry: dict[str, Any] = {"kind": type(item).__name__.lower()}
    if not isinstance(item, Cuboid):
        entry["axis"] = item.axis
    if isinstance(item, Wedge):
        entry["corner"] = list(item.corner)
    return entry | {"center": list(item.center), "half": list(item.half), "op": item.op}


def _from_dict(item: Any, index: int) -> Primitive:
    try:
        op = item.get("op", "add")
        if item["kind"] == "cuboid":
            return Cuboid(item["center"], item["half"], op)
        if item["kind"] == "cylinder":
            return Cylinder(item["center"], item["half"], item["axis"], op)
        if item["kind"] == "wedge":
            return Wedge(item["center"], item["half"], item["axis"], item["corner"], op)
    except KeyError as missing:
        raise ValueError(f"primitive {index} has no {missing}") from None
    except (AttributeError, TypeError, ValueError) as error:
        raise ValueError(f"primitive {index}: {error}") from None
    raise ValueError(f"primitive {index} has kind {item['kind']!r}; the kinds are 'cuboid', 'cylinder' and 'wedge'")
