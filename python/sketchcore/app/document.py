"""What a session is about: drawings from viewpoints, and frozen parts. Immutable, so that undo is cheap."""

from __future__ import annotations

import hashlib
import math
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sketchcore.app.ink import Stroke, check_id, new_id, rasterize
from sketchcore.camera import QUARTER_VIEWS, VIEWPOINTS, check_viewpoint

MAX_STROKES = 5_000
"""Of one drawing."""
MAX_TOTAL_POINTS = 500_000
"""Of all strokes of a document."""
MAX_PARTS = 64
MAX_NAME = 80
_SCALES = (0.05, 4.0)
_FARTHEST = 2.0


def check_name(name: object) -> str:
    """A name as it is shown: one line, spaces at its ends taken away.

    Raises:
        ValueError: if nothing is left, it is longer than 80 characters, or it has control characters.
    """
    if not isinstance(name, str):
        raise ValueError(f"a name must be text, got {type(name).__name__}")
    text = name.strip()
    if not 1 <= len(text) <= MAX_NAME:
        raise ValueError(f"a name must have 1 to {MAX_NAME} characters, got {len(text)}")
    if any(unicodedata.category(letter) in ("Cc", "Cs", "Zl", "Zp") for letter in text):
        raise ValueError("a name must be one line of plain characters")
    return text


@dataclass(frozen=True)
class Sheet:
    """A drawing from a viewpoint.

    Attributes:
        viewpoint: one of `sketchcore.VIEWPOINTS`.
        strokes: in the order in which they were drawn.

    Raises:
        ValueError: for an unknown viewpoint, more than 5000 strokes, or two of the same id.
    """

    viewpoint: str
    strokes: tuple[Stroke, ...] = ()

    def __post_init__(self) -> None:
        check_viewpoint(self.viewpoint)
        if len(self.strokes) > MAX_STROKES:
            raise ValueError(f"a drawing may have up to {MAX_STROKES} strokes, this one would have {len(self.strokes)}")
        if len({stroke.id for stroke in self.strokes}) < len(self.strokes):
            raise ValueError("two strokes of a drawing have the same id")

    @property
    def drawing(self) -> NDArray[np.uint8]:
        """uint8 [256, 256], ink 255 on 0: what the networks see. Made anew each time, for undo keeps many sheets."""
        return rasterize(self.strokes)

    @property
    def has_ink(self) -> bool:
        """Whether there is more than construction lines."""
        return any(stroke.kind == "ink" for stroke in self.strokes)


@dataclass(frozen=True)
class Placement:
    """Where a frozen part stands in the scene: it is scaled and turned about its cube's centre, then moved.

    Attributes:
        center: world x, y, z of its cube's centre, each from -2 to 2.
        scale: from 0.05 to 4; 1 leaves it as large as it was drawn.
        turn: quarter turns about y, 0 to 3; one takes what looked along +x to +z.

    Raises:
        ValueError: for numbers that are not finite or out of range.
    """

    center: tuple[float, float, float] = (0.0, 0.0, 0.0)
    scale: float = 1.0
    turn: int = 0

    def __post_init__(self) -> None:
        if not isinstance(self.center, list | tuple) or len(self.center) != 3 or not all(map(_number, self.center)):
            raise ValueError("a placement's center is three finite numbers: x, y and z")
        if max(map(abs, self.center)) > _FARTHEST:
            raise ValueError(f"a placement's center must lie within {_FARTHEST:g} of the middle of the scene")
        if not _number(self.scale) or not _SCALES[0] <= self.scale <= _SCALES[1]:
            raise ValueError(f"a placement's scale must lie between {_SCALES[0]:g} and {_SCALES[1]:g}")
        if isinstance(self.turn, bool) or not isinstance(self.turn, int) or not 0 <= self.turn <= 3:
            raise ValueError("a placement's turn is 0, 1, 2 or 3 quarter turns")
        x, y, z = map(float, self.center)
        object.__setattr__(self, "center", (x, y, z))
        object.__setattr__(self, "scale", float(self.scale))


def _number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


@dataclass(frozen=True)
class Part:
    """A solid that was frozen.

    Attributes:
        id: its name among parts.
        name: as people call it.
        visible: whether it belongs to the scene as shown and exported.
        sheets: the drawings that it was made from; they stay as construction lines (paper, section 6.7).
        volume: key of its solid in the session's table of volumes.
        placement: where it stands.

    Raises:
        ValueError: for what is no id, name or key.
    """

    id: str
    name: str
    visible: bool
    sheets: tuple[Sheet, ...]
    volume: str
    placement: Placement = Placement()

    def __post_init__(self) -> None:
        check_id(self.id, "a part")
        check_id(self.volume, "a volume")
        object.__setattr__(self, "name", check_name(self.name))
        if not isinstance(self.visible, bool):
            raise ValueError("a part's visible must be true or false")
        _check_sheets(self.sheets)


