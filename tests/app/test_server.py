"""The routes, without a browser: what they answer, what they refuse, and twenty clients at once."""

from __future__ import annotations

import asyncio
import io
import json
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

pytest.importorskip("nicegui", reason="the app's routes need NiceGUI (pip install 'sketchcore[app]')")

import httpx
import uvicorn
from fastapi import FastAPI
from hand import FIRST, HIGH, LOW, box_edges
from typer.testing import CliRunner

from sketchcore.app.events import Hub
from sketchcore.app.launch import sessions_folder
from sketchcore.app.server import MAX_CHANGE, Server, build_router
from sketchcore.app.store import Store
from sketchcore.asgi.address import is_local
from sketchcore.asgi.guard import Guard
from sketchcore.cli import app as command_line

BALL = np.linalg.norm(np.indices((64, 64, 64)) / 63 - 0.5, axis=0) < 0.3


class Made:
    """Instead of a network: a ball, at once."""

    probability = BALL.astype(np.float32)


def instead(drawings: Any, views: Any, *, iterations: int, model: Any, progress: Any) -> Made:
    for number in range(2):
        progress(number, iterations, Made.probability)
    return Made()


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    served = Server(Store(tmp_path / "sessions"), reconstruct=instead)
    yield served
    served.close()


@pytest.fixture
def client(server: Server) -> Iterator[httpx.Client]:
    app = FastAPI()
    app.include_router(build_router(server))
    app.add_middleware(Guard, hosts=("127.0.0.1",))
    uvicorn_server = uvicorn.Server(uvicorn.Config(app, port=0, log_level="error", ws="none"))
    thread = threading.Thread(target=uvicorn_server.run)
    thread.start()
    wait(lambda: uvicorn_server.started)
    port = uvicorn_server.servers[0].sockets[0].getsockname()[1]
    with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=60) as client:
        yield client
    uvicorn_server.should_exit = True
    thread.join()


def box(op: str = "op") -> dict[str, Any]:
    strokes = [
        {"id": f"{op}{i}", "kind": "ink", "points": [[*a, 0.5], [*b, 0.5]]}
        for i, (a, b) in enumerate(box_edges(FIRST, LOW, HIGH))
    ]
    return {"viewpoint": FIRST, "strokes": strokes, "op": op}


def made(client: httpx.Client) -> str:
    """A session with a box that was reconstructed."""
    id = client.post("/api/sessions").json()["id"]
    assert client.post(f"/api/s/{id}/strokes", json=box()).status_code == 200
    assert client.post(f"/api/s/{id}/reconstruct").status_code == 200
    wait(lambda: (state := client.get(f"/api/s/{id}").json())["solid"] and not state["progress"]["working"])
    return id


def wait(holds: Any) -> None:
    begun = time.monotonic()
    while not holds():
        assert time.monotonic() - begun < 60
        time.sleep(0.02)


def test_a_change_answers_with_the_state_and_is_kept(client, server):
    id = client.post("/api/sessions").json()["id"]
    state = client.post(f"/api/s/{id}/strokes", json=box()).json()
    assert len(state["sheets"][0]["strokes"]) == 9
    assert [one["id"] for one in client.get("/api/sessions").json()] == [id]
    again = Store(server.store.folder).get(id)
    assert len(again.document.sheets[0].strokes) == 9
    assert client.delete(f"/api/s/{id}").status_code == 200
    assert client.get(f"/api/s/{id}").status_code == 404


def test_a_change_that_comes_twice_is_done_once(client):
    id = client.post("/api/sessions").json()["id"]
    for _ in range(2):
        client.post(f"/api/s/{id}/strokes", json=box())
    for _ in range(2):
        state = client.post(f"/api/s/{id}/undo", json={"op": "once"}).json()
    assert len(state["sheets"][0]["strokes"]) == 8
    assert len(client.post(f"/api/s/{id}/undo", json={"op": "other"}).json()["sheets"][0]["strokes"]) == 7


def test_a_change_that_was_refused_may_come_again(client):
    id = client.post("/api/sessions").json()["id"]
    assert client.post(f"/api/s/{id}/freeze", json={"op": "a"}).status_code == 400
    assert client.post(f"/api/s/{id}/freeze", json={"op": "a"}).status_code == 400


