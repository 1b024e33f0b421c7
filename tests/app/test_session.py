"""Sessions: every step and its undo, and the solid that belongs to the drawings."""

from __future__ import annotations

import json
import random
import threading

import numpy as np
import pytest

from sketchcore.app.document import Placement
from sketchcore.app.ink import Stroke
from sketchcore.app.order import Progress
from sketchcore.app.session import Session
from sketchcore.evaluate.testset import load_testset


def line(y: float = 100, kind: str = "ink") -> Stroke:
    return Stroke.of([(60, y), (200, y)], kind)  # type: ignore[arg-type]


def cube(low: int, high: int) -> np.ndarray:
    volume = np.zeros((64, 64, 64), np.float32)
    volume[low:high, low:high, low:high] = 1
    return volume


def reconstructed(volume: np.ndarray | None = None) -> Session:
    session = Session()
    session.add_strokes("quarter-037", [line()])
    assert session.accept(cube(20, 40) if volume is None else volume, session.order())
    return session


def test_a_stroke_is_a_step() -> None:
    session = Session()
    states = [session.document]
    for y in (50, 60, 70):
        session.add_strokes("quarter-037", [line(y)])
        states.append(session.document)
    session.add_strokes("top", [line(80), line(90)])
    assert len(session.document.sheet("top").strokes) == 2
    assert session.revision == 5
    for expected in [*reversed(states)]:
        if expected is states[-1]:
            assert session.undo()
        assert session.undo()
        assert session.document == expected
    assert not session.undo()
    assert not session.can_undo
    for _ in range(5):
        assert session.redo()
    assert not session.redo()
    assert len(session.document.sheet("top").strokes) == 2
    session.undo()
    session.add_strokes("top", [line(5)])
    assert not session.can_redo


def test_undo_has_no_limit() -> None:
    session = Session()
    for i in range(1000):
        session.add_strokes("quarter-037", [line(i / 4)])
    for _ in range(1000):
        assert session.undo()
    assert session.document.sheets == ()


def test_a_stroke_that_was_sent_twice_is_there_once() -> None:
    session, stroke = Session(), line()
    session.add_strokes("quarter-037", [stroke])
    session.add_strokes("quarter-037", [stroke])
    assert session.document.sheets[0].strokes == (stroke,)
    assert session.revision == 1


def test_the_first_drawing_is_from_a_three_quarter_viewpoint() -> None:
    session = Session()
    with pytest.raises(ValueError, match="three-quarter viewpoint"):
        session.add_strokes("front", [line()])
    with pytest.raises(ValueError, match="unknown viewpoint"):
        session.add_strokes("below", [line()])
    session.add_strokes("front", [line(kind="construction")])
    session.add_strokes("quarter-217", [line()])
    session.add_strokes("front", [line()])
    assert session.drawings()[1] == ["quarter-217", "front"]
    session.delete_sheet("quarter-217")
    with pytest.raises(ValueError, match="three-quarter drawing is gone"):
        session.order()
    session.undo()
    assert session.order().viewpoints == ("quarter-217", "front")


def test_a_step_that_fails_changes_nothing() -> None:
    session = Session()
    session.add_strokes("quarter-037", [line()])
    before = session.state()
    with pytest.raises(ValueError, match="finite"):
        session.erase("quarter-037", [(float("nan"), 0)], 5)
    with pytest.raises(ValueError, match="no part"):
        session.delete_part("nobody")
    with pytest.raises(ValueError, match="unknown viewpoint"):
        session.clear("nowhere")
    other = Session()
    with pytest.raises(ValueError, match="three-quarter"):
        other.add_strokes("top", [line(kind="construction"), line()])
    assert not other.document.sheets
    assert session.state() == before


def test_construction_lines_reach_no_network() -> None:
    session = Session()
    session.add_strokes("quarter-037", [line(50), line(150, "construction")])
    drawings, _ = session.drawings()
    assert drawings[0][50].any()
    assert not drawings[0][140:160].any()
    session.add_strokes("top", [line(150, "construction")])
    assert len(session.drawings()[0]) == 1


def test_a_sweep_of_the_eraser_is_a_step_and_one_beside_the_ink_is_none() -> None:
    session = Session()
    session.add_strokes("quarter-037", [line(50), line(60)])
    session.erase("quarter-037", [(120, 0), (120, 100)], 5)
    assert len(session.document.sheets[0].strokes) == 4
    revision = session.revision
    session.erase("quarter-037", [(0, 250)], 5)
    session.clear("top")
    assert session.revision == revision
    session.undo()
    assert len(session.document.sheets[0].strokes) == 2


