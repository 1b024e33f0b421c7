"""Drawings out of place: where a stand-in for a network, which knows the solid at any place, says they belong."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import affine_transform

import sketchcore as sk
from sketchcore.nets.placement import Placement, bounds, plausibility, seen_at
from sketchcore.nets.search import in_place
from sketchcore.nets.sketches import Sketches
from sketchcore.outline import outline_iou
from sketchcore.rounds import Volume

SHAPE = sk.Shape([sk.Cuboid((0, -0.2, 0), (1 / 2.4, 0.1, 0.25)), sk.Cuboid((-0.2, 0.1, 0), (0.1, 0.2, 0.15))])
"""Centred, with a largest side of 1/1.2."""
CAMERA = sk.VIEWPOINTS["quarter-037"]
ORIGIN = seen_at(CAMERA, np.zeros(3))


def soft(center: NDArray[np.float64], scale: float) -> Volume:
    """The shape's voxels, moved and scaled about the world's origin, with soft edges."""
    voxels = sk.voxelize(SHAPE).astype(np.float32)
    offset = 31.5 - (31.5 + 64 * center) / scale
    moved = affine_transform(voxels, np.full(3, 1 / scale), offset=offset, order=1)
    return (0.9998 * moved).astype(np.float32)


class Drawn:
    """Predicts what a drawing shows, where it shows it: the ink's middle tells the place, the ink's size the scale."""

    def __init__(self, camera: sk.Camera) -> None:
        self.camera = camera
        self.middle, self.size = self._ink(sk.draw(SHAPE, camera))

    @staticmethod
    def _ink(drawing: NDArray[np.uint8]) -> tuple[NDArray[np.float64], float]:
        rows, columns = np.nonzero(drawing >= 64)
        low, high = np.array([columns.min(), rows.min()]), np.array([columns.max(), rows.max()]) + 1
        return 0.5 * (low + high), float(np.hypot(*(high - low)))

    def __call__(self, samples: Sequence[Sketches]) -> Iterator[Volume]:
        for sketches in samples:
            middle, size = self._ink(sketches.drawings[0])
            scale = size / self.size
            origin = seen_at(self.camera, np.zeros(3))
            across = (middle - origin - scale * (self.middle - origin)) * _units_a_pixel(self.camera)
            center = across[0] * self.camera.rotation[0] + across[1] * self.camera.rotation[1]
            yield soft(center, scale)


def _units_a_pixel(camera: sk.Camera) -> float:
    distance = float(np.linalg.norm(camera.position))
    return distance * math.tan(math.radians(camera.fov_degrees / 2)) / 128


def alone(drawing: NDArray[np.uint8], camera: sk.Camera = CAMERA) -> Sketches:
    return Sketches(drawing[None], camera.packed[None])


def test_where_a_camera_sees_a_point_is_where_its_frustum_has_it() -> None:
    camera = sk.Camera.orbit(20, 40, distance=3, fov_degrees=30)
    for point in np.random.default_rng(0).uniform(-0.4, 0.4, (20, 3)):
        # A small ball about the point, drawn.
        shape = sk.Shape([sk.Cuboid(tuple(point), (0.02, 0.02, 0.02))])
        rows, columns = np.nonzero(sk.draw(shape, camera))
        middle = 0.5 * np.array([columns.min() + columns.max() + 1, rows.min() + rows.max() + 1])
        np.testing.assert_allclose(seen_at(camera, point), middle, atol=1.5)


def test_the_box_of_a_soft_solid_is_that_of_its_surface() -> None:
    for scale, center in ((1.0, (0, 0, 0)), (0.7, (0.05, -0.03, 0)), (0.93, (0.011, 0.02, 0))):
        found = bounds(soft(np.array(center, float), scale))
        assert found is not None
        np.testing.assert_allclose(found[0], np.array(center) + scale * np.array([0, 0, 0]), atol=0.006)
        assert found[1] == pytest.approx(scale / 1.2, abs=0.012)
    assert bounds(np.zeros((64, 64, 64), np.float32)) is None
    assert bounds(np.ones((64, 64, 64), np.float32)) == (pytest.approx(np.zeros(3)), pytest.approx(1.0, abs=0.02))


def test_a_drawing_is_moved_and_scaled_about_the_origin() -> None:
    drawing = sk.draw(SHAPE, CAMERA)
    assert Placement().move(drawing, CAMERA) is drawing
    rows, columns = np.nonzero(drawing)
    for place in (Placement(0.8, (12.0, -7.0)), Placement(1.2, (-5.0, 3.0))):
        moved = place.move(drawing, CAMERA)
        assert moved.dtype == np.uint8
        there_rows, there_columns = np.nonzero(moved >= 64)
        for here, there, axis in ((columns, there_columns, 0), (rows, there_rows, 1)):
            for end in (np.min, np.max):
                expected = ORIGIN[axis] + place.scale * (end(here) + 0.5 - ORIGIN[axis]) + place.shift[axis]
                assert end(there) + 0.5 == pytest.approx(expected, abs=1.5)
        assert moved.max() > 200, "lines do not fade"
    assert not Placement(1.0, (300.0, 0.0)).move(drawing, CAMERA).any()


@pytest.mark.parametrize(
    ("scale", "shift"), [(0.7, (0.0, 0.0)), (1.0, (14.0, 0.0)), (1.0, (-6.0, 20.0)), (0.85, (10.0, -10.0))]
)
def test_a_drawing_out_of_place_is_brought_back(scale: float, shift: tuple[float, float]) -> None:
    predict = Drawn(CAMERA)
    exact = sk.draw(SHAPE, CAMERA)
    sketches = alone(Placement(scale, shift).move(exact, CAMERA))
    [first] = predict([sketches])
    moved = in_place(predict, sketches, first, always=True)
    middle, size = Drawn._ink(moved.drawings[0])
    np.testing.assert_allclose(middle, predict.middle, atol=2.0)
    assert size == pytest.approx(predict.size, rel=0.03)
    np.testing.assert_array_equal(in_place(predict, sketches, first, always=True).drawings, moved.drawings)


@pytest.mark.parametrize(
    ("scale", "shift"), [(0.55, (0.0, 0.0)), (1.0, (0.0, 25.0)), (0.7, (-20.0, 10.0)), (0.85, (0.0, 0.0))]
)
def test_a_drawing_plainly_out_of_place_is_brought_back_unasked(scale: float, shift: tuple[float, float]) -> None:
    predict = Drawn(CAMERA)
    sketches = alone(Placement(scale, shift).move(sk.draw(SHAPE, CAMERA), CAMERA))
    [first] = predict([sketches])
    assert Drawn._ink(in_place(predict, sketches, first).drawings[0])[1] == pytest.approx(predict.size, rel=0.03)


def test_an_exact_drawing_of_a_shape_off_centre_stays_where_it_is() -> None:
    # What a network is as sure of there as anywhere gains nothing by being moved but a place in the middle.
    shape = sk.Shape([sk.Cuboid((0, -0.06, 0), (0.3, 0.2, 0.25))])

    def predict(samples: Sequence[Sketches]) -> Iterator[Volume]:
        for _ in samples:
            yield (0.9998 * sk.voxelize(shape)).astype(np.float32)

    sketches = alone(sk.draw(shape, CAMERA))
    [first] = predict([sketches])
    box = bounds(first)
    assert box is not None
    assert box[1] < 0.75 / 1.2
    assert in_place(predict, sketches, first) is sketches


def test_a_drawing_in_its_place_is_not_touched() -> None:
    sketches = alone(sk.draw(SHAPE, CAMERA))
    [first] = Drawn(CAMERA)([sketches])

    def never(samples: Sequence[Sketches]) -> Iterator[Volume]:
        raise AssertionError("it was looked for")

    assert in_place(never, sketches, first) is sketches


class Turned:
    """Predicts the very solid that a drawing shows, as it lies in the world that the claimed camera stands in: the less
    surely, the more it is askew there, as networks do.
    """

    def __init__(self, camera: sk.Camera) -> None:
        self.camera = camera

    def __call__(self, samples: Sequence[Sketches]) -> Iterator[Volume]:
        voxels = sk.voxelize(SHAPE).astype(np.float32)
        for sketches in samples:
            camera = sk.Camera.from_packed(sketches.cameras[0])
            back = self.camera.rotation.T @ camera.rotation
            sure = 1 - 0.01 * _between(camera, self.camera)
            askew = affine_transform(voxels, back, offset=31.5 - back @ np.full(3, 31.5), order=1)
            yield (sure * askew).astype(np.float32)


def _between(one: sk.Camera, other: sk.Camera) -> float:
    """Degrees between two cameras as seen from the world's origin."""
    cosine = one.position @ other.position / np.linalg.norm(one.position) / np.linalg.norm(other.position)
    return math.degrees(math.acos(min(1.0, float(cosine))))