@dataclass(frozen=True)
class Document:
    """All that a person made: the drawings of the current part, the parts frozen before, and a name.

    Attributes:
        sheets: of the current part, in the order of their first strokes; at most one a viewpoint.
        parts: in the order in which they were frozen.
        name: of the whole.
        current: the id that the current part will have once it is frozen.

    Raises:
        ValueError: for two drawings from one viewpoint, two parts of one id, too many parts or points, or no name.
    """

    sheets: tuple[Sheet, ...] = ()
    parts: tuple[Part, ...] = ()
    name: str = "Untitled"
    current: str = field(default_factory=new_id)

    def __post_init__(self) -> None:
        check_id(self.current, "the current part")
        object.__setattr__(self, "name", check_name(self.name))
        _check_sheets(self.sheets)
        if len(self.parts) > MAX_PARTS:
            raise ValueError(f"a scene may have up to {MAX_PARTS} parts, this one would have {len(self.parts)}")
        if len({self.current, *(part.id for part in self.parts)}) <= len(self.parts):
            raise ValueError("two parts have the same id")
        sheets = [*self.sheets, *(sheet for part in self.parts for sheet in part.sheets)]
        if sum(len(stroke.points) for sheet in sheets for stroke in sheet.strokes) > MAX_TOTAL_POINTS:
            raise ValueError(
                f"all drawings together may have up to {MAX_TOTAL_POINTS} points; delete a part or a drawing"
            )

    @property
    def inked(self) -> tuple[Sheet, ...]:
        """The current part's drawings that have ink."""
        return tuple(sheet for sheet in self.sheets if sheet.has_ink)

    @property
    def fingerprint(self) -> str:
        """What the ink of the current part's drawings is known by; strokes of one id are the same."""
        ids = [
            (sheet.viewpoint, [stroke.id for stroke in sheet.strokes if stroke.kind == "ink"]) for sheet in self.inked
        ]
        return hashlib.sha256(repr((self.current, ids)).encode()).hexdigest()[:32]

    def check_first(self, viewpoint: str) -> None:
        """Refuses ink from a viewpoint that is none for a first drawing, if there is no such drawing yet.

        Raises:
            ValueError: then; it names the three-quarter viewpoints.
        """
        if viewpoint not in QUARTER_VIEWS and not any(sheet.viewpoint in QUARTER_VIEWS for sheet in self.inked):
            raise ValueError(
                f"the first drawing of a part is made from a three-quarter viewpoint ({', '.join(QUARTER_VIEWS)}); "
                f"{viewpoint} comes after it"
            )

    def sheet(self, viewpoint: str) -> Sheet:
        """The current part's drawing from a viewpoint; an empty one if there is none."""
        return next((sheet for sheet in self.sheets if sheet.viewpoint == viewpoint), Sheet(viewpoint))

    def with_sheet(self, sheet: Sheet) -> Document:
        """The document with a drawing put in the place of the one from its viewpoint, or added; none if it is empty."""
        if not sheet.strokes:
            return replace(self, sheets=tuple(other for other in self.sheets if other.viewpoint != sheet.viewpoint))
        if any(other.viewpoint == sheet.viewpoint for other in self.sheets):
            sheets = tuple(sheet if other.viewpoint == sheet.viewpoint else other for other in self.sheets)
        else:
            sheets = (*self.sheets, sheet)
        return replace(self, sheets=sheets)

    def reference(self, viewpoint: str) -> tuple[Stroke, ...]:
        """Lines of the visible parts that stand where they were drawn, from a viewpoint, as construction lines.

        Raises:
            ValueError: for an unknown viewpoint.
        """
        check_viewpoint(viewpoint)
        return tuple(
            replace(stroke, kind="construction")
            for part in self.parts
            if part.visible and part.placement == Placement()
            for sheet in part.sheets
            if sheet.viewpoint == viewpoint
            for stroke in sheet.strokes
            if stroke.kind == "ink"
        )

    def part(self, part: str) -> Part:
        """The part of an id.

        Raises:
            ValueError: if there is none.
        """
        found = next((one for one in self.parts if one.id == part), None)
        if found is None:
            raise ValueError(f"there is no part {str(part)[:80]!r} in this scene")
        return found

    def with_part(self, part: Part) -> Document:
        """The document with a part put in the place of the one of its id."""
        return replace(self, parts=tuple(part if one.id == part.id else one for one in self.parts))


def _check_sheets(sheets: Sequence[Sheet]) -> None:
    if len({sheet.viewpoint for sheet in sheets}) < len(sheets):
        raise ValueError("there are two drawings from the same viewpoint; a part has at most one from each")


