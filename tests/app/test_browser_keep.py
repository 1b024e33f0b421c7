"""Nothing is lost: by a reload, by a server that is killed, by one that is away while lines are drawn."""

from __future__ import annotations

from pathlib import Path

import pytest
from hand import DESK, FIRST, HIGH, LOW, STAGE, AppServer, needs_browser

pytestmark = [needs_browser(), pytest.mark.slow]


def test_a_reload_finds_everything(boxed):
    before = boxed.state
    ink = boxed.drawn()
    boxed.page.reload()
    boxed.ready()
    boxed.settled()
    after = boxed.state
    for key in ("id", "name", "sheets", "parts", "solid", "scene"):
        assert after[key] == before[key]
    assert (boxed.drawn() == ink).mean() > 0.999
    assert boxed.silhouette().any()


def test_a_killed_server_has_lost_nothing(tmp_path: Path, new_hand):
    first = AppServer(tmp_path / "sessions").start()
    hand = new_hand().open(first.url)
    hand.box(FIRST, LOW, HIGH)
    hand.reconstruct()
    hand.press("freeze")
    hand.saved()
    hand.line((40, 60), (90, 80))
    hand.saved()
    before = hand.state
    first.kill()

    # Away: what is drawn now stays in the browser, even over a reload of the page once the server is back.
    hand.page.wait_for_function(f"!{DESK}.now.online")
    hand.line((40, 90), (90, 110))
    assert hand.page.evaluate(f"{DESK}.now.waiting") == 1
    assert "Server away" in hand.page.locator(".status").inner_text()
    assert hand.drawn()[88:112, 40:90].max() > 200

    second = AppServer(tmp_path / "sessions", first.port).start()
    try:
        hand.page.wait_for_function(f"{DESK}?.now.online && {DESK}.now.waiting === 0")
        hand.ready()
        after = hand.state
        assert after["id"] == before["id"]
        assert after["parts"] == before["parts"]
        assert after["scene"] == before["scene"]
        strokes = after["sheets"][0]["strokes"]
        assert strokes[:1] == before["sheets"][0]["strokes"]
        assert len(strokes) == 2
        hand.page.goto(f"{second.url}/s/{before['id']}")
        hand.ready()
        hand.page.wait_for_function(f"{DESK}.loaded === {DESK}.state.scene")
        assert hand.state["sheets"][0]["strokes"] == strokes
    finally:
        second.stop()


def test_an_answer_that_comes_late_hides_nothing_newer(boxed, server):
    # What the page asks for takes a second on its way back: what happens meanwhile it hears of by events alone.
    page, id = boxed.page, boxed.id
    page.evaluate("""() => {
        const { fetch } = window;
        window.fetch = async (...request) => {
            const response = await fetch(...request);
            const late = /[/]api[/]s[/][0-9a-f]+$/.test(request[0]) && (request[1]?.method ?? "GET") === "GET";
            if (late) await new Promise((resolve) => setTimeout(resolve, 1000));
            return response;
        };
    }""")
    names = ["One", "Two", "Three"]
    for name in names:  # another page's changes: the first makes this page ask, the others come while it waits
        server.post(f"/api/s/{id}/call", {"name": name})
        page.wait_for_timeout(300)
    page.wait_for_function(f"{DESK}.state.name === 'Three'", timeout=5000)
    server.post(f"/api/s/{id}/clear", {"viewpoint": FIRST})  # the solid goes with its last drawing
    page.wait_for_timeout(300)
    server.post(f"/api/s/{id}/undo", {})
    page.wait_for_function(f"{DESK}.state.sheets.length === 1 && {DESK}.loaded === {DESK}.state.scene", timeout=5000)
    page.wait_for_timeout(1500)  # nothing that comes later takes it back
    assert boxed.silhouette().any()


def test_where_one_was_survives_a_reload(boxed):
    boxed.press("navigate")
    boxed.page.evaluate(f"{STAGE}.turn(33, -7)")
    before = boxed.page.evaluate(f"{STAGE}.place")
    boxed.page.reload()
    boxed.ready()
    assert boxed.page.evaluate(f"{STAGE}.mode") == "navigate"
    after = boxed.page.evaluate(f"{STAGE}.place")
    assert after == pytest.approx(before)


def test_sessions_are_listed_saved_and_opened_again(boxed, tmp_path):
    page = boxed.page
    name = page.locator(".sessionname input")
    name.fill("A box for the cat")
    name.press("Enter")
    boxed.saved()
    id = boxed.id
    boxed.press("sessions")
    with page.expect_download() as waiting:
        page.locator("dialog [data-action=save]").click()
    assert waiting.value.suggested_filename == "A box for the cat.sketchcore"
    file = tmp_path / "box.sketchcore"
    waiting.value.save_as(file)
    page.locator("dialog [data-action=new]").click()
    page.wait_for_function(f"{DESK}.state.id !== '{id}'")
    assert boxed.state["sheets"] == []
    boxed.press("sessions")
    page.locator(f"dialog [data-session='{id}']").click()
    page.wait_for_function(f"{DESK}.state.id === '{id}'")
    assert boxed.state["name"] == "A box for the cat"
    boxed.press("sessions")
    page.locator("dialog input[type=file]").set_input_files(file)
    page.wait_for_function(f"{DESK}.state.id !== '{id}' && {DESK}.state.solid")
    assert boxed.state["name"] == "A box for the cat"
    assert len(boxed.state["sheets"][0]["strokes"]) == 9
