"""World grid to camera grid and back: by torch with coordinates at hand, by Numba with both steps in one loop."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from sketchcore.camera import Camera

SIDE = 64
Floats = NDArray[np.float32]
Resampler = Callable[[Floats], Floats]


def torch_resampling(camera: Camera) -> tuple[Resampler, Resampler]:
    """`grid_sample` to the camera grid, and to the world grid; its coordinates are computed beforehand."""
    half = math.tan(math.radians(camera.fov_degrees / 2))
    at = (2 * np.arange(SIDE) + 1) / SIDE - 1
    depths = camera.near + (at + 1) / 2 * (camera.far - camera.near)
    rays = np.stack([*np.meshgrid(at * half, at * half), np.ones((SIDE, SIDE))], axis=-1) @ camera.rotation
    cells = camera.position + depths[:, None, None, None] * rays
    # grid_sample counts from -1 to 1, the last axis first.
    to_camera = 2 * cells[..., ::-1]
    world = np.stack(np.meshgrid(at / 2, at / 2, at / 2, indexing="ij"), axis=-1)
    x, y, z = np.moveaxis((world - camera.position) @ camera.rotation.T, -1, 0)
    to_world = np.stack([x / z / half, y / z / half, 2 * (z - camera.near) / (camera.far - camera.near) - 1], axis=-1)
    # Outside the frustum nothing is read.
    to_world[(np.abs(to_world) > 1).any(axis=-1)] = 9.0
    return _sampler(to_camera), _sampler(to_world)


def _sampler(places: NDArray[np.float64]) -> Resampler:
    grid = torch.from_numpy(np.ascontiguousarray(places, np.float32))[None]

    def resample(volume: Floats) -> Floats:
        with torch.inference_mode():
            made = torch.nn.functional.grid_sample(torch.from_numpy(volume)[None, None], grid, align_corners=False)
        values: Floats = made[0, 0].numpy()
        return values

    return resample


def numba_resampling(camera: Camera) -> tuple[Resampler, Resampler]:
    """Loops compiled by Numba: to the camera grid, and to the world grid."""
    import numba

    compiled = numba.njit(fastmath=True, error_model="numpy")

    def trilinear(volume: Floats, x: float, y: float, z: float) -> Any:
        i, j, k = math.floor(x), math.floor(y), math.floor(z)
        fx, fy, fz = np.float32(x - i), np.float32(y - j), np.float32(z - k)
        if 0 <= i < SIDE - 1 and 0 <= j < SIDE - 1 and 0 <= k < SIDE - 1:
            a = volume[i, j, k] + fz * (volume[i, j, k + 1] - volume[i, j, k])
            b = volume[i, j + 1, k] + fz * (volume[i, j + 1, k + 1] - volume[i, j + 1, k])
            c = volume[i + 1, j, k] + fz * (volume[i + 1, j, k + 1] - volume[i + 1, j, k])
            d = volume[i + 1, j + 1, k] + fz * (volume[i + 1, j + 1, k + 1] - volume[i + 1, j + 1, k])
            low, high = a + fy * (b - a), c + fy * (d - c)
            return low + fx * (high - low)
        total = np.float32(0)
        for di in range(2):
            for dj in range(2):
                for dk in range(2):
                    p, q, r = i + di, j + dj, k + dk
                    if 0 <= p < SIDE and 0 <= q < SIDE and 0 <= r < SIDE:
                        wx, wy, wz = (fx if di else 1 - fx), (fy if dj else 1 - fy), (fz if dk else 1 - fz)
                        total += volume[p, q, r] * wx * wy * wz
        return total

    read = compiled(trilinear)

    def to_camera(volume: Floats, eye: Floats, axes: Floats, half: float, near: float, step: float) -> Floats:
        out = np.empty((SIDE, SIDE, SIDE), np.float32)
        for s in range(SIDE):
            depth = np.float32(near + (s + 0.5) * step)
            for row in range(SIDE):
                v = np.float32((2 * row + 1) / SIDE - 1) * half * depth
                for col in range(SIDE):
                    u = np.float32((2 * col + 1) / SIDE - 1) * half * depth
                    x = eye[0] + u * axes[0, 0] + v * axes[1, 0] + depth * axes[2, 0]
                    y = eye[1] + u * axes[0, 1] + v * axes[1, 1] + depth * axes[2, 1]
                    z = eye[2] + u * axes[0, 2] + v * axes[1, 2] + depth * axes[2, 2]
                    if (
                        -0.5 - 1 / 128 < x < 0.5 + 1 / 128
                        and -0.5 - 1 / 128 < y < 0.5 + 1 / 128
                        and abs(z) < 0.5 + 1 / 128
                    ):
                        out[s, row, col] = read(volume, x * SIDE + 31.5, y * SIDE + 31.5, z * SIDE + 31.5)
                    else:
                        out[s, row, col] = 0
        return out

    def to_world(volume: Floats, eye: Floats, axes: Floats, half: float, near: float, step: float) -> Floats:
        out = np.empty((SIDE, SIDE, SIDE), np.float32)
        scale = np.float32(SIDE / 2) / half
        for i in range(SIDE):
            px = np.float32((i + 0.5) / SIDE - 0.5) - eye[0]
            for j in range(SIDE):
                py = np.float32((j + 0.5) / SIDE - 0.5) - eye[1]
                for k in range(SIDE):
                    pz = np.float32((k + 0.5) / SIDE - 0.5) - eye[2]
                    depth = px * axes[2, 0] + py * axes[2, 1] + pz * axes[2, 2]
                    over = scale / depth
                    col = (px * axes[0, 0] + py * axes[0, 1] + pz * axes[0, 2]) * over + np.float32(SIDE / 2)
                    row = (px * axes[1, 0] + py * axes[1, 1] + pz * axes[1, 2]) * over + np.float32(SIDE / 2)
                    s = (depth - near) / step
                    if 0 <= s <= SIDE and 0 <= row <= SIDE and 0 <= col <= SIDE:
                        out[i, j, k] = read(volume, s - 0.5, row - 0.5, col - 0.5)
                    else:
                        out[i, j, k] = 0
        return out

    eye, axes = camera.position.astype(np.float32), camera.rotation.astype(np.float32)
    half = np.float32(math.tan(math.radians(camera.fov_degrees / 2)))
    near, step = np.float32(camera.near), np.float32((camera.far - camera.near) / SIDE)

    def bound(kernel: Any) -> Resampler:
        return lambda volume: kernel(volume, eye, axes, half, near, step)

    return bound(compiled(to_camera)), bound(compiled(to_world))
