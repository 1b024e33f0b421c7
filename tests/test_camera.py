import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import reference
from sketchcore import _core
from sketchcore.camera import QUARTER_VIEWS, VIEWPOINTS, Camera, as_camera, pack_cameras

ANGLES = {
    "quarter-037": (37.5, 38), "quarter-052": (52.5, 38), "quarter-127": (127.5, 38), "quarter-142": (142.5, 38),
    "quarter-217": (217.5, 38), "quarter-232": (232.5, 38), "quarter-307": (307.5, 38), "quarter-322": (322.5, 38),
    "front": (0, 0), "right": (90, 0), "back": (180, 0), "left": (270, 0), "top": (None, 90),
}  # fmt: skip
GOOD = VIEWPOINTS["quarter-037"]


def test_names_and_order():
    assert list(VIEWPOINTS) == list(ANGLES)
    assert list(ANGLES)[:8] == list(QUARTER_VIEWS)
    with pytest.raises(TypeError):
        VIEWPOINTS["front"] = GOOD


@pytest.mark.parametrize("name", ANGLES)
def test_a_viewpoint_stands_two_away_and_looks_at_the_origin(name):
    camera, (azimuth, elevation) = VIEWPOINTS[name], ANGLES[name]
    x, y, z = camera.position
    assert np.linalg.norm(camera.position) == pytest.approx(2, abs=1e-12)
    assert np.degrees(np.arcsin(y / 2)) == pytest.approx(elevation, abs=1e-6)
    if azimuth is not None:
        assert np.degrees(np.arctan2(z, x)) % 360 == pytest.approx(azimuth, abs=1e-9)
        assert camera.rotation[1, 1] < 0, "image down is down"
    np.testing.assert_allclose(camera.rotation[2], -camera.position / 2, atol=1e-12)
    np.testing.assert_allclose(camera.rotation @ camera.rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(camera.rotation) == pytest.approx(1)
    assert camera.rotation[0, 1] == pytest.approx(0, abs=1e-12), "the horizon is level"
    assert (camera.fov_degrees, camera.near, camera.far) == (45, 1.25, 2.75)
    assert camera.position.dtype == camera.rotation.dtype == np.float64


def test_axes_of_front_and_top():
    np.testing.assert_allclose(VIEWPOINTS["front"].rotation, [[0, 0, -1], [0, -1, 0], [-1, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(VIEWPOINTS["top"].rotation, [[1, 0, 0], [0, 0, 1], [0, -1, 0]], atol=1e-12)


def test_orbit_comes_by_the_viewpoints():
    quarters = (37.5, 52.5, 127.5, 142.5, 217.5, 232.5, 307.5, 322.5)
    orbits = [Camera.orbit(azimuth, 38.0) for azimuth in quarters]
    orbits += [Camera.orbit(azimuth, 0.0) for azimuth in (0.0, 90.0, 180.0, 270.0)] + [Camera.orbit(0.0, 90.0)]
    packed = [camera.packed for camera in VIEWPOINTS.values()]
    np.testing.assert_allclose(packed, pack_cameras(orbits), rtol=0, atol=1e-12)


@given(reference.cameras())
def test_packed_cameras_come_back(camera):
    packed = camera.packed
    assert packed.shape == (15,)
    np.testing.assert_array_equal(packed[3:12].reshape(3, 3), camera.rotation)
    again = Camera.from_packed(packed)
    assert again == camera
    assert hash(again) == hash(camera)
    assert again != Camera(camera.position + 0.01, camera.rotation)
    np.testing.assert_array_equal(pack_cameras([camera, again]), [packed, packed])
    assert pack_cameras([]).shape == (0, 15)


def test_cameras_are_frozen_and_keep_copies():
    position = np.array([2.0, 0, 0])
    camera = Camera(position, VIEWPOINTS["front"].rotation)
    position[0] = 9
    assert camera.position[0] == 2
    for array in (camera.position, camera.rotation, camera.packed):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1
    with pytest.raises(dataclasses.FrozenInstanceError):
        camera.near = 1.0


@given(st.floats(-720, 720), st.floats(-89, 89), st.floats(0.1, 10))
def test_an_orbit_sees_the_origin_in_the_middle(azimuth, elevation, distance):
    camera = Camera.orbit(azimuth, elevation, distance)
    at, depth = reference.project(camera, np.zeros(3))
    np.testing.assert_allclose([*at, depth], [128, 128, distance], atol=1e-9)


SKEWED = GOOD.rotation + np.array([[0, 0.01, 0], [0, 0, 0], [0, 0, 0]])
DEGENERATE = [
    ({"position": [0, 0]}, r"position must have shape \[3\], got \[2\]"),
    ({"rotation": np.eye(4)}, r"rotation must have shape \[3, 3\], got \[4, 4\]"),
    ({"position": [np.nan, 0, 0]}, "every entry must be finite"),
    ({"rotation": np.full((3, 3), np.inf)}, "every entry must be finite"),
    ({"fov_degrees": np.nan}, "every entry must be finite"),
    ({"far": np.inf}, "every entry must be finite"),
    ({"rotation": np.zeros((3, 3))}, r"orthonormal with determinant \+1"),
    ({"rotation": SKEWED}, r"orthonormal with determinant \+1"),
    ({"rotation": 2 * GOOD.rotation}, r"orthonormal with determinant \+1"),
    ({"rotation": GOOD.rotation[[1, 0, 2]]}, r"orthonormal with determinant \+1"),
    ({"fov_degrees": 0}, "between 0 and 180, got 0"),
    ({"fov_degrees": 180}, "between 0 and 180, got 180"),
    ({"fov_degrees": -45}, "between 0 and 180, got -45"),
    ({"near": 0}, "0 < near < far, got near 0"),
    ({"near": -1}, "0 < near < far"),
    ({"near": 2.75}, "0 < near < far"),
    ({"far": 1}, "0 < near < far, got near 1.25 and far 1"),
]


@pytest.mark.parametrize(("change", "message"), DEGENERATE)
def test_degenerate_cameras_are_refused(change, message):
    entries = {
        "position": GOOD.position,
        "rotation": GOOD.rotation,
        "fov_degrees": 45,
        "near": 1.25,
        "far": 2.75,
    }
    entries |= change
    with pytest.raises(ValueError, match=message):
        Camera(**entries)
    if np.shape(entries["position"]) == (3,) and np.shape(entries["rotation"]) == (3, 3):
        row = np.concatenate([np.ravel(v) for v in entries.values()]).astype(np.float64)
        with pytest.raises(ValueError, match=message):
            Camera.from_packed(row)
        shape = np.array([[0, 1, 0, 0, 0, 0.1, 0.1, 0.1]])
        # The core looks at each number on its own, so it may name the range before it says "finite".
        message += "|between 0 and 180, got NaN|0 < near < far, got near 1.25 and far inf"
        with pytest.raises(ValueError, match=message):
            _core.draw(shape, row)
        with pytest.raises(ValueError, match=message):
            _core.to_camera_grid(np.zeros((1, 64, 64, 64), np.float32), row[None])


def test_bad_arguments_are_refused():
    with pytest.raises(ValueError, match="distance must be more than 0, got 0"):
        Camera.orbit(0, 0, 0)
    with pytest.raises(ValueError, match="finite"):
        Camera.orbit(np.nan, 0)
    with pytest.raises(ValueError, match=r"shape \[15\], got \[14\]"):
        Camera.from_packed(np.zeros(14))
    with pytest.raises(TypeError, match=r"expected a sketchcore.Camera, got str"):
        pack_cameras(["front"])
    with pytest.raises(KeyError, match="the viewpoints are quarter-037, "):
        as_camera("frnt")
    with pytest.raises(TypeError, match=r"name or a sketchcore.Camera, got int"):
        as_camera(3)
    assert as_camera("top") is VIEWPOINTS["top"]
    assert as_camera(GOOD) is GOOD


def test_a_turned_camera_sees_the_origin_where_it_was() -> None:
    camera = Camera.orbit(20, 40, distance=3, fov_degrees=30)
    turned = camera.turned(6.0, -8.0)
    np.testing.assert_allclose(turned.rotation @ -turned.position, camera.rotation @ -camera.position, atol=1e-12)
    np.testing.assert_allclose(turned.rotation @ turned.rotation.T, np.eye(3), atol=1e-12)
    between = np.degrees(np.arccos(turned.position @ camera.position / 9.0))
    assert between == pytest.approx(10.0)
    assert camera.turned(0.0, 0.0) is camera
    # About the axis to the right it goes up or down: what points to the right still does.
    np.testing.assert_allclose(camera.turned(15.0, 0.0).rotation[0], camera.rotation[0], atol=1e-12)
