"""Cameras and the 13 named viewpoints that drawings are made from (paper, section 4.3)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sketchcore import _core

FOV_DEGREES = 45.0
NEAR = 1.25
FAR = 2.75
DISTANCE = 2.0


def _frozen_array(value: ArrayLike, shape: tuple[int, ...], name: str) -> NDArray[np.float64]:
    array = np.array(value, dtype=np.float64)
    if array.shape != shape:
        raise ValueError(f"camera {name} must have shape {list(shape)}, got {list(array.shape)}")
    array.setflags(write=False)
    return array


def _half_sine(fov_degrees: float) -> float:
    # A field of view that is none is refused by `Camera` itself.
    return math.sin(math.radians(fov_degrees / 2)) if 0 < fov_degrees < 180 else 1.0


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole camera with a square image; axes x right, y down, z forward (OpenCV).

    Attributes:
        position: float64 [3], the eye in world units.
        rotation: float64 [3, 3], rows are the camera's x, y and z axes in the world.
        fov_degrees: vertical (and horizontal) field of view in degrees.
        near: distance along z of the first plane of the camera grid, world units.
        far: distance along z of the last plane of the camera grid, world units.

    Raises:
        ValueError: if a shape is wrong, a number is not finite, the rotation is no rotation, the field of
            view lies outside (0, 180) or not 0 < near < far.
    """

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    fov_degrees: float = FOV_DEGREES
    near: float = NEAR
    far: float = FAR
    _packed: NDArray[np.float64] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        position = _frozen_array(self.position, (3,), "position")
        rotation = _frozen_array(self.rotation, (3, 3), "rotation")
        numbers = np.concatenate([position, rotation.ravel(), [self.fov_degrees, self.near, self.far]])
        if not np.isfinite(numbers).all():
            raise ValueError("camera has a NaN or infinite number; every entry must be finite")
        # Cameras stored with six decimals are still rotations: hence the tolerance. Larger numbers might overflow.
        turns = np.abs(rotation).max() < 2 and np.abs(rotation @ rotation.T - np.eye(3)).max() <= 1e-4
        if not turns or np.linalg.det(rotation) < 0:
            raise ValueError("camera rotation must be orthonormal with determinant +1 (rows: right, down, forward)")
        if not 0 < self.fov_degrees < 180:
            raise ValueError(f"camera fov_degrees must lie between 0 and 180, got {self.fov_degrees}")
        if not 0 < self.near < self.far:
            raise ValueError(f"camera needs 0 < near < far, got near {self.near} and far {self.far}")
        numbers.setflags(write=False)
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "_packed", numbers)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Camera) and bool(np.array_equal(self._packed, other._packed))

    def __hash__(self) -> int:
        return hash(self._packed.tobytes())

    @property
    def packed(self) -> NDArray[np.float64]:
        """float64 [15], the form the Rust core takes: position, rotation row by row, fov, near, far."""
        return self._packed

    @property
    def focal(self) -> float:
        """Focal length in pixels of the 256 x 256 drawing, whose middle is (128, 128)."""
        return 128 / math.tan(math.radians(self.fov_degrees / 2))

    @classmethod
    def from_packed(cls, packed: ArrayLike) -> Camera:
        """The camera of a packed row, float64 [15] (see `packed`)."""
        row = _frozen_array(packed, (15,), "row")
        return cls(row[:3], row[3:12].reshape(3, 3), float(row[12]), float(row[13]), float(row[14]))

    @classmethod
    def orbit(
        cls, azimuth: float, elevation: float, distance: float | None = None, *, fov_degrees: float = FOV_DEGREES
    ) -> Camera:
        """A camera that looks at the origin; its near and far planes stand 0.75 before and behind it.

        Args:
            azimuth: degrees from +x towards +z.
            elevation: degrees above the horizon; at 90 the image's right is +x and its top -z.
            distance: world units from the origin, more than 0; None for one from which a ball around the origin fills
                as much of the image as it does from 2.0 with a field of view of 45 degrees. Nearer than 0.79 the near
                plane stands at a twentieth of it.
            fov_degrees: field of view in degrees.
        """
        if not all(math.isfinite(angle) for angle in (azimuth, elevation, fov_degrees)):
            raise ValueError(
                f"azimuth, elevation and field of view must be finite, got {azimuth}, {elevation} and {fov_degrees}"
            )
        if distance is None:
            distance = DISTANCE * _half_sine(FOV_DEGREES) / _half_sine(fov_degrees)
        if distance <= 0:
            raise ValueError(f"camera distance must be more than 0, got {distance}")
        planes = max(distance - DISTANCE + NEAR, distance / 20), distance - DISTANCE + FAR
        if elevation == 90.0:
            axes = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
            return cls(np.array([0.0, distance, 0.0]), axes, fov_degrees, *planes)
        a, e = math.radians(azimuth), math.radians(elevation)
        position = np.array([math.cos(e) * math.cos(a), math.sin(e), math.cos(e) * math.sin(a)])
        forward = -position
        right = np.array([math.sin(a), 0.0, -math.cos(a)])
        down = np.cross(forward, right)
        return cls(distance * position, np.stack([right, down, forward]), fov_degrees, *planes)

    def turned(self, right: float, down: float) -> Camera:
        """The camera carried around the world's origin, which it sees where it saw it before.

        Args:
            right: degrees of the turn about the camera's own axis to the right, and
            down: about that which points down, both at once.
        """
        if right == 0 and down == 0:
            return self
        [turn] = turns(self.rotation, np.array([right]), np.array([down]))
        return Camera(turn @ self.position, self.rotation @ turn.T, self.fov_degrees, self.near, self.far)

    def widened(self, factor: float) -> Camera:
        """The camera with a field of view so many times as large, from where what lies at the origin looks as large.

        Its near and far planes keep their distance from the origin.
        """
        return Camera.from_packed(_core.widened(self.packed, factor - 1))


