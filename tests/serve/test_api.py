"""The endpoint over real sockets: solids, refusals, limits, and what it promises of them."""

from __future__ import annotations

import gzip
import io
import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

pytest.importorskip("fastapi", reason="the server needs FastAPI (pip install 'sketchcore[serve]')")

import httpx
import uvicorn
from fastapi import FastAPI

import sketchcore as sk
from sketchcore.serve import service as serving
from sketchcore.serve.api import build_app
from sketchcore.serve.order import Made
from sketchcore.serve.service import Limits, Service

BOX = sk.Shape([sk.Cuboid((0.0, 0.0, 0.0), (0.4, 0.25, 0.3))])
URL = "/v1/reconstruct"


def png(view: str | sk.Camera = "quarter-037", size: int = 256) -> bytes:
    camera = view if isinstance(view, sk.Camera) else sk.VIEWPOINTS[view]
    with io.BytesIO() as file:
        Image.fromarray(255 - sk.draw(BOX, camera)).resize((size, size)).save(file, "PNG")
        return file.getvalue()


def wait(holds: Callable[[], Any]) -> None:
    begun = time.monotonic()
    while not holds():
        assert time.monotonic() - begun < 60
        time.sleep(0.01)


class Checked(httpx.Client):
    """A client that looks each answer up in what the server promises."""

    promises: dict[str, Any]

    def send(self, request: httpx.Request, **options: Any) -> httpx.Response:
        answer = super().send(request, **options)
        path = self.promises["paths"].get(request.url.path, {}) if hasattr(self, "promises") else {}
        operation = path.get(request.method.lower())
        if operation is not None:
            promised = operation["responses"]
            assert str(answer.status_code) in promised, f"{answer.status_code} is not promised of {request.url.path}"
            media = answer.headers["content-type"].split(";")[0]
            assert media in promised[str(answer.status_code)]["content"]
            assert answer.status_code != 503 or int(answer.headers["retry-after"]) > 0
        if answer.status_code >= 400:
            assert list(answer.json()) == ["error"]
        return answer


@contextmanager
def served(limits: Limits, hosts: tuple[str, ...] | None = ("127.0.0.1",)) -> Iterator[tuple[Checked, Service]]:
    app: FastAPI = build_app(sk.load_model(), limits, hosts)
    server = uvicorn.Server(uvicorn.Config(app, port=0, log_level="critical", ws="none", timeout_graceful_shutdown=5))
    thread = threading.Thread(target=server.run)
    thread.start()
    try:
        wait(lambda: server.started)
        port = server.servers[0].sockets[0].getsockname()[1]
        with Checked(base_url=f"http://127.0.0.1:{port}", timeout=60) as client:
            client.promises = client.get("/openapi.json").json()
            wait(lambda: app.state.service.warm)
            yield client, app.state.service
    finally:
        server.should_exit = True
        thread.join()


@pytest.fixture(scope="module")
def client() -> Iterator[Checked]:
    with served(Limits(drawings=3, megabytes=1, megapixels=1)) as (client, _):
        yield client


def post(client: httpx.Client, *drawings: bytes, **fields: Any) -> httpx.Response:
    files = [("drawings", ("drawing", one, "image/png")) for one in drawings]
    return client.post(URL, files=files, data=fields)


@pytest.mark.parametrize("format", ["glb", "obj", "stl", "ply"])
def test_drawings_come_back_as_a_mesh(client: Checked, format: str) -> None:
    answer = post(client, png(), png("right"), views=["quarter-037", "right"], iterations=0, format=format)
    assert answer.status_code == 200
    assert f'filename="solid.{format}"' in answer.headers["content-disposition"]
    mesh = trimesh.load_mesh(io.BytesIO(answer.content), file_type=format)
    assert len(mesh.faces) > 100
    assert np.abs(mesh.vertices).max() <= 0.51
    assert json.loads(answer.headers["sketchcore-trace"]) == []
    assert [camera["near"] for camera in json.loads(answer.headers["sketchcore-views"])] == [1.25, 1.25]


