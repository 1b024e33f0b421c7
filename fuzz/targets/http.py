"""Requests to the app's routes, behind its guard: an input is a JSON list of requests, made one after the other."""

from __future__ import annotations

import asyncio
import json
import tempfile
from pathlib import Path
from random import Random
from typing import Any
from urllib.parse import unquote

import numpy as np
import skimage.filters
import skimage.measure
from fastapi import FastAPI

from harness import SCRATCH, Target
from mutations import dump, of_bytes, of_json
from sketchcore.app.server import Server, build_router
from sketchcore.app.store import Store
from sketchcore.asgi.guard import Guard

_LOADED = skimage.filters, skimage.measure
_BALL = (np.linalg.norm(np.indices((64, 64, 64)) / 63 - 0.5, axis=0) < 0.3).astype(np.float32)


class _Made:
    probability = _BALL


def _instead(drawings: Any, views: Any, *, iterations: int, model: Any, progress: Any) -> _Made:
    """A ball, at once, instead of a reconstruction."""
    progress(0, iterations, _BALL)
    return _Made()


def _app() -> tuple[FastAPI, Server]:
    folder = Path(tempfile.mkdtemp(dir=SCRATCH))
    server = Server(Store(folder), model=_NoModel(), reconstruct=_instead)
    app = FastAPI()
    app.include_router(build_router(server))
    app.add_middleware(Guard, hosts=("127.0.0.1",))
    return app, server


class _NoModel:
    """Predicts nothing: guesses of viewpoints are another matter."""

    def first_predictions(self, samples: Any) -> Any:
        yield from (_BALL for _ in samples)

    def in_place(self, sketches: Any, always: bool = False) -> Any:
        return sketches

    def first(self, drawings: int) -> float:
        return 3.5


_APP, _SERVER = _app()
_LOOP = asyncio.new_event_loop()


def attempt(data: bytes) -> None:
    """Every request gets an answer; a refusal is a sentence."""
    try:
        requests = json.loads(data)
    except (ValueError, RecursionError):
        return
    id = _SERVER.store.create().id
    for one in requests[:20] if isinstance(requests, list) else ():
        if isinstance(one, dict):
            status, body = _LOOP.run_until_complete(_ask(one, id))
            assert status < 500, f"{status} {body[:300]!r} to {one!r:.300}"
            if status >= 400 and status not in (405, 422):
                told = json.loads(body)
                sentence = told.get("error") or told.get("detail")
                assert len(str(sentence).split()) >= 2, f"{status} {body[:300]!r} to {one!r:.300}"
    _SERVER.store.delete(id)


async def _ask(one: dict[str, Any], id: str) -> tuple[int, bytes]:
    body = one.get("body")
    content = body.encode("latin-1", "replace") if isinstance(body, str) else b"" if body is None else dump(body)
    path = str(one.get("path", "/")).replace("{id}", id)
    path, _, query = path.partition("?")
    raw = path.encode("utf-8", "replace")
    headers = one.get("headers") if isinstance(one.get("headers"), dict) else {}
    lines = {"host": "127.0.0.1", "content-length": str(len(content)), **headers}
    scope = {
        "type": "http",
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": str(one.get("method", "GET")).upper(),
        "scheme": "http",
        "path": unquote(raw.decode(), errors="replace"),
        "raw_path": raw,
        "query_string": query.encode("utf-8", "replace"),
        "headers": [
            (str(k).lower().encode("latin-1", "replace"), str(v).encode("latin-1", "replace")) for k, v in lines.items()
        ],
        "client": ("127.0.0.1", 1),
        "server": ("127.0.0.1", 80),
    }
    pieces = [content[i : i + 65536] for i in range(0, len(content), 65536)] or [b""]
    sent: list[dict[str, Any]] = []

    async def receive() -> dict[str, Any]:
        if pieces:
            piece = pieces.pop(0)
            return {"type": "http.request", "body": piece, "more_body": bool(pieces)}
        return {"type": "http.disconnect"}

    async def send(message: dict[str, Any]) -> None:
        sent.append(dict(message))

    await asyncio.wait_for(_APP(scope, receive, send), 8)  # type: ignore[arg-type]
    return int(sent[0]["status"]), b"".join(message.get("body", b"") for message in sent)


