"""The slow, plain NumPy twin of `rust/src/solid.rs`: rays through a mesh's faces, one face after the other."""

import numpy as np

SIDE = 64
COVER = 1.2
"""The world grid's cube is 120 % of a mesh's largest side."""


def placed(vertices, faces):
    """The corners of a mesh's faces in the world grid, [faces, 3, 3]."""
    corners = np.asarray(vertices, np.float64)[faces]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    return (corners - (low + high) / 2) / (COVER * (high - low).max())


def mesh_crossings(corners, axis):
    """Faces below each voxel along an axis: those entered minus those left, and all of them; int [64, 64, 64] each.

    In whole numbers, 2^20 to a voxel's side, so that it is exact on which side of an edge a ray passes; one that meets
    an edge passes a hair along the next axis, and by a hair of that along the one after it.
    """
    across = [(axis + 1) % 3, (axis + 2) % 3]
    at = (2 * np.arange(SIDE) + 1) * 2**19
    rays = np.stack(np.meshgrid(at, at, indexing="ij"), axis=-1)
    counts = np.zeros((2, SIDE, SIDE, SIDE + 1), int)
    for face in np.rint((corners + 0.5) * SIDE * 2**20).astype(np.int64):
        flat = face[:, across]
        ends = zip(flat.min(0), flat.max(0), strict=True)
        box = tuple(slice(np.searchsorted(at, low), np.searchsorted(at, high, "right")) for low, high in ends)
        a, b, c = np.moveaxis(flat[:, None, None] - rays[box], -1, 1)
        shares = np.stack([px * qy - py * qx for (px, py), (qx, qy) in ((b, c), (c, a), (a, b))])
        hairs = np.stack([py - qy for (_, py), (_, qy) in ((b, c), (c, a), (a, b))])
        hairs_of_hairs = np.stack([qx - px for (px, _), (qx, _) in ((b, c), (c, a), (a, b))])
        signs = np.sign(np.where(shares != 0, shares, np.where(hairs != 0, hairs, hairs_of_hairs)))
        i, j = np.nonzero(abs(signs.sum(axis=0)) == 3)
        shares = shares[:, i, j]
        first = np.searchsorted(at, face[:, axis] @ shares.astype(float) / shares.sum(axis=0))
        where = (i + box[0].start, j + box[1].start, first)
        np.add.at(counts[0], where, -signs[0, i, j])
        np.add.at(counts[1], where, 1)
    return np.moveaxis(counts.cumsum(axis=-1)[..., :SIDE], (1, 2, 3), (across[0] + 1, across[1] + 1, axis + 1))


def closed_solid(vertices, faces):
    """Where a closed mesh winds around voxels, by rays along x."""
    return (mesh_crossings(placed(vertices, faces), 0)[0] != 0).astype(np.uint8)


def voted_solid(vertices, faces):
    """What the rays along the three axes say of any mesh (rust/src/solid.rs)."""
    corners = placed(vertices, faces)
    balance, votes = np.zeros((2, SIDE, SIDE, SIDE), int)
    for axis in range(3):
        winding, crossed = mesh_crossings(corners, axis)
        total, all_ = (np.take(counts, [-1], axis) for counts in (winding, crossed))
        inside = np.where(total == 0, winding != 0, crossed % 2 == 1)
        votes += np.where((total == 0) | (all_ % 2 == 0), 2 * inside - 1, 0)
        balance += winding + (winding - total)
    return np.where(votes == 0, np.abs(balance) >= 3, votes > 0).astype(np.uint8)
