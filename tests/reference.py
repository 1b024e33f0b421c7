"""Slow, plain NumPy twins of the Rust kernels, written from the conventions; and random inputs for both.

The twins know nothing of how the kernels work: a shape along a ray is found by asking every stretch between two
surfaces whether its middle is inside, resampling is SciPy's, so are floods and distances.
"""

import numpy as np
from hypothesis import strategies as st
from scipy import ndimage

import reference_slanted
from sketchcore.camera import Camera
from sketchcore.shape import Cuboid, Cylinder, Frustum, Shape, Torus, Wedge

SIDE = 64
IMAGE = 256
SLIVER = 1e-9
"""Stretches of a ray shorter than this are rounding, not geometry (world units)."""


# --- random inputs -----------------------------------------------------------------------------------------------


def _numbers(low, high):
    # Every other number on a coarse lattice, so that faces coincide.
    snapped = st.integers(int(np.ceil(low * 32)), int(np.floor(high * 32))).map(lambda k: k / 32)
    return st.floats(low, high) | snapped


def primitives():
    center = st.tuples(*[_numbers(-0.3, 0.3)] * 3)
    half = st.tuples(*[_numbers(0.03, 0.22)] * 3)
    op = st.sampled_from(["add", "add", "subtract"])
    axis, corner = st.sampled_from("xyz"), st.tuples(*[st.sampled_from([-1, 1])] * 2)
    cuboid = st.builds(Cuboid, center, half, op)
    plain = cuboid | st.builds(Cylinder, center, half, axis, op) | st.builds(Wedge, center, half, axis, corner, op)
    return plain | reference_slanted.primitives(op)


def shapes(most=6):
    return st.lists(primitives(), min_size=1, max_size=most).map(Shape)


def _camera(azimuth, elevation, roll, distance, offset, fov, near, length):
    camera = Camera.orbit(azimuth, elevation, distance)
    c, s = np.cos(roll), np.sin(roll)
    rotation = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ camera.rotation
    return Camera(camera.position + np.array(offset), rotation, fov, near, near + length)


def cameras():
    """Cameras outside every shape of `shapes`, at all angles, some of them seeing only a part."""
    return st.builds(
        _camera,
        st.floats(0, 360),
        st.floats(-85, 85),
        st.floats(-0.5, 0.5),
        st.floats(1.6, 2.4),
        st.tuples(*[st.floats(-0.2, 0.2)] * 3),
        st.floats(30, 60),
        st.floats(1.0, 1.5),
        st.floats(1.0, 2.0),
    )


# --- shapes ------------------------------------------------------------------------------------------------------


def voxel_centers(side=SIDE, step=1):
    """World positions of a grid's voxels, [side, side, side, 3]; of every so many-th plane alone."""
    at = (np.arange(side) + 0.5) / side - 0.5
    return np.stack(np.meshgrid(at[::step], at, at, indexing="ij"), axis=-1)


def holds(primitive, points):
    """Whether each point lies in the primitive, its surface included."""
    parts = (points - np.array(primitive.center)) / np.array(primitive.half)
    within = np.abs(points - np.array(primitive.center)) <= np.array(primitive.half)
    if isinstance(primitive, Cuboid):
        return within.all(axis=-1)
    axis = "xyz".index(primitive.axis)
    across = [a for a in range(3) if a != axis]
    if isinstance(primitive, Frustum | Torus):
        return reference_slanted.holds(primitive, points)
    if isinstance(primitive, Wedge):
        # The section's corners lie at (1, 1) and (-1, -1) as seen from the right angle: the diagonal is in between.
        return within.all(axis=-1) & ((parts[..., across] * primitive.corner).sum(axis=-1) >= 0.0)
    return within[..., axis] & ((parts[..., across] ** 2).sum(axis=-1) <= 1.0)


def contains(shape, points):
    """Whether the last primitive that holds a point is additive."""
    inside = np.zeros(points.shape[:-1], bool)
    for primitive in shape.primitives:
        inside[holds(primitive, points)] = primitive.op == "add"
    return inside


def voxelize(shape):
    return contains(shape, voxel_centers()).astype(np.uint8)


# --- rays --------------------------------------------------------------------------------------------------------


