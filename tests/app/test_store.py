"""Sessions on disk: nothing is lost, whatever happens to the server."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from test_sessionfile import scene

from sketchcore.app.ink import Stroke
from sketchcore.app.session import Session
from sketchcore.app.store import Store


def draw(session: Session, y: float = 100) -> None:
    session.add_strokes("quarter-037", [Stroke.of([(60, y), (200, y)])])


def test_a_session_is_found_again_with_all_that_can_be_undone(tmp_path: Path) -> None:
    store = Store(tmp_path / "sessions")
    session = store.import_file(store.export_file(scene()))
    for y in (10, 20, 30):
        draw(session, y)
        store.save(session)
    session.undo()
    store.save(session)
    again = Store(tmp_path / "sessions").get(session.id)
    assert again is not session
    assert again.state() == session.state()
    np.testing.assert_array_equal(again.scene(), session.scene())
    assert again.redo()
    for _ in range(3):
        assert again.undo()
    assert not again.undo()
    assert len(again.document.sheets[0].strokes) == 1


def test_a_deleted_part_can_be_undone_after_a_restart(tmp_path: Path) -> None:
    store = Store(tmp_path)
    session = store.create()
    draw(session)
    session.accept(np.full((64, 64, 64), 0.7, np.float32), session.order())
    session.delete_part(session.freeze().id)
    store.save(session)
    again = Store(tmp_path).get(session.id)
    assert again.undo()
    assert again.scene()[5, 5, 5] == 178
    assert again.undo()
    assert again.document.sheets


def test_the_same_id_is_the_same_session(tmp_path: Path) -> None:
    store = Store(tmp_path)
    session = store.create()
    assert store.get(session.id) is session
    many = [store.create().id for _ in range(80)]
    assert store.get(session.id) is session
    assert {store.get(id).id for id in many} == set(many)
    assert len(store._held) < 80


def test_sessions_are_listed_the_last_one_first(tmp_path: Path) -> None:
    store = Store(tmp_path)
    first, second = store.create(), store.create()
    os.utime(tmp_path / second.id / "session.json", (1e9, 1e9))
    first.call("First")
    store.save(first)
    (tmp_path / ("f" * 32)).mkdir()
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / ("e" * 32)).mkdir()
    (tmp_path / ("e" * 32) / "session.json").write_text("[]")
    assert [(one.id, one.name) for one in Store(tmp_path).list()] == [(first.id, "First"), (second.id, "Untitled")]
    assert store.list()[0].changed > store.list()[1].changed


@pytest.mark.parametrize("id", ["", "..", "../x", "a" * 31, "g" * 32, "A" * 32, "0" * 32, "0" * 32 + "\n", None, 5])
def test_what_is_no_id_is_no_path(tmp_path: Path, id: object) -> None:
    store = Store(tmp_path / "sessions")
    (tmp_path / "session.json").write_text("{}")
    for ask in (store.get, store.delete):
        with pytest.raises(KeyError, match="no session"):
            ask(id)  # type: ignore[arg-type]


def test_what_is_deleted_stays_deleted(tmp_path: Path) -> None:
    store = Store(tmp_path)
    session = store.create()
    store.delete(session.id)
    draw(session)
    store.save(session)
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(KeyError):
        store.get(session.id)


def test_volumes_are_written_once_and_go_when_nothing_needs_them(tmp_path: Path) -> None:
    store = Store(tmp_path)
    session = store.create()
    draw(session)
    session.accept(np.full((64, 64, 64), 0.2, np.float32), session.order())
    store.save(session)
    folder = tmp_path / session.id / "volumes"
    (only,) = folder.iterdir()
    before = only.stat().st_mtime_ns, only.stat().st_ino
    draw(session, 50)
    store.save(session)
    assert (only.stat().st_mtime_ns, only.stat().st_ino) == before
    session.accept(np.full((64, 64, 64), 0.4, np.float32), session.order())
    (folder / f".{only.stem}-0123.gz").write_bytes(b"left over")
    store.save(session)
    (other,) = folder.iterdir()
    assert other.name != only.name


@pytest.mark.parametrize("damage", ["torn", "garbage", "gone", "behind", "empty"])
def test_a_damaged_history_costs_undo_and_no_drawing(tmp_path: Path, damage: str) -> None:
    store = Store(tmp_path)
    session = store.create()
    for y in range(5):
        draw(session, 10 * y)
        store.save(session)
    path = tmp_path / session.id / "history.jsonl"
    text = path.read_bytes()
    lines = text.splitlines(keepends=True)
    assert len(lines) == 6
    changed = {
        "torn": text + b'{"do": {"na',
        "garbage": b"\x00\xff" + text,
        "behind": b"".join(lines[:-1]),
        "empty": b"",
    }
    if damage in changed:
        path.write_bytes(changed[damage])
    else:
        path.unlink()
    again = Store(tmp_path)
    found = again.get(session.id)
    assert found.document == session.document
    undone = 0
    while found.undo():
        undone += 1
    assert undone == {"torn": 5, "behind": 5}.get(damage, 0)
    for _ in range(undone):
        found.redo()
    draw(found, 200)
    again.save(found)
    last = Store(tmp_path).get(session.id)
    assert last.document == found.document
    for _ in range(undone + 1):
        assert last.undo()


@pytest.mark.parametrize("torn", [False, True])
def test_a_kill_between_a_session_and_its_history_costs_no_step(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, torn: bool
) -> None:
    store = Store(tmp_path)
    session = store.create()
    draw(session, 10)
    store.save(session)

    class Killed(BaseException):
        pass

    def killed(path: Path, lines: list[str]) -> None:
        if torn:
            path.write_bytes(path.read_bytes() + lines[0].encode()[:20])
        raise Killed

    monkeypatch.setattr("sketchcore.app.store._append", killed)
    for y in (20, 30):
        draw(session, y)
    with pytest.raises(Killed):
        store.save(session)  # two steps at once
    monkeypatch.undo()
    again = Store(tmp_path)
    found = again.get(session.id)
    assert found.document == session.document
    assert sum(found.undo() for _ in range(10)) == 3
    again.save(found)
    last = Store(tmp_path).get(session.id)
    assert sum(last.redo() for _ in range(10)) == 3


def test_a_session_of_before_is_read(tmp_path: Path) -> None:
    store = Store(tmp_path)
    session = store.create()
    draw(session)
    store.save(session)
    path = tmp_path / session.id / "session.json"
    record = json.loads(path.read_text())
    del record["since"]
    path.write_text(json.dumps(record))
    found = Store(tmp_path).get(session.id)
    assert found.document == session.document
    assert found.undo()


@pytest.mark.parametrize(
    "since",
    [
        3,
        {},
        {"after": -1, "lines": []},
        {"after": 10**9, "lines": []},
        {"after": 0, "lines": [3]},
        {"after": True, "lines": []},
    ],
)
def test_steps_that_make_no_sense_cost_undo_and_no_drawing(tmp_path: Path, since: object) -> None:
    store = Store(tmp_path)
    session = store.create()
    draw(session)
    store.save(session)
    path = tmp_path / session.id / "session.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"since": since}))
    found = Store(tmp_path).get(session.id)
    assert found.document == session.document
    assert not found.undo()


def test_a_damaged_session_says_so(tmp_path: Path) -> None:
    store = Store(tmp_path)
    session = store.create()
    draw(session)
    session.accept(np.zeros((64, 64, 64), np.float32), session.order())
    store.save(session)
    (volume,) = (tmp_path / session.id / "volumes").iterdir()
    volume.write_bytes(b"no gzip")
    with pytest.raises(ValueError, match="cannot be read"):
        Store(tmp_path).get(session.id)
    (tmp_path / session.id / "session.json").write_text("{}")
    with pytest.raises(ValueError, match="damaged"):
        Store(tmp_path).get(session.id)


def test_whoever_saves_last_saves_the_newest(tmp_path: Path) -> None:
    store = Store(tmp_path)
    session = store.create()

    def work(first: int) -> None:
        for i in range(20):
            draw(session, first + i)
            store.save(session)

    threads = [threading.Thread(target=work, args=(40 * i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    again = Store(tmp_path).get(session.id)
    assert again.document == session.document
    assert sum(again.undo() for _ in range(100)) == 80


DRAWING = """
import sys
import numpy as np
from sketchcore.app.ink import Stroke
from sketchcore.app.store import Store

