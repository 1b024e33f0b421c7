"""Samples made ahead of time, so that whoever trains on them does not wait; and how long it waited all the same."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Generic, TypeVar

T = TypeVar("T")


class Ahead(Generic[T]):
    """An endless iterator over `make(number)` for endless numbers, in their order, made on threads of its own.

    What `make` raises is raised in the place of what it would have returned.

    Attributes:
        waited: seconds that were spent waiting for what was not ready.

    Args:
        make: called on several threads at once, if there are several.
        numbers: its arguments, such as `itertools.count()`.
        stock: how many are made ahead.
        threads: how many threads make them; None for one a core.
    """

    def __init__(self, make: Callable[[int], T], numbers: Iterator[int], stock: int, threads: int | None = 1) -> None:
        threads = threads or os.cpu_count() or 1
        self.waited = 0.0
        self._make = make
        self._numbers = numbers
        self._pool = ThreadPoolExecutor(threads)
        self._coming: deque[Future[T]] = deque()
        for _ in range(max(stock, threads)):
            self._order()

    def _order(self) -> None:
        self._coming.append(self._pool.submit(self._make, next(self._numbers)))

    def __iter__(self) -> Ahead[T]:
        return self

    def __next__(self) -> T:
        self._order()
        started = time.monotonic()
        try:
            return self._coming.popleft().result()
        finally:
            self.waited += time.monotonic() - started

    def close(self) -> None:
        """Stops the threads, each when it has made what it is making."""
        self._pool.shutdown(cancel_futures=True)
