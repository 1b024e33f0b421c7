"""Solid shapes as a sequence of primitives, added or subtracted.

Cuboids and cylinders are the paper's (section 4.1); wedges, frusta and tori are ours.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from sketchcore.untrusted import parse_json

if TYPE_CHECKING:
    import trimesh

_OPS = ("add", "subtract")
_AXES = ("x", "y", "z")


def _triple(value: Sequence[float], name: str) -> tuple[float, float, float]:
    array = np.asarray(value, dtype=np.float64)
    if array.shape != (3,) or not np.isfinite(array).all():
        raise ValueError(f"{name} must be three finite numbers, got {value!r}")
    return float(array[0]), float(array[1]), float(array[2])


def _pair(value: Any, name: str) -> tuple[float, float]:
    array = np.asarray(value, dtype=np.float64)
    if array.shape != (2,) or not np.isfinite(array).all():
        raise ValueError(f"{name} must be two finite numbers, got {value!r}")
    return float(array[0]), float(array[1])


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


@dataclass(frozen=True)
class Frustum:
    """A prism along one world axis whose section moves and grows evenly: a slanted leg, a trapezium, a cone.

    Stacked, round ones are any profile turned about an axis.

    Attributes:
        center: world x, y, z of the middle of its middle section.
        half: half of the extent of its middle section along the two other axes, and half the length along `axis`, in
            the order x, y, z; each more than 0.
        axis: "x", "y" or "z".
        shear: how far the upper end's centre lies from the middle's, along the two other axes in the order x, y, z; the
            lower end's lies as far the other way.
        taper: how much larger the upper end is than the middle, as a share of it, -1 to 1, along the two other axes,
            or one number for both; the lower end is as much smaller. Of -1 it has a point or an edge on top.
        round: whether the section is an ellipse, which tapers along both axes alike, instead of a rectangle.
        op: "add" or "subtract".

    Raises:
        ValueError: for an axis or op that is none, sizes that are not more than 0, a taper that is out of range or that
            an ellipse cannot have, numbers that are not finite.
    """

    center: tuple[float, float, float]
    half: tuple[float, float, float]
    axis: str = "y"
    shear: tuple[float, float] = (0.0, 0.0)
    taper: tuple[float, float] | float = (0.0, 0.0)
    round: bool = False
    op: str = "add"

    def __post_init__(self) -> None:
        _check_axis(self.axis)
        taper = _pair(np.broadcast_to(self.taper, 2) if np.ndim(self.taper) == 0 else self.taper, "taper")
        if max(abs(t) for t in taper) > 1:
            raise ValueError(f"taper must lie between -1 and 1, got {self.taper!r}")
        if self.round and taper[0] != taper[1]:
            raise ValueError(f"a round frustum tapers along both axes alike, got {self.taper!r}")
        center, half = _check(self.center, self.half, self.op)
        object.__setattr__(self, "center", center)
        object.__setattr__(self, "half", half)
        object.__setattr__(self, "shear", _pair(self.shear, "shear"))
        object.__setattr__(self, "taper", taper)
        object.__setattr__(self, "round", bool(self.round))


@dataclass(frozen=True)
class Torus:
    """A ring about one world axis, or an arc of one: a handle, a hoop, a rim. Ring and tube may be elliptic.

    Attributes:
        center: world x, y, z of the middle of the whole ring.
        half: half of the extent of the whole ring along x, y, z, each more than 0.
        axis: "x", "y" or "z".
        tube: half of the tube's width as a share of the ring's outer half sizes, more than 0, at most 0.5. A tube is as
            round as it can be where half of the extent along `axis` is `tube` times the other two.
        arc: from where to where it goes, in degrees from the first of the two other axes (in the order x, y, z)
            towards the second, of a ring that is stretched to a circle; by 360 at most. Ends are cut by planes through
            the axis.
        op: "add" or "subtract".

    Raises:
        ValueError: for an axis or op that is none, sizes, a tube or an arc that are out of range.
    """

    center: tuple[float, float, float]
    half: tuple[float, float, float]
    axis: str = "y"
    tube: float = 0.2
    arc: tuple[float, float] = (0.0, 360.0)
    op: str = "add"

    def __post_init__(self) -> None:
        _check_axis(self.axis)
        if not 0 < self.tube <= 0.5:
            raise ValueError(f"tube must be more than 0 and at most 0.5, got {self.tube!r}")
        arc = _pair(self.arc, "arc")
        if not (0 < arc[1] - arc[0] <= 360 + 1e-9 and abs(arc[0]) <= 720):
            raise ValueError(f"arc must be (from, to) in degrees, from less than to, by 360 at most; got {self.arc!r}")
        center, half = _check(self.center, self.half, self.op)
        object.__setattr__(self, "center", center)
        object.__setattr__(self, "half", half)
        object.__setattr__(self, "tube", float(self.tube))
        object.__setattr__(self, "arc", arc)


Primitive = Cuboid | Cylinder | Wedge | Frustum | Torus


@dataclass(frozen=True)
class Shape:
    """Primitives in order: a point is inside when the *last* primitive that contains it is additive.

    Attributes:
        primitives: `Cuboid`, `Cylinder`, `Wedge`, `Frustum` and `Torus`, at least one.

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
                raise TypeError(
                    f"a Shape is made of Cuboid, Cylinder and Wedge, Frustum and Torus; got {type(item).__name__}"
                )
        object.__setattr__(self, "primitives", items)

    @cached_property
    def packed(self) -> NDArray[np.float64]:
        """float64 [n, 8], the form the Rust core takes: kind, op, center, half.

        Kind is 0 for a cuboid, 1, 2 or 3 for a cylinder along x, y or z, and 4, 8 or 12 for a wedge along them, with 1
        more for a corner at the positive end of the first axis across, and 2 more for one of the second. Op is 1 to
        add, 0 to subtract. Made once, and read-only.

        Of a shape that has a frustum or a torus it is [n, 12]. Kind is 16, 17 or 18 for a frustum along x, y or z, 19,
        20 or 21 for a round one, and the last four numbers its shear and taper; 22, 23 or 24 for a torus, then tube,
        arc and 0.
        """
        rows: list[tuple[float, ...]]
        rows = [(_kind(item), float(item.op == "add"), *item.center, *item.half) for item in self.primitives]
        if any(isinstance(item, Frustum | Torus) for item in self.primitives):
            rows = [(*row, *_more(item)) for row, item in zip(rows, self.primitives, strict=True)]
        packed = np.array(rows, dtype=np.float64)
        packed.flags.writeable = False
        return packed

    @classmethod
    def from_packed(cls, packed: NDArray[np.float64]) -> Shape:
        """The shape of packed rows (see `packed`)."""
        return cls(_unpacked(row) for row in packed.tolist())

    def to_mesh(self, sections: int = 48) -> trimesh.Trimesh:
        """The surface as a watertight mesh, in the world as it stands: needs pip install 'sketchcore[meshes]'.

        Args:
            sections: flat faces around what is round, at least 3.

        Raises:
            ValueError: if nothing is left of the shape, or for too few sections.
        """
        from sketchcore.solidmesh import to_mesh

        return to_mesh(self, sections)

    def to_json(self) -> str:
        """The shape as JSON: `{"primitives": [{"kind": "cuboid", "center": ..., "half": ..., "op": ...}]}`."""
        return json.dumps({"primitives": [_as_dict(item) for item in self.primitives]})

    @classmethod
    def from_json(cls, text: str | dict[str, Any]) -> Shape:
        """The shape of a JSON text, or of the dictionary that one holds; other keys of it are ignored.

        Raises:
            ValueError: if the text is no JSON, or a primitive lacks an entry or has a wrong one.
        """
        data = parse_json(text, "a shape") if isinstance(text, str) else text
        if not isinstance(data, dict) or not isinstance(data.get("primitives"), list):
            raise ValueError('a shape in JSON is {"primitives": [...]}')
        return cls(_from_dict(item, index) for index, item in enumerate(data["primitives"]))


