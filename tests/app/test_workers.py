"""Reconstructions in the background: in turn, replaced by newer ones, and never silent about trouble."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from sketchcore.app.ink import Stroke
from sketchcore.app.order import Progress
from sketchcore.app.session import Session
from sketchcore.app.workers import ROUNDS, Workers

PATIENCE = 20.0


class Gate:
    """Stands in for the networks. Each round waits to be let through; the volume says how many drawings there were."""

    def __init__(self) -> None:
        self.seen: list[list[str]] = []
        self.at_once = 0
        self.most = 0
        self.lock = threading.Lock()
        self.rounds = threading.Semaphore(0)

    def __call__(
        self, drawings: Any, views: Any, *, iterations: int, model: Any, progress: Callable[[int, int, Any], None]
    ) -> Any:
        with self.lock:
            self.seen.append(list(views))
            self.at_once += 1
            self.most = max(self.most, self.at_once)
        try:
            volume = np.full((64, 64, 64), len(drawings) / 255, np.float32)
            for number in range(iterations + 1):
                assert self.rounds.acquire(timeout=PATIENCE)
                progress(number, iterations, volume)
            return SimpleNamespace(probability=volume)
        finally:
            with self.lock:
                self.at_once -= 1

    def let(self, rounds: int = 1000) -> None:
        self.rounds.release(rounds)


@pytest.fixture
def gate() -> Iterator[Gate]:
    gate = Gate()
    yield gate
    gate.let(100_000)


def drawn(viewpoint: str = "quarter-037") -> Session:
    session = Session()
    draw(session, viewpoint)
    return session


def draw(session: Session, viewpoint: str = "quarter-037") -> None:
    session.add_strokes(viewpoint, [Stroke.of([(60, 100), (200, 100)])])


def until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.002)


def test_a_session_gets_its_solid_round_by_round(gate: Gate) -> None:
    heard: list[Progress] = []
    session = drawn()
    with Workers(reconstruct=gate, changed=lambda one: heard.append(one.progress)) as workers:
        workers.submit(session)
        until(lambda: len(gate.seen) == 1)
        assert session.progress == Progress(0, ROUNDS, working=True)
        gate.let(1)
        until(lambda: session.solid is not None)
        assert not session.stale
        gate.let()
        until(lambda: not session.progress.working)
    assert gate.seen == [["quarter-037"]]
    assert session.progress == Progress(ROUNDS, ROUNDS)
    assert session.trouble == ""
    assert [p.round for p in heard if p.working] == [0, *range(ROUNDS + 1)]
    assert heard[0].waiting


def test_sessions_take_turns(gate: Gate) -> None:
    sessions = [drawn(view) for view in ("quarter-037", "quarter-052", "quarter-127", "quarter-142")]
    with Workers(reconstruct=gate) as workers:
        workers.submit(sessions[0])
        until(lambda: len(gate.seen) == 1)
        for session in sessions[1:]:
            workers.submit(session)
        for _ in range(10):
            workers.submit(sessions[0])  # impatience gains nothing
            workers.submit(sessions[1])
        assert sessions[2].progress.waiting
        gate.let()
        until(lambda: len(gate.seen) == 5 and not any(s.progress.working or s.progress.waiting for s in sessions))
    assert [views[0][-3:] for views in gate.seen] == ["037", "052", "127", "142", "037"]


def test_the_newest_drawings_are_taken_when_the_turn_comes(gate: Gate) -> None:
    busy, session = drawn(), drawn()
    with Workers(reconstruct=gate) as workers:
        workers.submit(busy)
        until(lambda: len(gate.seen) == 1)
        workers.submit(session)
        draw(session, "top")
        workers.submit(session)
        gate.let()
        until(lambda: len(gate.seen) == 2 and not session.progress.working)
    assert gate.seen[1] == ["quarter-037", "top"]
    assert not session.stale


def test_what_is_asked_anew_ends_after_its_round_which_is_shown(gate: Gate) -> None:
    session = drawn()
    with Workers(reconstruct=gate) as workers:
        workers.submit(session)
        until(lambda: len(gate.seen) == 1)
        draw(session, "top")
        workers.submit(session)
        gate.let(1)
        until(lambda: len(gate.seen) == 2)
        assert session.solid is not None
        assert session.solid[0, 0, 0] == 1
        assert session.stale
        gate.let()
        until(lambda: not session.progress.working)
        assert session.solid[0, 0, 0] == 2
        assert not session.stale


def test_a_part_that_was_frozen_is_not_worked_on_any_longer(gate: Gate) -> None:
    session = drawn()
    with Workers(reconstruct=gate) as workers:
        workers.submit(session)
        gate.let(1)
        until(lambda: session.solid is not None)
        session.freeze()
        gate.let(1)
        until(lambda: not session.progress.working)
        assert session.solid is None
        assert session.trouble == ""


@pytest.mark.parametrize("threads", [1, 3])
def test_no_more_threads_than_allowed_and_one_a_session(gate: Gate, threads: int) -> None:
    sessions = [drawn() for _ in range(6)]
    with Workers(reconstruct=gate, threads=threads) as workers:
        for session in sessions * 3:
            workers.submit(session)
        until(lambda: len(gate.seen) == threads)
        gate.let(100_000)
        until(lambda: not any(s.progress.working or s.progress.waiting for s in sessions))
        assert all(s.solid is not None for s in sessions)
    assert gate.most == threads


@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (ValueError("there is no ink"), "The reconstruction failed: there is no ink"),
        (KeyError("unknown viewpoint"), "The reconstruction failed: unknown viewpoint"),
        (MemoryError(), "The reconstruction failed: there is not enough memory for it"),
        (RuntimeError(), "The reconstruction failed: RuntimeError"),
    ],
)
def test_trouble_is_said_and_goes_with_the_next_attempt(
    gate: Gate, error: Exception, sentence: str, caplog: pytest.LogCaptureFixture
) -> None:
    broken = True

    def reconstruct(*arguments: Any, **options: Any) -> Any:
        if broken:
            raise error
        return gate(*arguments, **options)

    session = drawn()
    with Workers(reconstruct=reconstruct) as workers:
        workers.submit(session)
        until(lambda: session.trouble != "")
        assert session.trouble == sentence
        until(lambda: session.progress == Progress(0, ROUNDS))
        broken = False
        workers.submit(session)
        gate.let()
        until(lambda: session.solid is not None and not session.progress.working)
        assert session.trouble == ""


def test_a_listener_that_fails_stops_nobody(gate: Gate, caplog: pytest.LogCaptureFixture) -> None:
    def fail(session: Session) -> None:
        raise OSError("no space left")

    session = drawn()
    with Workers(reconstruct=gate, changed=fail) as workers:
        workers.submit(session)
        gate.let()
        until(lambda: session.solid is not None and not session.progress.working)
    assert "no space left" in caplog.text


def test_nothing_to_reconstruct_is_said_at_once(gate: Gate) -> None:
    with Workers(reconstruct=gate) as workers, pytest.raises(ValueError, match="draw something first"):
        workers.submit(Session())


def test_a_request_can_be_withdrawn(gate: Gate) -> None:
    busy, session = drawn(), drawn("quarter-217")
    with Workers(reconstruct=gate) as workers:
        workers.submit(busy)
        until(lambda: len(gate.seen) == 1)
        workers.submit(session)
        workers.withdraw(session)
        assert session.progress == Progress()
        gate.let()
        until(lambda: not busy.progress.working)
    assert len(gate.seen) == 1


def test_drawings_that_go_while_they_wait_are_trouble_and_no_crash(gate: Gate) -> None:
    busy, session = drawn(), drawn()
    with Workers(reconstruct=gate) as workers:
        workers.submit(busy)
        until(lambda: len(gate.seen) == 1)
        workers.submit(session)
        session.delete_sheet("quarter-037")
        gate.let()
        until(lambda: not session.progress.waiting and not session.progress.working)
        until(lambda: "draw something first" in session.trouble)


def test_closing_ends_the_threads(gate: Gate) -> None:
    running, waiting = drawn(), drawn()
    workers = Workers(reconstruct=gate)
    workers.submit(running)
    until(lambda: len(gate.seen) == 1)
    workers.submit(waiting)
    gate.let(1)
    workers.close()
    assert not any(thread.is_alive() for thread in workers._threads)
    assert running.solid is not None
    assert not running.progress.working
    assert not waiting.progress.waiting
    with pytest.raises(RuntimeError, match="closed"):
        workers.submit(running)


def test_at_least_one_thread() -> None:
    with pytest.raises(ValueError, match="at least 1 thread"):
        Workers(threads=0)
