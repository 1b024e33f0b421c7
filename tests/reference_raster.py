"""The slow, plain NumPy twin of `rust/src/surface.rs` and `raster.rs`: every ray against every face."""

import numpy as np

import reference
from reference_solid import placed


def corner_normals(corners, crease_degrees):
    """Normals at the corners of placed faces, [faces, 3, 3], smooth within the crease angle; merged by position."""
    flat = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    sides = [np.roll(corners, -k, axis=1) - corners for k in (1, 2)]
    lengths = [np.linalg.norm(side, axis=-1) for side in sides]
    angles = np.arccos(np.clip((sides[0] * sides[1]).sum(-1) / (lengths[0] * lengths[1]), -1, 1))
    at = corners.reshape(-1, 3)
    same = (np.abs(at[:, None] - at[None]).max(axis=-1) < 1e-6).astype(float)
    own = np.repeat(flat, 3, axis=0)
    cosine = own @ own.T
    within = np.abs(cosine) >= np.cos(np.radians(crease_degrees)) - 1e-9
    weights = same * within * np.where(cosine < 0, -1, 1) * angles.reshape(-1)[None]
    summed = weights @ own
    return (summed / np.linalg.norm(summed, axis=1, keepdims=True)).reshape(-1, 3, 3)


def buffers(vertices, faces, camera, size, crease_degrees=40.0):
    """Depth [size, size] and normals [size, size, 3] of the nearest face that each pixel's ray meets, from either side.

    The depth is that of the round surface that the face stands for.

    Also how near the ray passes to an edge of that face, or of a nearer one that it misses: where that is nothing, it
    is anybody's guess which face is met.
    """
    corners = placed(vertices, faces)
    corners = corners[
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) > 0
    ]
    normals = corner_normals(corners, crease_degrees)
    rays = reference.directions(camera, size).reshape(-1, 3)
    depth, normal = np.full(len(rays), np.inf), np.zeros((len(rays), 3))
    margin, round_depth = np.full((2, len(rays)), np.inf)
    for face, at_corners in zip(corners, normals, strict=True):
        a, b, c = face - camera.position
        # Möller and Trumbore (1997).
        across = np.cross(rays, c - a)
        det = across @ (b - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = -(across @ a) / det
            v = (rays * np.cross(-a, b - a)).sum(-1) / det
            t = np.cross(-a, b - a) @ (c - a) / det
        shares = np.stack([1 - u - v, u, v], axis=1)
        least = shares.min(axis=1)
        nearer = (t > 1e-6) & (t < depth + 1e-9)
        margin = np.where(nearer & (least > -1), np.minimum(margin, np.abs(least)), margin)
        met = (least >= 0) & (t > 1e-6) & (t < depth)
        depth = np.where(met, t, depth)
        towards = shares @ at_corners * np.where((np.cross(b - a, c - a) @ a) > 0, -1, 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        # Half way up to the corners' tangent planes, along the ray (Boubekeur and Alexa, 2008).
        to_corners = face - (camera.position + rays * np.where(met, t, 0)[:, None])[:, None]
        above = (to_corners * at_corners).sum(-1)[..., None] * at_corners
        rise = 0.5 * (shares[..., None] * above).sum(axis=1)
        sine = np.minimum((towards * rays).sum(-1), -0.15 * np.linalg.norm(rays, axis=1))
        round_depth = np.where(met, t + (rise * towards).sum(-1) / sine, round_depth)
        towards -= rays * np.maximum((towards * rays).sum(-1), 0)[:, None] / (rays**2).sum(-1)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        normal = np.where(met[:, None], towards, normal)
    return round_depth.reshape(size, size), normal.reshape(size, size, 3), margin.reshape(size, size)