def test_the_solid_is_that_of_reconstruct(client: Checked, tmp_path: Path) -> None:
    answer = post(client, png(), views="quarter-037", iterations=2, format="npz")
    (tmp_path / "solid.npz").write_bytes(answer.content)
    there = sk.load(tmp_path / "solid.npz")
    here = sk.reconstruct(sk.draw(BOX, sk.VIEWPOINTS["quarter-037"]), "quarter-037", iterations=2)
    np.testing.assert_allclose(there.probability, here.probability, atol=0.02)
    assert there.views == here.views
    assert json.loads(answer.headers["sketchcore-trace"]) == pytest.approx(here.trace, abs=1e-3)
    assert "sketchcore-guessed" not in answer.headers
    (tmp_path / "solid.binvox").write_bytes(
        post(client, png(), views="quarter-037", iterations=2, format="binvox").content
    )
    assert sk.iou(sk.load(tmp_path / "solid.binvox").probability > 0.5, here.probability > 0.5) > 0.99


def test_a_camera_is_said_by_angles_or_in_full(client: Checked) -> None:
    [first] = [one["camera"] for one in client.get("/v1/viewpoints").json() if one["name"] == "quarter-037"]
    orbit = sk.Camera.orbit(30, 20)
    for view, drawing, expected in (
        (json.dumps(first), png(), sk.VIEWPOINTS["quarter-037"]),
        ('{"azimuth": 30, "elevation": 20}', png(orbit), orbit),
    ):
        answer = post(client, drawing, views=view, iterations=0, align=False)
        assert answer.status_code == 200
        [camera] = json.loads(answer.headers["sketchcore-views"])
        np.testing.assert_allclose(camera["position"], expected.position)
        np.testing.assert_allclose(camera["rotation"], expected.rotation)


def test_a_view_that_is_left_out_is_found(client: Checked) -> None:
    answer = post(client, png("quarter-322"), iterations=0)
    assert answer.headers["sketchcore-guessed"] in sk.QUARTER_VIEWS


def test_all_viewpoints_are_told(client: Checked) -> None:
    told = client.get("/v1/viewpoints").json()
    assert [one["name"] for one in told] == list(sk.VIEWPOINTS)
    assert told[-1]["camera"]["position"] == pytest.approx([0, 2, 0], abs=1e-9)