def test_volumes_travel_compressed_and_know_when_they_are_known(client):
    id = made(client)
    answer = client.get(f"/api/s/{id}/volume/scene")
    assert answer.headers["content-encoding"] == "gzip"
    assert int(answer.headers["content-length"]) < 64**3 / 4
    scene = np.frombuffer(answer.content, np.uint8).reshape(64, 64, 64)
    assert ((scene > 127) == BALL).all()
    known = client.get(f"/api/s/{id}/volume/scene", headers={"If-None-Match": answer.headers["etag"]})
    assert known.status_code == 304
    solid = client.get(f"/api/s/{id}").json()["solid"]
    assert client.get(f"/api/s/{id}/volume/{solid}").content == answer.content
    assert len(client.get(f"/api/s/{id}/volume/unsure").content) == 64**3
    assert client.get(f"/api/s/{id}/volume/nonsense").status_code == 404


@pytest.mark.parametrize("suffix", ["glb", "obj", "stl", "ply"])
def test_exports_are_meshes_to_save(client, suffix):
    id = made(client)
    client.post(f"/api/s/{id}/call", json={"name": 'A "ball" é/..'})
    answer = client.get(f"/api/s/{id}/export.{suffix}")
    assert f'filename="A ball e.{suffix}"' in answer.headers["content-disposition"]
    mesh = trimesh.load(io.BytesIO(answer.content), file_type=suffix, force="mesh")
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * 0.3**3, rel=0.1)


def test_a_session_travels_as_a_file(client):
    id = made(client)
    file = client.get(f"/api/s/{id}/file")
    assert file.headers["content-disposition"].endswith(".sketchcore")
    other = client.post("/api/sessions/import", content=file.content).json()["id"]
    assert other != id
    state, copy = (client.get(f"/api/s/{one}").json() for one in (id, other))
    assert (copy["sheets"], copy["solid"], copy["scene"]) == (state["sheets"], state["solid"], state["scene"])
    assert client.get(f"/api/s/{other}/advice").json()["viewpoint"] != FIRST


@pytest.mark.parametrize(
    ("method", "path", "body", "status", "sentence"),
    [
        ("GET", "/api/s/{none}", None, 404, "There is no session"),
        ("GET", "/api/s/not-an-id", None, 404, "There is no session"),
        ("POST", "/api/s/{id}/dance", {}, 404, "no change 'dance'; the changes are strokes"),
        ("POST", "/api/s/{id}/strokes", {"viewpoint": FIRST}, 400, "needs viewpoint, strokes; there is no strokes"),
        ("POST", "/api/s/{id}/strokes", {"viewpoint": "behind", "strokes": []}, 200, ""),
        ("POST", "/api/s/{id}/clear", {"viewpoint": "behind"}, 400, "nknown viewpoint 'behind'; the viewpoints are"),
        (
            "POST",
            "/api/s/{id}/strokes",
            {"viewpoint": FIRST, "strokes": [{}]},
            400,
            "stroke must have id, kind, points",
        ),
        ("POST", "/api/s/{id}/strokes", [1], 400, "an object"),
        ("POST", "/api/s/{id}/reconstruct", {}, 400, "draw something first"),
        ("POST", "/api/s/{id}/freeze", {}, 400, "no solid to freeze"),
        ("GET", "/api/s/{id}/export.glb", None, 400, "no solid to export"),
        ("GET", "/api/s/{id}/export.exe", None, 404, "as .glb, .obj, .stl, .ply"),
        ("GET", "/api/s/{id}/advice", None, 400, "no solid to advise"),
        ("GET", "/api/s/{id}/hints/behind", None, 400, "nknown viewpoint"),
        ("POST", "/api/examples/nonsense", None, 404, "no example"),
    ],
)
def test_refusals_are_sentences(client, method, path, body, status, sentence):
    id = client.post("/api/sessions").json()["id"]
    answer = client.request(method, path.format(id=id, none="0" * 32), json=body)
    assert answer.status_code == status
    if status >= 400:
        assert sentence in answer.text