def test_of_two_states_the_later_says_so() -> None:
    session = Session()
    moments = [session.moment]
    session.add_strokes("quarter-037", [line(50)])
    moments.append(session.moment)
    session.report(Progress(0, 5, working=True))
    moments.append(session.moment)
    assert session.accept(np.zeros((64, 64, 64), np.uint8), session.order())
    moments.append(session.moment)
    session.undo()
    moments.append(session.moment)
    assert moments == sorted(set(moments))
    assert Session(session.id).life != session.life


def test_clear_leaves_construction_lines_and_delete_leaves_nothing() -> None:
    session = Session()
    session.add_strokes("quarter-037", [line(50), line(60, "construction")])
    session.clear("quarter-037")
    assert [s.kind for s in session.document.sheets[0].strokes] == ["construction"]
    session.delete_sheet("quarter-037")
    assert session.document.sheets == ()
    session.undo()
    session.undo()
    assert len(session.document.sheets[0].strokes) == 2


def test_the_solid_belongs_to_the_drawings() -> None:
    session = Session()
    assert session.solid is None
    assert not session.stale
    session.add_strokes("quarter-037", [line(50)])
    assert session.stale
    assert session.accept(cube(20, 40), session.order())
    first = session.state()["solid"]
    assert not session.stale
    session.add_strokes("quarter-037", [line(60, "construction")])
    assert not session.stale
    session.add_strokes("quarter-037", [line(70)])
    assert session.stale
    assert session.state()["solid"] == first
    session.accept(cube(10, 50), session.order())
    second = session.state()["solid"]
    assert second != first
    session.undo()
    assert session.state()["solid"] == first
    assert not session.stale
    session.redo()
    assert session.state()["solid"] == second
    session.clear("quarter-037")
    assert session.solid is None
    assert not session.stale
    session.undo()
    assert session.state()["solid"] == second


def test_a_result_for_older_drawings_is_shown_and_stale() -> None:
    session = Session()
    session.add_strokes("quarter-037", [line(50)])
    older = session.order()
    session.add_strokes("quarter-037", [line(60)])
    assert session.accept(cube(20, 40), older)
    assert session.solid is not None
    assert session.stale
    session.accept(cube(10, 50), session.order())
    newer = session.state()["solid"]
    assert session.accept(cube(20, 40), older)  # too late
    assert session.state()["solid"] == newer
    session.undo()
    assert not session.stale


def test_a_result_for_a_part_that_was_frozen_is_of_no_use() -> None:
    session = reconstructed()
    order = session.order()
    session.freeze()
    assert not session.accept(cube(0, 10), order)
    assert session.solid is None
    session.add_strokes("quarter-037", [line()])
    assert not session.accept(cube(0, 10), order)


def test_what_is_no_volume_is_refused() -> None:
    session = reconstructed()
    order = session.order()
    for volume, message in (
        (np.zeros((64, 64)), "shape"),
        (np.full((64, 64, 64), np.nan), "NaN"),
        (np.full((64, 64, 64), 1.5), r"\[0, 1\]"),
    ):
        with pytest.raises(ValueError, match=message):
            session.accept(volume, order)
    with pytest.raises(TypeError, match="uint8 or float"):
        session.accept(np.zeros((64, 64, 64), np.int64), order)


def test_one_half_stays_the_surface() -> None:
    volume = np.full((64, 64, 64), 0.499, np.float32)
    volume[:32] = 0.501
    solid = reconstructed(volume).solid
    assert solid is not None
    assert ((solid / 255 > 0.5) == (volume > 0.5)).all()


def test_freeze_begins_a_new_part_and_the_scene_is_the_union() -> None:
    session = reconstructed(cube(10, 20))
    part = session.freeze("Seat")
    assert session.document.sheets == ()
    assert session.document.parts == (part,)
    assert [s.viewpoint for s in part.sheets] == ["quarter-037"]
    assert session.document.reference("quarter-037")[0].kind == "construction"
    assert session.document.reference("top") == ()
    with pytest.raises(ValueError, match="three-quarter"):
        session.add_strokes("front", [line()])
    session.add_strokes("quarter-037", [line()])
    with pytest.raises(ValueError, match="no solid to freeze"):
        session.freeze()
    session.accept(cube(40, 50), session.order())
    assert ((session.scene() > 127) == ((cube(10, 20) + cube(40, 50)) > 0)).all()
    session.show(part.id, False)
    assert ((session.scene() > 127) == (cube(40, 50) > 0)).all()
    assert session.document.reference("quarter-037") == ()
    session.undo()
    session.place(part.id, Placement((0.25, 0, 0)))
    assert session.scene()[30, 15, 15] > 127
    assert session.document.reference("quarter-037") == ()
    session.rename(part.id, " Back ")
    assert session.document.parts[0].name == "Back"
    assert session.freeze().name == "Part 2"
    session.delete_part(part.id)
    assert ((session.scene() > 127) == (cube(40, 50) > 0)).all()
    for _ in range(5):
        session.undo()
    assert ((session.scene() > 127) == (cube(10, 20) > 0)).all()