def turns(rotation: NDArray[np.float64], right: NDArray[np.float64], down: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turns about a camera's right and down axes, both at once (`Camera.turned`): float64 [m, 3, 3], of the world.

    Args:
        rotation: float64 [3, 3], the camera's, or [m, 3, 3] for one each.
        right: float64 [m], degrees about its right axis.
        down: float64 [m], degrees about its down axis.
    """
    degrees = np.hypot(right, down)
    about = right[:, None] * rotation[..., 0, :] + down[:, None] * rotation[..., 1, :]
    x, y, z = about.T / np.maximum(degrees, 1e-12)
    none = np.zeros_like(x)
    cross = np.stack([none, -z, y, z, none, -x, -y, x, none], axis=1).reshape(-1, 3, 3)
    angle = np.radians(degrees)[:, None, None]
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def pack_cameras(cameras: Iterable[Camera]) -> NDArray[np.float64]:
    """float64 [n, 15], the form the Rust core takes.

    Raises:
        TypeError: if an entry is not a `Camera`.
    """
    rows = []
    for camera in cameras:
        if not isinstance(camera, Camera):
            raise TypeError(f"expected a sketchcore.Camera, got {type(camera).__name__}")
        rows.append(camera.packed)
    return np.stack(rows) if rows else np.empty((0, 15))


_QUARTERS = tuple(f"quarter-{azimuth:03d}" for azimuth in (37, 52, 127, 142, 217, 232, 307, 322))
_NAMES = (*_QUARTERS, "front", "right", "back", "left", "top")  # in the order of `rust/src/camera.rs`

VIEWPOINTS: Mapping[str, Camera] = MappingProxyType(
    dict(zip(_NAMES, map(Camera.from_packed, _core.viewpoints()), strict=True))
)
"""Name -> camera: eight three-quarter views (the single view's), then front, right, back, left and top."""

QUARTER_VIEWS: tuple[str, ...] = _QUARTERS
"""Names of the eight three-quarter viewpoints that a first drawing is made from."""


def as_camera(view: str | Camera) -> Camera:
    """The camera of a viewpoint's name; a camera stays as it is.

    Raises:
        KeyError: for a name that is no viewpoint (the message lists them).
        TypeError: for anything else.
    """
    if isinstance(view, Camera):
        return view
    if isinstance(view, str):
        if view not in VIEWPOINTS:
            raise KeyError(f"unknown viewpoint {view!r}; the viewpoints are {', '.join(VIEWPOINTS)}")
        return VIEWPOINTS[view]
    raise TypeError(f"a view is a viewpoint's name or a sketchcore.Camera, got {type(view).__name__}")


def check_viewpoint(viewpoint: object) -> str:
    """The viewpoint's name itself, if it is one of the 13.

    Raises:
        ValueError: if it is not (the message lists them).
    """
    if not isinstance(viewpoint, str) or viewpoint not in VIEWPOINTS:
        raise ValueError(f"unknown viewpoint {str(viewpoint)[:80]!r}; the viewpoints are {', '.join(VIEWPOINTS)}")
    return viewpoint