def test_what_is_too_large_or_no_image_or_no_json_is_refused(client):
    id = client.post("/api/sessions").json()["id"]
    large = client.post(f"/api/s/{id}/strokes", content=b"x" * (MAX_CHANGE + 1))
    assert large.status_code == 413
    assert large.json()["error"] == "This may have up to 4 MB"
    chunked = client.post(f"/api/s/{id}/strokes", content=(b"x" * 2**20 for _ in range(6)))
    assert chunked.status_code == 413
    assert client.post(f"/api/s/{id}/strokes", content=b"[[[").status_code == 400
    assert client.post(f"/api/s/{id}/strokes", content=b"[" * 100_000).status_code == 400
    text = client.post(f"/api/s/{id}/photo?viewpoint={FIRST}", content=b"x", headers={"Content-Type": "text/html"})
    assert text.status_code == 400
    broken = client.post(f"/api/s/{id}/photo?viewpoint={FIRST}", content=b"x", headers={"Content-Type": "image/png"})
    assert broken.status_code == 400
    assert client.post("/api/sessions/import", content=b"PK no zip").status_code == 400
    assert client.get(f"/api/s/{id}").json()["sheets"] == []


def test_pages_of_other_sites_are_kept_out(client):
    id = client.post("/api/sessions").json()["id"]
    assert client.get(f"/api/s/{id}", headers={"Origin": "http://evil.example"}).status_code == 403
    assert client.get(f"/api/s/{id}", headers={"Origin": str(client.base_url).rstrip("/")}).status_code == 200
    assert client.get(f"/api/s/{id}", headers={"Host": "evil.example"}).status_code == 403


def test_the_list_of_all_sessions_is_for_the_users_own_machine(server, client):
    client.post("/api/sessions")
    server.open = False
    assert client.get("/api/sessions").json() == []
    assert [is_local(host) for host in ("127.0.0.1", "localhost", "::1", "0.0.0.0", "192.168.1.4", "example.org")] == [
        True,
        True,
        True,
        False,
        False,
        False,
    ]


def test_sessions_are_kept_among_the_users_data(monkeypatch, tmp_path):
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    assert sessions_folder() == tmp_path / "sketchcore" / "sessions"
    monkeypatch.delenv("XDG_DATA_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert sessions_folder() == tmp_path / "home" / ".local" / "share" / "sketchcore" / "sessions"


def test_without_nicegui_the_command_says_what_to_install(monkeypatch):
    monkeypatch.setattr("sketchcore.cli.serving.find_spec", lambda name: None)
    result = CliRunner().invoke(command_line, ["app", "--no-browser"])
    assert result.exit_code == 1
    assert "pip install 'sketchcore[app]'" in result.output


def test_those_who_listen_hear_the_newest_state(server):
    session = server.store.create()
    hub = Hub()

    async def listen() -> list[dict[str, Any]]:
        heard = []
        events = hub.listen(session)
        assert (await anext(events)).startswith("retry")
        heard.append(json.loads((await anext(events)).removeprefix("data: ")))
        for name in ("one", "two", "three"):  # a slow reader misses some, and never the last
            session.call(name)
        threading.Thread(target=hub.tell, args=(session,)).start()
        heard.append(json.loads((await anext(events)).removeprefix("data: ")))
        await events.aclose()
        return heard

    first, last = asyncio.run(listen())
    assert last["revision"] == first["revision"] + 3
    assert set(last) >= {"revision", "scene", "solid", "stale", "round", "rounds", "working", "waiting", "trouble"}
    assert hub._listeners == {}


def test_twenty_clients_at_once_are_all_served(client):
    def person(number: int) -> str:
        id = client.post("/api/sessions").json()["id"]
        for turn in range(3):
            for stroke in box(f"{number}-{turn}-")["strokes"]:
                body = {"viewpoint": FIRST, "strokes": [stroke], "op": stroke["id"]}
                assert client.post(f"/api/s/{id}/strokes", json=body).status_code == 200
            assert client.post(f"/api/s/{id}/reconstruct").status_code == 200
            assert client.post(f"/api/s/{id}/undo", json={"op": f"u{number}-{turn}"}).status_code == 200
            assert len(client.get(f"/api/s/{id}/volume/scene").content) == 64**3
        wait(lambda: not any(client.get(f"/api/s/{id}").json()["progress"][key] for key in ("working", "waiting")))
        state = client.get(f"/api/s/{id}").json()
        assert state["trouble"] == ""
        assert len(state["sheets"][0]["strokes"]) == 3 * 9 - 3
        return id

    with ThreadPoolExecutor(20) as pool:
        assert len(set(pool.map(person, range(20)))) == 20
