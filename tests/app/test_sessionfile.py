"""Session files: whole journeys, and files that mean harm."""

from __future__ import annotations

import contextlib
import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sketchcore.app import sessionfile
from sketchcore.app.document import Placement
from sketchcore.app.ink import Stroke
from sketchcore.app.session import Session
from sketchcore.app.sessionfile import read_session, write_session
from sketchcore.camera import VIEWPOINTS


def scene() -> Session:
    """A frozen part that was moved, and a part that is being drawn, with its solid."""
    session = Session()
    session.call("Two boxes")
    for first, last in ((10, 20), (30, 50)):
        session.add_strokes("quarter-037", [Stroke.of([(60, first), (200, last)])])
        session.add_strokes("top", [Stroke.of([(60, 60), (90, 90)], "construction")])
        volume = np.zeros((64, 64, 64), np.float32)
        volume[first:last, first:last, first:last] = 1
        session.accept(volume, session.order())
        if first == 10:
            session.place(session.freeze("Box").id, Placement((0.2, 0, 0), 0.5, 1))
    return session


def rewritten(data: bytes, change: Callable[[dict[str, bytes]], object]) -> bytes:
    """A session file with its entries changed."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    change(entries)
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in entries.items():
            archive.writestr(name, content)
    return file.getvalue()


def test_a_session_comes_back_from_its_file() -> None:
    session = scene()
    data = write_session(session)
    again = read_session(data)
    assert again.document == session.document
    np.testing.assert_array_equal(again.scene(), session.scene())
    assert again.state()["solid"] == session.state()["solid"]
    assert not again.stale
    assert again.id != session.id
    assert not again.can_undo
    assert len(data) < 100_000
    session.add_strokes("quarter-037", [Stroke.of([(1, 1)])])
    assert read_session(write_session(session)).stale


def test_the_file_says_its_cameras_to_other_readers() -> None:
    with zipfile.ZipFile(io.BytesIO(write_session(scene()))) as archive:
        record = json.loads(archive.read("document.json"))
        array = np.load(io.BytesIO(archive.read(f"volumes/{record['solid']}.npy")))
    assert set(record["cameras"]) == {"quarter-037", "top"}
    np.testing.assert_array_equal(record["cameras"]["top"], VIEWPOINTS["top"].packed)
    assert array.shape == (64, 64, 64)


def _set(*path: Any) -> Callable[[dict[str, bytes]], None]:
    """Sets an entry of the document to the last of the arguments."""

    def change(entries: dict[str, bytes]) -> None:
        record = json.loads(entries["document.json"])
        inner = record
        for step in path[:-2]:
            inner = inner[step]
        inner[path[-2]] = path[-1]
        entries["document.json"] = json.dumps(record).encode()

    return change


def _volumes(content: bytes) -> Callable[[dict[str, bytes]], None]:
    def change(entries: dict[str, bytes]) -> None:
        for name in entries:
            if name.startswith("volumes/"):
                entries[name] = content

    return change


def _npy(array: np.ndarray, pickled: bool = False) -> bytes:
    file = io.BytesIO()
    np.save(file, array, allow_pickle=pickled)
    return file.getvalue()


def _huge_npy() -> bytes:
    """An array whose header claims a terabyte."""
    honest = _npy(np.zeros((64, 64, 64), np.uint8))
    return honest.replace(b"(64, 64, 64), }      ", b"(99999, 99999, 99), }")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda e: e.pop("document.json"), "no document.json"),
        (lambda e: e.update({"document.json": b"{"}), "is damaged"),
        (lambda e: e.update({"document.json": b'"\xff"'}), "UTF-8"),
        (lambda e: e.update({"document.json": b"[" * 200_000}), "nested too deeply"),
        (lambda e: e.update({"document.json": b"[1]"}), "a session must be an object"),
        (lambda e: e.update({"document.json": b'{"format": NaN}'}), "holds NaN"),
        (lambda e: [e.pop(n) for n in list(e) if n.startswith("volumes/")], r"no volumes/\w+\.npy"),
        (lambda e: e.update({f"x{i}": b"" for i in range(200)}), "up to 129 entries"),
        (_set("version", 2), "version 1; this is"),
        (_set("format", "zip"), "this is 'zip'"),
        (_set("solid", "../../../etc/passwd"), "id of a volume"),
        (_set("document", "parts", 0, "volume", "/etc/passwd"), "id of a volume"),
        (_set("document", "sheets", 0, "strokes", 0, "points", 0, 0, 1e999), "holds Infinity"),
        (_set("cameras", "top", [0.0] * 15), "camera top is another one"),
        (_set("cameras", "top", [True] * 15), "camera top is another one"),
        (_set("cameras", "top", 5), "camera top is another one"),
        (_set("cameras", "below", []), "by name"),
        (_volumes(b""), "is damaged"),
        (_volumes(b"\x93NUMPY"), "is damaged"),
        (_volumes(_npy(np.zeros((64, 64, 64), np.uint8))), "its content is another"),
        (_volumes(_npy(np.zeros((64, 64), np.uint8))), r"must be uint8 \[64, 64, 64\]"),
        (_volumes(_npy(np.zeros((64, 64, 64), np.int8))), r"must be uint8 \[64, 64, 64\]"),
        (_volumes(_npy(np.array([print], object), pickled=True)), "is damaged"),
        (_volumes(_huge_npy()), "is damaged"),
        (_volumes(_npy(np.zeros(300_000, np.uint8))), "larger than"),
    ],
)
def test_what_is_wrong_is_said(change: Callable[[dict[str, bytes]], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_session(rewritten(write_session(scene()), change))


@pytest.mark.parametrize("data", [b"", b"PK", b"hello" * 100, b"PK\x05\x06" + bytes(18)])
def test_what_is_no_zip_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="not a session file"):
        read_session(data)


def test_every_cut_and_many_flips_are_refused_or_harmless() -> None:
    data = write_session(scene())
    whole = read_session(data).document
    random = np.random.default_rng(0)
    for _ in range(150):
        broken = bytearray(data)
        broken[random.integers(len(data))] ^= 1 << random.integers(8)
        with contextlib.suppress(ValueError):
            assert read_session(bytes(broken)).document == whole
    for length in random.integers(0, len(data) - 1, 30):
        with pytest.raises(ValueError, match="session"):
            read_session(data[:length])


def test_a_bomb_is_not_unpacked(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sessionfile, "MAX_DOCUMENT", 100_000)
    bomb = rewritten(write_session(scene()), lambda e: e.update({"document.json": b" " * 50_000_000}))
    assert len(bomb) < 100_000
    with pytest.raises(ValueError, match="larger than 100000 bytes"):
        read_session(bomb)
    monkeypatch.setattr(sessionfile, "MAX_FILE", 1000)
    with pytest.raises(ValueError, match="up to 0 MB"):
        read_session(bomb)


def test_names_inside_are_no_paths(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "inner").mkdir()
    monkeypatch.chdir(tmp_path / "inner")
    session = scene()
    data = rewritten(write_session(session), lambda e: e.update({"../evil.npy": b"x", "evil/../../evil": b"x"}))
    assert read_session(data).document == session.document
    assert [path.name for path in tmp_path.rglob("*")] == ["inner"]
