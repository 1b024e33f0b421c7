import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import reference
from sketchcore import _core
from sketchcore.camera import VIEWPOINTS
from sketchcore.grids import carve, draw, silhouette, voxelize
from sketchcore.shape import Cuboid, Cylinder, Shape

NAMES = st.sampled_from(list(VIEWPOINTS))


def ring(gap=0, radius=60):
    """A circle, with a gap of so many pixels at its right."""
    row, col = np.indices((256, 256)) - 128
    drawing = np.abs(np.hypot(row, col) - radius) < 0.75
    drawing &= ~((col > 0) & (row >= 0) & (row < gap))
    return drawing.astype(np.uint8) * 255


@st.composite
def drawings(draw_from):
    """Drawings of shapes with pieces rubbed out and scribbles of any ink put in."""
    shape, name = draw_from(reference.shapes(5)), draw_from(NAMES)
    drawing = draw(shape, VIEWPOINTS[name])
    random = np.random.default_rng(draw_from(st.integers(0, 2**32 - 1)))
    ink = np.argwhere(drawing)
    for _ in range(draw_from(st.integers(0, 4)) if len(ink) else 0):
        row, col = ink[random.integers(len(ink))]
        size = random.integers(1, 14)
        drawing[row : row + size, col : col + size] = 0
    for _ in range(draw_from(st.integers(0, 3))):
        row, col = random.integers(0, 256, 2)
        drawing[row, col : col + 40] = random.choice([63, 64, 255])
    return drawing


@pytest.mark.slow
@settings(max_examples=60)
@given(drawings())
def test_silhouettes_are_what_the_flood_does_not_reach(drawing):
    np.testing.assert_array_equal(silhouette(drawing), reference.silhouette(drawing))


def test_a_closed_outline_is_filled_exactly_with_its_holes():
    row, col = np.indices((256, 256)) - 128
    for drawing in (ring(), np.maximum(ring(), ring(radius=20))):
        inside = silhouette(drawing)
        expected = np.hypot(row, col) < 60.75
        np.testing.assert_array_equal(inside, expected)


@pytest.mark.parametrize("gap", range(1, 28, 2))
def test_gaps_of_up_to_27_pixels_are_closed(gap):
    full = silhouette(ring()).astype(bool)
    # What is missing is at most the bite that a disc as wide as the gap takes at it.
    missing = full & ~silhouette(ring(gap)).astype(bool)
    assert missing.sum() < max(30, gap * gap / 2)
    assert not (silhouette(ring(gap)).astype(bool) & ~full).any()


def test_wide_gaps_stay_open_and_blank_paper_is_empty():
    assert silhouette(ring(36)).mean() < 0.02
    assert not silhouette(np.zeros((256, 256), np.uint8)).any()
    assert silhouette(np.full((256, 256), 255, np.uint8)).all()
    assert not silhouette(np.full((256, 256), 63, np.uint8)).any()


@settings(max_examples=15)
@given(reference.shapes(5), st.lists(NAMES, min_size=1, max_size=5))
def test_carving_keeps_what_falls_into_every_silhouette(shape, names):
    cameras = [VIEWPOINTS[name] for name in names]
    images = [draw(shape, camera) for camera in cameras]
    least, most = reference.carve([reference.silhouette(i) for i in images], cameras)
    got = carve(images, cameras)
    assert ((least <= got) & (got <= most)).all()
    assert (least != most).mean() < 1e-3


def test_carving_a_box_from_its_sides_leaves_little_more():
    half = np.array([0.3, 0.2, 0.25])
    shape = Shape([Cuboid((0, 0, 0), tuple(half))])
    cameras = [VIEWPOINTS[n] for n in ("front", "right", "top", "back", "left")]
    hull, truth = carve([draw(shape, c) for c in cameras], cameras), voxelize(shape)
    # A pixel belongs to the silhouette when its middle sees the box: half a pixel, 0.0033, may be missing.
    assert (truth & (1 - hull)).sum() < 0.001 * truth.sum()
    # Silhouettes are those of the nearest face, at depth 1.7 at least: where both of a pair of opposite cameras
    # agree, which is at depth 2, they are wider by 2 / 1.7.
    at = np.abs(reference.voxel_centers()[hull > 0])
    assert (at < half * 2 / 1.7 + 0.0033 * 2).all()
    assert (at.max(axis=0) > half).all()


def test_carving_ignores_hollows():
    hollow = Shape([Cuboid((0, 0, 0), (0.3, 0.3, 0.3)), Cylinder((0, 0.2, 0), (0.1, 0.2, 0.1), "y", "subtract")])
    cameras = list(VIEWPOINTS.values())
    hull = carve([draw(hollow, c) for c in cameras], cameras)
    assert hull[32, 55 - 8, 32] == 1
    assert voxelize(hollow)[32, 47, 32] == 0


def test_silhouettes_of_many_are_those_of_each():
    images = np.stack([ring(), ring(7), np.zeros((256, 256), np.uint8)])
    many = _core.silhouettes(images)
    assert many.dtype == np.uint8
    for image, inside in zip(images, many, strict=True):
        np.testing.assert_array_equal(inside, silhouette(image))
    assert _core.silhouettes(images[:0]).shape == (0, 256, 256)
