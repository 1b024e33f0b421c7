"""How a mesh from elsewhere stands in the world: which way is up, and which way it looks.

Nothing in most files says so. What can be seen: a thing that stands does so on a wide base, and is hardly ever the same
upside down; its plane of symmetry is upright; and what has a back (chairs, benches, shelves) has it behind. Meshes of
one source agree on what is up, so they vote; to which side each looks is its own matter.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from sketchcore import _core
from sketchcore.volume import iou

AXES = ("x", "y", "z", "-x", "-y", "-z")
"""Directions in a file."""
CUSTOM = {".stl": "z"}
"""What is up where nothing can be told; y in all other formats, as the Khronos group demands of GLB."""
FIXED = (".glb", ".gltf")
"""Formats that say what is up."""

# A mesh votes for an axis that is better than all others by this much, and the majority must be as clear as that.
_CLEARLY = 0.1
_MAJORITY = 0.6
# How near to the lowest point a thing touches the ground, in world units.
_GROUND = 0.012
# An upper half this far back is a back; and of two planes of symmetry one must be so much better.
_BEHIND = 0.01

Array = NDArray[np.float64]


def direction(name: str) -> Array:
    """The unit vector of one of `AXES`.

    Raises:
        ValueError: for another name.
    """
    if name not in AXES:
        raise ValueError(f"a direction is one of {', '.join(AXES)}; got {name!r}")
    vector = np.zeros(3)
    vector["xyz".index(name[-1])] = -1.0 if name.startswith("-") else 1.0
    return vector


def turn(up: str, front: str | None = None) -> Array:
    """The rotation, [3, 3], that brings one direction of a file to +y, and another to +x if it is given.

    Raises:
        ValueError: if they lie along one axis, or are none of `AXES`.
    """
    above = direction(up)
    if front is not None and front[-1] == up[-1]:
        raise ValueError(f"up and front must be different axes; got {up} and {front}")
    # Without a front, one axis stays where it is if it can: z, or x for what has z up.
    ahead = direction(front or ("x" if up[-1] != "x" else "y" if up == "-x" else "-y"))
    return np.stack([ahead, above, np.cross(ahead, above)])


def standing(vertices: Array, faces: NDArray[np.int64]) -> dict[str, float]:
    """How well a mesh stands with each of x, y and z up: 0 to 2."""
    scores = {}
    for axis in "xyz":
        turned = vertices @ turn(axis).T
        world = _core.voxelize_mesh(np.ascontiguousarray(turned), faces)
        scores[axis] = _base(turned[np.unique(faces)]) + 1 - iou(world, world[:, ::-1])
    return scores


def _base(points: Array) -> float:
    """The share of a thing's ground plan that it stands on, if it would not fall over; 0 if it would."""
    from scipy.spatial import ConvexHull, QhullError

    low, high = points.min(axis=0), points.max(axis=0)
    largest = (high - low).max()
    ground = points[points[:, 1] < low[1] + _GROUND * 1.2 * largest][:, [0, 2]]
    try:
        feet, plan = ConvexHull(ground), ConvexHull(points[:, [0, 2]])
    except (QhullError, ValueError):
        return 0.0  # fewer than three points, or all in a line
    middle = (low + high)[[0, 2]] / 2
    stands = (feet.equations @ np.append(middle, 1.0) < 0).all()
    return float(feet.volume / plan.volume) if stands else 0.0


def elect(votes: Iterable[dict[str, float]], custom: str) -> tuple[str, dict[str, int]]:
    """The axis that is up in files of one source: the clear majority's, or else the custom of the format.

    Returns:
        the axis, and how many votes each got.
    """
    cast: Counter[str] = Counter()
    for scores in votes:
        first, second, _ = sorted(scores, key=lambda axis: -scores[axis])
        if scores[first] > scores[second] + _CLEARLY:
            cast[first] += 1
    if cast:
        (best, count), *_ = cast.most_common(1)
        if count >= _MAJORITY * cast.total():
            return best, dict(cast)
    return custom, dict(cast)


def facing(world: NDArray[np.uint8]) -> str:
    """Which direction of an upright world volume should look along +x: "x", "-x", "z" or "-z".

    Such that the plane of symmetry is z = 0, if one is better than the other, and that the upper half lies behind.
    """
    across_z, across_x = iou(world, world[:, :, ::-1]), iou(world, world[::-1])
    axis = "z" if across_x > across_z + _CLEARLY else "x"
    counts = world.sum(axis=2 if axis == "x" else 0, dtype=np.float64)
    along = counts if axis == "x" else counts.T  # [along the axis, y]
    rows = np.flatnonzero(along.any(axis=0))
    upper = along[:, (rows[0] + rows[-1] + 1) // 2 :].sum(axis=1)
    at = (np.arange(len(upper)) + 0.5) / len(upper) - 0.5
    behind = float(upper @ at) / max(upper.sum(), 1.0)
    return f"-{axis}" if behind > _BEHIND else axis


def symmetry(world: NDArray[np.uint8]) -> float:
    """How far a volume is its own mirror image about z = 0: an IoU."""
    return iou(world, world[:, :, ::-1])


def check_axis(name: str, allowed: Sequence[str], option: str) -> None:
    """Raises ValueError for a name that is not allowed, naming the option."""
    if name not in allowed:
        raise ValueError(f"{option} must be one of {', '.join(allowed)}; got {name!r}")
