"""Sessions on disk: kept after every change, and found again after whatever happened.

FOLDER/ID/session.json          what `sessionfile.describe` says, and the revision; replaced whole
FOLDER/ID/volumes/KEY.npy.gz      one a solid, written once, before the session that names it
"""

from __future__ import annotations

import gzip
import io
import json
import re
import shutil
import threading
import weakref
import zlib
from collections import OrderedDict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from sketchcore.app.session import Session, Solid
from sketchcore.app.sessionfile import describe, parse_json, parse_volume, read_session, restore, write_session
from sketchcore.atomic import write_atomically

_ID = re.compile(r"[0-9a-f]{32}")
_AT_HAND = 64
"""Sessions that stay in memory without being in use."""


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
        """A new, empty session, kept from now on."""
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
        """Keeps a session as it is now: whole, or as it was before. One that was deleted stays deleted."""
        with self._lock:
            saving = self._saving.setdefault(session.id, threading.Lock())
        with saving:  # whoever saves later saves what is newer
            if self._held.get(session.id) is not session:
                return
            document, volumes, solid, made_of, revision = session.kept()
            place = self.folder / session.id
            for key, volume in volumes.items():
                _write_volume(place / "volumes" / f"{key}.npy.gz", volume)
            record = {"revision": revision, **describe(document, solid, made_of)}
            write_atomically(place / "session.json", json.dumps(record, allow_nan=False).encode())
            for file in (place / "volumes").iterdir():
                if file.name.startswith(".") or file.name.split(".")[0] not in volumes:
                    file.unlink(missing_ok=True)

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

    def _place(self, id: object) -> Path:
        if not isinstance(id, str) or not _ID.fullmatch(id) or not (self.folder / id / "session.json").is_file():
            raise KeyError(f"there is no session {str(id)[:40]!r}")
        return self.folder / id

    def _adopt(self, session: Session) -> Session:
        (self.folder / session.id / "volumes").mkdir(parents=True)
        with self._lock:
            self._hold(session)
        self.save(session)
        return session

    def _hold(self, session: Session) -> Session:
        self._held[session.id] = self._recent[session.id] = session
        self._recent.move_to_end(session.id)
        while len(self._recent) > _AT_HAND:
            self._recent.popitem(last=False)
        return session

    def _load(self, place: Path) -> Session:
        record = dict(_read(place))
        revision = record.pop("revision", None)
        if type(revision) is not int:
            raise ValueError(f"the session {place.name} is damaged: it has no revision")
        return restore(record, lambda key: _read_volume(place / "volumes" / f"{key}.npy.gz", key), place.name, revision)


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