def test_undoing_a_freeze_gives_the_part_and_its_solid_back() -> None:
    session = reconstructed()
    before = session.state()
    session.freeze()
    session.add_strokes("quarter-307", [line()])
    session.accept(cube(1, 5), session.order())
    session.undo()
    session.undo()
    after = session.state()
    for name in ("sheets", "parts", "solid", "scene", "stale", "part"):
        assert after[name] == before[name]
    session.redo()
    assert session.solid is None
    session.redo()
    assert session.solid is not None
    assert session.solid[2, 2, 2] == 255


def test_what_was_drawn_since_is_not_frozen_away() -> None:
    session = reconstructed()
    session.add_strokes("quarter-037", [line(180)])
    with pytest.raises(ValueError, match="changed since the last reconstruction"):
        session.freeze()


def test_volumes_stay_as_long_as_undo_needs_them_and_no_longer() -> None:
    session = reconstructed()
    key = session.state()["solid"]
    part = session.freeze()
    session.delete_part(part.id)
    session.add_strokes("quarter-037", [line()])
    for i in range(60):
        session.add_strokes("quarter-037", [line(i)])
        session.accept(cube(i % 50, 60), session.order())
        session.accept(np.full((64, 64, 64), (i + 1) / 255, np.float32), session.order())
    assert key in session.volumes
    assert len(session.volumes) < 40
    while session.undo():
        pass
    session.redo()
    session.redo()
    assert session.document.parts
    assert (session.scene() > 127).any()


def test_an_imported_drawing_can_be_edited() -> None:
    example = next(load_testset(1))
    session = Session()
    session.add_strokes("quarter-037", [line(5), line(250, "construction")])
    session.import_drawing("quarter-037", example.drawings[0])
    sheet = session.document.sheets[0]
    assert [s.kind for s in sheet.strokes].count("construction") == 1
    assert len(sheet.strokes) > 10
    drawn, found = example.drawings[0] > 0, sheet.drawing > 0
    wide = np.pad(found, 1)
    near = np.any([wide[y : y + 256, x : x + 256] for y in range(3) for x in range(3)], axis=0)
    assert near[drawn].mean() > 0.97
    assert not found[:8].any()
    session.undo()
    assert len(session.document.sheets[0].strokes) == 2
    with pytest.raises(ValueError, match="no lines"):
        session.import_drawing("quarter-037", np.zeros((256, 256), np.uint8))
    with pytest.raises(ValueError, match="three-quarter"):
        Session().import_drawing("top", example.drawings[0])


def test_the_state_is_plain_data() -> None:
    session = reconstructed()
    session.freeze("Wheel")
    session.call("A cart")
    session.report(Progress(2, 5, working=True), "Something went wrong.")
    state = json.loads(json.dumps(session.state()))
    assert state["name"] == "A cart"
    assert state["parts"][0]["name"] == "Wheel"
    assert state["parts"][0]["viewpoints"] == ["quarter-037"]
    assert state["progress"] == {"round": 2, "rounds": 5, "working": True, "waiting": False}
    assert state["trouble"] == "Something went wrong."
    assert state["first"]
    assert state["can_undo"]
    assert not state["can_redo"]


def test_the_scene_is_known_by_what_is_in_it() -> None:
    session = reconstructed()
    part = session.freeze()
    keys = {session.state()["scene"]}
    for placement in (Placement((0.1, 0, 0)), Placement(scale=0.5), Placement(turn=1)):
        session.place(part.id, placement)
        keys.add(session.state()["scene"])
    assert len(keys) == 4
    while session.undo():
        keys.add(session.state()["scene"])
    assert len(keys) == 5  # the empty one; the solid alone is the same scene as the part
    assert not session.scene().any()


def test_threads_change_a_session_at_once() -> None:
    session = reconstructed()
    troubles: list[Exception] = []

    def draw(seed: int) -> None:
        mine = random.Random(seed)
        try:
            for _ in range(60):
                session.add_strokes("quarter-037", [line(mine.uniform(0, 256))])
                if mine.random() < 0.3:
                    session.undo()
                session.state()
        except Exception as error:
            troubles.append(error)

    def work() -> None:
        try:
            for i in range(40):
                session.accept(cube(i, i + 9), session.order())
                session.scene()
        except Exception as error:
            troubles.append(error)

    threads = [threading.Thread(target=draw, args=(i,)) for i in range(4)] + [threading.Thread(target=work)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not troubles
    while session.undo():
        pass
    assert session.document.sheets == ()
