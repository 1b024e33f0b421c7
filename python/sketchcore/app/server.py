"""The routes under /api: what a page asks of a session, as HTTP.

All work is done in threads, so that none waits for another.

A change carries `op`, a random name of its own. One that comes a second time, since its answer was lost, is not done
again: pages repeat what they are not sure has arrived.
"""

from __future__ import annotations

import gzip
import json
import tempfile
import threading
from collections import OrderedDict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from fastapi import APIRouter, Request, Response
from starlette.concurrency import run_in_threadpool
from starlette.responses import StreamingResponse

from sketchcore import advice
from sketchcore.app import hints, photo
from sketchcore.app.document import listed, placement_from_json, stroke_from_json, stroke_to_json
from sketchcore.app.events import Hub, sent_state
from sketchcore.app.examples import read_scene, read_tour
from sketchcore.app.session import Session
from sketchcore.app.sessionfile import MAX_FILE, SUFFIX
from sketchcore.app.store import NotKeptError, Store
from sketchcore.app.workers import Reconstruct, Workers
from sketchcore.asgi.files import attachment
from sketchcore.asgi.guard import TooLargeError, body_length
from sketchcore.asgi.sentences import sentence_route
from sketchcore.camera import check_viewpoint
from sketchcore.mesh import MESH_SUFFIXES, extract_mesh, save_mesh
from sketchcore.reconstruction import load_model
from sketchcore.viewpoint import guess_viewpoint

MAX_CHANGE = 4 * 2**20
"""Bytes of a change as JSON."""
MAX_PHOTO = 24 * 2**20
"""Bytes of an image."""
_PACKED = 24
"""Volumes that are kept compressed, for all sessions together."""
_REMEMBERED = 4096
"""Changes whose names are kept, for all sessions together."""
_CHANGES: dict[str, tuple[str, ...]] = {
    "strokes": ("viewpoint", "strokes"),
    "erase": ("viewpoint", "path", "radius"),
    "clear": ("viewpoint",),
    "delete_sheet": ("viewpoint",),
    "undo": (),
    "redo": (),
    "reconstruct": (),
    "freeze": ("name",),
    "show": ("part", "visible"),
    "rename": ("part", "name"),
    "place": ("part", "placement"),
    "delete_part": ("part",),
    "call": ("name",),
}
"""What can be done to a session, and what has to be said with it."""


_Route = sentence_route({TooLargeError: 413, KeyError: 404, ValueError: 400, TypeError: 400, NotKeptError: 507})