@pytest.mark.parametrize("turn", [(12.0, 0.0), (0.0, -12.0), (-9.0, 9.0)])
def test_a_drawing_from_beside_its_viewpoint_finds_its_camera(turn: tuple[float, float]) -> None:
    true = CAMERA.turned(*turn)
    drawing = sk.draw(SHAPE, true)
    sketches = alone(drawing)
    predict = Turned(true)
    [first] = predict([sketches])
    found = sk.Camera.from_packed(in_place(predict, sketches, first, always=True).cameras[0])
    assert _between(found, true) < 4.0
    np.testing.assert_array_equal(sketches.cameras[0], CAMERA.packed)


@pytest.mark.parametrize("turn", [(5.0, 0.0), (-3.5, 3.5)])
def test_lines_alone_say_unasked_that_a_drawing_was_made_from_beside_its_viewpoint(turn: tuple[float, float]) -> None:
    # What is predicted is as sure from one side as from another: so it is lines that tell.
    def predict(samples: Sequence[Sketches]) -> Iterator[Volume]:
        for _ in samples:
            yield soft(np.zeros(3), 1.0)

    true = CAMERA.turned(*turn)
    sketches = alone(sk.draw(SHAPE, true))
    [first] = predict([sketches])
    found = sk.Camera.from_packed(in_place(predict, sketches, first).cameras[0])
    assert _between(found, true) < 1.5 < _between(CAMERA, true) - 2