def directions(camera, size):
    """The ray through the middle of each pixel, one unit of depth long: [size, size, 3] (row, col)."""
    at = ((np.arange(size) + 0.5) / size * 2 - 1) * np.tan(np.radians(camera.fov_degrees) / 2)
    x, y = np.meshgrid(at, at)
    return np.stack([x, y, np.ones_like(x)], axis=-1) @ camera.rotation


def slanted(wedge):
    """Unit normal of a wedge's slanted face, outwards: at right angles to its axis and to the diagonal it lies on."""
    axis = "xyz".index(wedge.axis)
    u, v = (a for a in range(3) if a != axis)
    along = np.zeros(3)
    along[[u, v]] = wedge.half[u] * wedge.corner[0], -wedge.half[v] * wedge.corner[1]
    normal = np.cross(np.eye(3)[axis], along)
    away = np.zeros(3)
    away[[u, v]] = wedge.corner
    return -np.sign(normal @ away) * normal / np.linalg.norm(normal)


def _crossings(shape, origin, rays):
    """Depths at which rays [n, 3] cross the planes and curved surfaces of all primitives: sorted, [n, m]."""
    depths = [np.zeros(len(rays))]
    with np.errstate(divide="ignore", invalid="ignore"):
        for primitive in shape.primitives:
            center, half = np.array(primitive.center), np.array(primitive.half)
            if isinstance(primitive, Frustum | Torus):
                depths += reference_slanted.crossings(primitive, origin - center, rays)
                continue
            flat, across = range(3), []
            if isinstance(primitive, Cylinder):
                flat = ["xyz".index(primitive.axis)]
                across = [a for a in range(3) if a not in flat]
            for axis in flat:
                for side in (-1, 1):
                    depths.append((center[axis] + side * half[axis] - origin[axis]) / rays[:, axis])
            if across:
                o, d = ((origin - center) / half)[across], (rays / half)[:, across]
                a, b, c = (d * d).sum(axis=1), 2 * (d @ o), o @ o - 1
                root = np.sqrt(b * b - 4 * a * c)
                depths += [(-b - root) / (2 * a), (-b + root) / (2 * a)]
            if isinstance(primitive, Wedge):
                across = slanted(primitive)
                depths.append((center - origin) @ across / (rays @ across))
    found = np.stack(depths, axis=1)
    found[~(np.isfinite(found) & (found > 0))] = 0.0
    return np.sort(found, axis=1)


def stretches(shape, camera, rays):
    """Where rays [n, 3] are inside the shape: depths `start`, `end` and truth values, each [n, m]."""
    depths = _crossings(shape, camera.position, rays)
    start, end = depths[:, :-1], depths[:, 1:]
    points = camera.position + rays[:, None] * (0.5 * (start + end))[..., None]
    return start, end, contains(shape, points) & (end - start > SLIVER)


def depth(shape, camera, size):
    """Depth buffer, float64 [size, size], infinite where nothing is seen."""
    start, _, inside = stretches(shape, camera, directions(camera, size).reshape(-1, 3))
    first = np.argmax(inside, axis=1)
    hit = np.where(inside.any(axis=1), start[np.arange(len(start)), first], np.inf)
    return hit.reshape(size, size)


