"""The screenshots of docs/app.md, taken in a real browser as a person would come by them.

python docs/app/make.py [FOLDER]     writes PNG files (beside this script)
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "app"))

from hand import ARGUMENTS, CHROMIUM, DESK, FIRST, PATIENCE, STAGE, AppServer, Hand, project
from playwright.sync_api import Browser, sync_playwright

from sketchcore.app.examples import SCENES, read_tour

SIZE = {"width": 1280, "height": 800}


def finished(hand: Hand) -> None:
    """Waits until the 3D view has drawn its last and finest frame."""
    hand.page.wait_for_timeout(400)
    hand.page.wait_for_function(f"!{STAGE}.view.dirty && !{STAGE}.view.fence && !{STAGE}.view.last.moving")
    hand.page.wait_for_timeout(300)


@contextmanager
def person(browser: Browser, url: str, **options: Any) -> Iterator[Hand]:
    """A fresh page."""
    page = browser.new_page(**{"viewport": SIZE, "reduced_motion": "reduce", **options})
    hand = Hand(page)
    yield hand.open(url)
    page.close()


def draw(hand: Hand, strokes: list[Any]) -> None:
    for line in strokes:
        hand.line(*[tuple(point) for point in line[:: max(1, len(line) // 12)]], tuple(line[-1]), steps=1)
    hand.saved()


def main(folder: Path) -> None:
    """Takes them all."""
    folder.mkdir(parents=True, exist_ok=True)
    first, second = read_tour()

    def shot(hand: Hand, name: str, away: bool = True) -> None:
        if away:
            hand.page.mouse.move(640, 798)
        finished(hand)
        hand.page.screenshot(path=folder / f"{name}.png")
        print(f"{name}.png", flush=True)

    with tempfile.TemporaryDirectory() as place, sync_playwright() as playwright:
        server = AppServer(Path(place) / "sessions").start()
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        page = browser.new_page(viewport=SIZE)
        page.set_default_timeout(PATIENCE)
        welcome = Hand(page)
        page.goto(server.url)
        welcome.ready()
        shot(welcome, "empty")
        page.close()

        with person(browser, server.url) as hand:
            hand.view(first["viewpoint"])
            hand.press("construction")
            for y, z in ((-0.36, 0.26), (0.3, 0), (0.04, 0.36)):  # long lines, to lay out the object
                hand.line(project(first["viewpoint"], (-0.46, y, z)), project(first["viewpoint"], (0.46, y, z)))
            for x, y in ((0.34, -0.36), (-0.34, -0.36), (0.4, 0.04), (-0.4, 0.04)):
                hand.line(project(first["viewpoint"], (x, y, 0.46)), project(first["viewpoint"], (x, y, -0.46)))
            hand.press("pen")
            draw(hand, first["strokes"][:10])
            hand.page.mouse.move(*hand.at(*project(first["viewpoint"], (0.34, 0.04, 0.26))))
            shot(hand, "drawing", away=False)
            draw(hand, first["strokes"][10:])
            hand.page.mouse.move(2, 400)
            hand.reconstruct()
            hand.page.locator(".advice").wait_for()
            shot(hand, "reconstructed")
            hand.press("navigate")
            hand.page.evaluate(f"{STAGE}.look({{ azimuth: 18, elevation: 20, distance: 2 }})")
            shot(hand, "turned")
            hand.page.locator("[data-action=doubt]").click()
            hand.page.wait_for_function(f"{STAGE}.view.unsure && {STAGE}.view.look.doubt")
            shot(hand, "unsure")
            hand.page.locator("[data-action=doubt]").click()
            hand.view(second["viewpoint"])
            draw(hand, second["strokes"][:9])
            hand.page.mouse.move(*hand.at(180, 120))
            shot(hand, "second", away=False)
            draw(hand, second["strokes"][9:])
            hand.reconstruct()
            hand.press("navigate")
            hand.page.evaluate(f"{STAGE}.look({{ azimuth: 40, elevation: 24, distance: 2 }})")
            shot(hand, "better")
            hand.press("freeze")
            hand.saved()
            hand.view(FIRST)
            hand.press("ellipse")
            hand.line((70, 150), (95, 150))
            hand.line((70, 110), (95, 110))
            hand.page.mouse.move(*hand.at(120, 128))
            hand.saved()
            shot(hand, "ellipse", away=False)
            hand.press("pen")
            hand.page.keyboard.press("?")
            shot(hand, "help")
            hand.page.keyboard.press("Escape")

        with person(browser, server.url, color_scheme="dark") as hand:
            hand.line((110, 110), (140, 112), (142, 140), (112, 142), (110, 110))
            hand.saved()
            hand.page.locator(".note.hint").first.wait_for()
            shot(hand, "hint")

        with person(browser, server.url) as hand:
            for number, scene in enumerate(SCENES):
                hand.press("sessions")
                if number == 0:
                    shot(hand, "sessions")
                before = hand.id
                hand.page.locator(f"[data-scene={scene}]").click()
                hand.page.wait_for_function(
                    f"{DESK}.state.id !== '{before}' && {DESK}.loaded === {DESK}.state.scene"
                    f" && {STAGE}.mode === 'navigate'"
                )
                if number == 0:
                    hand.page.locator(".parts [aria-label^=Place]").first.click()
                shot(hand, f"scene-{scene}")
                if number == 0:
                    hand.press("theme")
                    shot(hand, "dark")
                    hand.press("theme")

        with person(browser, server.url, viewport={"width": 430, "height": 860}, has_touch=True) as hand:
            hand.press("panel")
            hand.view(first["viewpoint"])
            hand.press("panel")
            draw(hand, first["strokes"])
            hand.reconstruct()
            shot(hand, "phone")
        browser.close()
        server.stop()


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent)
