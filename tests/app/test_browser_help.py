"""What makes it easy: guides, keys, labels, hints, the example, light and dark, photos, touch."""

from __future__ import annotations

import io

import numpy as np
import pytest
from hand import DESK, FIRST, STAGE, needs_browser, project
from PIL import Image

from sketchcore.camera import VIEWPOINTS

pytestmark = [needs_browser(), pytest.mark.slow]


def guides(hand) -> np.ndarray:
    hand.page.wait_for_timeout(60)
    return hand._canvas("canvas.guides", False)


def test_vanishing_lines_follow_the_cursor(hand):
    hand.page.mouse.move(*hand.at(100, 120))
    hand.page.wait_for_function(f"{STAGE}.overlay.marked && !{STAGE}.pointers.aiming")
    seen = guides(hand)
    camera = VIEWPOINTS[FIRST]
    for axis in range(3):
        right, down, forward = camera.rotation[:, axis]
        scale = 128 / np.tan(np.radians(camera.fov_degrees) / 2) / forward
        toward = np.array([128 + right * scale, 128 + down * scale]) - (100, 120)
        x, y = (100, 120) + 40 * toward / np.hypot(*toward)
        assert seen[round(y) - 2 : round(y) + 2, round(x) - 2 : round(x) + 2].max() > 40
    hand.press("navigate")
    assert guides(hand).max() == 0


def test_shift_draws_a_straight_line_along_a_vanishing_line(hand):
    page = hand.page
    start, end = project(FIRST, (0.4, -0.3, 0.25)), project(FIRST, (-0.3, -0.3, 0.25))
    page.keyboard.down("Shift")
    hand.line(start, (end[0] + 3, end[1] + 2))
    page.keyboard.up("Shift")
    hand.saved()
    (stroke,) = hand.state["sheets"][0]["strokes"]
    points = np.array(stroke["points"])[:, :2]
    along = np.subtract(end, start) / np.hypot(*np.subtract(end, start))
    away = points - start
    assert len(points) > 20
    assert np.abs(along[0] * away[:, 1] - along[1] * away[:, 0]).max() < 0.5


def test_an_ellipse_is_the_image_of_a_circle_about_the_axis(hand):
    hand.press("ellipse")
    hand.press("axis-y")
    hand.line((128, 140), (190, 140))
    hand.saved()
    (stroke,) = hand.state["sheets"][0]["strokes"]
    points = np.array(stroke["points"])[:, :2]
    camera = VIEWPOINTS[FIRST]
    # Back into the world, onto the level plane through the centre: all points are as far from it.
    tan = np.tan(np.radians(camera.fov_degrees) / 2)
    rays = np.c_[(points / 128 - 1) * tan, np.ones(len(points))] @ camera.rotation
    middle = np.array([(128 / 128 - 1) * tan, (140 / 128 - 1) * tan, 1]) @ camera.rotation * 2
    level = (camera.position + middle)[1]
    places = camera.position + rays * ((level - camera.position[1]) / rays[:, 1])[:, None]
    radii = np.hypot(*(places - camera.position - middle)[:, [0, 2]].T)
    assert radii.mean() > 0.1
    assert radii == pytest.approx(np.full(len(radii), radii.mean()), rel=0.02)
    assert stroke["kind"] == "ink"


def test_a_small_drawing_gets_a_friendly_hint(hand):
    hand.line((120, 120), (140, 120), (140, 140), (120, 140), (120, 120))
    hand.saved()
    hint = hand.page.locator(".note.hint").first
    hint.wait_for()
    assert "small" in hint.inner_text()
    hint.locator("[aria-label=Dismiss]").click()
    assert hand.page.locator(".note.hint", has_text="small").count() == 0


def test_everything_has_a_name_and_keys_do_what_they_say(boxed):
    page = boxed.page
    unnamed = page.evaluate("""() => [...document.querySelectorAll('.workspace button, .workspace input')]
        .filter((element) => !(element.getAttribute('aria-label') || element.getAttribute('aria-hidden')
            || element.textContent.trim() || element.closest('label')?.textContent.trim()))
        .map((element) => element.outerHTML)""")
    assert unnamed == []
    page.keyboard.press("?")
    assert page.locator("dialog[aria-label='How it works']").is_visible()
    page.keyboard.press("Escape")
    page.wait_for_selector("dialog", state="detached")
    page.keyboard.press("x")
    assert page.evaluate(f"{STAGE}.tool") == "eraser"
    page.keyboard.press("n")
    assert page.evaluate(f"{STAGE}.mode") == "navigate"
    azimuth = page.evaluate(f"{STAGE}.place.azimuth")
    page.locator(".stage").focus()
    page.keyboard.press("ArrowRight")
    assert page.evaluate(f"{STAGE}.place.azimuth") == pytest.approx(azimuth + 5)
    page.keyboard.press("d")
    page.wait_for_function(f"{STAGE}.mode === 'draw'")
    first = page.evaluate("""() => [...document.querySelectorAll('.workspace button, .workspace input, .stage')]
        .filter((element) => element.tabIndex >= 0 && element.offsetParent)
        .map((element) => element.closest('.topbar') ? 'bar' : element.closest('.stage') ? 'stage' : 'panel')""")
    assert first == sorted(first, key=["bar", "stage", "panel"].index)  # the focus goes bar, stage, panel


