"""Samples made ahead: in order, on any number of threads, errors in their place, and how long one waited."""

from __future__ import annotations

import threading
import time
from itertools import count, islice

import pytest

from sketchcore.train.ahead import Ahead


@pytest.mark.parametrize("threads", [1, 3, None])
def test_everything_comes_in_order(threads: int | None) -> None:
    def slower_if_even(index: int) -> int:
        time.sleep(0.01 if index % 2 == 0 else 0.0)
        return index * index

    ahead = Ahead(slower_if_even, count(5), stock=4, threads=threads)
    try:
        assert list(islice(ahead, 12)) == [i * i for i in range(5, 17)]
    finally:
        ahead.close()


def test_so_many_are_made_ahead_and_no_more() -> None:
    made: list[int] = []
    ahead = Ahead(made.append, count(0), stock=3)
    try:
        deadline = time.monotonic() + 10
        while len(made) < 3 and time.monotonic() < deadline:
            time.sleep(0.001)
        time.sleep(0.02)
        assert made == [0, 1, 2]
    finally:
        ahead.close()


def test_several_are_made_at_once() -> None:
    # A barrier lets nobody through before all three have come.
    together = threading.Barrier(3, timeout=10)
    ahead = Ahead(lambda index: together.wait() >= 0, count(0), stock=3, threads=3)
    try:
        assert all(islice(ahead, 3))
    finally:
        together.abort()
        ahead.close()


def test_waiting_is_told_from_what_was_ready() -> None:
    released = threading.Event()

    def first_only(index: int) -> int:
        if index:
            assert released.wait(10)
        return index

    ahead = Ahead(first_only, count(0), stock=2)
    try:
        time.sleep(0.05)
        next(ahead)
        ready = ahead.waited
        threading.Timer(0.2, released.set).start()
        next(ahead)
        assert ahead.waited >= ready + 0.1
    finally:
        released.set()
        ahead.close()


def test_an_error_comes_in_its_place() -> None:
    def fails_at_two(index: int) -> int:
        if index == 2:
            raise ValueError("no sample 2")
        return index

    ahead = Ahead(fails_at_two, count(0), stock=4)
    try:
        assert [next(ahead), next(ahead)] == [0, 1]
        with pytest.raises(ValueError, match="no sample 2"):
            next(ahead)
    finally:
        ahead.close()


def test_closing_stops_what_has_not_begun() -> None:
    made: list[int] = []
    begun, released = threading.Event(), threading.Event()

    def held(index: int) -> None:
        begun.set()
        assert released.wait(10)
        made.append(index)

    ahead = Ahead(held, count(0), stock=50)
    assert begun.wait(10)
    threading.Timer(0.05, released.set).start()
    ahead.close()
    finished = len(made)
    assert finished < 50
    time.sleep(0.02)
    assert len(made) == finished
