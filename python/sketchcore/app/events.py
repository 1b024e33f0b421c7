"""Who looks at a session hears when it changes: server-sent events, the newest state of things, never a backlog."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import AsyncIterator
from typing import Any

from sketchcore.app.session import Session

_SILENCE = 15.0
"""Seconds after which something is sent so that proxies keep the line open, and a line that is gone is noticed."""


class Hub:
    """Passes on that a session has changed, from any thread, to everyone who listens to it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._listeners: dict[str, set[tuple[asyncio.AbstractEventLoop, asyncio.Event]]] = {}

    def tell(self, session: Session) -> None:
        """Wakes those who listen to a session. It never waits for them."""
        with self._lock:
            listeners = list(self._listeners.get(session.id, ()))
        for loop, changed in listeners:
            if not loop.is_closed():
                loop.call_soon_threadsafe(changed.set)

    async def listen(self, session: Session) -> AsyncIterator[str]:
        """Server-sent events of `summary`: one at once, then one whenever it changed; a slow reader skips some."""
        listener = asyncio.get_running_loop(), asyncio.Event()
        with self._lock:
            self._listeners.setdefault(session.id, set()).add(listener)
        try:
            yield "retry: 1000\n\n"
            while True:
                listener[1].clear()
                yield f"data: {json.dumps(summary(session))}\n\n"
                try:
                    await asyncio.wait_for(listener[1].wait(), _SILENCE)
                except TimeoutError:
                    yield ": still here\n\n"
        finally:
            with self._lock:
                self._listeners[session.id].discard(listener)
                if not self._listeners[session.id]:
                    del self._listeners[session.id]


def sent_state(session: Session) -> dict[str, Any]:
    """`Session.state`, and how late it is, so that a page can tell which of two that it was sent is the newer."""
    with session.lock:
        return {**session.state(), "life": session.life, "moment": session.moment}


def summary(session: Session) -> dict[str, Any]:
    """What tells a page whether to ask for more: revision, keys of solid and scene, progress and trouble; how late."""
    whole = sent_state(session)
    kept = {key: whole[key] for key in ("revision", "life", "moment", "solid", "scene", "stale", "trouble")}
    return {**kept, **whole["progress"]}
