"""A session: a document with undo and redo without limit, what people do to it, and the solid that belongs to it.

A session is used by several threads: those that serve the page change the document, those that reconstruct hand back
volumes. Every method may be called from any of them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from threading import RLock
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from skimage.measure import approximate_polygon

from sketchcore.app import ink
from sketchcore.app.document import (
    Document,
    Part,
    Placement,
    Sheet,
    check_name,
    placement_to_json,
    sheet_to_json,
)
from sketchcore.app.history import History
from sketchcore.app.ink import Stroke
from sketchcore.app.order import Order, Progress
from sketchcore.app.solids import Solid, Solids, as_solid
from sketchcore.app.union import unite
from sketchcore.camera import QUARTER_VIEWS, check_viewpoint
from sketchcore.grids import as_drawings
from sketchcore.strokes import trace

_STRAY = 0.6
"""Pixels that a traced line may be straightened by."""


class Kept(NamedTuple):
    """What has to be kept of a session.

    Attributes:
        document: as it is.
        volumes: by key, all that the document and undo need.
        solid: key of the current part's solid.
        made_of: what that was made of.
        revision: of the session.
        news: lines of its history that were not kept yet; they go after those that were.
    """

    document: Document
    volumes: dict[str, Solid]
    solid: str | None
    made_of: str | None
    revision: int
    news: tuple[str, ...]


class Session:
    """See the module.

    Attributes:
        id: 32 hexadecimal digits.
        revision: one more after every change of the document or of the solid.
        life: an id of this object's own: who opens a kept session again gets another.
        moment: one more after every change of what `state` says, progress too: of two states of one life the later has
            the greater one.
        progress: of the reconstruction.
        trouble: what went wrong with the last reconstruction, a sentence; "" if nothing did.
    """

    def __init__(
        self,
        id: str | None = None,
        history: History | None = None,
        volumes: dict[str, Solid] | None = None,
        solid: str | None = None,
        made_of: str | None = None,
        revision: int = 0,
    ) -> None:
        """A new session, or one that was kept.

        Args:
            id: None for a fresh one.
            history: its document, and what can be undone; None for an empty one.
            volumes: by key; those of the parts of all documents, and the current solid.
            solid: key of the current solid.
            made_of: `Order.print` of the drawings that it was made from.
            revision: where to go on counting from.

        Raises:
            ValueError: if a part's volume is missing, or the solid's.
        """
        self.id = ink.check_id(id, "a session") if id is not None else ink.new_id()
        self.lock = RLock()
        self._history = history if history is not None else History(Document())
        self._solids = Solids(volumes or {})
        self.revision = revision
        self.life = ink.new_id()
        self.moment = 0
        self.progress = Progress()
        self.trouble = ""
        self._solid = solid
        self._made_of = made_of if solid is not None else None
        self._solid_part = self.document.current if solid is not None else None
        if solid is not None and made_of is not None:
            self._solids.learn(made_of, solid)
        if missing := sorted(self._needed() - set(self.volumes)):
            raise ValueError(f"the session lacks the volume {missing[0]}, which its document needs")
        self._scene: tuple[str, Solid] | None = None

    @property
    def document(self) -> Document:
        """As it is now; immutable."""
        return self._history.now

    @property
    def volumes(self) -> Mapping[str, Solid]:
        """Key -> solid: of the current part, of frozen parts, and what undo may bring back. A key's never changes."""
        return self._solids.volumes

    # What people do: each call is one step of undo, unless it changes nothing.

    def add_strokes(self, viewpoint: str, strokes: Iterable[Stroke]) -> None:
        """Adds strokes to the drawing from a viewpoint; each is a step of undo of its own.

        One that is there already, by its id, is left out: pages may send again what they are not sure has arrived.

        Raises:
            ValueError: for ink from another than a three-quarter viewpoint as long as no three-quarter drawing has ink;
                for an unknown viewpoint; for too many strokes.
        """
        with self.lock:
            documents = []
            document = self.document
            for stroke in strokes:
                sheet = document.sheet(check_viewpoint(viewpoint))
                if stroke.id not in {other.id for other in sheet.strokes}:
                    if stroke.kind == "ink":
                        document.check_first(viewpoint)
                    document = document.with_sheet(replace(sheet, strokes=(*sheet.strokes, stroke)))
                    documents.append(document)
            for document in documents:
                self._change(document)

    def import_drawing(self, viewpoint: str, drawing: NDArray[np.uint8]) -> None:
        """Puts a drawing in the place of the ink from a viewpoint, traced into strokes so that it can be edited.

        Args:
            viewpoint: where it was drawn from.
            drawing: uint8 [256, 256], ink 255 on 0.

        Raises:
            ValueError: as for `add_strokes`; for a drawing without lines or of another shape.
            TypeError: for another dtype.
        """
        lines = [approximate_polygon(line, _STRAY) + 0.5 for line in trace(as_drawings(drawing)[0])]  # type: ignore[no-untyped-call]
        strokes = tuple(Stroke.of(line.tolist()) for line in lines)
        if not strokes:
            raise ValueError("there are no lines in that picture")
        with self.lock:
            sheet = self.document.sheet(check_viewpoint(viewpoint))
            self.document.check_first(viewpoint)
            construction = tuple(stroke for stroke in sheet.strokes if stroke.kind == "construction")
            self._change(self.document.with_sheet(replace(sheet, strokes=(*construction, *strokes))))

    def erase(self, viewpoint: str, path: Sequence[Sequence[float]], radius: float) -> None:
        """Takes away what an eraser passes over: one sweep, one step. See `ink.erase`."""
        with self.lock:
            sheet = self.document.sheet(check_viewpoint(viewpoint))
            strokes = ink.erase(sheet.strokes, path, radius)
            self._change(self.document.with_sheet(replace(sheet, strokes=strokes)))

    def clear(self, viewpoint: str) -> None:
        """Takes all ink from the drawing from a viewpoint; construction lines stay."""
        with self.lock:
            sheet = self.document.sheet(check_viewpoint(viewpoint))
            strokes = tuple(stroke for stroke in sheet.strokes if stroke.kind == "construction")
            self._change(self.document.with_sheet(replace(sheet, strokes=strokes)))

    def delete_sheet(self, viewpoint: str) -> None:
        """Takes the drawing from a viewpoint away, with its construction lines."""
        with self.lock:
            self._change(self.document.with_sheet(Sheet(check_viewpoint(viewpoint))))

    def call(self, name: str) -> None:
        """Names the session.

        Raises:
            ValueError: for what is no name (`document.check_name`).
        """
        with self.lock:
            self._change(replace(self.document, name=check_name(name)))

    def freeze(self, name: str | None = None) -> Part:
        """Makes the current solid a part, and begins a new one; the part's drawings stay with it.

        Args:
            name: of the part; None for "Part 1", "Part 2", ...

        Raises:
            ValueError: if there is no solid, or it lacks what was drawn since.
        """
        with self.lock:
            if self._solid is None:
                raise ValueError("there is no solid to freeze yet: draw something and reconstruct it first")
            if self.stale:
                raise ValueError("the drawings have changed since the last reconstruction: reconstruct, then freeze")
            label = check_name(name) if name is not None else f"Part {len(self.document.parts) + 1}"
            part = Part(self.document.current, label, True, self.document.sheets, self._solid)
            self._change(replace(self.document, sheets=(), parts=(*self.document.parts, part), current=ink.new_id()))
            return part

    def show(self, part: str, visible: bool) -> None:
        """Shows or hides a part.

        Raises:
            ValueError: if there is no such part.
        """
        self._change_part(part, lambda one: replace(one, visible=visible))

    def rename(self, part: str, name: str) -> None:
        """Names a part.

        Raises:
            ValueError: if there is no such part, or for what is no name.
        """
        self._change_part(part, lambda one: replace(one, name=name))

    def place(self, part: str, placement: Placement) -> None:
        """Puts a part somewhere else.

        Raises:
            ValueError: if there is no such part.
        """
        self._change_part(part, lambda one: replace(one, placement=placement))

    def delete_part(self, part: str) -> None:
        """Takes a part away.

        Raises:
            ValueError: if there is no such part.
        """
        with self.lock:
            gone = self.document.part(part)
            self._change(replace(self.document, parts=tuple(one for one in self.document.parts if one is not gone)))

    def undo(self) -> bool:
        """Takes the last step back; false if there is none."""
        with self.lock:
            return self._history.undo() and self._moved()

    def redo(self) -> bool:
        """Takes the last step that was taken back again; false if there is none."""
        with self.lock:
            return self._history.redo() and self._moved()

    @property
    def can_undo(self) -> bool:
        """Whether there is a step to take back."""
        return self._history.can_undo

    @property
    def can_redo(self) -> bool:
        """Whether there is a step that was taken back."""
        return self._history.can_redo

    # Reconstruction

    def drawings(self) -> tuple[list[NDArray[np.uint8]], list[str]]:
        """The drawings that have ink, uint8 [256, 256], and their viewpoints; a three-quarter one first."""
        # The sort is stable: otherwise they are in the order in which they were begun.
        sheets = sorted(self.document.inked, key=lambda sheet: sheet.viewpoint not in QUARTER_VIEWS)
        return [sheet.drawing for sheet in sheets], [sheet.viewpoint for sheet in sheets]

    def order(self) -> Order:
        """What is to be reconstructed, as it is now.

        Raises:
            ValueError: if there is no ink, or none from a three-quarter viewpoint.
        """
        with self.lock:
            document = self.document
            drawings, viewpoints = self.drawings()
        if not drawings:
            raise ValueError("there is nothing to reconstruct yet: draw something first")
        if viewpoints[0] not in QUARTER_VIEWS:
            raise ValueError("the three-quarter drawing is gone: draw one again, or undo")
        return Order(document.current, document.fingerprint, tuple(drawings), tuple(viewpoints))

    def accept(self, volume: NDArray[np.generic], order: Order) -> bool:
        """Takes a reconstruction, whole or between two rounds.

        If the drawings have changed since, it is shown, and is `stale`.

        Args:
            volume: [64, 64, 64] (x, y, z), probability in [0, 1] as floats, or * 255 as uint8.
            order: what it was made of.

        Returns:
            False if it is of no use any more: the part was frozen, or all its drawings taken away.
        """
        solid = as_solid(volume)
        with self.lock:
            if order.part != self.document.current or not self.document.inked:
                return False
            key = self._solids.add(solid, order.print)
            now = self.document.fingerprint
            if order.print == now or self._made_of != now:  # else what is shown is the very one, and this is an older
                self._solid, self._made_of, self._solid_part = key, order.print, order.part
            self._solids.keep(self._needed())
            self.revision += 1
            self.moment += 1
            return True

    def report(self, progress: Progress, trouble: str = "") -> None:
        """Says how a reconstruction goes."""
        with self.lock:
            self.progress, self.trouble = progress, trouble
            self.moment += 1

    @property
    def solid(self) -> Solid | None:
        """The current part's; None before its first reconstruction."""
        with self.lock:
            return None if self._solid is None else self.volumes[self._solid]

    @property
    def stale(self) -> bool:
        """Whether the drawings have other ink than the solid was made of."""
        with self.lock:
            return bool(self.document.inked) and self._made_of != self.document.fingerprint

    def scene(self) -> Solid:
        """The union of the visible parts and the current solid."""
        with self.lock:
            key, parts = self._scene_parts()
            if self._scene is not None and self._scene[0] == key:
                return self._scene[1]
            volumes = [(self.volumes[volume], placement) for volume, placement in parts]
        scene = as_solid(unite(volumes))
        with self.lock:
            self._scene = key, scene
        return scene

    def _scene_parts(self) -> tuple[str, list[tuple[str, Placement]]]:
        parts = [(part.volume, part.placement) for part in self.document.parts if part.visible]
        if self._solid is not None:
            parts.append((self._solid, Placement()))
        return hashlib.sha256(repr(parts).encode()).hexdigest()[:32], parts

    # What others see

    def state(self) -> dict[str, Any]:
        """All that a page needs to draw itself, as plain data; volumes by their keys."""
        with self.lock:
            document = self.document
            return {
                "id": self.id,
                "name": document.name,
                "revision": self.revision,
                "part": document.current,
                "first": not document.inked,
                "sheets": [sheet_to_json(sheet) | {"ink": sheet.has_ink} for sheet in document.sheets],
                "parts": [
                    {
                        "id": part.id,
                        "name": part.name,
                        "visible": part.visible,
                        "volume": part.volume,
                        "placement": placement_to_json(part.placement),
                        "viewpoints": [sheet.viewpoint for sheet in part.sheets],
                    }
                    for part in document.parts
                ],
                "solid": self._solid,
                "scene": self._scene_parts()[0],
                "stale": self.stale,
                "can_undo": self.can_undo,
                "can_redo": self.can_redo,
                "progress": asdict(self.progress),
                "trouble": self.trouble,
            }

    def kept(self) -> Kept:
        """What has to be kept of it."""
        with self.lock:
            volumes = {key: self.volumes[key] for key in sorted(self._needed())}
            return Kept(self.document, volumes, self._solid, self._made_of, self.revision, tuple(self._history.news()))

    def told(self, count: int) -> None:
        """Says that so many of `Kept.news` are kept."""
        with self.lock:
            self._history.told(count)

    # How it is done

    def _change_part(self, part: str, change: Callable[[Part], Part]) -> None:
        with self.lock:
            self._change(self.document.with_part(change(self.document.part(part))))

    def _change(self, document: Document) -> None:
        if document != self.document:
            self._history.do(document)
            self._moved()
            self._solids.keep(self._needed())

    def _moved(self) -> bool:
        """After another document became the present one: finds its solid, or the part's stale one, or none."""
        self.revision += 1
        self.moment += 1
        now = self.document.fingerprint
        if not self.document.inked:
            self._solid = self._made_of = self._solid_part = None
        elif (known := self._solids.of(now)) is not None:
            self._solid, self._made_of, self._solid_part = known, now, self.document.current
        elif self._solid_part != self.document.current:
            self._solid = self._made_of = self._solid_part = None
        return True

    def _needed(self) -> set[str]:
        """Keys of the volumes without which something could not be shown or undone."""
        needed = {part.volume for document in self._history.documents() for part in document.parts}
        return needed if self._solid is None else needed | {self._solid}
