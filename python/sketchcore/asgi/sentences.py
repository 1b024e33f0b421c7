"""Errors as {"error": sentence}."""

from __future__ import annotations

from collections.abc import Callable, Coroutine, Mapping
from typing import Any

from fastapi import Request, Response
from fastapi.routing import APIRoute
from starlette.responses import JSONResponse


def error_response(status: int, error: Exception | str, headers: Mapping[str, str] | None = None) -> Response:
    """What is wrong, in a sentence that begins with a capital."""
    message = error if isinstance(error, str) else str(error.args[0] if error.args else error)
    return JSONResponse({"error": message[:1].upper() + message[1:]}, status, headers)


def sentence_route(statuses: Mapping[type[Exception], int]) -> type[APIRoute]:
    """A kind of route that answers exceptions with a sentence.

    Args:
        statuses: the HTTP status of each kind of exception; the first kind that fits counts.
    """

    class Route(APIRoute):
        def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
            handle = super().get_route_handler()

            async def careful(request: Request) -> Response:
                try:
                    return await handle(request)
                except tuple(statuses) as error:
                    return error_response(next(s for kind, s in statuses.items() if isinstance(error, kind)), error)

            return careful

    return Route
