"""The twins of frusta and tori: of what they hold, where rays cross their surfaces, and how those face."""

import numpy as np
from hypothesis import strategies as st

from sketchcore.shape import Frustum, Torus


def primitives(op):
    """Frusta and tori, off any lattice: no centre of a voxel lies in their surface, where rounding would decide."""

    def off(low, high):
        return st.integers(int(np.ceil(low * 997)), int(np.floor(high * 997))).map(lambda k: k / 997)

    center, half = st.tuples(*[off(-0.3, 0.3)] * 3), st.tuples(*[off(0.03, 0.22)] * 3)
    axis, shear = st.sampled_from("xyz"), st.tuples(*[off(-0.2, 0.2)] * 2)
    taper = st.sampled_from([-1.0, 0.0, 1.0]) | off(-0.9, 0.9)
    tapers = st.tuples(taper, taper)
    square = st.builds(Frustum, center, half, axis, shear, tapers, st.just(False), op)
    round_ = st.builds(Frustum, center, half, axis, shear, taper, st.just(True), op)
    arc = st.tuples(off(-180, 180), off(10, 350) | st.sampled_from([180.0, 360.0])).map(lambda a: (a[0], a[0] + a[1]))
    tube = off(0.05, 0.49) | st.just(0.5)
    return square | round_ | st.builds(Torus, center, half, axis, tube, arc, op)


def holds(primitive, points):
    """Whether each point lies in a frustum or a torus, its surface included."""
    parts = (points - np.array(primitive.center)) / np.array(primitive.half)
    within = np.abs(points - np.array(primitive.center)) <= np.array(primitive.half)
    axis = "xyz".index(primitive.axis)
    across = [a for a in range(3) if a != axis]
    if isinstance(primitive, Frustum):
        up = parts[..., axis, None]
        middle, size = np.array(primitive.shear) * up, np.array(primitive.half)[across] * (1 + primitive.taper * up)
        away = (points - np.array(primitive.center))[..., across] - middle
        if not primitive.round:
            return within[..., axis] & (np.abs(away) <= size).all(axis=-1)
        with np.errstate(divide="ignore", invalid="ignore"):
            return within[..., axis] & (((away / size) ** 2).sum(axis=-1) <= 1.0)
    out = np.hypot(parts[..., across[0]], parts[..., across[1]]) - (1 - primitive.tube)
    angle = np.degrees(np.arctan2(parts[..., across[1]], parts[..., across[0]]))
    reached = (angle - primitive.arc[0]) % 360 <= primitive.arc[1] - primitive.arc[0]
    return ((out / primitive.tube) ** 2 + parts[..., axis] ** 2 <= 1.0) & reached


def crossings(primitive, eye, rays):
    """Depths at which rays [n, 3] cross surfaces of a primitive; the eye is told from its centre."""
    cross = _frustum_crossings if isinstance(primitive, Frustum) else _torus_crossings
    return cross(primitive, eye, rays)


def _frustum_crossings(frustum, eye, rays):
    """Depths at which rays cross the planes of the ends and the sides, or the cone."""
    axis = "xyz".index(frustum.axis)
    across = [a for a in range(3) if a != axis]
    half = np.array(frustum.half)
    depths = [(side * half[axis] - eye[axis]) / rays[:, axis] for side in (-1, 1)]
    shift, growth = np.array(frustum.shear) / half[axis], np.array(frustum.taper) / half[axis]
    # The offset from the middle, and the size, in half sizes of the middle section; each at the eye and for each ray.
    off = [((at[..., a] - shift[k] * at[..., axis]) / half[a]) for k, a in enumerate(across) for at in (eye, rays)]
    size = [growth[k] * at[..., axis] + (at is eye) for k in (0, 1) for at in (eye, rays)]
    if frustum.round:
        a = off[1] ** 2 + off[3] ** 2 - size[1] ** 2
        b = 2 * (off[0] * off[1] + off[2] * off[3] - size[0] * size[1])
        c = off[0] ** 2 + off[2] ** 2 - size[0] ** 2
        q = -0.5 * (b + np.copysign(np.sqrt(b * b - 4 * a * c), b))
        return [*depths, q / a, c / q]
    return depths + [(size[k] - side * off[k]) / (side * off[k + 1] - size[k + 1]) for k in (0, 2) for side in (-1, 1)]


def _torus_crossings(torus, eye, rays):
    """The real parts of all roots of the quartic: those that are no crossings do no harm. And the ends of an arc."""
    axis = "xyz".index(torus.axis)
    order = [*(a for a in range(3) if a != axis), axis]
    o, d = (eye / torus.half)[order], (rays / torus.half)[:, order]
    ends = [np.radians(degrees) for degrees in torus.arc]
    planes = [-(o[0] * np.sin(e) - o[1] * np.cos(e)) / (d[:, 0] * np.sin(e) - d[:, 1] * np.cos(e)) for e in ends]
    o, d = o * (1, 1, torus.tube), d * (1, 1, torus.tube)
    nearest = -(d @ o) / (d * d).sum(axis=1)
    o = o + nearest[:, None] * d
    dd, do, oo = (d * d).sum(axis=1), (d * o).sum(axis=1), (o * o).sum(axis=1)
    middle = 1 - torus.tube
    rest = oo + middle**2 - torus.tube**2
    flat = [(p[:, :2] * q[:, :2]).sum(axis=1) for p, q in ((d, d), (d, o), (o, o))]
    monic = np.stack(
        [
            4 * dd * do,
            2 * dd * rest + 4 * do**2 - 4 * middle**2 * flat[0],
            4 * do * rest - 8 * middle**2 * flat[1],
            rest**2 - 4 * middle**2 * flat[2],
        ],
        axis=1,
    ) / (dd**2)[:, None]  # fmt: skip
    companion = np.zeros((len(rays), 4, 4))
    companion[:, 1:, :3] = np.eye(3)
    companion[:, :, 3] = -monic[:, ::-1]
    roots = np.linalg.eigvals(companion).real + nearest[:, None]
    return [*planes, *roots.T]


def fields(primitive, at):
    """For each surface a function that is 0 on it, [m, ...], at offsets from the centre."""
    return (_frustum_fields if isinstance(primitive, Frustum) else _torus_fields)(primitive, at)


def _frustum_fields(frustum, at):
    axis = "xyz".index(frustum.axis)
    across = [a for a in range(3) if a != axis]
    up = at[..., axis] / frustum.half[axis]
    off = [(at[..., a] - frustum.shear[k] * up) / frustum.half[a] for k, a in enumerate(across)]
    size = [1 + frustum.taper[k] * up for k in (0, 1)]
    if frustum.round:
        return np.stack([up - 1, up + 1, off[0] ** 2 + off[1] ** 2 - size[0] ** 2])
    return np.stack([up - 1, up + 1, *(off[k] + side * size[k] for k in (0, 1) for side in (-1, 1))])


def _torus_fields(torus, at):
    axis = "xyz".index(torus.axis)
    u, v = ((at / torus.half)[..., a] for a in range(3) if a != axis)
    tube = ((np.hypot(u, v) - 1 + torus.tube) / torus.tube) ** 2 + (at[..., axis] / torus.half[axis]) ** 2 - 1
    whole = torus.arc[1] - torus.arc[0] >= 360
    ends = [] if whole else [u * np.sin(e) - v * np.cos(e) for e in np.radians(torus.arc)]
    return np.stack([tube, *ends])
