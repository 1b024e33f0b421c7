"""A session as one file: a zip of `document.json` and of its volumes as `.npy`, read with suspicion.

    document.json       {"format": "sketchcore session", "version": 1, "document", "solid", "made_of", "cameras"}
    volumes/KEY.npy     uint8 [64, 64, 64] (x, y, z), probability * 255

Names inside are looked up, never used as paths; sizes are checked before anything is unpacked.
"""

from __future__ import annotations

import io
import json
import zipfile
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
from sketchcore.untrusted import Archive, parse_array, parse_json

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
    archive = Archive(io.BytesIO(data), "a session file of sketchcore", _MAX_ENTRIES)
    record = parse_json(archive.read(_DOCUMENT, MAX_DOCUMENT), "the session's document")
    document, solid, made_of = recall(record)
    keys = {part.volume for part in document.parts} | ({solid} if solid is not None else set())
    names = {key: f"volumes/{check_id(key, 'a volume')}.npy" for key in sorted(keys)}
    volumes = {key: parse_volume(archive.read(name, _VOLUME_BYTES), key) for key, name in names.items()}
    return Session(None, History(document), volumes, solid, made_of)


def parse_volume(content: bytes, key: str) -> Solid:
    """The solid of an `.npy` file.

    Raises:
        ValueError: if it is damaged, or another one than its key says.
    """
    array = parse_array(content, f"the volume {key}")
    if array.dtype != np.uint8 or array.shape != (SIDE,) * 3:
        raise ValueError(f"the volume {key} must be uint8 [64, 64, 64]")
    solid = as_solid(array)
    if key_of(solid) != key:
        raise ValueError(f"the volume {key} is damaged: its content is another")
    return solid
