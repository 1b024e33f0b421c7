"""The whole way in a real browser: draw, reconstruct, turn, draw over it, mend, keep, export."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest
import trimesh
from hand import DESK, FIRST, HIGH, LOW, STAGE, AppServer, Hand, needs_browser, overlap, project

from sketchcore.app.document import sheet_from_json
from sketchcore.app.ink import rasterize
from sketchcore.grids import silhouette

pytestmark = [needs_browser(), pytest.mark.slow]


def ink(state: dict) -> dict[str, list[dict]]:
    return {
        sheet["viewpoint"]: [stroke for stroke in sheet["strokes"] if stroke["kind"] == "ink"]
        for sheet in state["sheets"]
    }


def drawing(state: dict, viewpoint: str) -> np.ndarray:
    sheet = next(sheet for sheet in state["sheets"] if sheet["viewpoint"] == viewpoint)
    return rasterize(sheet_from_json({"viewpoint": viewpoint, "strokes": sheet["strokes"]}).strokes)


def solid(server: AppServer, hand: Hand) -> np.ndarray:
    data = server.read(f"/api/s/{hand.id}/volume/scene")
    return np.frombuffer(data, np.uint8).reshape(64, 64, 64)


def test_an_empty_space_opens_from_a_three_quarter_view(hand):
    assert hand.page.evaluate(f"[{STAGE}.mode, {STAGE}.viewpoint]") == ["draw", FIRST]
    assert hand.page.url.endswith(f"/s/{hand.id}")
    assert hand.page.locator("[data-view=left]").is_disabled()
    assert hand.page.locator("[data-view=quarter-232]").is_enabled()
    assert hand.page.locator("[data-action=reconstruct]").is_disabled()
    # The wireframe cube: its corners, seen through the packed camera, are where the lines meet.
    seen = hand._canvas("canvas.volume", True)
    for corner in ((0.5, 0.5, 0.5), (-0.5, 0.5, 0.5), (0.5, -0.5, -0.5)):
        x, y = project(FIRST, corner)
        if 4 < x < 252 and 4 < y < 252:
            assert seen[round(y) - 3 : round(y) + 3, round(x) - 3 : round(x) + 3].max() > 20


def test_a_box_drawn_stroke_by_stroke_comes_back_as_a_solid(boxed):
    state = boxed.state
    assert len(ink(state)[FIRST]) == 9
    lines = drawing(state, FIRST)
    # What is on the screen is what was sent.
    on_screen = boxed.drawn() > 127
    assert (on_screen & (lines == 0)).sum() < 0.1 * on_screen.sum()
    for a, b in (((0.4, 0.3, 0.25), (-0.4, 0.3, 0.25)), ((0.4, -0.3, 0.25), (0.4, 0.3, 0.25))):
        x, y = project(FIRST, (np.array(a) + b) / 2)
        assert on_screen[round(y) - 2 : round(y) + 2, round(x) - 2 : round(x) + 2].any()
    assert overlap(boxed.silhouette(), silhouette(lines) > 0) >= 0.8


def test_turn_snap_to_the_left_and_draw_again(server, boxed):
    before = solid(server, boxed)
    page = boxed.page
    boxed.press("navigate")
    stage = page.locator(".stage").bounding_box()
    x, y = stage["x"] + stage["width"] * 0.75, stage["y"] + stage["height"] * 0.6
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x - 315, y - 85, steps=12)  # 0.4 degrees a pixel: 126 to the left and 34 down
    page.mouse.up()
    turned = page.evaluate(f"{STAGE}.place")
    assert turned["azimuth"] % 360 == pytest.approx(37.5 - 126 + 360, abs=1)
    boxed.press("draw")
    assert page.evaluate(f"{STAGE}.mode") == "flying"  # the way there is shown
    page.wait_for_function(f"{STAGE}.mode === 'draw'")
    assert page.evaluate(f"{STAGE}.viewpoint") == "left"
    # A box that is only half as high: the second drawing must count.
    boxed.box("left", (LOW[0], -0.3, LOW[2]), (HIGH[0], 0.0, HIGH[2]))
    boxed.reconstruct()
    after = solid(server, boxed)
    assert overlap(before > 127, after > 127) < 0.97
    assert sorted(ink(boxed.state)) == ["left", FIRST]
    boxed.view(FIRST)  # and a drawing can be edited later
    assert boxed.drawn().max() > 200


def test_undo_redo_and_erase(boxed):
    page = boxed.page
    before = ink(boxed.state)[FIRST]
    boxed.line((20, 20), (60, 20))
    boxed.saved()
    assert len(ink(boxed.state)[FIRST]) == len(before) + 1
    assert boxed.drawn()[18:23, 30:50].max() > 200
    boxed.press("undo")
    boxed.saved()
    assert ink(boxed.state)[FIRST] == before
    assert boxed.drawn()[18:23, 30:50].max() == 0
    page.keyboard.press("Control+y")
    boxed.saved()
    assert len(ink(boxed.state)[FIRST]) == len(before) + 1
    boxed.press("eraser")
    boxed.line((40, 5), (40, 40))
    assert boxed.drawn()[15:26, 38:42].max() == 0  # at once, before the server has heard of it
    boxed.saved()
    pieces = [stroke for stroke in ink(boxed.state)[FIRST] if stroke["points"][0][1] < 30]
    assert len(pieces) == 2
    assert boxed.drawn()[18:23, 24:30].max() > 200


def test_construction_lines_are_never_sent_to_the_networks(server, boxed):
    lines = drawing(boxed.state, FIRST)
    boxed.press("construction")
    boxed.line((30, 30), (220, 230))
    boxed.saved()
    state = boxed.state
    kinds = [stroke["kind"] for sheet in state["sheets"] for stroke in sheet["strokes"]]
    assert kinds.count("construction") == 1
    assert not state["stale"]  # nothing to reconstruct
    assert (drawing(state, FIRST) == lines).all()
    red = boxed.page.evaluate("""() => {
        const canvas = document.querySelector('canvas.ink'), k = canvas.width / 256;
        const [x, y] = [60, 61.5].map((at) => Math.round(at * k) - 6);
        return Array.from(canvas.getContext('2d').getImageData(x, y, 12, 12).data);
    }""")
    pixels = np.array(red).reshape(-1, 4)
    reddest = pixels[pixels[:, 3].argmax()]
    assert reddest[3] > 150
    assert reddest[0] > 2 * reddest[2]


def test_freeze_and_union(server, boxed):
    box = solid(server, boxed)
    boxed.press("freeze")
    boxed.saved()
    state = boxed.state
    assert [part["name"] for part in state["parts"]] == ["Part 1"]
    assert state["sheets"] == []
    assert (solid(server, boxed) == box).all()
    assert boxed.page.locator("[data-view=left]").is_disabled()  # a new part begins with a three-quarter drawing
    boxed.box(FIRST, (-0.12, -0.42, -0.12), (0.12, 0.42, 0.12))
    boxed.reconstruct()
    union = solid(server, boxed)
    assert (union >= box).all()
    assert (union > 127).sum() > (box > 127).sum()
    boxed.page.locator("[aria-label='Hide Part 1']").click()
    boxed.settled()
    pillar = solid(server, boxed)
    assert (pillar > 127).sum() < (union > 127).sum()
    boxed.page.locator("[aria-label='Delete Part 1']").click()
    boxed.saved()
    assert boxed.state["parts"] == []


def test_the_exported_mesh_is_watertight(boxed):
    with boxed.page.expect_download() as waiting:
        boxed.page.locator("[data-export=glb]").click()
    assert waiting.value.suggested_filename.endswith(".glb")
    with open(waiting.value.path(), "rb") as file:
        mesh = trimesh.load(io.BytesIO(file.read()), file_type="glb", force="mesh")
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(0.8 * 0.6 * 0.5, rel=0.35)


def test_a_drawing_can_be_deleted_and_the_shape_goes_with_it(boxed):
    boxed.page.locator(f"[data-sheet={FIRST}] .remove").click()
    boxed.saved()
    boxed.page.wait_for_function(f"{DESK}.loaded === 'none'")
    assert boxed.state["solid"] is None
    assert not boxed.silhouette().any()
    boxed.press("undo")
    boxed.settled()
    assert boxed.silhouette().any()


def test_the_shape_follows_an_edited_drawing(boxed):
    before = boxed.state["solid"]
    boxed.press("eraser")
    boxed.line(*[project(FIRST, point) for point in ((0.4, 0.3, 0.25), (-0.4, 0.3, 0.25))], steps=12)
    boxed.saved()
    boxed.page.wait_for_function(f"{DESK}.state.solid !== '{before}'")  # without a click
    boxed.settled()


def test_the_page_projects_as_the_library_does(hand):
    points = [[0.3, -0.2, 0.4], [-0.5, 0.5, 0.1], [0, 0, 0]]
    code = f"""async (points) => {{
        const {{ project, imageDirection }} = await import('sketchcore-app/camera.js');
        const {{ vanishingLines }} = await import('sketchcore-app/guides.js');
        const cameras = {STAGE}.cameras;
        return Object.fromEntries(Object.entries(cameras).map(([name, camera]) => [name, {{
            points: points.map((point) => project(camera, point)),
            lines: vanishingLines(camera, [90, 140]),
        }}]));
    }}"""
    seen = hand.page.evaluate(code, points)
    assert len(seen) == 13
    for name, found in seen.items():
        for point, (x, y, depth) in zip(points, found["points"], strict=True):
            assert (x, y) == pytest.approx(project(name, point), abs=1e-9)
            assert depth > 0
        # A vanishing line goes through the cursor, and through the image of a point far along its axis.
        for axis, (a, b) in found["lines"].items():
            direction = np.array(b) - a
            for place in ((90, 140), far(name, "xyz".index(axis))):
                away = np.array(place) - a
                assert abs(direction[0] * away[1] - direction[1] * away[0]) / np.hypot(*direction) < 0.05
    assert json.dumps(seen["top"]["lines"]).count("[") > 3


def far(name: str, axis: int) -> tuple[float, float]:
    """Where lines along an axis meet; the cursor itself where they are parallel in the image."""
    from sketchcore.camera import VIEWPOINTS

    camera = VIEWPOINTS[name]
    right, down, forward = camera.rotation[:, axis]
    if abs(forward) < 1e-6:
        return 90, 140
    scale = 128 / np.tan(np.radians(camera.fov_degrees) / 2) / forward
    return 128 + right * scale, 128 + down * scale
