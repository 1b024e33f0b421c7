"""Python calls of the kernels beside what one would otherwise use, on the same data in the same run: `make bench`.

Each group holds ours and a peer, where `sketchcore bench` has none; `embedding_bag` gets its rows and weights for free.
"""

from __future__ import annotations

import numpy as np
import pytest
import torch

import sketchcore as sk
from sketchcore import _core
from sketchcore.bench.resampling import torch_resampling
from sketchcore.bench.solids import torus
from sketchcore.bench.voxels import numpy_voxels

CAMERA = sk.VIEWPOINTS["quarter-037"]
BATCH = sk.generate(0, 1)
ROWS = BATCH.packed_shapes[0]
VOLUME = BATCH.world.astype(np.float32)
VIEWS = list(sk.VIEWPOINTS.values())[::2][:6]
CAMERAS = np.stack([view.packed for view in VIEWS])
FIELDS = _core.evidence_fields(np.stack([_core.draw(ROWS, camera) for camera in CAMERAS]))
FEATURES = np.random.default_rng(0).standard_normal((65536, 16), np.float32)
GRADIENT = np.random.default_rng(1).standard_normal((16384, 32), np.float32)
TAPS = [torch.from_numpy(taps[0].reshape(-1, 8)) for taps in _core.lift_taps(CAMERA.packed[None])]


@pytest.fixture(autouse=True, scope="module")
def _one_thread():
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def embedding_bag(features: torch.Tensor) -> torch.Tensor:
    rows, weights = TAPS
    return torch.nn.functional.embedding_bag(rows, features, per_sample_weights=weights, mode="sum")


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
    made = benchmark(torch_resampling(CAMERA)[0], VOLUME[0])
    np.testing.assert_allclose(made, _core.to_camera_grid(VOLUME, CAMERA.packed[None])[0], atol=1e-4)


@pytest.mark.benchmark(group="mesh -> solid")
@pytest.mark.parametrize("triangles", [100, 5_000, 100_000, 1_000_000])
def test_voxelize_mesh(benchmark, triangles):
    benchmark(_core.voxelize_mesh, *torus(triangles))


@pytest.mark.benchmark(group="six drawings -> evidence")
def test_evidence(benchmark):
    benchmark(_core.evidence, FIELDS, CAMERAS)


@pytest.mark.benchmark(group="six drawings -> evidence")
def test_evidence_torch(benchmark):
    at = (np.arange(64) + 0.5) / 64 - 0.5
    voxels = np.stack(np.meshgrid(at, at, at[32:], indexing="ij"), axis=-1)
    grids = []
    for camera in VIEWS:
        for side in (1, -1):
            p = (voxels * [1, 1, side] - camera.position) @ camera.rotation.T
            grids.append(p[..., :2] / p[..., 2:] / np.tan(np.radians(camera.fov_degrees / 2)))
    grid = torch.from_numpy(np.stack(grids).astype(np.float32).reshape(12, 64, -1, 2))
    fields = torch.from_numpy(FIELDS).permute(0, 3, 1, 2).repeat_interleave(2, 0).float()

    def gather():
        seen = torch.nn.functional.grid_sample(fields, grid, mode="nearest", align_corners=False)
        return torch.stack([seen[:, 0].amin(0), seen[:, 1].mean(0), seen[:, 1].amin(0)]).add(0.5).byte()

    made = benchmark(gather).numpy().reshape(3, 64, 64, 32)
    assert (made == _core.evidence(FIELDS, CAMERAS)).mean() > 0.999


@pytest.mark.benchmark(group="image features -> world grid")
def test_lift(benchmark):
    benchmark(_core.lift, FEATURES[None], CAMERA.packed[None])


@pytest.mark.benchmark(group="image features -> world grid")
def test_lift_torch(benchmark):
    made = benchmark(embedding_bag, torch.from_numpy(FEATURES))
    ours = _core.lift(FEATURES[None], CAMERA.packed[None])
    np.testing.assert_allclose(made.numpy().reshape(16384, -1), ours[0], atol=1e-5)


@pytest.mark.benchmark(group="image features -> world grid, backwards")
def test_lift_transposed(benchmark):
    benchmark(_core.lift_transposed, GRADIENT[None], CAMERA.packed[None])


@pytest.mark.benchmark(group="image features -> world grid, backwards")
def test_lift_transposed_torch(benchmark):
    features = torch.from_numpy(FEATURES).requires_grad_()
    read, gradient = embedding_bag(features), torch.from_numpy(GRADIENT).reshape(32768, -1)
    (made,) = benchmark(torch.autograd.grad, read, features, gradient, retain_graph=True)
    ours = _core.lift_transposed(GRADIENT[None], CAMERA.packed[None])
    np.testing.assert_allclose(made.numpy(), ours[0], atol=1e-4)


@pytest.mark.benchmark(group="one sample")
def test_draw(benchmark):
    benchmark(_core.draw, ROWS, CAMERA.packed)


@pytest.mark.benchmark(group="one sample")
def test_generate_one(benchmark):
    benchmark(sk.generate, 0, 1, threads=1)


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.benchmark(group="batch of 64, as in `cargo bench`")
def test_generate_64(benchmark, threads):
    benchmark(sk.generate, 0, 64, threads=threads, out=sk.generate(0, 64))
