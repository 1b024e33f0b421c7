"""The app's server is killed while people draw, and started again: no stroke is missing whose POST was answered.

    python tests/faults/kill_app.py --kills 100

Two clients draw into sessions of their own, stroke after stroke, and undo now and then.
"""

from __future__ import annotations

import os
import random
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import httpx
from kills import main

SIDE = "quarter-037"
CLIENTS = 2
PATIENCE = 300.0


class Server:
    """`sketchcore app`, as a process of its own."""

    def __init__(self, sessions: Path) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = int(probe.getsockname()[1])
        self.url = f"http://127.0.0.1:{self.port}"
        command = [sys.executable, "-m", "sketchcore.cli", "app", "--no-browser"]
        command += ["--port", str(self.port), "--sessions", str(sessions)]
        # NiceGUI serves nothing where it believes to be in a test.
        told = {key: value for key, value in os.environ.items() if not key.startswith(("NICEGUI", "PYTEST"))}
        self.process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=told)
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until and self.process.poll() is None:
            try:
                httpx.get(f"{self.url}/api/sessions", timeout=10).raise_for_status()
                return
            except httpx.HTTPError:
                time.sleep(0.05)
        self.process.kill()
        raise RuntimeError("the server did not start")


class Client:
    """Somebody who draws.

    Attributes:
        kept: ids of the strokes that the server has said it has, in order.
        asked: what the document may be as well: the last request may have been done though no answer came.
        answered: how many requests were answered.
    """

    def __init__(self, url: str) -> None:
        self.id = httpx.post(f"{url}/api/sessions", timeout=PATIENCE).raise_for_status().json()["id"]
        self.kept: list[str] = []
        self.asked: list[str] = []
        self.answered = 0
        self._number = 0

    def draw(self, url: str) -> None:
        """Draws until the server is gone."""
        with httpx.Client(base_url=f"{url}/api/s/{self.id}", timeout=PATIENCE) as link:
            while True:
                self._number += 1
                name = f"stroke-{self._number}"
                if self.kept and random.random() < 0.2:
                    self.asked, path, body = self.kept[:-1], "/undo", {"op": name}
                else:
                    line = [[random.uniform(10, 240), random.uniform(10, 240), 0.5] for _ in range(20)]
                    stroke = {"id": name, "kind": "ink", "points": line}
                    self.asked, path = [*self.kept, name], "/strokes"
                    body = {"op": name, "viewpoint": SIDE, "strokes": [stroke]}
                try:
                    link.post(path, json=body).raise_for_status()
                except httpx.TransportError:
                    return
                self.kept = self.asked
                self.answered += 1

    def look(self, url: str) -> bool:
        """Whether all is there that was answered; takes what is there for granted from then on."""
        state = httpx.get(f"{url}/api/s/{self.id}", timeout=PATIENCE).raise_for_status().json()
        found = [stroke["id"] for sheet in state["sheets"] for stroke in sheet["strokes"]]
        whole = found in (self.kept, self.asked)
        self.kept = self.asked = found
        return whole


def kill_app(kills: int, folder: Path) -> dict[str, Any]:
    """Kills the server so many times.

    Raises:
        AssertionError: if a stroke is lost.
    """
    sessions = folder / "sessions"
    server = Server(sessions)
    clients = [Client(server.url) for _ in range(CLIENTS)]
    row: dict[str, Any] = {"fault": "app", "kills": 0, "answered": 0, "kept": 0, "half_done": 0, "while_writing": 0}
    try:
        while row["kills"] < kills:
            drawing = [threading.Thread(target=client.draw, args=(server.url,)) for client in clients]
            for thread in drawing:
                thread.start()
            time.sleep(random.uniform(0.0, 2.0))
            server.process.kill()
            server.process.wait()
            for thread in drawing:
                thread.join()
            row["kills"] += 1
            row["while_writing"] += any(sessions.glob("*/.*"))
            server = Server(sessions)
            for client in clients:
                before = client.kept
                assert client.look(server.url), f"after kill {row['kills']} strokes are missing"
                row["half_done"] += client.kept != before
        row["answered"] = sum(client.answered for client in clients)
        row["kept"] = sum(len(client.kept) for client in clients)
    finally:
        server.process.kill()
        server.process.wait()
    return row


if __name__ == "__main__":
    main(kill_app, __doc__ or "")
