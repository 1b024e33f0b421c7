"""Session files of the app, and the history that lies beside a session on disk. First byte: z for the file, h."""

from __future__ import annotations

from random import Random

import numpy as np

from harness import Target
from mutations import of_bytes, of_json_text, of_zip
from sketchcore.app.document import Placement
from sketchcore.app.history import History
from sketchcore.app.ink import Stroke
from sketchcore.app.session import Session
from sketchcore.app.sessionfile import read_session, write_session


def attempt(data: bytes) -> None:
    """Reads a file, and does with the session what the app does first."""
    if data[:1] == b"h":
        History.replay(data[1:].split(b"\n"))
        return
    session = read_session(data[1:])
    session.state()
    session.scene()
    session.drawings()
    assert read_session(write_session(session)).document == session.document


def _drawn() -> Session:
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


def seeds() -> list[bytes]:
    """A session of two parts, an empty one, and the histories of both."""
    drawn, empty = _drawn(), Session()
    files = [b"z" + write_session(session) for session in (drawn, empty)]
    drawn.undo()
    return files + [b"h" + "\n".join(session.kept().news).encode() for session in (drawn, empty)]


def mutate(data: bytes, random: Random) -> bytes:
    """The document as JSON, the volumes as bytes."""
    if data[:1] == b"z":
        return b"z" + of_zip(data[1:], random, _entry)
    lines = data[1:].split(b"\n")
    at = random.randrange(len(lines))
    lines[at] = of_json_text(lines[at], random)
    return b"h" + b"\n".join(lines)


def _entry(name: str, content: bytes, random: Random) -> bytes:
    return of_json_text(content, random) if name.endswith(".json") else of_bytes(content, random)


TARGET = Target(attempt, seeds, mutate, (ValueError,), megabytes=512)