class Server:
    """What the routes share.

    Attributes:
        store: the sessions.
        workers: who reconstructs.
        hub: who hears of it.
        open: whether anyone may see the list of all sessions; not so where others than the user can reach the server.
    """

    def __init__(
        self,
        store: Store,
        model: Any = None,
        threads: int = 1,
        open: bool = True,
        reconstruct: Reconstruct | None = None,
    ) -> None:
        """Starts the workers.

        Args:
            store: the sessions.
            model: as for `sketchcore.reconstruct`.
            threads: how many reconstructions run at a time.
            open: see the class.
            reconstruct: None for `sketchcore.reconstruct`.
        """
        self.store = store
        self.hub = Hub()
        self.open = open
        self.model = model
        self.workers = Workers(model, threads, self._worked, reconstruct)
        self._lock = threading.Lock()
        self._done: OrderedDict[tuple[str, str], None] = OrderedDict()
        self._packed: OrderedDict[str, bytes] = OrderedDict()

    def close(self) -> None:
        """Ends the workers."""
        self.workers.close(5.0)

    def _worked(self, session: Session) -> None:
        if not session.progress.working:
            self.store.save(session)
        self.hub.tell(session)

    def change(self, id: str, name: str, body: Mapping[str, Any]) -> dict[str, Any]:
        """Does one of `_CHANGES` to a session, keeps it, and says so to all who listen.

        Returns:
            the session's state.

        Raises:
            KeyError: if there is no such session or change.
            ValueError: for whatever cannot be done; a sentence for people.
            NotKeptError: if it was done and cannot be kept; asked again, it is kept, and not done again.
        """
        session = self.store.get(id)
        if name not in _CHANGES:
            raise KeyError(f"there is no change {name[:40]!r}; the changes are {', '.join(_CHANGES)}")
        missing = [entry for entry in _CHANGES[name] if entry not in body and (name, entry) != ("freeze", "name")]
        if missing:
            raise ValueError(f"{name} needs {', '.join(_CHANGES[name])}; there is no {missing[0]}")
        with session.lock:
            repeated = self._was_done(session, body.get("op"))
            if not repeated:
                _apply(session, name, body)
                self._remember(session, body.get("op"))
        if repeated:
            return self.changed(session)  # it may not have been kept the first time
        if name == "reconstruct":
            self.workers.submit(session)
        elif not session.document.inked:
            self.workers.withdraw(session)
        return self.changed(session)

    def changed(self, session: Session) -> dict[str, Any]:
        """Keeps a session, tells of it, and gives its state."""
        self.store.save(session)
        self.hub.tell(session)
        return sent_state(session)

    def _was_done(self, session: Session, op: object) -> bool:
        with self._lock:
            return isinstance(op, str) and (session.id, op[:64]) in self._done

    def _remember(self, session: Session, op: object) -> None:
        if isinstance(op, str):
            with self._lock:
                self._done[session.id, op[:64]] = None
                while len(self._done) > _REMEMBERED:
                    self._done.popitem(last=False)

    def volume(self, session: Session, key: str) -> tuple[str, bytes]:
        """The name of a volume's content, and its 64^3 bytes, gzipped."""
        if key in ("scene", "unsure"):
            name = f"{key}-{session.state()['scene']}"
        else:
            name = str(session.state()["solid"]) if key == "solid" else key
        with self._lock:
            packed = self._packed.get(name)
        if packed is None:
            if key == "unsure":
                array = np.rint(advice.unsure(session.scene()) * 255).astype(np.uint8)
            elif key == "scene":
                array = session.scene()
            elif name in session.volumes:
                array = session.volumes[name]
            else:
                raise KeyError(f"the session has no volume {key[:40]!r}")
            packed = gzip.compress(array.tobytes(), 2, mtime=0)
            with self._lock:
                self._packed[name] = packed
                while len(self._packed) > _PACKED:
                    self._packed.popitem(last=False)
        return name, packed


def _apply(session: Session, name: str, body: Mapping[str, Any]) -> None:
    match name:
        case "strokes":
            session.add_strokes(
                body["viewpoint"], [stroke_from_json(s) for s in listed(body["strokes"], "strokes", 1000)]
            )
        case "erase":
            session.erase(body["viewpoint"], body["path"], body["radius"])
        case "clear":
            session.clear(body["viewpoint"])
        case "delete_sheet":
            session.delete_sheet(body["viewpoint"])
        case "undo":
            session.undo()
        case "redo":
            session.redo()
        case "freeze":
            session.freeze(body.get("name"))
        case "show":
            session.show(body["part"], body["visible"])
        case "rename":
            session.rename(body["part"], body["name"])
        case "place":
            session.place(body["part"], placement_from_json(body["placement"]))
        case "delete_part":
            session.delete_part(body["part"])
        case "call":
            session.call(body["name"])


async def _body(request: Request, limit: int) -> bytes:
    """A request's body.

    Raises:
        TooLargeError: if it is larger than `limit` bytes.
    """
    body = bytearray()
    if body_length(request.headers.get("content-length", "0")) > limit:
        raise TooLargeError(f"this may have up to {limit // 2**20} MB")
    async for chunk in request.stream():
        body += chunk
        if len(body) > limit:
            raise TooLargeError(f"this may have up to {limit // 2**20} MB")
    return bytes(body)