def _kind(item: Primitive) -> float:
    if isinstance(item, Cuboid):
        return 0.0
    axis = _AXES.index(item.axis)
    if isinstance(item, Cylinder):
        return 1.0 + axis
    if isinstance(item, Frustum):
        return 16.0 + 3 * item.round + axis
    if isinstance(item, Torus):
        return 22.0 + axis
    return 4.0 + 4 * axis + (item.corner[0] > 0) + 2 * (item.corner[1] > 0)


def _more(item: Primitive) -> tuple[float, ...]:
    """The last four numbers of a row of twelve."""
    if isinstance(item, Frustum):
        return (*item.shear, *_pair(item.taper, "taper"))
    if isinstance(item, Torus):
        return (item.tube, *item.arc, 0.0)
    return (0.0, 0.0, 0.0, 0.0)


def _unpacked(row: list[float]) -> Primitive:
    kind, op = int(row[0]), "add" if row[1] else "subtract"
    center, half = (row[2], row[3], row[4]), (row[5], row[6], row[7])
    if kind == 0:
        return Cuboid(center, half, op)
    if kind < 4:
        return Cylinder(center, half, _AXES[kind - 1], op)
    if kind < 16:
        corner = (1 if kind & 1 else -1, 1 if kind & 2 else -1)
        return Wedge(center, half, _AXES[kind // 4 - 1], corner, op)
    axis = _AXES[(kind - 16) % 3]
    if kind < 22:
        return Frustum(center, half, axis, (row[8], row[9]), (row[10], row[11]), kind >= 19, op)
    return Torus(center, half, axis, row[8], (row[9], row[10]), op)


_KINDS: dict[str, type[Primitive]] = {kind.__name__.lower(): kind for kind in (Cuboid, Cylinder, Wedge, Frustum, Torus)}


def _as_dict(item: Primitive) -> dict[str, Any]:
    entry = {field.name: getattr(item, field.name) for field in fields(item)}
    lists = {name: list(value) if isinstance(value, tuple) else value for name, value in entry.items()}
    return {"kind": type(item).__name__.lower(), **lists}


def _from_dict(item: Any, index: int) -> Primitive:
    try:
        kind = _KINDS.get(item["kind"])
        if kind is None:
            names = [repr(name) for name in _KINDS]
            known = f"{', '.join(names[:-1])} and {names[-1]}"
            raise ValueError(f"primitive {index} has kind {item['kind']!r}; the kinds are {known}")
        entries = {field.name: item[field.name] for field in fields(kind) if field.name != "op"}
        op = item.get("op", "add")
    except KeyError as missing:
        raise ValueError(f"primitive {index} has no {missing}") from None
    except (AttributeError, TypeError) as error:
        raise ValueError(f"primitive {index}: {error}") from None
    try:
        return kind(**entries, op=op)
    except (TypeError, ValueError) as error:
        raise ValueError(f"primitive {index}: {error}") from None