def normals(shape, camera, hits):
    """For each primitive, the normal [size, size, 3] of its nearest face where the hits are on its surface, else 0.

    On its surface: a step along the ray from before the hit to behind it enters or leaves the primitive.
    """
    rays = directions(camera, len(hits))
    seen = np.isfinite(hits)
    t = np.where(seen, hits, 1.0)[..., None]
    result = []
    for primitive in shape.primitives:
        if isinstance(primitive, Frustum | Torus):
            result.append(_nearest_normal(primitive, camera, rays, t, seen))
            continue
        center, half = np.array(primitive.center), np.array(primitive.half)
        before, behind = (holds(primitive, camera.position + rays * (t + d)) for d in (-1e-7, 1e-7))
        at = camera.position + rays * t - center
        off = np.abs(np.abs(at) - half)
        normal = np.zeros_like(at)
        if isinstance(primitive, Cylinder):
            axis = "xyz".index(primitive.axis)
            across = [a for a in range(3) if a != axis]
            radius = np.linalg.norm((at / half)[..., across], axis=-1)
            curved = np.abs(radius - 1) * half[across].min() < off[..., axis]
            gradient = np.where(np.isin(np.arange(3), across), at / half**2, 0.0)
            normal[curved] = (gradient / np.linalg.norm(gradient, axis=-1, keepdims=True))[curved]
            normal[..., axis][~curved] = 1.0
        else:
            np.put_along_axis(normal, off.argmin(axis=-1)[..., None], 1.0, axis=-1)
            if isinstance(primitive, Wedge):
                # Not where the ray runs along it: then it came in by the other face at that edge.
                slant = (np.abs(at @ slanted(primitive)) < off.min(axis=-1)) & (
                    np.abs(rays @ slanted(primitive)) > SLIVER
                )
                normal[slant] = slanted(primitive)
        normal[(before == behind) | ~seen] = 0.0
        away = (normal * rays).sum(axis=-1) > 0
        result.append(np.where(away[..., None], -normal, normal))
    return result


def _nearest_normal(primitive, camera, rays, t, seen):
    """The normal of the nearest surface of a frustum or a torus, where a step along the ray enters or leaves it."""
    before, behind = (holds(primitive, camera.position + rays * (t + d)) for d in (-1e-7, 1e-7))
    at = camera.position + rays * t - np.array(primitive.center)
    step = 1e-6
    # Each field is 0 on one surface: over the length of its gradient it is the distance.
    values = reference_slanted.fields(primitive, at)
    slopes = [
        (reference_slanted.fields(primitive, at + e) - reference_slanted.fields(primitive, at - e)) / (2 * step)
        for e in step * np.eye(3)
    ]
    gradients = np.stack(slopes, axis=-1)
    lengths = np.linalg.norm(gradients, axis=-1)
    nearest = (np.abs(values) / np.maximum(lengths, 1e-12)).argmin(axis=0)[None]
    normal = np.take_along_axis(gradients / np.maximum(lengths, 1e-12)[..., None], nearest[..., None], axis=0)[0]
    normal[(before == behind) | ~seen] = 0.0
    away = (normal * rays).sum(axis=-1) > 0
    return np.where(away[..., None], -normal, normal)


def frustum(shape, camera, rays):
    """Share of each cell inside, float64 [64, 64, 64]: exact along depth, rays x rays rays a cell across."""
    size = SIDE * rays
    start, end, inside = stretches(shape, camera, directions(camera, size).reshape(-1, 3))
    to_slices = SIDE / (camera.far - camera.near)
    start, end = ((d - camera.near) * to_slices for d in (start, end))
    share = np.empty((SIDE, len(start)))
    for k in range(SIDE):
        share[k] = (np.clip(np.minimum(end, k + 1) - np.maximum(start, k), 0, 1) * inside).sum(axis=1)
    return share.reshape(SIDE, SIDE, rays, SIDE, rays).mean(axis=(2, 4))


def cell_volumes(camera):
    """World volume of a camera-grid cell of each slice, [64]: a slab of the pyramid through the eye, cut up."""
    edges = np.linspace(camera.near, camera.far, SIDE + 1)
    side = 2 * np.tan(np.radians(camera.fov_degrees) / 2) / SIDE
    return side**2 * np.diff(edges**3) / 3


# --- lines -------------------------------------------------------------------------------------------------------


