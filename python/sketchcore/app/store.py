"""Sessions on disk: kept after every change, and found again after whatever happened.

FOLDER/ID/session.json          what `sessionfile.describe` says, the revision, and the steps since; replaced whole
FOLDER/ID/history.jsonl         what can be undone (`history`), a line a step; the steps since are added after that
FOLDER/ID/volumes/KEY.npy.gz      one a solid, written once, before the session that names it
"""

from __future__ import annotations

import gzip
import io
import json
import logging
import os
import re
import shutil
import threading
import weakref
import zlib
from collections import OrderedDict
from collections.abc import Collection, Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sketchcore.app.document import Document, fields
from sketchcore.app.history import History
from sketchcore.app.session import Session
from sketchcore.app.sessionfile import describe, parse_volume, read_session, recall, write_session
from sketchcore.app.solids import Solid
from sketchcore.atomic import sweep, write_atomically
from sketchcore.untrusted import parse_json

_log = logging.getLogger(__name__)
_ID = re.compile(r"[0-9a-f]{32}")
_AT_HAND = 16
"""Sessions that stay in memory without being in use."""


class NotKeptError(RuntimeError):
    """A session could not be written: it is on the disk as it was before, and in memory as it is now."""


class Listed(NamedTuple):
    """A session on disk, without reading all of it."""

    id: str
    name: str
    changed: datetime


class Store:
    """A folder of sessions. Its methods may be called from any thread.

    The same id always gives the same `Session`, as long as anyone holds it.
    """

    def __init__(self, folder: str | Path) -> None:
        """Opens the folder, and makes it if need be.

        Raises:
            OSError: if it cannot be made.
        """
        self.folder = Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self._lock = threading.RLock()
        self._held: weakref.WeakValueDictionary[str, Session] = weakref.WeakValueDictionary()
        self._recent: OrderedDict[str, Session] = OrderedDict()
        self._saving: dict[str, threading.Lock] = {}
        self._names: dict[str, tuple[int, str]] = {}

    def create(self) -> Session:
        """A new, empty session, kept from now on.

        Raises:
            NotKeptError: if it cannot be written.
        """
        return self._adopt(Session())

    def get(self, id: str) -> Session:
        """The session of an id.

        Raises:
            KeyError: if there is none, or that is no id.
            ValueError: if what is on disk is damaged.
        """
        with self._lock:
            session = self._held.get(id) if isinstance(id, str) else None
            if session is None:
                session = self._load(self._place(id))
            return self._hold(session)

    def list(self) -> list[Listed]:
        """All sessions, the one that was changed last first; damaged ones are left out."""
        found = []
        for place in self.folder.iterdir():
            if not _ID.fullmatch(place.name):
                continue
            try:
                changed = (place / "session.json").stat().st_mtime_ns
                known = self._names.get(place.name)
                if known is None or known[0] != changed:
                    known = changed, str(_read(place)["document"]["name"])
                    self._names[place.name] = known
            except (OSError, ValueError, KeyError, TypeError):
                continue
            found.append(Listed(place.name, known[1], datetime.fromtimestamp(changed / 1e9, UTC)))
        return sorted(found, key=lambda one: one.changed, reverse=True)

    def save(self, session: Session) -> None:
        """Keeps a session as it is now: whole, or as it was before. One that was deleted stays deleted.

        Raises:
            NotKeptError: if the disk is full, or cannot be written to.
        """
        with self._lock:
            saving = self._saving.setdefault(session.id, threading.Lock())
        with saving:  # whoever saves later saves what is newer
            if self._held.get(session.id) is not session:
                return
            try:
                self._write(session, self.folder / session.id)
            except OSError as error:
                raise NotKeptError(
                    f"this could not be kept on the disk ({os.strerror(error.errno or 0)}); it is kept with the next "
                    "change, once there is room"
                ) from error

    def delete(self, id: str) -> None:
        """Takes a session away for good.

        Raises:
            KeyError: if there is none, or that is no id.
        """
        place = self._place(id)
        with self._lock:
            saving = self._saving.setdefault(id, threading.Lock())
        with saving:
            with self._lock:
                self._held.pop(id, None)
                self._recent.pop(id, None)
            shutil.rmtree(place)

    def import_file(self, data: bytes) -> Session:
        """The session of a file (`sessionfile.read_session`), kept from now on under a new id.

        Raises:
            ValueError: if it is none.
        """
        return self._adopt(read_session(data))

    def export_file(self, session: Session) -> bytes:
        """The session as a file."""
        return write_session(session)

    def _write(self, session: Session, place: Path) -> None:
        kept = session.kept()
        for key, volume in kept.volumes.items():
            _write_volume(place / "volumes" / f"{key}.npy.gz", volume)
        history = place / "history.jsonl"
        anew = _begins(kept.news) or not history.exists()
        since = {"after": 0 if anew else history.stat().st_size, "lines": kept.news}
        record = {"revision": kept.revision, "since": since, **describe(kept)}
        write_atomically(place / "session.json", json.dumps(record, allow_nan=False).encode())
        _append(history, kept.news)
        session.told(len(kept.news))
        for file in (place / "volumes").iterdir():
            if file.name.startswith(".") or file.name.split(".")[0] not in kept.volumes:
                file.unlink(missing_ok=True)

    def _place(self, id: object) -> Path:
        if not isinstance(id, str) or not _ID.fullmatch(id) or not (self.folder / id / "session.json").is_file():
            raise KeyError(f"there is no session {str(id)[:40]!r}")
        return self.folder / id

    def _adopt(self, session: Session) -> Session:
        place = self.folder / session.id
        try:
            (place / "volumes").mkdir(parents=True)
            with self._lock:
                self._hold(session)
            self.save(session)
        except (OSError, NotKeptError) as error:
            with self._lock:
                self._held.pop(session.id, None)
                self._recent.pop(session.id, None)
            shutil.rmtree(place, ignore_errors=True)
            if isinstance(error, NotKeptError):
                raise
            raise NotKeptError(f"a session cannot be begun on the disk ({os.strerror(error.errno or 0)})") from error
        return session

    def _hold(self, session: Session) -> Session:
        self._held[session.id] = self._recent[session.id] = session
        self._recent.move_to_end(session.id)
        while len(self._recent) > _AT_HAND:
            self._recent.popitem(last=False)
        return session

    def _load(self, place: Path) -> Session:
        for name in ("session.json", "history.jsonl"):
            sweep(place / name)
        record = _read(place)
        revision = record.pop("revision", None)
        if type(revision) is not int:
            raise ValueError(f"the session {place.name} is damaged: it has no revision")
        since = record.pop("since", None)  # sessions of before have none
        document, solid, made_of = recall(record)
        history = _read_history(
            place / "history.jsonl", since, document, {path.name for path in (place / "volumes").iterdir()}
        )
        keys = {part.volume for one in history.documents() for part in one.parts}
        if solid is not None:
            keys.add(solid)
        volumes = {key: _read_volume(place / "volumes" / f"{key}.npy.gz", key) for key in sorted(keys)}
        return Session(place.name, history, volumes, solid, made_of, revision)