def to_json(document: Document) -> dict[str, Any]:
    """A document as plain data, for `json.dumps`; `from_json` reads it."""
    return {
        "name": document.name,
        "current": document.current,
        "sheets": [sheet_to_json(sheet) for sheet in document.sheets],
        "parts": [part_to_json(part) for part in document.parts],
    }


def from_json(data: object) -> Document:
    """The document of plain data that may come from anywhere.

    Raises:
        ValueError: for whatever is missing, unknown, of a wrong type or out of range.
    """
    entries = fields(data, "a document", ("name", "current", "sheets", "parts"))
    return Document(
        tuple(sheet_from_json(sheet) for sheet in listed(entries["sheets"], "sheets", len(VIEWPOINTS))),
        tuple(part_from_json(part) for part in listed(entries["parts"], "parts", MAX_PARTS)),
        check_name(entries["name"]),
        check_id(entries["current"], "the current part"),
    )


def stroke_to_json(stroke: Stroke) -> dict[str, Any]:
    """{"id", "kind", "points": [[x, y, pressure], ...]}."""
    return {"id": stroke.id, "kind": stroke.kind, "points": stroke.points}


def stroke_from_json(data: object) -> Stroke:
    """A stroke of plain data.

    Raises:
        ValueError: for what is no stroke.
    """
    entries = fields(data, "a stroke", ("id", "kind", "points"))
    return Stroke(entries["points"], entries["kind"], entries["id"])


def sheet_to_json(sheet: Sheet) -> dict[str, Any]:
    """{"viewpoint", "strokes": [...]}."""
    return {"viewpoint": sheet.viewpoint, "strokes": [stroke_to_json(stroke) for stroke in sheet.strokes]}


def sheet_from_json(data: object) -> Sheet:
    """A drawing of plain data.

    Raises:
        ValueError: for what is no drawing.
    """
    entries = fields(data, "a drawing", ("viewpoint", "strokes"))
    strokes = listed(entries["strokes"], "strokes", MAX_STROKES)
    return Sheet(check_viewpoint(entries["viewpoint"]), tuple(stroke_from_json(stroke) for stroke in strokes))


def placement_to_json(placement: Placement) -> dict[str, Any]:
    """{"center": [x, y, z], "scale", "turn"}."""
    return {"center": list(placement.center), "scale": placement.scale, "turn": placement.turn}


def placement_from_json(data: object) -> Placement:
    """A placement of plain data.

    Raises:
        ValueError: for what is no placement.
    """
    entries = fields(data, "a placement", ("center", "scale", "turn"))
    return Placement(entries["center"], entries["scale"], entries["turn"])


def part_to_json(part: Part) -> dict[str, Any]:
    """{"id", "name", "visible", "volume", "placement", "sheets"}."""
    return {
        "id": part.id,
        "name": part.name,
        "visible": part.visible,
        "volume": part.volume,
        "placement": placement_to_json(part.placement),
        "sheets": [sheet_to_json(sheet) for sheet in part.sheets],
    }


def part_from_json(data: object) -> Part:
    """A part of plain data.

    Raises:
        ValueError: for what is no part.
    """
    entries = fields(data, "a part", ("id", "name", "visible", "volume", "placement", "sheets"))
    return Part(
        entries["id"],
        entries["name"],
        entries["visible"],
        tuple(sheet_from_json(sheet) for sheet in listed(entries["sheets"], "sheets", len(VIEWPOINTS))),
        entries["volume"],
        placement_from_json(entries["placement"]),
    )


def fields(data: object, what: str, names: Sequence[str]) -> Mapping[str, Any]:
    """The entries of an object of plain data that must have these, and no others.

    Raises:
        ValueError: if it has not.
    """
    if not isinstance(data, Mapping):
        raise ValueError(f"{what} must be an object with {', '.join(names)}; got {type(data).__name__}")
    missing, unknown = set(names) - set(data), set(data) - set(names)
    if missing or unknown:
        wrong = ", ".join(
            [f"no {n}" for n in sorted(missing)] + [f"unknown {str(n)[:40]!r}" for n in sorted(unknown, key=str)][:5]
        )
        raise ValueError(f"{what} must have {', '.join(names)} and nothing else; this one has {wrong}")
    return data


def listed(data: object, what: str, most: int) -> Sequence[Any]:
    """A list of plain data with at most so many entries.

    Raises:
        ValueError: if it is none, or longer.
    """
    if not isinstance(data, list | tuple):
        raise ValueError(f"{what} must be a list, got {type(data).__name__}")
    if len(data) > most:
        raise ValueError(f"{what} may have up to {most} entries, got {len(data)}")
    return data