store = Store(sys.argv[1])
session = store.create()
print(session.id, flush=True)
for number in range(100_000):
    session.add_strokes("quarter-037", [Stroke.of([(number % 256, 10), (number % 256, 200)])])
    if number % 5 == 4:
        session.accept(np.full((64, 64, 64), number % 250 / 255, np.float32), session.order())
    if number % 20 == 19:
        session.freeze()
    store.save(session)
    print(number, flush=True)
"""


@pytest.mark.slow
@pytest.mark.parametrize("lines", [1, 23, 67])
def test_a_server_that_is_killed_has_lost_nothing(tmp_path: Path, lines: int) -> None:
    process = subprocess.Popen([sys.executable, "-c", DRAWING, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    id = process.stdout.readline().strip()
    last = -1
    while last < lines:
        last = int(process.stdout.readline())
    time.sleep(0.003 * lines)  # somewhere within a save
    process.send_signal(signal.SIGKILL)
    rest = process.stdout.read().split("\n")
    process.stdout.close()
    process.wait()
    last = max([last, *(int(number) for number in rest[:-1])])
    session = Store(tmp_path).get(id)
    document = session.document
    drawn = sum(len(s.strokes) for sheets in (document.sheets, *(p.sheets for p in document.parts)) for s in sheets)
    assert last + 1 <= drawn <= last + 2
    session.scene()
    undone = 0
    while session.undo():
        undone += 1
    assert undone == drawn + len(document.parts)