@pytest.mark.parametrize(
    ("drawings", "fields", "status", "sentence"),
    [
        ([b"no image"], {"views": "right"}, 422, "Drawing 1 is no image of a known kind"),
        ([b""], {"views": "right"}, 422, "Drawing 1 is no image of a known kind"),
        (["box", b"GIF89a"], {"views": ["right", "top"]}, 422, "Drawing 2 is no image"),
        (["cut"], {"views": "right"}, 422, "cannot be read as an image"),
        (["blank"], {"views": "right"}, 422, "there is no ink"),
        (["box"], {"views": "below"}, 422, "Unknown viewpoint 'below'; the viewpoints are quarter-037"),
        (["box"], {"views": ["right", "top"]}, 422, "Each drawing needs a view: got 1 drawings, 2 views"),
        (["box", "box"], {}, 422, "2 drawings need a view each"),
        (["box"], {"views": "{"}, 422, "this is none"),
        (["box"], {"views": '{"a":' * 100_000}, 422, "this is none"),
        (["box"], {"views": '{"azimuth": 1e999, "elevation": 0}'}, 422, "azimuth: Input should be a finite number"),
        (["box"], {"views": '{"azimuth": 1, "elevation": 0, "roll": 1}'}, 422, "roll: Extra inputs"),
        (["box"], {"views": '{"rotation": [[1,0,0],[0,1,0],[0,0,2]], "position": [0,0,2]}'}, 422, "orthonormal"),
        (["box"], {"views": "right", "iterations": 11}, 422, "iterations: Input should be less than or equal to 10"),
        (["box"], {"views": "right", "iterations": "many"}, 422, "iterations: Input should be a valid integer"),
        (["box"], {"views": "right", "align": "perhaps"}, 422, "align: Input should be a valid boolean"),
        (["box"], {"views": "right", "format": "step"}, 422, "format: Input should be 'glb', 'obj'"),
        (["box"] * 4, {"views": ["right"] * 4}, 422, "drawings: List should have at most 3 items"),
        (["wide"], {"views": "right"}, 413, "Drawing 1 has more than 1 megapixels"),
        (["heavy"], {"views": "right"}, 413, "a request may have up to 1 MB"),
    ],
)
def test_what_is_wrong_is_said(
    client: Checked, drawings: list[Any], fields: dict[str, Any], status: int, sentence: str
) -> None:
    with io.BytesIO() as file:
        Image.new("1", (1200, 900)).save(file, "PNG")
        wide = file.getvalue()
    with io.BytesIO() as file:
        Image.new("L", (64, 64), 255).save(file, "PNG")
        blank = file.getvalue()
    known = {"box": png(), "cut": png()[:600], "blank": blank, "wide": wide, "heavy": bytes(2**20)}
    answer = post(client, *(one if isinstance(one, bytes) else known[one] for one in drawings), **fields)
    assert answer.status_code == status, answer.text
    assert sentence.lower() in answer.json()["error"].lower()


def test_what_is_no_form_is_refused(client: Checked) -> None:
    assert client.post(URL, json={"drawings": []}).status_code == 415
    assert client.post(URL).status_code == 415
    broken = client.post(URL, content=b"--x\r\nnonsense", headers={"content-type": "multipart/form-data; boundary=x"})
    assert broken.status_code in (400, 422)
    assert client.post(URL, content=b"", headers={"content-type": "multipart/form-data"}).status_code == 400
    text = client.post(URL, files={"views": (None, "right"), "drawings": (None, "text")})
    assert (text.status_code, "Drawings.0" in text.json()["error"]) == (422, True)
    none = client.post(URL, files={"views": (None, "right")})
    assert (none.status_code, none.json()["error"]) == (422, "Drawings: Field required")
    large = client.post(URL, files={"views": (None, "x" * 1_500_000)})
    assert large.status_code == 413


def test_a_body_without_a_length_is_counted(client: Checked) -> None:
    def chunks() -> Iterator[bytes]:
        yield b'--x\r\nContent-Disposition: form-data; name="drawings"; filename="a"\r\n\r\n'
        for _ in range(40):
            yield bytes(2**16)

    answer = client.post(URL, content=chunks(), headers={"content-type": "multipart/form-data; boundary=x"})
    assert (answer.status_code, answer.json()["error"]) == (413, "A request may have up to 1 MB")
    packed = client.post(URL, content=gzip.compress(bytes(100)), headers={"content-encoding": "gzip"})
    assert packed.status_code == 415


def test_other_sites_and_names_are_refused(client: Checked) -> None:
    for headers in ({"host": "evil.example"}, {"origin": "http://evil.example"}):
        assert client.get("/v1/viewpoints", headers=headers).status_code == 403
    assert client.get("/v2").json() == {"error": "Not Found"}
    assert client.delete(URL).status_code == 405


def test_the_promises_are_a_valid_openapi_document(client: Checked) -> None:
    validator = pytest.importorskip("openapi_spec_validator")
    validator.validate(client.promises)
    assert set(client.promises["paths"]) == {"/healthz", "/readyz", "/v1/viewpoints", URL}
    form = client.promises["components"]["schemas"]
    [body] = [schema for name, schema in form.items() if name.startswith("Body")]
    assert set(body["properties"]) == {"drawings", "views", "iterations", "align", "format"}
    assert body["properties"]["drawings"]["maxItems"] == 3
    assert client.get("/docs").status_code == 404, "its page would fetch scripts from elsewhere"