def build_router(server: Server) -> APIRouter:
    """The routes, to be included in NiceGUI's app, or in any FastAPI."""
    router = APIRouter(prefix="/api", route_class=_Route)
    store = server.store

    @router.get("/sessions")
    def sessions() -> list[dict[str, Any]]:
        if not server.open:
            return []
        return [{"id": one.id, "name": one.name, "changed": one.changed.isoformat()} for one in store.list()]

    @router.post("/sessions")
    def create() -> dict[str, str]:
        return {"id": store.create().id}

    @router.post("/sessions/import")
    async def import_file(request: Request) -> dict[str, str]:
        session = await run_in_threadpool(store.import_file, await _body(request, MAX_FILE))
        return {"id": session.id}

    @router.get("/examples/tour")
    def tour() -> list[dict[str, Any]]:
        return read_tour()

    @router.post("/examples/{name}")
    def example(name: str) -> dict[str, str]:
        return {"id": store.import_file(read_scene(name)).id}

    @router.get("/s/{id}")
    def state(id: str) -> dict[str, Any]:
        return sent_state(store.get(id))

    @router.delete("/s/{id}")
    def delete(id: str) -> dict[str, str]:
        server.workers.withdraw(store.get(id))
        store.delete(id)
        return {"id": id}

    @router.get("/s/{id}/volume/{key}")
    def volume(id: str, key: str, request: Request) -> Response:
        name, packed = server.volume(store.get(id), key)
        headers = {"ETag": f'"{name}"', "Cache-Control": "private, no-cache", "Content-Encoding": "gzip"}
        if request.headers.get("if-none-match") == f'"{name}"':
            return Response(status_code=304, headers={"ETag": f'"{name}"'})
        return Response(packed, media_type="application/octet-stream", headers=headers)

    @router.get("/s/{id}/events")
    async def events(id: str) -> Response:
        session = await run_in_threadpool(store.get, id)
        headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
        return StreamingResponse(server.hub.listen(session), media_type="text/event-stream", headers=headers)

    @router.post("/s/{id}/photo")
    async def import_photo(id: str, request: Request, viewpoint: str = "guess") -> dict[str, Any]:
        kind = request.headers.get("content-type", "")
        if not kind.startswith("image/"):
            raise ValueError(
                f"a drawing comes as an image (PNG, JPEG, WebP, ...), not as {kind[:40] or 'unknown data'}"
            )
        data = await _body(request, MAX_PHOTO)
        return await run_in_threadpool(_import_photo, server, id, data, viewpoint)

    @router.get("/s/{id}/export.{suffix}")
    def export(id: str, suffix: str) -> Response:
        session = store.get(id)
        if f".{suffix}" not in MESH_SUFFIXES:
            raise KeyError(f"a mesh is exported as {', '.join(MESH_SUFFIXES)}, not as .{suffix[:20]}")
        scene = session.scene()
        if scene.max() < 128:
            raise ValueError("there is no solid to export yet: draw something and reconstruct it first")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"mesh.{suffix}"
            save_mesh(extract_mesh(scene.astype(np.float32) / 255), path)
            content = path.read_bytes()
        return attachment(content, session.document.name, f".{suffix}")

    @router.get("/s/{id}/file")
    def file(id: str) -> Response:
        session = store.get(id)
        return attachment(store.export_file(session), session.document.name, SUFFIX)

    @router.get("/s/{id}/advice")
    def best_view(id: str) -> dict[str, Any]:
        session = store.get(id)
        solid = session.solid
        if solid is None:
            raise ValueError("there is no solid to advise about yet: draw something and reconstruct it first")
        viewpoint, scores = advice.best_view(solid, session.drawings()[1])
        return {"viewpoint": viewpoint, "scores": scores}

    @router.get("/s/{id}/hints/{viewpoint}")
    def composition(id: str, viewpoint: str) -> list[str]:
        sheet = store.get(id).document.sheet(check_viewpoint(viewpoint))
        return hints.composition(sheet.drawing, viewpoint) if sheet.has_ink else []

    @router.get("/s/{id}/reference/{viewpoint}")
    def reference(id: str, viewpoint: str) -> list[dict[str, Any]]:
        return [stroke_to_json(stroke) for stroke in store.get(id).document.reference(viewpoint)]

    # Last: {name} takes whatever no route above has taken.
    @router.post("/s/{id}/{name}")
    async def change(id: str, name: str, request: Request) -> dict[str, Any]:
        data = await _body(request, MAX_CHANGE)
        return await run_in_threadpool(_change, server, id, name, data)

    return router


def _change(server: Server, id: str, name: str, data: bytes) -> dict[str, Any]:
    try:
        body = json.loads(data) if data else {}
    except (ValueError, RecursionError) as error:
        raise ValueError(f"a change is said in JSON; this is none: {error}") from None
    if not isinstance(body, dict):
        raise ValueError("a change is said by an object")
    return server.change(id, name, body)


def _import_photo(server: Server, id: str, data: bytes, viewpoint: str) -> dict[str, Any]:
    session = server.store.get(id)
    drawing = photo.read_photo(data)
    if viewpoint == "guess":
        viewpoint = guess_viewpoint(load_model(server.model), drawing)[0]
    session.import_drawing(viewpoint, drawing)
    return server.changed(session) | {"viewpoint": viewpoint}