def lines(depth, normal, depth_step=0.006, crease_degrees=30.0, slack=0.0):
    """Ink by the rules: outlines, second differences of inverse depth, angles between normals.

    `slack` moves both thresholds (1 / world units, and cosine) towards less ink; negative, towards more.
    """
    near = np.pad(1.0 / depth.astype(np.float64), 1)
    here = near[1:-1, 1:-1]
    left, right, above, below = near[1:-1, :-2], near[1:-1, 2:], near[:-2, 1:-1], near[2:, 1:-1]
    seen = here > 0
    ink = np.minimum.reduce([left, right, above, below]) == 0
    ink |= 2 * here - left - right > depth_step + slack
    ink |= 2 * here - above - below > depth_step + slack
    ink &= seen
    normal = normal.astype(np.float64)
    for axis in (0, 1):
        first = tuple(slice(None, -1) if a == axis else slice(None) for a in (0, 1))
        second = tuple(slice(1, None) if a == axis else slice(None) for a in (0, 1))
        cosine = (normal[first] * normal[second]).sum(axis=-1)
        crease = (cosine < np.cos(np.radians(crease_degrees)) - slack) & seen[first] & seen[second]
        # The nearer pixel carries the line; of two equally near ones the face that faces more up, then +x, then +z.
        step = here[second] - here[first]
        facing = normal @ np.array([0.32, 1.0, 0.11])
        order = facing[first] - facing[second]
        level = np.abs(step) <= depth_step - slack
        ink[second] |= crease & ((step > depth_step + slack) | (level & (order < -slack)))
        ink[first] |= crease & ((step < -depth_step - slack) | (level & (order >= slack)))
        if slack < 0:  # too close to call: either may have it
            close = crease & ((np.abs(np.abs(step) - depth_step) <= -slack) | (level & (np.abs(order) <= -slack)))
            ink[first] |= close
            ink[second] |= close
    return ink


# --- volumes -----------------------------------------------------------------------------------------------------


def cell_centers(camera, side=SIDE, step=1):
    """World positions of a camera grid's cells, [side, side, side, 3] (depth, row, col); of every so many-th slice."""
    depths = camera.near + (np.arange(side) + 0.5)[::step] / side * (camera.far - camera.near)
    return camera.position + directions(camera, side)[None] * depths[:, None, None, None]


def _trilinear(volume, at):
    # `at` in cells, cell i centred on i; zeros all around the volume.
    volume = volume.astype(np.float64)
    return ndimage.map_coordinates(volume, np.moveaxis(at, -1, 0), order=1, mode="grid-constant", cval=0.0)


def to_camera_grid(volume, camera, step=1):
    """Every so many-th slice of the camera grid."""
    side = len(volume)
    return _trilinear(volume, (cell_centers(camera, side, step) + 0.5) * side - 0.5)


def to_world_grid(volume, camera, into, step=1):
    """Every so many-th plane resampled, and how far its voxels lie from the frustum's border, in cells."""
    side = len(volume)
    p = (voxel_centers(side, step) - camera.position) @ camera.rotation.T
    half = np.tan(np.radians(camera.fov_degrees) / 2)
    slice_ = (p[..., 2] - camera.near) / (camera.far - camera.near) * side
    row, col = ((p[..., a] / (p[..., 2] * half) + 1) / 2 * side for a in (1, 0))
    at = np.stack([slice_, row, col], axis=-1)
    inside = ((at >= 0) & (at <= side)).all(axis=-1)
    margin = np.minimum(np.abs(at), np.abs(at - side)).min(axis=-1)
    return np.where(inside, _trilinear(volume, at - 0.5), into), margin


# --- drawings ----------------------------------------------------------------------------------------------------

FURTHER = 1000.0
"""Stands for the distance to what is nowhere."""


def distance_to(mask):
    """Distance in pixels from each pixel to the nearest one that is set."""
    return ndimage.distance_transform_edt(~mask) if mask.any() else np.full(mask.shape, FURTHER)


def outside(open_):
    """Pixels that a flood from the image's border reaches over open four-connected neighbours."""
    labels, _ = ndimage.label(open_)
    border = np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]])
    return np.isin(labels, border[border > 0])


def silhouette(drawing):
    """What the flood does not reach, the lines thickened by the least radius (up to 14) that leaves no leak.

    A leak is a pixel that is further from ink than the least radius that keeps the flood away from it, by more than 1.
    """
    ink = drawing >= 64
    squares = np.rint(distance_to(ink) ** 2)
    ways = np.full(ink.shape, np.inf)
    for square in np.unique(squares[squares <= 14**2]):
        ways[~outside(squares > square) & np.isinf(ways)] = square
    leaks = (ways > 0) & np.isfinite(ways) & (np.sqrt(np.minimum(squares, 17**2)) > np.sqrt(ways) + 1)
    radius = ways[leaks].max(initial=0)
    flooded = outside(squares > radius)
    return ink | ((np.rint(distance_to(flooded) ** 2) > radius) if radius else ~flooded)