def test_of_several_drawings_each_finds_its_own_place() -> None:
    cameras = [CAMERA, sk.VIEWPOINTS["quarter-127"]]
    knowing = [Drawn(camera) for camera in cameras]

    def nearest(row: NDArray[np.float64]) -> int:
        return int(np.argmin([np.linalg.norm(row - camera.packed) for camera in cameras]))

    def predict(samples: Sequence[Sketches]) -> Iterator[Volume]:
        for sketches in samples:
            said = [
                next(knowing[nearest(row)]([alone(drawing, cameras[0])]))
                for drawing, row in zip(sketches.drawings, sketches.cameras, strict=True)
            ]
            yield np.mean(said, axis=0)

    exact = [sk.draw(SHAPE, camera) for camera in cameras]
    spoilt = [Placement(0.8, (9.0, 4.0)).move(exact[0], cameras[0]), exact[1]]
    sketches = Sketches(np.stack(spoilt), np.stack([camera.packed for camera in cameras]))
    [first] = predict([sketches])
    moved = in_place(predict, sketches, first)
    assert [Drawn._ink(drawing)[1] for drawing in moved.drawings] == [
        pytest.approx(one.size, rel=0.03) for one in knowing
    ]


def test_what_is_empty_or_unsure_is_less_plausible() -> None:
    sketches = alone(sk.draw(SHAPE, CAMERA))
    sure = soft(np.zeros(3), 1.0)
    unsure = (0.5 + 0.4 * (sure - 0.5)).astype(np.float32)
    assert plausibility(np.zeros_like(sure), sketches) == -math.inf
    assert plausibility(unsure, sketches) < plausibility(sure, sketches)
    for worse in (soft(np.array([0.04, 0, 0]), 1.0), soft(np.array([0, 0.04, 0]), 1.0), soft(np.zeros(3), 0.9)):
        assert plausibility(worse, sketches) < plausibility(sure, sketches)
    empty = alone(np.zeros((256, 256), np.uint8))
    assert in_place(lambda samples: (np.zeros_like(sure) for _ in samples), empty, np.zeros_like(sure)) is empty


def test_reconstruct_moves_what_is_plainly_out_of_place_or_when_told(monkeypatch: pytest.MonkeyPatch) -> None:
    model = sk.load_model()
    exact = sk.draw(SHAPE, CAMERA)
    small = Placement(0.6).move(exact, CAMERA)

    def made(drawing: NDArray[np.uint8], **options: Any) -> sk.Reconstruction:
        return sk.reconstruct(drawing, CAMERA, iterations=1, model=model, **options)

    kept, moved = made(small, align=False), made(small)
    np.testing.assert_array_equal(kept.drawings[0], small)

    def side(solid: sk.Reconstruction) -> float:
        box = bounds(solid.probability)
        assert box is not None
        return box[1]

    assert side(kept) < 0.9 / 1.2 < side(moved)
    assert outline_iou(moved.probability, CAMERA, exact) > 0.85 > outline_iou(kept.probability, CAMERA, exact)
    np.testing.assert_array_equal(made(exact).drawings[0], exact)
    asked = []
    monkeypatch.setattr(
        type(model), "in_place", lambda self, sketches, always=False: (asked.append(always), sketches)[1]
    )
    made(exact, align=True), made(exact), made(exact, align=False)
    assert asked == [True, False]
