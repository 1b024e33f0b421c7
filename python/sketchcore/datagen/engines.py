"""Who makes the shards of an export: this process, several, or the machines of a Ray cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import islice
from types import MappingProxyType

from sketchcore.datagen.manifest import Shard
from sketchcore.datagen.processes import process_pool

Make = Callable[[int], Shard]
"""Makes the shard of a number, and says what it made."""
Engine = Callable[[Make, Sequence[int], int | None], Iterator[Shard]]
"""Makes shards of some numbers, so many at a time; yields them as they are done."""

RETRIES = 5
"""How often a shard is made again whose Ray worker died."""


def in_processes(make: Make, numbers: Sequence[int], workers: int | None) -> Iterator[Shard]:
    """One shard a process; a process a core, unless told otherwise.

    Raises:
        RuntimeError: if a process dies; what it was making is not there.
    """
    count = min(workers or os.cpu_count() or 1, max(len(numbers), 1))
    waiting: set[Future[Shard]] = set()
    pool = process_pool(count)
    try:
        for number in numbers:
            waiting.add(pool.submit(make, number))
            if len(waiting) >= 2 * count:
                done, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                yield from (future.result() for future in done)
        yield from (future.result() for future in waiting)
    except BrokenProcessPool:
        raise RuntimeError("a process that made shards died; the same command goes on with what is missing") from None
    finally:
        pool.shutdown(cancel_futures=True)


def on_ray(make: Make, numbers: Sequence[int], workers: int | None) -> Iterator[Shard]:
    """A Ray task a shard, on the cluster that RAY_ADDRESS names, or else on this machine.

    A task whose worker dies is done again elsewhere.

    Raises:
        ValueError: without Ray.
        RuntimeError: if a shard's workers died again and again, or a task failed in Ray.
    """
    try:
        import ray
    except ImportError:
        raise ValueError("the engine ray needs Ray; install it by: pip install 'sketchcore[ray]'") from None
    began = not ray.is_initialized()
    if began:
        ray.init(log_to_driver=False, include_dashboard=False)
    task = ray.remote(max_retries=RETRIES, num_cpus=1)(make_one)
    shared = ray.put(make)
    most = workers or max(1, int(ray.cluster_resources().get("CPU", 1)))
    waiting: list[object] = []
    try:
        coming = iter(numbers)
        while True:
            waiting += [task.remote(shared, number) for number in islice(coming, most - len(waiting))]
            if not waiting:
                return
            done, waiting = ray.wait(waiting)
            yield from ray.get(done)
    except ray.exceptions.RayTaskError as error:
        raise error.cause from None
    except ray.exceptions.RayError as error:
        raise RuntimeError(f"Ray gave up: {error}; the same command goes on with what is missing") from error
    finally:
        for left in waiting:
            ray.cancel(left, force=True)
        if began:
            ray.shutdown()


def make_one(make: Make, number: int) -> Shard:
    """What Ray runs, and shows under this name."""
    return make(number)


ENGINES: Mapping[str, Engine] = MappingProxyType({"processes": in_processes, "ray": on_ray})
"""Engines beside "local", which is this process."""
