"""`sketchcore serve` as a process: how it begins, and how it ends while it is being asked."""

from __future__ import annotations

import io
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from PIL import Image

pytest.importorskip("fastapi", reason="the server needs FastAPI (pip install 'sketchcore[serve]')")

import httpx
import uvicorn
from typer.testing import CliRunner

import sketchcore as sk
from sketchcore.cli import app


def wait(holds: Callable[[], Any], process: subprocess.Popen[bytes]) -> None:
    begun = time.monotonic()
    while not holds():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() - begun < 120
        time.sleep(0.02)


def ready(url: str) -> dict[str, Any]:
    try:
        answer = httpx.get(f"{url}/readyz")
    except httpx.TransportError:
        return {}
    return answer.json() if answer.status_code == 200 else {}


def test_what_was_taken_on_is_finished_before_the_server_ends() -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "sketchcore.cli", "serve", "--port", str(port), "--workers", "1"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    url = f"http://127.0.0.1:{port}"
    shape = sk.Shape([sk.Cuboid((0.0, 0.0, 0.0), (0.4, 0.25, 0.3))])
    with io.BytesIO() as file:
        Image.fromarray(sk.draw(shape, sk.VIEWPOINTS["right"])).save(file, "PNG")
        files = {"drawings": file.getvalue()}

    def ask() -> httpx.Response:
        return httpx.post(f"{url}/v1/reconstruct", files=files, data={"views": "right"}, timeout=120)

    try:
        wait(lambda: ready(url), process)
        with ThreadPoolExecutor(5) as pool:
            asked = [pool.submit(ask) for _ in range(5)]
            # Answered ones are counted first: none of them is among those that are still taken.
            wait(lambda: sum(one.done() for one in asked) + ready(url).get("taken", 0) == 5, process)
            process.send_signal(signal.SIGTERM)
            begun = time.monotonic()
            while time.monotonic() - begun < 60:
                try:
                    socket.create_connection(("127.0.0.1", port)).close()
                except OSError:
                    break
                time.sleep(0.01)
            assert not all(one.done() for one in asked), "new clients are refused while the last are being served"
            answers = [one.result() for one in asked]
        assert [answer.status_code for answer in answers] == [200] * 5
        assert all(answer.content[:4] == b"glTF" for answer in answers)
        out, log = process.communicate(timeout=60)
    finally:
        process.kill()
        process.communicate()
    assert process.returncode in (0, -signal.SIGTERM)
    assert out.decode().startswith(f"sketchcore serve: {url} ")
    assert b"Traceback" not in log


def test_weights_that_are_none_are_refused_before_it_listens(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["serve", "--model", str(tmp_path / "none.safetensors")])
    assert result.exit_code == 1
    assert result.stderr.startswith("error: no weights at")


def test_it_warns_where_others_reach_it(monkeypatch: pytest.MonkeyPatch) -> None:
    run: dict[str, Any] = {}
    monkeypatch.setattr(uvicorn, "run", lambda app, **options: run.update(options, app=app))
    result = CliRunner().invoke(app, ["serve"])
    run["app"].state.service.close()
    assert (run["host"], run["port"], result.stderr) == ("127.0.0.1", 8021, "")
    result = CliRunner().invoke(app, ["serve", "--host", "0.0.0.0", "--no-log"])
    run["app"].state.service.close()
    assert "others may reach it from the network" in result.stderr
    assert result.exit_code == 0
