"""Kernels beside what one would otherwise use, on the same data in the same run: `make bench`.

Each group holds ours and a peer; the table's ratio is the figure to quote. `grid_sample` gets its coordinates for free.
"""

from __future__ import annotations

import numpy as np
import pytest
import torch

import sketchcore as sk
from sketchcore import _core

CAMERA = sk.VIEWPOINTS["quarter-037"]
BATCH = sk.generate(0, 1)
ROWS = BATCH.packed_shapes[0]
VOLUME = BATCH.world.astype(np.float32)


@pytest.fixture(autouse=True, scope="module")
def _one_thread():
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def numpy_voxels(rows: np.ndarray) -> np.ndarray:
    grid = np.zeros((64, 64, 64), np.uint8)
    centers = (np.arange(64) + 0.5) / 64 - 0.5
    for kind, op, *numbers in rows:
        center, half = np.array(numbers[:3]), np.array(numbers[3:])
        ends = [np.searchsorted(centers, (c - h, c + h)) for c, h in zip(center, half, strict=True)]
        slab = tuple(slice(lo, hi) for lo, hi in ends)
        if kind == 0:
            grid[slab] = op
            continue
        axis = int(kind) - 1
        u, v = (a for a in range(3) if a != axis)
        du, dv = (((centers[slab[a]] - center[a]) / half[a]) ** 2 for a in (u, v))
        disc = np.expand_dims(du[:, None] + dv[None, :] <= 1, axis)
        grid[slab] = np.where(disc, np.uint8(op), grid[slab])
    return grid


@pytest.mark.benchmark(group="shape -> world voxels")
def test_voxelize(benchmark):
    np.testing.assert_array_equal(benchmark(_core.voxelize, ROWS), numpy_voxels(ROWS))


@pytest.mark.benchmark(group="shape -> world voxels")
def test_voxelize_numpy(benchmark):
    benchmark(numpy_voxels, ROWS)


@pytest.mark.benchmark(group="world grid -> camera grid")
def test_to_camera_grid(benchmark):
    benchmark(_core.to_camera_grid, VOLUME, CAMERA.packed[None])


@pytest.mark.benchmark(group="world grid -> camera grid")
def test_to_camera_grid_torch(benchmark):
    depth = CAMERA.near + (np.arange(64) + 0.5) / 64 * (CAMERA.far - CAMERA.near)
    at = ((2 * np.arange(64) + 1) / 64 - 1) * np.tan(np.radians(CAMERA.fov_degrees / 2))
    rays = np.stack([*np.meshgrid(at, at), np.ones((64, 64))], axis=-1) @ CAMERA.rotation
    points = CAMERA.position + depth[:, None, None, None] * rays
    grid = torch.from_numpy(2 * points[..., ::-1].astype(np.float32).copy())[None]
    volume = torch.from_numpy(VOLUME)[None]
    made = benchmark(torch.nn.functional.grid_sample, volume, grid, align_corners=False)
    np.testing.assert_allclose(made[0, 0].numpy(), _core.to_camera_grid(VOLUME, CAMERA.packed[None])[0], atol=1e-4)


@pytest.mark.benchmark(group="one sample")
def test_draw(benchmark):
    benchmark(_core.draw, ROWS, CAMERA.packed)


@pytest.mark.benchmark(group="one sample")
def test_generate_one(benchmark):
    benchmark(sk.generate, 0, 1, threads=1)