def project(camera, points):
    """Pixel coordinates (x, y) [..., 2] of world points in the 256^2 image, and their depth."""
    p = (points - camera.position) @ camera.rotation.T
    half = np.tan(np.radians(camera.fov_degrees) / 2)
    return (p[..., :2] / (p[..., 2:] * half) + 1) / 2 * IMAGE, p[..., 2]


def look_up(image, camera, points, slack):
    """The least and the greatest value (0 beyond the image) of the pixels that a point may fall into.

    Points that fall closer than `slack` pixels to the border between pixels may fall to either side.
    """
    at, depths = project(camera, points)
    padded = np.pad(image.astype(np.int16), 1)
    found = []
    for dx, dy in ((-slack, -slack), (-slack, slack), (slack, -slack), (slack, slack)):
        x = np.clip(np.floor(at[..., 0] + dx), -1, IMAGE).astype(int) + 1
        y = np.clip(np.floor(at[..., 1] + dy), -1, IMAGE).astype(int) + 1
        found.append(np.where(depths > 0, padded[y, x], 0))
    return np.minimum.reduce(found), np.maximum.reduce(found)


def carve(silhouettes, cameras):
    """A voxel stays while its centre falls into every silhouette: at least these, and at most those."""
    pairs = [look_up(s, c, voxel_centers(), 1e-9) for s, c in zip(silhouettes, cameras, strict=True)]
    return np.minimum.reduce([low for low, _ in pairs]), np.minimum.reduce([high for _, high in pairs])


def fields(drawing):
    """Evidence fields, uint8 [256, 256, 2]: signed distance to the silhouette's border, nearness to ink."""
    inside = silhouette(drawing)
    signed = np.where(inside, distance_to(~inside) - 0.5, 0.5 - distance_to(inside))
    nearness = 255 - 16 * distance_to(drawing >= 64)
    return np.round(np.clip(np.stack([128 + 8 * signed, nearness], axis=-1), 0, 255)).astype(np.uint8)


def half_centers(side):
    """Centres of the cells at z > 0 of a world grid with `side` cells along x, [side, side, side / 2, 3]."""
    at = (np.arange(side) + 0.5) / side - 0.5
    return np.stack(np.meshgrid(at, at, at[side // 2 :], indexing="ij"), axis=-1)


MIRROR = np.array([1.0, 1.0, -1.0])


def evidence(fields, cameras, slack=5e-4):
    """Hull, mean and least nearness, [3, 64, 64, 32], at z > 0: the least they may be, and the greatest."""
    seen = [(f, c, half_centers(SIDE) * m) for f, c in zip(fields, cameras, strict=True) for m in (1, MIRROR)]
    signed, nearness = (np.array([look_up(f[..., k], c, points, slack) for f, c, points in seen]) for k in (0, 1))
    bounds = np.stack([signed.min(axis=0), nearness.mean(axis=0), nearness.min(axis=0)], axis=1)
    return bounds[0], bounds[1]


# --- feature volumes ---------------------------------------------------------------------------------------------

PLANE = 64
BINS = 16
COARSE = 32


def feature_places(camera, points):
    """Where points lie in the feature volume, [..., 3]: row, column, bin, with centres at whole numbers.

    Depth stays within the outermost bins' centres. What is behind the eye has no place: NaN.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        at, depths = project(camera, points)
    col, row = (at[..., k] * PLANE / IMAGE - 0.5 for k in (0, 1))
    bin_ = (depths - camera.near) / (camera.far - camera.near) * BINS - 0.5
    places = np.stack([row, col, np.clip(bin_, 0, BINS - 1)], axis=-1)
    return np.where(depths[..., None] > 0, places, np.nan)


def lift(features, camera):
    """Features [65536, width] as the cells at z > 0 read them: own place, then mirror image's; [16384, 2 * width]."""
    volume = features.reshape(PLANE, PLANE, BINS, -1)
    readings = []
    for side in (1, MIRROR):
        at = feature_places(camera, half_centers(COARSE) * side)
        at = np.clip(np.where(np.isnan(at), -2, at), -2, PLANE + 2)
        readings += [_trilinear(volume[..., k], at).ravel() for k in range(volume.shape[-1])]
    return np.stack(readings, axis=-1)