def seeds() -> list[bytes]:
    """What pages ask for, and what they do."""
    line = {"id": "a1", "kind": "ink", "points": [[60, 60, 0.5], [200, 180, 0.7], [60, 180, 0.2]]}
    post = {"method": "POST"}
    strokes = post | {
        "path": "/api/s/{id}/strokes",
        "body": {"viewpoint": "quarter-037", "strokes": [line], "op": "x1"},
    }
    get = [{"method": "GET", "path": f"/api/{path}"} for path in (
        "sessions", "s/{id}", "s/{id}/volume/solid", "s/{id}/volume/scene", "s/{id}/volume/unsure", "s/{id}/events",
        "s/{id}/export.glb", "s/{id}/export.obj", "s/{id}/file", "s/{id}/advice", "s/{id}/hints/quarter-037",
        "s/{id}/reference/front", "examples/tour", "s/00000000000000000000000000000000", "s/..%2f..%2fetc",
        "../../etc")]  # fmt: skip
    changes = {
        "erase": {"viewpoint": "quarter-037", "path": [[60, 60], [90, 90]], "radius": 8},
        "clear": {"viewpoint": "quarter-037"},
        "delete_sheet": {"viewpoint": "front"},
        "undo": {},
        "redo": {},
        "reconstruct": {},
        "freeze": {"name": "Seat"},
        "show": {"part": "p", "visible": False},
        "rename": {"part": "p", "name": "Leg"},
        "place": {"part": "p", "placement": {"center": [0, 0, 0.5], "scale": 1.5, "turn": 1}},
        "delete_part": {"part": "p"},
        "call": {"name": "Chair"},
    }
    do = {name: post | {"path": f"/api/s/{{id}}/{name}", "body": body} for name, body in changes.items()}
    picture = "P5 64 64 255\n" + ("\xff" * 31 + "\x00\x00" + "\xff" * 31) * 64
    photo = post | {
        "path": "/api/s/{id}/photo?viewpoint=quarter-052",
        "headers": {"content-type": "image/png"},
        "body": picture,
    }
    file = post | {"path": "/api/sessions/import", "body": "PK\x05\x06" + "\0" * 18}
    journeys = [[strokes, *get], [strokes, *do.values()], [strokes, do["reconstruct"], do["freeze"], get[3], get[6]]]
    journeys += [[photo, get[1]], [file], [post | {"path": "/api/sessions"}], [post | {"path": "/api/examples/table"}]]
    journeys.append([{"method": "DELETE", "path": "/api/s/0123"}, {"method": "OPTIONS", "path": "/api/sessions"}])
    headers = {"origin": "http://evil.example", "host": "[::1]:80", "if-none-match": '"x"', "content-length": "12"}
    journeys += [[strokes | {"headers": {name: value}}] for name, value in headers.items()]
    return [dump(journey) for journey in journeys]


def mutate(data: bytes, random: Random) -> bytes:
    """A request changed as data; bodies that are text as bytes."""
    try:
        value = json.loads(data)
    except (ValueError, RecursionError):
        return random.choice(seeds())
    if random.random() < 0.15 and isinstance(value, list) and value and isinstance(value[0], dict):
        body = value[0].get("body")
        if isinstance(body, str):
            changed = of_bytes(body.encode("latin-1", "replace"), random).decode("latin-1")
            return dump([value[0] | {"body": changed}, *value[1:]])
    for _ in range(random.choice((1, 1, 3))):
        value = of_json(value, random)
    return dump(value)


TARGET = Target(attempt, seeds, mutate, (), megabytes=512)
