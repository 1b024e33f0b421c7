"""Reconstructions in the background: a bounded pool of threads, and every session has its turn."""

from __future__ import annotations

import logging
import threading
from collections import OrderedDict
from collections.abc import Callable
from functools import partial
from typing import Any, Protocol

from sketchcore.app.order import Order, Progress
from sketchcore.app.session import Session

ROUNDS = 5
"""Over all drawings, at most; fewer where the solid has settled."""

_log = logging.getLogger(__name__)


class Reconstruct(Protocol):
    """`sketchcore.reconstruct`, or what does as much."""

    def __call__(
        self, drawings: Any, views: Any, *, iterations: int, model: Any, progress: Callable[[int, int, Any], None]
    ) -> Any:
        """Returns an object with `probability`, float32 [64, 64, 64]; calls `progress(round, rounds, probability)`."""
        ...


class _SupersededError(Exception):
    """The session has asked again, or nobody needs the result any more."""


class Workers:
    """Threads that reconstruct for sessions, one at a time for each of them, the one that waits longest first.

    A session waits in one place: asking again changes nothing about its turn, and its drawings are taken as they are
    when its turn comes. One that asks while it is being served is served again, after the others; what is running for
    it ends after the round that it is at, which is shown.
    """

    def __init__(
        self,
        model: Any = None,
        threads: int = 1,
        changed: Callable[[Session], None] | None = None,
        reconstruct: Reconstruct | None = None,
    ) -> None:
        """Starts the threads; they load the model at once, so that the first drawing need not wait for it.

        Args:
            model: as for `sketchcore.reconstruct`.
            threads: how many sessions are served at a time, 1 or more; each uses all processors as it can.
            changed: called from a worker's thread whenever a session's solid or progress changed.
            reconstruct: None for `sketchcore.reconstruct`, which leaves every drawing where it is.

        Raises:
            ValueError: for fewer than one thread.
        """
        if threads < 1:
            raise ValueError(f"reconstructions need at least 1 thread, got {threads}")
        self._model = model
        self._changed = changed
        self._reconstruct = reconstruct
        self._turn = threading.Condition()
        self._waiting: OrderedDict[str, Session] = OrderedDict()
        self._running: set[str] = set()
        self._closed = False
        self._loading = threading.Lock()
        self._threads = [
            threading.Thread(target=self._serve, name=f"reconstruct-{number}", daemon=True) for number in range(threads)
        ]
        for thread in self._threads:
            thread.start()

    def submit(self, session: Session) -> None:
        """Asks for the reconstruction of a session's drawings.

        Raises:
            ValueError: if there is nothing to reconstruct (`Session.order`).
            RuntimeError: after `close`.
        """
        session.order()  # says what is missing to whom asked
        with self._turn:
            if self._closed:
                raise RuntimeError("the workers are closed")
            self._waiting.setdefault(session.id, session)
            if session.id not in self._running:
                session.report(Progress(0, ROUNDS, working=False, waiting=True))
            self._turn.notify()
        self._tell(session)

    def withdraw(self, session: Session) -> None:
        """Takes a request back; what is running for the session ends after the round that it is at."""
        with self._turn:
            if self._waiting.pop(session.id, None) is not None and session.id not in self._running:
                session.report(Progress())
        self._tell(session)

    def close(self, timeout: float | None = 30.0) -> None:
        """Ends the threads, after the rounds that they are at; waits for them so many seconds."""
        with self._turn:
            self._closed = True
            for session in self._waiting.values():
                session.report(Progress())
            self._waiting.clear()
            self._turn.notify_all()
        for thread in self._threads:
            thread.join(timeout)

    def __enter__(self) -> Workers:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _serve(self) -> None:
        try:
            self._load()
        except Exception:
            _log.exception("the model cannot be loaded")  # and is said to whoever asks for a reconstruction
        while (session := self._next()) is not None:
            trouble = ""
            try:
                self._run(session, session.order())
            except _SupersededError:
                pass
            except Exception as error:
                trouble = _sentence(error)
                if not isinstance(error, ValueError | TypeError | FileNotFoundError):
                    _log.exception("a reconstruction failed")
            with self._turn:
                self._running.discard(session.id)
                again = session.id in self._waiting
                done = session.progress.round
                session.report(Progress(0 if again else done, ROUNDS, waiting=again), trouble)
                self._turn.notify_all()
            self._tell(session)

    def _next(self) -> Session | None:
        """The session that waits longest and is not being served; None once closed."""
        with self._turn:
            while True:
                if self._closed:
                    return None
                ready = next((id for id in self._waiting if id not in self._running), None)
                if ready is not None:
                    self._running.add(ready)
                    return self._waiting.pop(ready)
                self._turn.wait()

    def _load(self) -> None:
        """Has a function to reconstruct with, and its model in memory."""
        with self._loading:
            if self._reconstruct is None:
                import sketchcore as sk

                self._model = sk.load_model(self._model)
                self._reconstruct = partial(sk.reconstruct, align=False)  # the solid lies under what was drawn

    def _run(self, session: Session, order: Order) -> None:
        self._load()
        assert self._reconstruct is not None
        session.report(Progress(0, ROUNDS, working=True))
        self._tell(session)

        def between(number: int, rounds: int, probability: Any) -> None:
            wanted = session.accept(probability, order)
            session.report(Progress(number, rounds, working=True))
            self._tell(session)
            with self._turn:
                if not wanted or self._closed or session.id in self._waiting:
                    raise _SupersededError

        made = self._reconstruct(
            list(order.drawings), list(order.viewpoints), iterations=ROUNDS, model=self._model, progress=between
        )
        session.accept(made.probability, order)

    def _tell(self, session: Session) -> None:
        if self._changed is not None:
            try:
                self._changed(session)
            except Exception:
                _log.exception("what listens to the workers failed")


def _sentence(error: Exception) -> str:
    message = str(error.args[0]) if isinstance(error, KeyError) and error.args else str(error)
    if isinstance(error, MemoryError):
        message = "there is not enough memory for it"
    return f"The reconstruction failed: {message or type(error).__name__}"
