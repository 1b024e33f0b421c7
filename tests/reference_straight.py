"""The slow twin of `rust/src/straight.rs`: singular values, splines of SciPy, least squares of NumPy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from sketchcore.strokes import trace

Points = NDArray[np.float64]


def straight(drawing: NDArray[np.uint8]) -> Points:
    """float64 [n, 5]: both ends (x, y) of each straight piece, and by how much it bends."""
    pieces = [piece for stroke in trace(drawing) for piece in _split(stroke + 0.5)]
    measured = [_measured(drawing, *piece) for piece in pieces]
    return np.array([one for one in measured if one is not None]).reshape(-1, 5)


def _split(points: Points) -> list[tuple[Points, Points]]:
    if len(points) < 4:
        return []
    chord = points[-1] - points[0]
    length = np.hypot(*chord)
    if length < 8:
        half = len(points) // 2
        return _split(points[: half + 1]) + _split(points[half:]) if len(points) > 24 else []
    inner = points[1:-1] if len(points) > 8 else points
    middle = inner.mean(axis=0)
    along = np.linalg.svd(inner - middle)[2][0]
    if along[0] < 0 or (along[0] == 0 and along[1] < 0):
        along = -along
    if np.abs((points - middle) @ (-along[1], along[0])).max() <= 0.9:
        places = (inner - middle) @ along
        if places.max() - places.min() < 8:
            return []
        return [(middle + places.min() * along, middle + places.max() * along)]
    cut = int(np.argmax(np.abs((points - points[0]) @ (-chord[1], chord[0]))))
    if cut < 3 or cut + 4 > len(points):
        cut = len(points) // 2
    return _split(points[: cut + 1]) + _split(points[cut:])


def _measured(drawing: NDArray[np.uint8], start: Points, end: Points) -> Points | None:
    length = np.hypot(*(end - start))
    along = (end - start) / length
    across = np.array([-along[1], along[0]])
    places = np.arange(1.0, length - 0.99, 0.5)
    offsets = np.linspace(-2.5, 2.5, 11)
    at = (start + places[:, None] * along)[:, None] + offsets[:, None] * across
    ink = map_coordinates(
        drawing.astype(np.float64), [at[..., 1] - 0.5, at[..., 0] - 0.5], order=1, mode="grid-constant"
    )
    total = ink.sum(axis=1)
    middle = (ink @ offsets) / np.maximum(total, 1e-9)
    spread = np.sqrt(np.maximum((ink @ offsets**2) / np.maximum(total, 1e-9) - middle**2, 0))
    if not len(places):
        return None
    kept = (total > 0.3 * np.median(total)) & (total < 1.35 * np.median(total))
    kept &= spread < 1.3 * np.median(spread) + 0.1
    if kept.sum() < 10:
        return None
    u = 2 * places / length - 1
    basis = np.stack([np.ones_like(u), u, u**2 - 1 / 3], axis=1)
    for _ in range(3):
        bow = np.linalg.lstsq(basis[kept], middle[kept], rcond=None)[0]
        off = np.abs(middle - basis @ bow)
        fewer = kept & (off < max(0.2, 2.5 * np.median(off[kept])))
        if (fewer == kept).all() or fewer.sum() < 10:
            break
        kept = fewer
    ends = np.stack([start + (bow[0] - bow[1]) * across, end + (bow[0] + bow[1]) * across])
    long = np.hypot(*(ends[1] - ends[0]))
    if np.ptp(u[kept]) < 1.2 or long < 10 or abs(bow[2]) >= 0.06 * long:
        return None
    return np.array([*ends.ravel(), abs(bow[2])])
