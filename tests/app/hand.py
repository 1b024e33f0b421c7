"""The app in a real browser: its server as a process of its own, Chromium, and a hand that draws with the pointer."""

from __future__ import annotations

import gzip
import json
import math
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from sketchcore.camera import VIEWPOINTS

CHROMIUM = os.environ.get("SKETCHCORE_CHROMIUM") or shutil.which("chromium") or shutil.which("chromium-browser")
ARGUMENTS = ["--no-sandbox", "--disable-gpu-compositing", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
"""WebGL in the software renderer, everything else as a browser without a graphics processor does it."""
PATIENCE = 120_000
"""Milliseconds that anything may take on a machine that is busy with other things."""

FIRST = "quarter-037"
LOW, HIGH = (-0.4, -0.3, -0.25), (0.4, 0.3, 0.25)
"""The viewpoint and the box of most tests."""

# What the workspace hangs on its element for those who look inside.
DESK = "document.querySelector('.workspace').desk"
STAGE = "document.querySelector('.workspace').stage"


def needs_browser() -> pytest.MarkDecorator:
    """Skips where there is no Chromium, NiceGUI or Playwright, and says which."""
    missing = [name for name in ("nicegui", "playwright") if not _installed(name)]
    if CHROMIUM is None:
        missing.append("Chromium (Debian: apt-get install chromium)")
    return pytest.mark.skipif(bool(missing), reason=f"browser tests need {', '.join(missing)}")


def _installed(name: str) -> bool:
    from importlib.util import find_spec

    return find_spec(name) is not None


class AppServer:
    """`sketchcore app` on a free port, with a folder of its own."""

    def __init__(self, sessions: Path, port: int | None = None) -> None:
        self.sessions = sessions
        self.port = port or _free_port()
        self.url = f"http://127.0.0.1:{self.port}"
        self.process: subprocess.Popen[bytes] | None = None

    def start(self) -> AppServer:
        command = [sys.executable, "-c", "from sketchcore.cli import app; app()", "app", "--no-browser"]
        command += ["--port", str(self.port), "--sessions", str(self.sessions)]
        self.log = (self.sessions.parent / f"server-{self.port}.log").open("ab")
        environment = {key: value for key, value in os.environ.items() if not key.startswith(("NICEGUI", "PYTEST"))}
        self.process = subprocess.Popen(command, stdout=self.log, stderr=self.log, env=environment)
        begun = time.monotonic()
        while time.monotonic() - begun < 3 * PATIENCE / 1000:
            if self.process.poll() is not None:
                break
            try:
                urllib.request.urlopen(f"{self.url}/api/sessions", timeout=5).close()
                return self
            except OSError:
                time.sleep(0.2)
        self.stop()
        raise RuntimeError(
            f"the server did not start ({self.process.returncode}): {Path(self.log.name).read_text()[-2000:]}"
        )

    def kill(self) -> None:
        """As a crash would: nothing is said to it."""
        assert self.process is not None
        self.process.send_signal(signal.SIGKILL)
        self.process.wait()
        self.log.close()

    def stop(self) -> None:
        if self.process is not None and self.process.poll() is None:
            self.process.terminate()
            try:
                self.process.wait(20)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()
        self.log.close()

    def get(self, path: str) -> Any:
        with urllib.request.urlopen(self.url + path, timeout=PATIENCE / 1000) as answer:
            return json.loads(answer.read())

    def post(self, path: str, body: Any) -> Any:
        """What another page would do."""
        headers = {"Content-Type": "application/json"}
        request = urllib.request.Request(self.url + path, json.dumps(body).encode(), headers, method="POST")
        with urllib.request.urlopen(request, timeout=PATIENCE / 1000) as answer:
            return json.loads(answer.read())

    def read(self, path: str) -> bytes:
        with urllib.request.urlopen(self.url + path, timeout=PATIENCE / 1000) as answer:
            content: bytes = answer.read()
            packed = answer.headers.get("Content-Encoding") == "gzip"
        return gzip.decompress(content) if packed else content


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    return port


def project(viewpoint: str, point: Sequence[float]) -> tuple[float, float]:
    """Where a world point is seen: pixels of the drawing, written from the convention and not from the page's code."""
    camera = VIEWPOINTS[viewpoint]
    right, down, forward = camera.rotation @ (np.asarray(point) - camera.position)
    scale = 128 / math.tan(math.radians(camera.fov_degrees) / 2) / forward
    return 128 + right * scale, 128 + down * scale


def box_edges(
    viewpoint: str, low: Sequence[float], high: Sequence[float]
) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """The visible edges of a box, as pixels: those of faces that look at the camera."""
    eye = VIEWPOINTS[viewpoint].position
    corners = np.array([low, high], dtype=np.float64)
    edges = set()
    for axis in range(3):
        for side in (0, 1):
            outside = eye[axis] > corners[1][axis] if side else eye[axis] < corners[0][axis]
            if not outside:
                continue
            others = [a for a in range(3) if a != axis]
            around = [(0, 0), (0, 1), (1, 1), (1, 0)]
            for a, b in zip(around, around[1:] + around[:1], strict=True):
                ends = []
                for which in (a, b):
                    corner = [0, 0, 0]
                    corner[axis], corner[others[0]], corner[others[1]] = side, which[0], which[1]
                    ends.append(tuple(corner))
                edges.add(tuple(sorted(ends)))
    place = [[corners[bit][axis] for bit in (0, 1)] for axis in range(3)]
    return [
        (
            project(viewpoint, [place[i][c] for i, c in enumerate(a)]),
            project(viewpoint, [place[i][c] for i, c in enumerate(b)]),
        )
        for a, b in sorted(edges)
    ]


class Hand:
    """A person at the page."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.troubles: list[str] = []
        page.set_default_timeout(PATIENCE)
        page.on("pageerror", lambda error: self.troubles.append(str(error)))

    def open(self, url: str) -> Hand:
        self.page.goto(url)
        self.ready()
        close = self.page.locator("[data-note=welcome] button[aria-label^=No]")
        if close.count():
            close.click()
        return self

    def ready(self) -> None:
        """Waits until the page has a session and the camera has come to rest."""
        self.page.wait_for_function(f"document.querySelector('.workspace')?.stage && {DESK}.state.id")
        self.page.wait_for_function(f"{STAGE}.mode !== 'flying'")

    @property
    def id(self) -> str:
        value: str = self.page.evaluate(f"{DESK}.state.id")
        return value

    @property
    def state(self) -> dict[str, Any]:
        value: dict[str, Any] = self.page.evaluate(f"JSON.parse(JSON.stringify({DESK}.state))")
        return value

    def at(self, x: float, y: float) -> tuple[float, float]:
        """A pixel of the drawing on the page."""
        left, top, side = map(float, self.page.get_attribute(".stage", "data-area").split())
        stage = self.page.locator(".stage").bounding_box()
        return stage["x"] + left + x * side / 256, stage["y"] + top + y * side / 256

    def line(self, *points: tuple[float, float], steps: int = 6) -> None:
        """Draws through places, pixels of the drawing."""
        mouse = self.page.mouse
        mouse.move(*self.at(*points[0]))
        mouse.down()
        for point in points[1:]:
            mouse.move(*self.at(*point), steps=steps)
        mouse.up()

    def box(self, viewpoint: str, low: Sequence[float], high: Sequence[float]) -> None:
        """Draws the visible edges of a box, stroke by stroke, and waits until they have been saved."""
        for a, b in box_edges(viewpoint, low, high):
            self.line(a, b)
        self.saved()

    def saved(self) -> None:
        self.page.wait_for_function(f"{DESK}.now.waiting === 0")

    def press(self, action: str) -> None:
        """Clicks a button of the page by its action's name."""
        self.page.locator(f"[data-action={action}]").first.click()

    def reconstruct(self) -> None:
        """Presses the button, and waits until the shape is on the screen."""
        before = self.page.evaluate(f"{DESK}.now.shownAt")
        self.press("reconstruct")
        self.settled()
        self.page.wait_for_function(f"{DESK}.now.shownAt > {before}")

    def settled(self) -> None:
        """Waits until the shape is that of the drawings, and has been loaded."""
        self.saved()
        self.page.wait_for_function(
            f"(() => {{ const d = {DESK}, s = d.state; return s.solid && !s.stale && !s.progress.working"
            " && !s.progress.waiting && d.loaded === s.scene && !d.loading; })()"
        )

    def view(self, viewpoint: str) -> None:
        """Chooses a viewpoint in the panel, and waits for the end of the way there."""
        self.page.locator(f"[data-view={viewpoint}]").click()
        self.page.wait_for_function(f"{STAGE}.mode === 'draw' && {STAGE}.viewpoint === '{viewpoint}'")

    def drawn(self) -> NDArray[np.uint8]:
        """The ink canvas as it is on the screen: alpha, uint8 [256, 256]."""
        return self._canvas("canvas.ink", False)

    def silhouette(self) -> NDArray[np.bool_]:
        """Where the solid covers the drawing area, as the 3D view shows it: bool [256, 256]."""
        self.page.evaluate(f"""() => {{
            const view = {STAGE}.view;
            Object.assign(view.look, {{ opacity: 1, cube: 0, grid: 0, shade: 0 }});
            view.movedAt = undefined;
            view.tick = () => {{}};
            view.draw(view.frame(), 1, false);
        }}""")
        solid = self._canvas("canvas.volume", True) > 127
        self.page.evaluate(f"""() => {{
            const stage = {STAGE};
            delete stage.view.tick;
            stage.view.look.shade = 1;
            stage.setFaint(stage.faint);
            stage.view.invalidate();
        }}""")
        return solid

    def _canvas(self, selector: str, cut: bool) -> NDArray[np.uint8]:
        data = self.page.evaluate(f"""() => {{
            const canvas = document.querySelector('{selector}');
            const {{ x, y, side }} = {STAGE}.area;
            const scale = canvas.width / canvas.clientWidth;
            const copy = new OffscreenCanvas(256, 256).getContext('2d');
            const [left, top, size] = {"[x * scale, y * scale, side * scale]" if cut else "[0, 0, canvas.width]"};
            copy.drawImage(canvas, left, top, size, size, 0, 0, 256, 256);
            return Array.from(copy.getImageData(0, 0, 256, 256).data.filter((_, i) => i % 4 === 3));
        }}""")
        return np.array(data, np.uint8).reshape(256, 256)


def overlap(a: NDArray[np.bool_], b: NDArray[np.bool_]) -> float:
    """Intersection over union."""
    return float((a & b).sum() / (a | b).sum())
