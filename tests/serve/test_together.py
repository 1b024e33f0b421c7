"""Passes of several threads made side by side: the same solids, and nobody's trouble but one's own."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import sketchcore as sk
from sketchcore.nets.cells import Cells
from sketchcore.nets.compactmodel import CompactModel
from sketchcore.nets.passes import Passes, Reading
from sketchcore.nets.sketches import Sketches
from sketchcore.nets.together import Together, Watched
from sketchcore.rounds import until_settled


class Recorded:
    """Passes that are counted; the first waits until so many others have been asked for."""

    def __init__(self, passes: Any, hold: threading.Event) -> None:
        self.passes, self.hold = passes, hold
        self.sizes: list[int] = []
        self.at_once = 0

    def read(self, samples: Sequence[Sketches]) -> list[Reading]:
        return self.passes.read(samples)

    def decide(self, readings: Sequence[Reading], prior: Cells | None, counts: Sequence[int]) -> Cells:
        self.at_once += 1
        assert self.at_once == 1, "one pass at a time"
        self.hold.wait(60)
        self.sizes.append(len(counts))
        answer = self.passes.decide(readings, prior, counts)
        self.at_once -= 1
        return answer


class Doubling:
    """Instead of a network: twice the reading; a negative one is refused, and takes the pass with it."""

    def read(self, samples: Sequence[Sketches]) -> list[Reading]:
        raise NotImplementedError

    def decide(self, readings: Sequence[Reading], prior: Cells | None, counts: Sequence[int]) -> Cells:
        if min(readings) < 0:
            raise ValueError("negative")
        return 2 * np.array(readings, np.float32) + (0 if prior is None else prior)


def all_asked(together: Together, count: int, hold: threading.Event) -> None:
    """Lets the first pass go on once the others wait."""
    begun = time.monotonic()
    while len(together._asked) < count and time.monotonic() - begun < 60:
        time.sleep(0.005)
    hold.set()


def test_solids_made_side_by_side_are_those_made_alone() -> None:
    model = sk.load_model()
    assert isinstance(model, CompactModel)
    batch = sk.generate(3, 3, views=3)
    objects = [Sketches(batch.drawings[i, : 1 + i % 3], batch.packed_cameras[i, : 1 + i % 3]) for i in range(3)]
    alone = [list(until_settled(model.rounds(one, 5))) for one in objects]
    hold = threading.Event()
    recorded = Recorded(model.passes, hold)
    together = Together(recorded, 3)
    shared = model.by(together)
    fresh = [Sketches(one.drawings, one.cameras) for one in objects]
    with ThreadPoolExecutor(3) as pool:
        made = [pool.submit(lambda one: list(until_settled(shared.rounds(one, 5))), one) for one in fresh]
        all_asked(together, 2, hold)
        volumes = [one.result() for one in made]
    assert recorded.sizes[:2] == [1, 2], "what was asked for during the first pass is one pass"
    assert sum(recorded.sizes) == sum(len(each) for each in alone), "each stops when its own solid has settled"
    for mine, expected in zip(volumes, alone, strict=True):
        assert len(mine) == len(expected)
        np.testing.assert_array_equal(mine[-1], expected[-1])


def together_with(hold: threading.Event, most: int = 8) -> tuple[Together, Recorded]:
    recorded = Recorded(Doubling(), hold)
    return Together(recorded, most), recorded


def test_one_that_fails_is_no_harm_to_the_others() -> None:
    hold = threading.Event()
    together, recorded = together_with(hold)

    def slow(readings: Sequence[Reading], prior: Cells | None, counts: Sequence[int]) -> Cells:
        hold.wait(60)
        return Doubling().decide(readings, prior, counts)

    recorded.decide = slow  # type: ignore[method-assign]
    with ThreadPoolExecutor(4) as pool:
        asked = [pool.submit(together.decide, [float(v)], None, [1]) for v in (1, 2, -3, 4)]
        all_asked(together, 3, hold)
        for value, one in zip((1, 2, -3, 4), asked, strict=True):
            if value < 0:
                with pytest.raises(ValueError, match="negative"):
                    one.result()
            else:
                assert one.result().tolist() == [2.0 * value]


def test_passes_are_no_larger_than_asked_and_priors_go_with_priors() -> None:
    hold = threading.Event()
    together, recorded = together_with(hold, most=2)
    prior = np.ones(1, np.float32)
    with ThreadPoolExecutor(6) as pool:
        asked = [pool.submit(together.decide, [1.0], None, [1])]
        time.sleep(0.05)
        for known in (None, None, None, prior, prior):
            asked.append(pool.submit(together.decide, [1.0], known, [1]))
            time.sleep(0.02)
        hold.set()
        answers = [each.result().item() for each in asked]
    assert answers == [2, 2, 2, 2, 3, 3]
    assert recorded.sizes == [1, 2, 1, 2]


def test_a_call_with_more_objects_than_that_is_a_pass_by_itself() -> None:
    hold = threading.Event()
    hold.set()
    together, recorded = together_with(hold, most=2)
    assert together.decide([1.0] * 5, None, [1] * 5).shape == (5,)
    assert recorded.sizes == [5]
    with pytest.raises(ValueError, match="at least 1 object"):
        Together(Doubling(), 0)


def test_nothing_is_computed_that_nobody_wants() -> None:
    passes: Passes = sk.load_model().passes  # type: ignore[union-attr]
    calls = []

    class GoneError(Exception):
        pass

    def check() -> None:
        calls.append(1)
        if len(calls) > 3:
            raise GoneError

    model = sk.load_model()
    assert isinstance(model, CompactModel)
    drawing = sk.draw(sk.Shape([sk.Cuboid((0, 0, 0), (0.3, 0.2, 0.2))]), sk.VIEWPOINTS["quarter-037"])
    with pytest.raises(GoneError):
        sk.reconstruct(drawing, "quarter-037", align=True, model=model.by(Watched(passes, check)))
    assert len(calls) == 4
