"""Undo and redo, and the lines that they are kept as."""

from __future__ import annotations

import json
import random
from dataclasses import replace

import pytest

from sketchcore.app.document import Document, Part, Placement, Sheet
from sketchcore.app.history import History
from sketchcore.app.ink import Stroke, erase, new_id


def _draw(document: Document, viewpoint: str = "quarter-037") -> Document:
    stroke = Stroke.of([(random.uniform(0, 256), random.uniform(0, 256)) for _ in range(20)])
    sheet = document.sheet(viewpoint)
    return document.with_sheet(Sheet(viewpoint, (*sheet.strokes, stroke)))


def _freeze(document: Document) -> Document:
    part = Part(document.current, "Part", True, document.sheets, new_id())
    return replace(document, sheets=(), parts=(*document.parts, part), current=new_id())


def _lines(history: History) -> list[bytes]:
    return [line.encode() for line in history.news()]


def _states(history: History) -> list[Document]:
    """All documents from first to last; the history is left at its last."""
    while history.undo():
        pass
    found = [history.now]
    while history.redo():
        found.append(history.now)
    return found


def test_any_walk_is_told_again_by_its_lines() -> None:
    random.seed(1)
    history = History(Document())
    for _ in range(300):
        step = random.random()
        if step < 0.45:
            history.do(_draw(history.now, random.choice(["quarter-037", "top"])))
        elif step < 0.55:
            sheet = history.now.sheet("quarter-037")
            history.do(history.now.with_sheet(replace(sheet, strokes=erase(sheet.strokes, [(128, 0), (128, 256)], 9))))
        elif step < 0.6 and history.now.sheets:
            history.do(_freeze(history.now))
        elif step < 0.65 and history.now.parts:
            part = random.choice(history.now.parts)
            history.do(history.now.with_part(replace(part, placement=Placement((0, random.random(), 0)))))
        elif step < 0.9:
            history.undo()
        else:
            history.redo()
    again = History.replay(_lines(history))
    assert again.now == history.now
    assert not again.news()
    history.retell()
    retold = History.replay(_lines(history))
    assert retold.now == history.now
    expected = _states(history)
    assert _states(again) == expected
    assert _states(retold) == expected


def test_a_line_is_as_long_as_what_is_new() -> None:
    history = History(Document())
    for _ in range(200):
        history.do(_draw(history.now))
    history.do(_freeze(history.now))
    longest = max(len(line) for line in history.news())
    assert longest < 1.5 * len(history.news()[1]) + 200


def test_what_is_kept_is_not_told_twice() -> None:
    history = History(Document())
    kept = _lines(history)
    history.told(len(kept))
    history.do(_draw(history.now))
    history.undo()
    assert [json.loads(line) if line == b'"undo"' else "do" for line in _lines(history)] == ["do", "undo"]
    again = History.replay([*kept, *_lines(history)])
    assert again.can_redo
    assert not again.can_undo


@pytest.mark.parametrize(
    "lines",
    [
        [],
        [b"{}"],
        [b'"undo"'],
        [b"{"],
        [b"\xff"],
        [b"[" * 100_000],
        ["begin", b'"undo"'],
        ["begin", b'{"do": {}}'],
        ["begin", b'{"do": {"name": "a", "current": "b", "sheets": [7], "parts": []}}'],
        ["begin", b'{"do": {"name": "a", "current": "b", "sheets": [], "parts": [{"id": 3}]}}'],
        ["begin", b'{"do": {"name": "a", "current": "b", "sheets": [{"viewpoint": [], "strokes": []}], "parts": []}}'],
        [
            "begin",
            b'{"do": {"name": "a", "current": "b", "sheets": [{"viewpoint": "top", "strokes": 5}], "parts": []}}',
        ],
    ],
)
def test_what_is_damaged_is_refused(lines: list[bytes | str]) -> None:
    begin = _lines(History(Document()))[0]
    with pytest.raises(ValueError, match=r"history (is empty|is damaged)"):
        History.replay([begin if isinstance(line, str) else line for line in lines])
