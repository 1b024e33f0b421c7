"""What the browser tests share: one server, one Chromium, a fresh page for each test."""

from __future__ import annotations

import json
import urllib.request
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from hand import ARGUMENTS, CHROMIUM, FIRST, HIGH, LOW, PATIENCE, AppServer, Hand


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[AppServer]:
    served = AppServer(tmp_path_factory.mktemp("app") / "sessions").start()
    yield served
    served.stop()


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        yield chromium
        chromium.close()


@pytest.fixture
def new_hand(browser: Any) -> Iterator[Callable[..., Hand]]:
    """Makes a page in a browser profile of its own: nothing is remembered from another test."""
    contexts = []

    def make(**options: Any) -> Hand:
        context = browser.new_context(**{"viewport": {"width": 1280, "height": 800}, **options})
        contexts.append(context)
        return Hand(context.new_page())

    yield make
    for context in contexts:
        context.close()


@pytest.fixture
def hand(server: AppServer, new_hand: Callable[..., Hand]) -> Iterator[Hand]:
    """A person before an empty page."""
    person = new_hand().open(server.url)
    yield person
    assert person.troubles == []


@pytest.fixture(scope="session")
def box_file(server: AppServer, browser: Any) -> tuple[bytes, str]:
    """A session in which a box was drawn with the pointer and reconstructed, as a file; and its id."""
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    person = Hand(page).open(server.url)
    person.box(FIRST, LOW, HIGH)
    person.reconstruct()
    file = server.read(f"/api/s/{person.id}/file")
    id = person.id
    assert person.troubles == []
    page.close()
    return file, id


@pytest.fixture
def boxed(server: AppServer, box_file: tuple[bytes, str], new_hand: Callable[..., Hand]) -> Iterator[Hand]:
    """A person before a page with that box, in a session of their own."""
    request = urllib.request.Request(f"{server.url}/api/sessions/import", box_file[0], method="POST")
    with urllib.request.urlopen(request, timeout=PATIENCE / 1000) as answer:
        id = json.loads(answer.read())["id"]
    person = new_hand().open(f"{server.url}/s/{id}")
    person.settled()
    yield person
    assert person.troubles == []