class Held:
    """Instead of a reconstruction: waits until it is let go, or is no longer wanted."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.begun, self.ended = 0, 0
        self.go = threading.Event()
        monkeypatch.setattr(serving, "make", self)

    def __call__(self, order: Any, model: Any, passes: Any, check: Callable[[], None]) -> Made:
        self.begun += 1
        try:
            begun = time.monotonic()
            while not self.go.wait(0.01):
                check()
                assert time.monotonic() - begun < 60
            if order.iterations == 7:
                raise RuntimeError("a bug")
            return Made(b"made", {})
        finally:
            self.ended += 1


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> Held:
    return Held(monkeypatch)


def test_more_than_can_wait_are_told_to_come_again(held: Held) -> None:
    with served(Limits(workers=1, waiting=2)) as (client, service), ThreadPoolExecutor(8) as pool:
        asked = [pool.submit(post, client, png(), views="right") for _ in range(3)]
        wait(lambda: service.taken == 3)
        refused = post(client, png(size=1024), views="right")
        assert refused.status_code == 503
        assert "try again in" in refused.json()["error"]
        assert client.get("/readyz").status_code == 503
        assert client.get("/healthz").json() == {"status": "alive"}
        held.go.set()
        assert [one.result().content for one in asked] == [b"made"] * 3
        assert held.begun == 3
        assert client.get("/readyz").json() == {"status": "ready", "taken": 0, "seats": 3}
        assert post(client, png(), views="right", iterations=7).status_code == 500
        assert post(client, png(), views="right").status_code == 200


def test_who_goes_away_is_not_served(held: Held) -> None:
    with served(Limits(workers=1, waiting=4)) as (client, service):
        clients = [httpx.Client(base_url=client.base_url) for _ in range(3)]
        with ThreadPoolExecutor(3) as pool:
            for number, one in enumerate(clients):
                pool.submit(post, one, png(), views="right")
                wait(lambda number=number: service.taken == number + 1)
            wait(lambda: held.begun == 1)
            for one in clients:  # the second and third wait for a worker
                leave(one)
            wait(lambda: service.taken == 0)
            wait(lambda: held.ended == 1)
        held.go.set()
        assert post(client, png(), views="right").status_code == 200
        assert held.begun == 2, "those who waited were never begun"


def leave(client: httpx.Client) -> None:
    """Cuts the connection, as a client that was killed."""
    [connection] = client._transport._pool.connections  # type: ignore[attr-defined]
    connection._connection._network_stream._sock.shutdown(socket.SHUT_RDWR)


def test_time_runs_out(held: Held) -> None:
    with served(Limits(workers=1, seconds=0.5)) as (client, service):
        answer = post(client, png(), views="right")
        assert (answer.status_code, "not made within 0.5 s" in answer.json()["error"]) == (504, True)
        wait(lambda: held.ended == 1)
        host, port = client.base_url.host, client.base_url.port
        with socket.create_connection((host, port)) as slow:
            slow.sendall(
                f"POST {URL} HTTP/1.1\r\nHost: {host}:{port}\r\nContent-Length: 9\r\n"
                "Content-Type: multipart/form-data; boundary=x\r\n\r\n--x".encode()
            )
            assert slow.recv(100).startswith(b"HTTP/1.1 408 ")
        wait(lambda: service.taken == 0)


def test_limits_that_leave_nothing_are_refused() -> None:
    for limit in ("workers", "batch", "seconds", "megabytes", "drawings", "megapixels"):
        with pytest.raises(ValueError, match=f"{limit} must be more than 0"):
            Limits(**{limit: 0})
    with pytest.raises(ValueError, match="waiting must be 0 or more"):
        Limits(waiting=-1)
