"""Documents: what they may hold, and their JSON."""

from __future__ import annotations

import copy
import json
from dataclasses import replace
from typing import Any

import pytest

from sketchcore.app.document import Document, Part, Placement, Sheet, from_json, to_json
from sketchcore.app.ink import Stroke

# Not an id of the day: it names a test, and every process of a run has to name it alike.
CONSTRUCTION = replace(Stroke.of([(5, 5, 0.2)], "construction"), id="cd" * 16)
SHEET = Sheet("quarter-037", (Stroke.of([(10, 20), (30, 40)]), CONSTRUCTION))
PART = Part("p1", "Seat", True, (SHEET,), "ab" * 16, Placement((0.1, -0.2, 0.3), 0.5, 3))
DOCUMENT = Document((SHEET, Sheet("top", (Stroke.of([(1, 2)]),))), (PART, replace(PART, id="p2")), "A chair")


def test_a_document_comes_back_from_json() -> None:
    assert from_json(json.loads(json.dumps(to_json(DOCUMENT)))) == DOCUMENT
    empty = Document()
    assert from_json(json.loads(json.dumps(to_json(empty)))) == empty


def _at(data: Any, path: list[Any]) -> Any:
    for step in path:
        data = data[step]
    return data


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (["name"], "", "1 to 80 characters"),
        (["name"], 5, "must be text"),
        (["name"], "a\nb", "one line"),
        (["name"], "\ud800", "one line"),
        (["sheets"], {}, "must be a list"),
        (["sheets", 0, "viewpoint"], "below", "unknown viewpoint 'below'"),
        (["sheets", 0, "viewpoint"], ["top"], "unknown viewpoint"),
        (["sheets", 1, "viewpoint"], "quarter-037", "two drawings from the same viewpoint"),
        (["sheets", 0, "strokes", 0, "points", 0, 0], float("nan"), "finite"),
        (["sheets", 0, "strokes", 0, "points"], None, "points"),
        (["sheets", 0, "strokes", 0, "kind"], "pencil", "'ink' or 'construction'"),
        (["sheets", 0, "strokes", 0, "id"], CONSTRUCTION.id, "same id"),
        (["parts", 0, "id"], "p2", "same id"),
        (["parts", 0, "volume"], "../../etc/passwd", "id of a volume"),
        (["parts", 0, "visible"], "yes", "true or false"),
        (["parts", 0, "placement", "scale"], 0, "between 0.05 and 4"),
        (["parts", 0, "placement", "scale"], float("inf"), "between 0.05 and 4"),
        (["parts", 0, "placement", "turn"], 4, "quarter turns"),
        (["parts", 0, "placement", "turn"], 1.0, "quarter turns"),
        (["parts", 0, "placement", "center"], [0, 0], "three finite numbers"),
        (["parts", 0, "placement", "center", 1], float("nan"), "three finite numbers"),
        (["parts", 0, "placement", "center", 1], 9, "within 2"),
        (["parts", 0, "sheets", 0], 3, "a drawing must be an object"),
    ],
)
def test_what_is_wrong_is_said(path: list[Any], value: object, message: str) -> None:
    data = json.loads(json.dumps(to_json(DOCUMENT)))
    _at(data, path[:-1])[path[-1]] = value
    with pytest.raises(ValueError, match=message):
        from_json(data)


@pytest.mark.parametrize(
    "path", [[], ["sheets", 0], ["sheets", 0, "strokes", 0], ["parts", 0], ["parts", 0, "placement"]]
)
def test_every_entry_is_needed_and_no_other_is_known(path: list[Any]) -> None:
    whole = json.loads(json.dumps(to_json(DOCUMENT)))
    for name in list(_at(whole, path)):
        data = copy.deepcopy(whole)
        del _at(data, path)[name]
        with pytest.raises(ValueError, match=f"no {name}"):
            from_json(data)
    _at(whole, path)["more"] = 1
    with pytest.raises(ValueError, match="unknown 'more'"):
        from_json(whole)


@pytest.mark.parametrize("data", [None, 3, "x", [], [1]])
def test_what_is_no_object_is_no_document(data: object) -> None:
    with pytest.raises(ValueError, match="a document must be an object"):
        from_json(data)


def test_counts_are_limited() -> None:
    with pytest.raises(ValueError, match="up to 64 parts"):
        Document((), tuple(replace(PART, id=f"p{i}", sheets=()) for i in range(65)))
    with pytest.raises(ValueError, match="up to 5000 strokes"):
        Sheet("top", tuple(Stroke(((0, 0, 0.5),), "ink", str(i)) for i in range(5001)))
    heavy = tuple(Stroke(((0, 0, 0.5),) * 20_000, "ink", str(i)) for i in range(26))
    with pytest.raises(ValueError, match="500000 points"):
        Document((Sheet("top", heavy),))


def test_an_empty_sheet_is_no_sheet() -> None:
    assert [s.viewpoint for s in DOCUMENT.with_sheet(Sheet("quarter-037")).sheets] == ["top"]
    assert DOCUMENT.with_sheet(Sheet("left")).sheets == DOCUMENT.sheets