def test_light_and_dark(hand):
    page = hand.page
    assert page.evaluate("document.documentElement.dataset.theme") == "light"
    light = page.evaluate("getComputedStyle(document.querySelector('.paper')).backgroundColor")
    hand.press("theme")
    page.wait_for_function("document.documentElement.dataset.theme === 'dark'")
    dark = page.evaluate("getComputedStyle(document.querySelector('.paper')).backgroundColor")
    brightness = [sum(map(float, colour[4:-1].split(","))) for colour in (light, dark)]
    assert brightness[0] > 600
    assert brightness[1] < 200
    page.reload()
    hand.ready()
    assert page.evaluate("document.documentElement.dataset.theme") == "dark"


def test_the_advised_view_is_a_click_away(boxed):
    advice = boxed.page.locator(".advice")
    advice.wait_for()
    assert "would help most" in advice.inner_text()
    named = boxed.page.evaluate(f"{DESK}.now.advice.viewpoint")
    boxed.press("advised")
    boxed.page.wait_for_function(f"{STAGE}.mode === 'draw' && {STAGE}.viewpoint === '{named}'")


def test_uncertainty_colours_the_surface_on_request(boxed):
    boxed.page.locator("[data-action=doubt]").click()
    boxed.page.wait_for_function(f"{STAGE}.view.unsure && {STAGE}.view.look.doubt")
    assert boxed.page.evaluate(f"{STAGE}.view.unsure.reduce((a, b) => Math.max(a, b))") > 100


def test_a_photo_becomes_a_drawing_that_can_be_edited(boxed, hand):
    lines = np.full((600, 800), 235, np.uint8)
    lines[:] = np.linspace(150, 245, 800).astype(np.uint8)  # uneven light
    ink = np.array(boxed.drawn()) > 127
    large = np.asarray(Image.fromarray(ink).resize((512, 512)))
    lines[44:556, 144:656][large] = 40
    png = io.BytesIO()
    Image.fromarray(lines).save(png, "PNG")
    hand.page.locator("input[type=file][accept='image/*']").set_input_files(
        {"name": "paper.png", "mimeType": "image/png", "buffer": png.getvalue()}
    )
    hand.page.locator("[data-action=take]").click()
    hand.page.wait_for_function(f"{DESK}.state.sheets.length === 1")
    strokes = hand.state["sheets"][0]["strokes"]
    assert len(strokes) >= 6
    assert all(stroke["kind"] == "ink" for stroke in strokes)


def test_a_pen_presses_and_two_fingers_turn(server, new_hand):
    hand = new_hand(has_touch=True).open(server.url)
    session = hand.page.context.new_cdp_session(hand.page)

    def pen(kind: str, x: float, y: float, force: float) -> None:
        place = dict(zip("xy", hand.at(x, y), strict=True))
        session.send(
            "Input.dispatchMouseEvent",
            {
                "type": kind,
                **place,
                "button": "left",
                "buttons": 1,
                "clickCount": 1,
                "force": force,
                "pointerType": "pen",
            },
        )

    pen("mousePressed", 60, 60, 0.2)
    for step in range(1, 9):
        pen("mouseMoved", 60 + 10 * step, 60 + 2 * step, 0.2 + 0.08 * step)
    pen("mouseReleased", 140, 76, 0.0)
    hand.saved()
    (stroke,) = hand.state["sheets"][0]["strokes"]
    pressures = [point[2] for point in stroke["points"]]
    assert pressures[-1] > pressures[0] + 0.3

    def touch(kind: str, *fingers: tuple[float, float]) -> None:
        points = [{**dict(zip("xy", hand.at(*finger), strict=True)), "id": i} for i, finger in enumerate(fingers)]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    before = hand.page.evaluate(f"{STAGE}.place.azimuth")
    touch("touchStart", (100, 100))
    touch("touchStart", (100, 100), (150, 100))
    for step in range(1, 6):
        touch("touchMove", (100 + 8 * step, 100), (150 + 8 * step, 100))
    touch("touchEnd")
    assert hand.page.evaluate(f"{STAGE}.mode") == "navigate"
    assert hand.page.evaluate(f"{STAGE}.place.azimuth") > before + 3
    assert len(hand.state["sheets"][0]["strokes"]) == 1
    assert hand.troubles == []


def test_the_example_plays_and_leaves_things_as_they_were(server, new_hand):
    hand = new_hand()
    hand.page.goto(server.url)
    hand.ready()
    own = hand.id
    hand.page.locator("[data-action=tour]").click()
    hand.page.wait_for_function(
        f"{DESK}.state.id !== '{own}' && {DESK}.state.sheets.some((sheet) => sheet.strokes.length > 2)"
    )
    assert "1. Draw an object" in hand.page.locator(".note.tour").inner_text()
    hand.press("skip")
    hand.page.wait_for_function(f"{DESK}.state.id === '{own}'")
    hand.ready()
    assert hand.state["sheets"] == []
    assert hand.page.locator("[data-note=welcome]").count() == 0
    assert hand.troubles == []
