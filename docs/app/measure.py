"""How quick the app is, in Chromium's software renderer and on this machine, which should do nothing else meanwhile.

Run as `python docs/app/measure.py`; it prints JSON. Times are in milliseconds; `processor` is what all of Chromium's
processes took of the processors, which does not depend on what else runs.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "app"))

from hand import ARGUMENTS, CHROMIUM, DESK, FIRST, HIGH, LOW, STAGE, AppServer, Hand
from playwright.sync_api import sync_playwright

# The stage beside the panel is 800 x 600 in a window of this size.
SIZE = {"width": 1072, "height": 652}
FRAMES = 20


def processor() -> float:
    """Seconds that the browsers of this machine have taken of the processors so far."""
    ticks = 0
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if b"chromium" in (process / "cmdline").read_bytes():
                numbers = (process / "stat").read_text().rsplit(")", 1)[1].split()
                ticks += int(numbers[11]) + int(numbers[12])
        except OSError:
            continue
    return ticks / os.sysconf("SC_CLK_TCK")


def quantiles(values: list[float]) -> dict[str, float]:
    """Median, 95th percentile and the largest."""
    ordered = sorted(values)
    at = {"median": 0.5, "95%": 0.95, "largest": 1.0}
    return {name: round(ordered[min(len(ordered) - 1, int(share * len(ordered)))], 1) for name, share in at.items()}


def shown(hand: Hand) -> dict[str, float]:
    """From the click on Reconstruct to the first prediction on the screen, and to the last round's."""
    page = hand.page
    page.evaluate(f"""() => {{
        const desk = {DESK}, view = {STAGE}.view, draw = view.draw;
        window.first = window.last = null;
        document.querySelector('[data-action=reconstruct]').addEventListener('click', () => {{
            window.clicked = performance.now();
        }}, {{ once: true, capture: true }});
        const loaded = view.setVolume;
        view.setVolume = function (bytes) {{
            loaded.call(this, bytes);
            view.settle = function () {{
                delete view.settle;
                view.settle();
                window.last = performance.now();
                window.first ??= window.last;
            }};
        }};
    }}""")
    hand.press("reconstruct")
    hand.settled()
    page.wait_for_function(f"window.last && !{STAGE}.view.fence && !{STAGE}.view.dirty")
    return dict(
        zip(
            ("first", "last"),
            page.evaluate("[window.first - window.clicked, window.last - window.clicked]"),
            strict=True,
        )
    )


def measure(hand: Hand) -> dict[str, Any]:
    """All of it."""
    page = hand.page
    report: dict[str, Any] = {"load": os.getloadavg()[0], "processors": os.cpu_count()}
    hand.box(FIRST, LOW, HIGH)
    report["pointer to ink"] = quantiles(page.evaluate(f"{STAGE}.pointers.latency"))
    report["one view"] = [shown(hand)]
    for _ in range(2):
        hand.line((20, 20), (24, 20))
        hand.press("undo")
        hand.saved()
        report["one view"].append(shown(hand))
    for viewpoint in ("left", "front", "quarter-232"):
        hand.view(viewpoint)
        hand.box(viewpoint, LOW, HIGH)
    report["four views"] = [shown(hand) for _ in range(3)]
    hand.press("navigate")
    page.wait_for_timeout(1000)
    report["stage"] = page.evaluate(f"[{STAGE}.view.canvas.clientWidth, {STAGE}.view.canvas.clientHeight]")

    before = processor()
    frames = page.evaluate(
        """async ([count]) => {
        const stage = document.querySelector('.workspace').stage, view = stage.view, times = [];
        view.tick = () => {};
        for (let i = 0; i < count; i++) {
            stage.turn(7, 0);
            const begun = performance.now();
            view.draw(view.frame(), 1, false);
            const { gl } = view;
            const over = () => gl.getSyncParameter(view.fence, gl.SYNC_STATUS) === gl.SIGNALED;
            while (!over()) await new Promise((resolve) => setTimeout(resolve, 1));
            view.gl.deleteSync(view.fence);
            view.fence = null;
            times.push(performance.now() - begun);
            await new Promise(requestAnimationFrame);
        }
        delete view.tick;
        return times;
    }""",
        [FRAMES],
    )
    report["full frame"] = quantiles(frames) | {"processor": round(1000 * (processor() - before) / FRAMES, 1)}

    box = page.locator(".stage").bounding_box()
    page.mouse.move(box["x"] + 300, box["y"] + 300)
    page.mouse.down()
    page.wait_for_timeout(300)
    for step in range(40):  # until the resolution has found its level
        page.mouse.move(box["x"] + 300 + step, box["y"] + 300)
    count, begun, before = page.evaluate(f"{STAGE}.view.last.frames"), time.monotonic(), processor()
    step = 0
    while time.monotonic() - begun < 4:
        step += 1
        page.mouse.move(box["x"] + 300 + 100 * ((step // 50) % 2) + step % 50, box["y"] + 300)
        page.wait_for_timeout(8)
    seconds, frames_drawn = time.monotonic() - begun, page.evaluate(f"{STAGE}.view.last.frames") - count
    report["turning"] = {
        "frames a second": round(frames_drawn / seconds, 1),
        "scale": page.evaluate(f"{STAGE}.view.last.scale"),
        "processor": round(1000 * (processor() - before) / max(frames_drawn, 1), 1),
    }
    page.mouse.up()
    return report


def main() -> None:
    """Prints the report."""
    with tempfile.TemporaryDirectory() as place, sync_playwright() as playwright:
        server = AppServer(Path(place) / "sessions").start()
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=ARGUMENTS)
        hand = Hand(browser.new_page(viewport=SIZE)).open(server.url)
        print(json.dumps(measure(hand), indent=2))
        browser.close()
        server.stop()


if __name__ == "__main__":
    main()
