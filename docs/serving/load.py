"""How much `sketchcore serve` serves: starts it as a process, and asks it for solids from many clients at once.

    python docs/serving/load.py clients                  # 1 to 64 clients: throughput, latency, refusals
    python docs/serving/load.py setups                   # workers and passes put together, beside each other
    python docs/serving/load.py memory --minutes 10      # the server's memory, under load all the while

Each prints a table as Markdown; `-o FILE` writes the figures as JSON as well; what follows `--` is given to the server.
A client asks, waits for the answer, and asks again; one that is refused comes again after as long as it is told to.
"""

from __future__ import annotations

import argparse
import asyncio
import io
import json
import os
import platform
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import httpx
from PIL import Image

import sketchcore as sk

VIEWS = ("quarter-037", "right")
SHAPES = 16
PATIENCE = 120.0
"""Seconds that a server may take to begin, and an answer to come."""
LEVELS = "1,2,4,8,16,32,64"
SETUPS = ((1, 1), (2, 1), (4, 1), (2, 2), (4, 4), (8, 8))
"""Workers, and objects in a pass of the network."""


class Server:
    """`sketchcore serve` as a process of its own."""

    def __init__(self, arguments: Sequence[str]) -> None:
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        self.url = f"http://127.0.0.1:{port}"
        command = [sys.executable, "-m", "sketchcore.cli", "serve", "--port", str(port), "--no-log", *arguments]
        self._said = tempfile.TemporaryFile()  # noqa: SIM115, it lives as long as the server
        self.process = subprocess.Popen(command, stdout=self._said, stderr=self._said)

    def wait(self) -> None:
        begun = time.monotonic()
        while time.monotonic() - begun < PATIENCE and self.process.poll() is None:
            try:
                if httpx.get(f"{self.url}/readyz").status_code == 200:
                    return
            except httpx.TransportError:
                pass
            time.sleep(0.2)
        self.stop()
        raise RuntimeError(f"the server did not begin: {self.said()}")

    def said(self) -> str:
        self._said.seek(0)
        return self._said.read().decode(errors="replace")[-2000:]

    def rss(self) -> float:
        """Megabytes of memory that it has now."""
        lines = Path(f"/proc/{self.process.pid}/status").read_text().splitlines()
        return int(next(line for line in lines if line.startswith("VmRSS")).split()[1]) / 1024

    def cpu(self) -> float:
        """Seconds of processor time that it has taken."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def stop(self) -> None:
        self.process.terminate()
        try:
            self.process.wait(30)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


@contextmanager
def serving(arguments: Sequence[str]) -> Iterator[Server]:
    server = Server(arguments)
    try:
        server.wait()
        yield server
    finally:
        server.stop()


@dataclass
class Answers:
    """What came back.

    Attributes:
        latencies: seconds from a request that was taken on to the last byte of its answer.
        refused: answers 503.
        late: answers 504.
        errors: anything else that is no solid, by what it is.
    """

    latencies: list[float] = field(default_factory=list)
    refused: int = 0
    late: int = 0
    errors: Counter[str] = field(default_factory=Counter)


def drawings() -> list[list[bytes]]:
    """PNG files of each of some generated shapes, from `VIEWS`."""
    found = []
    for shape in sk.generate(seed=11, count=SHAPES, views=1).shapes:
        files = []
        for view in VIEWS:
            with io.BytesIO() as file:
                Image.fromarray(255 - sk.draw(shape, sk.VIEWPOINTS[view])).save(file, "PNG")
                files.append(file.getvalue())
        found.append(files)
    return found


async def client(url: str, number: int, files: list[list[bytes]], until: float, answers: Answers) -> None:
    """Asks for one solid after the other, from one and from two drawings in turns."""
    async with httpx.AsyncClient(timeout=PATIENCE) as http:
        turn = number
        while time.monotonic() < until:
            count = 1 + turn % 2
            sent = [("drawings", ("drawing.png", one, "image/png")) for one in files[turn % len(files)][:count]]
            begun = time.monotonic()
            try:
                answer = await http.post(f"{url}/v1/reconstruct", files=sent, data={"views": list(VIEWS[:count])})
            except httpx.HTTPError as error:
                answers.errors[type(error).__name__] += 1
                await asyncio.sleep(0.5)
                continue
            turn += 1
            if answer.status_code == 200 and answer.content[:4] == b"glTF":
                answers.latencies.append(time.monotonic() - begun)
            elif answer.status_code == 503 and "retry-after" in answer.headers:
                answers.refused += 1
                await asyncio.sleep(min(float(answer.headers["retry-after"]), max(0.0, until - time.monotonic())))
            elif answer.status_code == 504:
                answers.late += 1
            else:
                answers.errors[f"{answer.status_code}: {answer.text[:200]}"] += 1


async def ask(url: str, clients: int, seconds: float, files: list[list[bytes]]) -> Answers:
    answers, until = Answers(), time.monotonic() + seconds
    await asyncio.gather(*(client(url, number, files, until, answers) for number in range(clients)))
    return answers


@dataclass
class Row:
    """One level of load.

    Attributes:
        clients: how many ask at a time.
        solids: how many were made.
        throughput: of these, a second.
        cpu: seconds of processor time that the server took for each, which other work on the machine hardly changes.
        p50, p95, p99: milliseconds that half, 95 % and 99 % of the answers took at most.
        refused: how many requests were (503).
        late: how many were not answered in time (504).
        errors: all others that brought no solid.
        before, after: megabytes of the server's memory.
    """

    clients: int
    solids: int
    throughput: float
    cpu: float
    p50: float
    p95: float
    p99: float
    refused: int
    late: int
    errors: dict[str, int]
    before: float
    after: float


def measure(server: Server, clients: int, seconds: float, files: list[list[bytes]]) -> Row:
    before, spent, begun = server.rss(), server.cpu(), time.monotonic()
    answers = asyncio.run(ask(server.url, clients, seconds, files))
    took = time.monotonic() - begun
    if not answers.latencies:
        raise RuntimeError(f"nothing came back from {server.url}: {dict(answers.errors)}; {server.said()}")
    cuts = statistics.quantiles([1000 * one for one in answers.latencies] * 2, n=100, method="inclusive")
    solids = len(answers.latencies)
    cpu = (server.cpu() - spent) / solids
    errors = dict(answers.errors)
    p50, p95, p99 = cuts[49], cuts[94], cuts[98]
    refusals = (answers.refused, answers.late)
    return Row(clients, solids, solids / took, cpu, p50, p95, p99, *refusals, errors, before, server.rss())


def report(row: Row) -> None:
    """What went wrong, beside the table."""
    for error, count in row.errors.items():
        print(f"{count} times with {row.clients} clients: {error}", file=sys.stderr, flush=True)


def line(*cells: object) -> None:
    print("|", " | ".join(f"{cell:.0f}" if isinstance(cell, float) else str(cell) for cell in cells), "|", flush=True)


def head(*names: str) -> None:
    line(*names)
    print("|---" * len(names) + "|")


def by_clients(options: argparse.Namespace, files: list[list[bytes]]) -> list[dict[str, Any]]:
    times = ("p50 ms", "p95 ms", "p99 ms")
    head("clients", "solids/s", "CPU s each", *times, "solids", "503", "504", "other errors", "memory MB")
    rows = []
    with serving(options.server) as server:
        measure(server, 4, options.seconds / 2, files)  # memory that is taken once, and warm caches
        for level in map(int, options.levels.split(",")):
            row = measure(server, level, options.seconds, files)
            speed = (f"{row.throughput:.2f}", f"{row.cpu:.2f}", row.p50, row.p95, row.p99)
            wrong = (row.refused, row.late, sum(row.errors.values()))
            line(level, *speed, row.solids, *wrong, f"{row.before:.0f} -> {row.after:.0f}")
            rows.append(asdict(row))
            report(row)
    return rows


def by_setups(options: argparse.Namespace, files: list[list[bytes]]) -> list[dict[str, Any]]:
    one_client = ("1 client: solids/s", "CPU s each", "p50 ms")
    head("workers", "objects in a pass", *one_client, "8 clients: solids/s", "CPU s each", "p50 ms", "p95 ms")
    rows = []
    for workers, batch in SETUPS:
        with serving([*options.server, "--workers", str(workers), "--batch", str(batch)]) as server:
            measure(server, 4, options.seconds / 4, files)
            one, eight = (measure(server, level, options.seconds, files) for level in (1, 8))
        first, second = ((f"{row.throughput:.2f}", f"{row.cpu:.2f}", row.p50) for row in (one, eight))
        line(workers, batch, *first, *second, eight.p95)
        rows.append({"workers": workers, "batch": batch, "1": asdict(one), "8": asdict(eight)})
    return rows


def by_time(options: argparse.Namespace, files: list[list[bytes]]) -> list[dict[str, Any]]:
    print(f"{options.clients} clients.\n")
    head("after s", "memory MB", "solids", "503", "504", "other errors")
    rows = []
    with serving(options.server) as server:
        line(0, server.rss(), 0, 0, 0, 0)
        begun = time.monotonic()
        for _ in range(max(1, round(60 * options.minutes / options.every))):
            row = measure(server, options.clients, options.every, files)
            after = time.monotonic() - begun
            line(after, row.after, row.solids, row.refused, row.late, sum(row.errors.values()))
            rows.append(asdict(row) | {"seconds": after})
            report(row)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    kinds = {"clients": by_clients, "setups": by_setups, "memory": by_time}
    parser.add_argument("kind", choices=kinds)
    parser.add_argument("--seconds", type=float, default=20.0, help="for each level of load")
    parser.add_argument("--levels", default=LEVELS, help="numbers of clients")
    parser.add_argument("--minutes", type=float, default=10.0, help="for memory")
    parser.add_argument("--every", type=float, default=60.0, help="seconds between looks at the memory")
    parser.add_argument("--clients", type=int, default=8, help="for memory")
    parser.add_argument("-o", "--out", type=Path, help="JSON to write")
    parser.add_argument("server", nargs="*", help="options of the server, after --")
    options = parser.parse_args()
    rows = kinds[options.kind](options, drawings())
    if options.out:
        machine = {"processor": platform.machine(), "cores": len(os.sched_getaffinity(0)), "load": os.getloadavg()[0]}
        said = {"kind": options.kind, "server": options.server, "machine": machine, "rows": rows}
        options.out.write_text(json.dumps(said, indent=1) + "\n")


if __name__ == "__main__":
    main()
