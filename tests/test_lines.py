"""Lines from buffers.

The golden images in tests/golden are looked at by a person before they are committed. To make them anew after a
deliberate change of the lines: `SKETCHCORE_UPDATE_GOLDEN=1 pytest tests/test_lines.py`, then look at each of them.
"""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from scipy import ndimage

import reference
from sketchcore import _core
from sketchcore.camera import VIEWPOINTS, Camera
from sketchcore.datagen import generate
from sketchcore.grids import buffers, draw
from sketchcore.shape import Cuboid, Cylinder, Shape, Wedge

GOLDEN = Path(__file__).parent / "golden"
ANY_CAMERA = reference.cameras() | st.sampled_from(list(VIEWPOINTS.values()))
SCENES = {
    "box-quarter-037": [Cuboid((0, 0, 0), (0.3, 0.2, 0.35))],
    "cylinder-quarter-322": [Cylinder((0, 0, 0), (0.25, 0.35, 0.25))],
    "hole-quarter-142": [
        Cuboid((0, 0, 0), (0.35, 0.15, 0.35)),
        Cylinder((0, 0.1, 0), (0.18, 0.2, 0.18), "y", "subtract"),
    ],
    "step-front": [Cuboid((-0.1, -0.35, 0), (0.25, 0.1, 0.3)), Cuboid((-0.2, -0.1, 0.1), (0.1, 0.15, 0.2))],
    "step-quarter-052": [Cuboid((0, -0.2, 0), (0.35, 0.1, 0.3)), Cuboid((-0.15, 0.05, 0), (0.2, 0.15, 0.2))],
    "thin-step-quarter-037": [
        Cuboid((0, -0.1, 0), (0.35, 0.1, 0.35)),
        Cuboid((-0.1, 0.01, 0.05), (0.15, 0.02, 0.15)),
    ],
    "pair-quarter-217": [
        Cuboid((0, -0.1, 0), (0.3, 0.05, 0.3)),
        Cylinder((0.15, 0.15, 0.2), (0.08, 0.2, 0.08)),
        Cylinder((0.15, 0.15, -0.2), (0.08, 0.2, 0.08)),
        Cylinder((-0.1, -0.1, 0.2), (0.1, 0.1, 0.15), "z", "subtract"),
        Cylinder((-0.1, -0.1, -0.2), (0.1, 0.1, 0.15), "z", "subtract"),
    ],
    "house-quarter-052": [
        Cuboid((0, -0.2, 0), (0.35, 0.15, 0.25)),
        Wedge((0, 0.1, 0.15), (0.4, 0.15, 0.15), "x", (-1, -1)),
        Wedge((0, 0.1, -0.15), (0.4, 0.15, 0.15), "x", (-1, 1)),
        Cuboid((-0.2, 0.2, 0.1), (0.05, 0.15, 0.04)),
    ],
    "tunnel-top": [
        Cuboid((0, 0, 0), (0.35, 0.3, 0.2)),
        Cylinder((0, 0, 0), (0.12, 0.5, 0.12), "y", "subtract"),
        Cylinder((0.3, 0.3, 0), (0.05, 0.1, 0.3), "z", "subtract"),
    ],
}


@pytest.mark.slow
@settings(max_examples=60)
@given(reference.shapes(), ANY_CAMERA)
def test_lines_follow_the_rules(shape, camera):
    depth, normal = buffers(shape, camera)
    ink = draw(shape, camera) > 0
    # 1e-6 for float32 in inverse depths and cosines: what is sure must agree.
    sure, maybe = (reference.lines(depth, normal, slack=slack) for slack in (1e-6, -1e-6))
    assert not (sure & ~ink).any()
    assert not (ink & ~maybe).any()


@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1), st.floats(0.001, 0.1), st.floats(1, 170))
def test_lines_follow_the_rules_on_noise_and_at_any_threshold(seed, depth_step, crease):
    random = np.random.default_rng(seed)
    depth = random.choice([1.9, 1.95, 2.0, 2.2, np.inf], (40, 40)).astype(np.float32)
    depth += random.normal(0, 0.01, depth.shape).astype(np.float32)
    normal = random.normal(size=(40, 40, 3))
    normal = (normal / np.linalg.norm(normal, axis=-1, keepdims=True)).astype(np.float32)
    ink = _core.lines(depth, normal, depth_step, crease) > 0
    sure, maybe = (reference.lines(depth, normal, depth_step, crease, s) for s in (1e-6, -1e-6))
    assert not (sure & ~ink).any()
    assert not (ink & ~maybe).any()
    assert (sure != maybe).sum() < 8


