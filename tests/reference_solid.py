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

    Rays pass beside the voxels' centres, by a hair along the next axis and by a hair of that along the one after it.
    """
    across = [(axis + 1) % 3, (axis + 2) % 3]
    at = (np.arange(SIDE) + 0.5) / SIDE - 0.5
    rays = np.stack(np.meshgrid(at + 1e-7, at + 1e-11, indexing="ij"), axis=-1)
    counts = np.zeros((2, SIDE, SIDE, SIDE + 1), int)
    for face in corners:
        flat = face[:, across]
        box = tuple(
            slice(*np.searchsorted(at, ends)) for ends in zip(flat.min(0) - 1e-7, flat.max(0) + 1e-7, strict=True)
        )
        (ax, ay), (bx, by), (cx, cy) = np.moveaxis(flat[:, None, None] - rays[box], -1, 1)
        shares = np.stack([bx * cy - by * cx, cx * ay - cy * ax, ax * by - ay * bx])
        i, j = np.nonzero((shares > 0).all(axis=0) | (shares < 0).all(axis=0))
        shares = shares[:, i, j]
        first = np.searchsorted(at, face[:, axis] @ shares / shares.sum(axis=0))
        where = (i + box[0].start, j + box[1].start, first)
        np.add.at(counts[0], where, -np.sign(shares.sum(axis=0)).astype(int))
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
