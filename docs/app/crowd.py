"""Twenty people at once on one server: whether all are served, how long they wait, and what the server holds.

Run as `python docs/app/crowd.py`; it prints JSON. Each client draws a box from four sides, stroke by stroke, has it
reconstructed after every side, and looks at the solid and the mesh; all begin together, four times over.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "app"))

from hand import HIGH, LOW, AppServer, box_edges

CLIENTS, WAVES = 20, 4
SIDES = ("quarter-037", "left", "front", "quarter-232")


def strokes(viewpoint: str) -> list[dict[str, Any]]:
    """A box's visible edges from a viewpoint, a stroke each."""
    lines = [[[*end, 0.5] for end in edge] for edge in box_edges(viewpoint, LOW, HIGH)]
    return [{"id": f"{viewpoint}-{i}", "kind": "ink", "points": line} for i, line in enumerate(lines)]


class Client:
    """One person's requests, and how long the server took over each."""

    def __init__(self, url: str) -> None:
        self.url = url
        self.seconds: dict[str, list[float]] = {}

    def ask(self, name: str, path: str, body: object = None) -> bytes:
        """One request; raises for any answer but 2xx."""
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.url + path, data, {"Content-Type": "application/json"})
        begun = time.monotonic()
        with urllib.request.urlopen(request, timeout=120) as answer:
            content: bytes = answer.read()
        self.seconds.setdefault(name, []).append(time.monotonic() - begun)
        return content

    def draw(self) -> None:
        """A box from four sides, reconstructed after each."""
        id = json.loads(self.ask("session", "/api/sessions", {}))["id"]
        for side in SIDES:
            for stroke in strokes(side):
                self.ask("stroke", f"/api/s/{id}/strokes", {"viewpoint": side, "strokes": [stroke], "op": stroke["id"]})
            begun = time.monotonic()
            self.ask("click", f"/api/s/{id}/reconstruct", {})
            while True:
                state = json.loads(self.ask("state", f"/api/s/{id}"))
                if not (state["progress"]["working"] or state["progress"]["waiting"]):
                    break
                time.sleep(0.1)
            if state["trouble"] or state["solid"] is None or state["stale"]:
                raise RuntimeError(f"no solid of {side}: {state['trouble']}")
            self.seconds.setdefault("solid", []).append(time.monotonic() - begun)
        self.ask("volume", f"/api/s/{id}/volume/scene")
        self.ask("mesh", f"/api/s/{id}/export.glb")


def held(process: int) -> dict[str, int]:
    """Megabytes of memory that a process holds, and the most that it has held."""
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    said = {
        name: int(rest.split()[0])
        for name, rest in (line.split(":", 1) for line in lines)
        if name in ("VmRSS", "VmHWM")
    }
    return {"now": said["VmRSS"] // 1024, "peak": said["VmHWM"] // 1024}


def wave(url: str, clients: int) -> dict[str, Any]:
    """So many clients together: the median and the longest time of each kind of request, in seconds."""
    crowd = [Client(url) for _ in range(clients)]
    begun = time.monotonic()
    with ThreadPoolExecutor(clients) as pool:
        list(pool.map(Client.draw, crowd))  # raises if any was not served
    report: dict[str, Any] = {"clients": clients, "seconds": round(time.monotonic() - begun, 1)}
    for name in crowd[0].seconds:
        times = sorted(second for client in crowd for second in client.seconds[name])
        report[name] = {"median": round(times[len(times) // 2], 3), "longest": round(times[-1], 3)}
    return report


def main() -> None:
    """Prints the report."""
    with tempfile.TemporaryDirectory() as place:
        server = AppServer(Path(place) / "sessions").start()
        assert server.process is not None
        report = []
        for clients in (1, *[CLIENTS] * WAVES):
            report.append(wave(server.url, clients) | {"megabytes": held(server.process.pid)})
        server.stop()
    print(json.dumps(report, indent=2))


if __name__ == "__main__":
    main()
