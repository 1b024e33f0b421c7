"""A session as one file: a zip of `document.json` and of its volumes as `.npy`, read with suspicion.

    document.json       {"format": "sketchcore session", "version": 1, "document", "solid", "made_of", "cameras"}
    volumes/KEY.npy     uint8 [64, 64, 64] (x, y, z), probability * 255

Names inside are looked up, never used as paths; sizes are checked before anything is unpacked.
"""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from sketchcore.app.document import Document, fields, from_json, to_json
from sketchcore.app.history import History
from sketchcore.app.ink import check_id
from sketchcore.app.session import Kept, Session
from sketchcore.app.solids import Solid, as_solid, key_of
from sketchcore.camera import VIEWPOINTS
from sketchcore.grids import SIDE

FORMAT = "sketchcore session"
VERSION = 1
SUFFIX = ".sketchcore"
MAX_FILE = 64 * 2**20
"""Bytes of a session file."""
MAX_DOCUMENT = 24 * 2**20
"""Bytes of its document, unpacked."""
_VOLUME_BYTES = SIDE**3 + 1024  # with the header of .npy
_MAX_ENTRIES = 1 + 2 * 64
_DOCUMENT = "document.json"
_FIELDS = ("format", "version", "document", "solid", "made_of", "cameras")


def describe(kept: Kept) -> dict[str, Any]:
    """What `document.json` holds, as plain data; the cameras are for other readers."""
    document = kept.document
    names = dict.fromkeys(
        sheet.viewpoint for sheets in (document.sheets, *(part.sheets for part in document.parts)) for sheet in sheets
    )
    return {
        "format": FORMAT,
        "version": VERSION,
        "document": to_json(document),
        "solid": kept.solid,
        "made_of": kept.made_of,
        "cameras": {name: VIEWPOINTS[name].packed.tolist() for name in names},
    }


def recall(data: object) -> tuple[Document, str | None, str | None]:
    """The document that `describe` told of, the key of its solid, and what that was made of.

    Args:
        data: plain data, from anywhere.

    Raises:
        ValueError: for whatever is wrong with it.
    """
    entries = fields(data, "a session", _FIELDS)
    if entries["format"] != FORMAT or entries["version"] != VERSION:
        found = f"{str(entries['format'])[:40]!r}, version {str(entries['version'])[:40]!r}"
        raise ValueError(f"sessions are {FORMAT!r}, version {VERSION}; this is {found}")
    _check_cameras(entries["cameras"])
    solid, made_of = (None if entries[n] is None else check_id(entries[n], "a volume") for n in ("solid", "made_of"))
    return from_json(entries["document"]), solid, made_of


def _check_cameras(cameras: object) -> None:
    """Drawings mean nothing from other cameras."""
    if not isinstance(cameras, Mapping) or not set(cameras) <= set(VIEWPOINTS):
        raise ValueError("the cameras of a session must be those of sketchcore's viewpoints, by name")
    for name, row in cameras.items():
        numbers = row if isinstance(row, list) and all(type(n) in (int, float) for n in row) else []
        if len(numbers) != 15 or not np.allclose(np.array(numbers, np.float64), VIEWPOINTS[name].packed, atol=1e-6):
            raise ValueError(
                f"the session's camera {name} is another one than sketchcore's: its drawings would not fit"
            )


def parse_json(text: bytes, what: str) -> Any:
    """Plain data of JSON, without NaN and Infinity.

    Raises:
        ValueError: for what is no JSON, or nested without end.
    """

    def refuse(constant: str) -> None:
        raise ValueError(f"{what} holds {constant}; every number must be finite")

    try:
        return json.loads(text, parse_constant=refuse)
    except UnicodeDecodeError as error:
        raise ValueError(f"{what} is no text in UTF-8") from error
    except json.JSONDecodeError as error:
        raise ValueError(f"{what} is damaged: {error}") from error
    except RecursionError as error:
        raise ValueError(f"{what} is nested too deeply") from error


def write_session(session: Session) -> bytes:
    """The session file: the drawings of all parts, the cameras, and the volumes; not what could be undone."""
    kept = session.kept()
    needed = {part.volume for part in kept.document.parts} | ({kept.solid} if kept.solid is not None else set())
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(_DOCUMENT, json.dumps(describe(kept), allow_nan=False))
        for key in sorted(needed):
            array = io.BytesIO()
            np.save(array, kept.volumes[key], allow_pickle=False)
            archive.writestr(f"volumes/{key}.npy", array.getvalue())
    return file.getvalue()


def read_session(data: bytes) -> Session:
    """The session of a file that may come from anywhere, under a new id.

    Raises:
        ValueError: if it is none, is damaged, or is larger than a session may be.
    """
    if len(data) > MAX_FILE:
        raise ValueError(f"a session file may have up to {MAX_FILE // 2**20} MB, this one has more")
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if len(archive.infolist()) > _MAX_ENTRIES:
                raise ValueError(f"a session file has up to {_MAX_ENTRIES} entries, this one more")
            record = parse_json(_entry(archive, _DOCUMENT, MAX_DOCUMENT), "the session's document")
            document, solid, made_of = recall(record)
            keys = {part.volume for part in document.parts} | ({solid} if solid is not None else set())
            volumes = {key: _volume(archive, key) for key in sorted(keys)}
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, OSError) as error:
        raise ValueError(f"this is no session file of sketchcore, or it is damaged: {error}") from error
    return Session(None, History(document), volumes, solid, made_of)


def _entry(archive: zipfile.ZipFile, name: str, most: int) -> bytes:
    try:
        entry = archive.getinfo(name)
    except KeyError:
        raise ValueError(f"this is no session file of sketchcore, or it is damaged: it has no {name}") from None
    # What the archive says of its size may be a lie; no more than that much is unpacked.
    with archive.open(entry) as stream:
        content = stream.read(most + 1)
    if len(content) > most:
        raise ValueError(f"{name} in the session file is larger than {most} bytes")
    return content


def _volume(archive: zipfile.ZipFile, key: str) -> Solid:
    return parse_volume(_entry(archive, f"volumes/{check_id(key, 'a volume')}.npy", _VOLUME_BYTES), key)


def parse_volume(content: bytes, key: str) -> Solid:
    """The solid of an `.npy` file.

    Raises:
        ValueError: if it is damaged, or another one than its key says.
    """
    try:
        array = np.load(io.BytesIO(content), allow_pickle=False)
    except (ValueError, EOFError, TypeError, SyntaxError, MemoryError, OverflowError) as error:
        raise ValueError(f"the volume {key} is damaged: {error}") from error
    if not isinstance(array, np.ndarray) or array.dtype != np.uint8 or array.shape != (SIDE,) * 3:
        raise ValueError(f"the volume {key} must be uint8 [64, 64, 64]")
    solid = as_solid(array)
    if key_of(solid) != key:
        raise ValueError(f"the volume {key} is damaged: its content is another")
    return solid
