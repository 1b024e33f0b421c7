"""How many requests are served at a time, how many wait, and for how long.

A request has a seat from before its body is read until it is answered; where all are taken, it is refused at once, and
told when to come again. So neither memory nor waiting grows without end. Workers are threads: the kernels let others
run while they compute, and share the cores among themselves.
"""

from __future__ import annotations

import asyncio
import logging
import math
import os
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

from sketchcore.camera import VIEWPOINTS
from sketchcore.grids import draw
from sketchcore.nets.compactmodel import CompactModel
from sketchcore.nets.model import Model
from sketchcore.nets.together import Together
from sketchcore.reconstruction import reconstruct
from sketchcore.serve.order import AbandonedError, Made, Order, make
from sketchcore.shape import Cuboid, Shape

_log = logging.getLogger(__name__)


class BusyError(Exception):
    """All seats are taken, or the server ends.

    Attributes:
        again: seconds after which to try again.
    """

    def __init__(self, sentence: str, again: int) -> None:
        super().__init__(sentence)
        self.again = again


@dataclass(frozen=True)
class Limits:
    """What is taken on.

    Attributes:
        workers: requests that are computed at a time.
        batch: objects in a pass of the network, of those; 1 for passes of their own, each on a core.
        waiting: requests that may wait beside those.
        seconds: from a request's first byte to its answer, at most.
        megabytes: of a request.
        drawings: of an object.
        megapixels: of a drawing.
        iterations: rounds that may be asked for.

    Raises:
        ValueError: for a limit that leaves nothing.
    """

    workers: int = 1
    batch: int = 1
    waiting: int = 16
    seconds: float = 60.0
    megabytes: int = 32
    drawings: int = 8
    megapixels: int = 50
    iterations: int = 10

    def __post_init__(self) -> None:
        for name in ("workers", "batch", "seconds", "megabytes", "drawings", "megapixels"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be more than 0, got {getattr(self, name)}")
        for name in ("waiting", "iterations"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} must be 0 or more, got {getattr(self, name)}")


def cores() -> int:
    """Processors that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Service:
    """Seats and workers; all but the workers' own work happens on the event loop's thread.

    Attributes:
        limits: what is taken on.
        taken: seats that are taken.
        warm: whether everything that is loaded on first use is there.
    """

    def __init__(self, model: Model, limits: Limits) -> None:
        """Starts the workers, which warm up first."""
        self.limits = limits
        self.taken = 0
        self.warm = False
        self._model = model
        together = isinstance(model, CompactModel) and limits.batch > 1
        self._passes = Together(model.passes, limits.batch) if together and isinstance(model, CompactModel) else None
        self._closed = threading.Event()
        self._pool = ThreadPoolExecutor(limits.workers, "reconstruct")
        self._work = 1.0
        self._pool.submit(self._warm)

    @property
    def seats(self) -> int:
        """Requests that are served and that wait, at most."""
        return self.limits.workers + self.limits.waiting

    @property
    def closed(self) -> bool:
        """Whether the server ends."""
        return self._closed.is_set()

    @contextmanager
    def seat(self) -> Iterator[None]:
        """A seat, for as long as it is needed.

        Raises:
            BusyError: if none is free.
        """
        self.check()
        self.taken += 1
        try:
            yield
        finally:
            self.taken -= 1

    def check(self) -> None:
        """Raises a `BusyError` if no seat is free."""
        if self.closed:
            raise BusyError("the server is ending; ask again, or ask another", 5)
        if self.taken >= self.seats:
            again = math.ceil(self._work * self.taken / self.limits.workers)
            sentence = f"{self.taken} requests are being served or wait, which is the most that is taken on"
            raise BusyError(f"{sentence}; try again in {again} s", again)

    async def made(self, order: Order) -> Made:
        """The file; whoever stops waiting for it (cancels) stops the work."""
        wanted = threading.Event()
        wanted.set()
        asked = time.perf_counter()
        future = self._pool.submit(self._make, order, wanted, asked)
        try:
            return await asyncio.wrap_future(future)
        finally:
            wanted.clear()

    def _make(self, order: Order, wanted: threading.Event, asked: float) -> Made:
        begun = time.perf_counter()
        made = make(order, self._model, self._passes, partial(self._check, wanted))
        work = time.perf_counter() - begun
        self._work += 0.1 * (work - self._work)
        timing = f"wait;dur={1000 * (begun - asked):.1f}, work;dur={1000 * work:.1f}"
        return Made(made.content, made.headers | {"Server-Timing": timing})

    def _check(self, wanted: threading.Event) -> None:
        if not wanted.is_set() or self.closed:
            raise AbandonedError

    def _warm(self) -> None:
        """Loads what is imported, compiled or allocated on first use."""
        try:
            camera = VIEWPOINTS["quarter-037"]
            drawing = draw(Shape([Cuboid((0.0, 0.0, 0.0), (0.3, 0.2, 0.2))]), camera)
            reconstruct(drawing, camera, iterations=1, align=False, model=self._model)
        except Exception:
            _log.exception("the first reconstruction failed; the server will not be ready")
        else:
            self.warm = True

    def close(self) -> None:
        """Ends the workers: what is still waiting is dropped, what runs ends at its next pass."""
        self._closed.set()
        self._pool.shutdown(cancel_futures=True)