@settings(max_examples=10)
@given(reference.shapes(), ANY_CAMERA)
def test_drawing_is_lines_of_buffers(shape, camera):
    drawing = draw(shape, camera)
    assert drawing.dtype == np.uint8
    assert set(np.unique(drawing)) <= {0, 255}
    np.testing.assert_array_equal(drawing, _core.lines(*buffers(shape, camera), 0.006, 30.0))


def test_planes_have_no_lines_at_any_slant():
    for elevation in (12, 38, 80):
        depth, normal = buffers(Shape([Cuboid((0, -1, 0), (50, 0.9, 50))]), Camera.orbit(30, elevation))
        assert not (_core.lines(depth, normal, 1e-4, 1.0) > 0)[1:-1, 1:-1][np.isfinite(depth[:-2, 1:-1])].any()


@pytest.mark.parametrize("voxels", [1, 2, 4])
def test_a_step_as_deep_as_some_voxels_is_a_line(voxels):
    # A plate before a wall, seen from the front: 1/z jumps by step / z^2; the threshold 0.006 lies between one
    # voxel's step (0.0156 / 4 = 0.004) and two voxels' (0.008).
    step = voxels / 64
    shape = Shape([Cuboid((-0.2, 0, 0), (0.2, 2, 2)), Cuboid((step / 2, 0, 0), (step / 2, 0.25, 0.25))])
    drawing = draw(shape, VIEWPOINTS["front"])[1:-1, 1:-1] > 0
    if voxels == 1:
        assert not drawing.any()
        return
    rows, cols = np.nonzero(drawing)
    side = rows.max() - rows.min() + 1
    assert side == cols.max() - cols.min() + 1
    assert side == pytest.approx(0.5 / (2 - step) / (2 * np.tan(np.radians(22.5))) * 256, abs=1)
    assert drawing.sum() == 4 * (side - 1), "one pixel wide, closed, nothing else"


@pytest.mark.parametrize(("crease", "drawn"), [(89.0, True), (91.0, False)])
def test_a_crease_is_drawn_from_its_angle_on(crease, drawn):
    depth, normal = buffers(Shape([Cuboid((0, 0, 0), (0.3, 0.3, 0.3))]), VIEWPOINTS["quarter-037"])
    inner = ndimage.binary_erosion(np.isfinite(depth), iterations=3)
    # The threshold on depth is out of reach.
    ink = (_core.lines(depth, normal, 9.0, crease) > 0) & inner
    assert ink.any() == drawn
    if drawn:
        assert ndimage.label(ink, np.ones((3, 3)))[1] == 1, "three creases that meet"


@pytest.mark.slow
@pytest.mark.parametrize("wedges", [0.0, 0.3])
def test_outlines_are_closed(wedges):
    structure = np.ones((3, 3))
    worst = 0
    for shape in generate(20, 200, config={"grammar": {"wedges": wedges}}).shapes:
        for camera in VIEWPOINTS.values():
            ink = draw(shape, camera) > 0
            seen = np.isfinite(buffers(shape, camera)[0])
            filled = ndimage.binary_fill_holes(seen)
            assert not (ink & ~seen).any(), "lines lie on the object"
            np.testing.assert_array_equal(~reference.outside(~ink), filled)
            # Taken with the corners, the outline of each piece hangs together.
            outline = filled & ~ndimage.binary_erosion(filled, border_value=0)
            assert (ink | ~outline).all()
            pieces = ndimage.label(filled, structure)[1]
            assert ndimage.label(ink & ndimage.binary_dilation(outline), structure)[1] >= pieces
            worst = max(worst, pieces)
    assert worst >= 1


@pytest.mark.parametrize("scene", SCENES)
def test_golden_images(scene):
    name = "-".join(scene.split("-")[-2:]) if "quarter" in scene else scene.split("-")[-1]
    drawing = draw(Shape(SCENES[scene]), VIEWPOINTS[name])
    path = GOLDEN / f"{scene}.png"
    if os.environ.get("SKETCHCORE_UPDATE_GOLDEN"):
        path.parent.mkdir(exist_ok=True)
        Image.fromarray(255 - drawing).save(path, optimize=True)
    with Image.open(path) as image:
        expected = 255 - np.asarray(image)
    assert expected.shape == (256, 256)
    assert set(np.unique(expected)) == {0, 255}
    assert (drawing != expected).sum() <= 256**2 // 10_000
