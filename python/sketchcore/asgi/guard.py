"""What a request must be like to be let in: not too large, and not from another site's page."""

from __future__ import annotations

import math
from collections.abc import Awaitable, Callable, Iterable, MutableMapping
from typing import Any
from urllib.parse import urlsplit

from starlette.responses import JSONResponse

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[Message]]
Send = Callable[[Message], Awaitable[None]]
App = Callable[[Scope, Receive, Send], Awaitable[None]]

LARGEST = 64 * 2**20
"""Bytes of any request; routes ask for less."""


class TooLargeError(ValueError):
    """A request's body is larger than it may be."""


def body_length(header: str) -> float:
    """What a request says of its body's length; infinite if that is no number."""
    return int(header) if header.isascii() and header.isdecimal() and len(header) < 20 else math.inf


class Guard:
    """ASGI middleware that refuses foreign pages and bodies beyond all limits.

    A page of another site could otherwise talk to a server on the user's own machine: by a form, which the browser
    marks with its origin, or by a name that it lets point to 127.0.0.1.
    """

    def __init__(self, app: App, hosts: Iterable[str] | None = None, largest: int = LARGEST) -> None:
        """Wraps an ASGI app.

        Args:
            app: what lies behind.
            hosts: names that the server may be called by; None for any.
            largest: bytes that a body may have.
        """
        self.app = app
        self.hosts = None if hosts is None else {host.lower() for host in hosts}
        self.largest = largest

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answers a refused request, or hands it on."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        refusal = self._refusal(headers)
        if refusal is not None and scope["type"] == "http":
            status, sentence = refusal
            await JSONResponse({"error": sentence}, status)(scope, receive, send)
        elif refusal is not None:
            await receive()
            await send({"type": "websocket.close", "code": 1008})
        else:
            await self.app(scope, self._counted(receive), send)

    def _refusal(self, headers: dict[str, str]) -> tuple[int, str] | None:
        host = headers.get("host", "")
        origin = headers.get("origin")
        try:
            name = urlsplit(f"//{host}").hostname or ""
            foreign = origin is not None and urlsplit(origin).netloc != host
        except ValueError:
            return 400, "the host or the origin of this request is no name of a server"
        if self.hosts is not None and name not in self.hosts:
            return 403, f"this server is not called {name[:80]!r}; its names are {', '.join(sorted(self.hosts))}"
        if foreign:
            return 403, "requests from the pages of another site are refused"
        if body_length(headers.get("content-length", "0")) > self.largest:
            return 413, f"a request may have up to {self.largest // 2**20} MB"
        return None

    def _counted(self, receive: Receive) -> Receive:
        total = 0

        async def counted() -> Message:
            nonlocal total
            message = await receive()
            total += len(message.get("body", b""))
            if total > self.largest:
                raise TooLargeError(f"a request may have up to {self.largest // 2**20} MB")
            return message

        return counted
