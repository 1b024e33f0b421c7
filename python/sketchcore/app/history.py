"""Undo and redo without limit, and the lines of text by which they survive a restart.

Documents are immutable and share what did not change, so a history is a list of them. As text, each step says what is
new in it and refers to the step before for the rest: a line is about as long as the stroke that was drawn.

    {"begin": document}                 the first line
    {"do": change}  "undo"  "redo"      every further one
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from sketchcore.app.document import (
    Document,
    Part,
    Sheet,
    fields,
    from_json,
    listed,
    part_from_json,
    part_to_json,
    stroke_from_json,
    stroke_to_json,
    to_json,
)
from sketchcore.app.ink import Stroke


class History:
    """A document, the ones before it, and the ones that were taken back. Not for several threads at once.

    Attributes:
        now: the document as it is.
    """

    def __init__(self, document: Document) -> None:
        self.now = document
        self._past: list[Document] = []
        self._future: list[Document] = []
        self._news = [_line({"begin": to_json(document)})]

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to take back."""
        return bool(self._past)

    @property
    def can_redo(self) -> bool:
        """Whether there is a step that was taken back."""
        return bool(self._future)

    def documents(self) -> Iterator[Document]:
        """All that can be had by undo and redo, and the one that is."""
        yield from (*self._past, self.now, *self._future)

    def do(self, document: Document) -> None:
        """Makes a step; what was taken back is gone."""
        self._news.append(_line({"do": _change(self.now, document)}))
        self._past.append(self.now)
        self._future.clear()
        self.now = document

    def undo(self) -> bool:
        """Takes a step back; false if there is none."""
        if not self._past:
            return False
        self._news.append(_line("undo"))
        self._future.append(self.now)
        self.now = self._past.pop()
        return True

    def redo(self) -> bool:
        """Takes a step again that was taken back; false if there is none."""
        if not self._future:
            return False
        self._news.append(_line("redo"))
        self._past.append(self.now)
        self.now = self._future.pop()
        return True

    def news(self) -> list[str]:
        """The lines that were not `told` yet."""
        return list(self._news)

    def told(self, count: int) -> None:
        """Says that the first so many of the `news` are kept."""
        del self._news[:count]

    def retell(self) -> None:
        """Makes the news the whole history, from a first line on."""
        every = [*self._past, self.now, *reversed(self._future)]
        changes = [_line({"do": _change(before, after)}) for before, after in itertools.pairwise(every)]
        self._news = [_line({"begin": to_json(every[0])}), *changes, *[_line("undo")] * len(self._future)]

    @classmethod
    def replay(cls, lines: Iterable[bytes]) -> History:
        """The history that lines tell, all of them told already.

        Raises:
            ValueError: if they do not tell one.
        """
        history: History | None = None
        for number, text in enumerate(lines, start=1):
            try:
                line = json.loads(text)
                if history is None:
                    history = cls(from_json(fields(line, "the first line", ("begin",))["begin"]))
                elif line == "undo" or line == "redo":
                    if not (history.undo() if line == "undo" else history.redo()):
                        raise ValueError(f"there is nothing to {line}")
                else:
                    history.do(_changed(history.now, fields(line, "a step", ("do",))["do"]))
            except (ValueError, TypeError, IndexError, RecursionError) as error:
                raise ValueError(f"line {number} of the history is damaged: {error}") from error
            history.told(len(history.news()))
        if history is None:
            raise ValueError("the history is empty")
        return history


def _line(data: object) -> str:
    return json.dumps(data, separators=(",", ":"), allow_nan=False)


def _sheets(document: Document) -> list[Sheet]:
    """All drawings of a document, those of the current part first: steps refer to them by number."""
    return [*document.sheets, *(sheet for part in document.parts for sheet in part.sheets)]


def _change(before: Document, after: Document) -> dict[str, Any]:
    """What is new in a document, as plain data; sheets and parts of the one before by their numbers."""
    sheets = {id(sheet): number for number, sheet in enumerate(_sheets(before))}
    parts = {id(part): number for number, part in enumerate(before.parts)}

    def refer(sheet: Sheet) -> int | dict[str, Any]:
        if id(sheet) in sheets:
            return sheets[id(sheet)]
        old = before.sheet(sheet.viewpoint).strokes
        return {"viewpoint": sheet.viewpoint, "strokes": _runs(old, sheet.strokes)}

    def refer_part(part: Part) -> int | dict[str, Any]:
        if id(part) in parts:
            return parts[id(part)]
        return part_to_json(part) | {"sheets": [refer(sheet) for sheet in part.sheets]}

    return {
        "name": after.name,
        "current": after.current,
        "sheets": [refer(sheet) for sheet in after.sheets],
        "parts": [refer_part(part) for part in after.parts],
    }


def _runs(old: Sequence[Stroke], new: Sequence[Stroke]) -> list[list[int] | dict[str, Any]]:
    """Strokes as [first, count] of those that were there, and in full."""
    numbers = {id(stroke): number for number, stroke in enumerate(old)}
    runs: list[list[int] | dict[str, Any]] = []
    for stroke in new:
        number = numbers.get(id(stroke))
        last = runs[-1] if runs else None
        if number is None:
            runs.append(stroke_to_json(stroke))
        elif isinstance(last, list) and sum(last) == number:
            last[1] += 1
        else:
            runs.append([number, 1])
    return runs


def _changed(before: Document, change: object) -> Document:
    """The document that `_change` told of."""
    entries = fields(change, "a step", ("name", "current", "sheets", "parts"))
    sheets = _sheets(before)

    def sheet_of(data: object) -> Sheet:
        if isinstance(data, int):
            return sheets[data]
        told = fields(data, "a drawing", ("viewpoint", "strokes"))
        old = before.sheet(told["viewpoint"]).strokes
        strokes: list[Stroke] = []
        for run in told["strokes"]:
            if isinstance(run, list):
                strokes += old[run[0] : run[0] + run[1]]
            else:
                strokes.append(stroke_from_json(run))
        return Sheet(told["viewpoint"], tuple(strokes))

    def part_of(data: object) -> Part:
        if isinstance(data, int):
            return before.parts[data]
        if not isinstance(data, dict):
            raise ValueError("a part of a step is a number or an object")
        bare = part_from_json({**data, "sheets": []})
        own = tuple(sheet_of(sheet) for sheet in listed(data.get("sheets"), "sheets", len(sheets) + 13))
        return Part(bare.id, bare.name, bare.visible, own, bare.volume, bare.placement)

    return Document(
        tuple(sheet_of(sheet) for sheet in listed(entries["sheets"], "sheets", 13)),
        tuple(part_of(part) for part in listed(entries["parts"], "parts", 64)),
        entries["name"],
        entries["current"],
    )