def _begins(lines: Sequence[str]) -> bool:
    """Whether lines are a whole history, and not the end of one."""
    return bool(lines) and lines[0].startswith('{"begin"')


def _text(lines: Iterable[str]) -> bytes:
    return "".join(f"{line}\n" for line in lines).encode()


def _append(path: Path, lines: Sequence[str]) -> None:
    """Adds lines to a history, all or none; if it begins anew, in the place of what was there."""
    text = _text(lines)
    if _begins(lines):
        write_atomically(path, text)
    elif lines:
        with path.open("ab", buffering=0) as file:
            end, rest = file.tell(), memoryview(text)
            try:
                while rest:
                    rest = rest[file.write(rest) :]
                os.fsync(file.fileno())
            except OSError:
                file.truncate(end)
                raise


def _read_history(path: Path, since: object, document: Document, files: Collection[str]) -> History:
    """What can be undone. The document counts, whatever the history lacks.

    Args:
        path: of the history.
        since: the steps that were kept with the document, and at which byte of the history they belong; none before.
        document: as it was kept.
        files: names of the volumes that there are.
    """
    try:
        told = path.read_bytes()
        whole = told if since is None else _since(told, since)
        *lines, rest = whole.split(b"\n")
        history = History.replay(lines)
        if any(f"{part.volume}.npy.gz" not in files for one in history.documents() for part in one.parts):
            raise ValueError("the history needs a volume that is gone")
    except (OSError, ValueError) as error:
        _log.warning("what could be undone is lost: %s", error)
        return History(document)
    if history.now != document:
        history.do(document)
        history.retell()
    elif rest or whole != told:
        history.retell()
    return history


def _since(told: bytes, since: object) -> bytes:
    """A history with the steps that were kept with the document, whether or not they, or a part of them, were added."""
    entries = fields(since, "what was done since", ("after", "lines"))
    after, lines = entries["after"], entries["lines"]
    if type(after) is not int or not 0 <= after <= len(told):
        raise ValueError("the history is shorter than it was")
    if not isinstance(lines, list) or not all(isinstance(line, str) for line in lines):
        raise ValueError("the steps since are no lines")
    return told[:after] + _text(lines)


def _read(place: Path) -> dict[str, Any]:
    record = parse_json((place / "session.json").read_bytes(), f"the session {place.name}")
    if not isinstance(record, dict):
        raise ValueError(f"the session {place.name} is damaged: it is no object")
    return record


def _write_volume(path: Path, volume: Solid) -> None:
    if not path.exists():  # a key's content never changes
        array = io.BytesIO()
        np.save(array, volume, allow_pickle=False)
        write_atomically(path, gzip.compress(array.getvalue(), 4, mtime=0))


def _read_volume(path: Path, key: str) -> Solid:
    try:
        return parse_volume(gzip.decompress(path.read_bytes()), key)
    except (OSError, EOFError, zlib.error) as error:
        raise ValueError(f"the volume {key} of the session cannot be read: {error}") from error
