"""Many threads call the kernels at once, on the same inputs: each gets what it would get alone."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
import trimesh

import sketchcore as sk
from sketchcore import _core
from sketchcore.mesh import extract_mesh

THREADS = 8

CAMERA = sk.VIEWPOINTS["quarter-037"]
BATCH = sk.generate(3, 2, views=2)
SHAPE = sk.Shape(
    [
        sk.Cuboid((0, 0, 0), (0.3, 0.2, 0.2)),
        sk.Cylinder((0, 0.1, 0), (0.1, 0.2, 0.1), "y", "subtract"),
        sk.Torus((0, 0.2, 0), (0.2, 0.05, 0.2)),
        sk.Frustum((0, -0.2, 0), (0.2, 0.1, 0.2), "y", (0.1, 0), 0.5),
    ]
)
MESH = trimesh.creation.icosphere(3)
VOLUME = np.random.default_rng(0).random((2, 64, 64, 64), np.float32)
VIEWS = [CAMERA, sk.VIEWPOINTS["top"]]
PACKED = np.stack([view.packed for view in VIEWS])
HULL = np.full((64, 64, 32), 128, np.uint8)
FEATURES = np.random.default_rng(1).random((2, 64 * 64 * 16, 4), np.float32)
DRAWINGS = BATCH.drawings[0]

CALLS: dict[str, Callable[[], Any]] = {
    "voxelize": lambda: sk.voxelize(SHAPE),
    "voxelize a mesh": lambda: sk.voxelize(MESH),
    "draw": lambda: sk.draw(SHAPE, CAMERA),
    "draw in a style": lambda: sk.draw(SHAPE, CAMERA, lines=sk.LINES, style="sketchy", seed=4),
    "draw a mesh": lambda: sk.draw(MESH, CAMERA),
    "buffers": lambda: sk.buffers(SHAPE, CAMERA, 64),
    "buffers of a mesh": lambda: sk.buffers(MESH, CAMERA, 64),
    "frustum": lambda: sk.frustum(SHAPE, CAMERA),
    "frustum of a mesh": lambda: sk.frustum(MESH, CAMERA, 1),
    "to_camera_grid": lambda: sk.to_camera_grid(VOLUME, VIEWS),
    "to_world_grid": lambda: sk.to_world_grid(VOLUME, VIEWS),
    "carve": lambda: sk.carve(DRAWINGS, VIEWS),
    "silhouette": lambda: sk.silhouette(DRAWINGS[0]),
    "evidence": lambda: _core.evidence(_core.evidence_fields(DRAWINGS), PACKED),
    "heed_outlines": lambda: _core.heed_outlines(VOLUME[0], VOLUME[:, 0].copy(), PACKED, HULL),
    "lift": lambda: _core.lift(FEATURES, PACKED),
    "lift_transposed": lambda: _core.lift_transposed(_core.lift(FEATURES, PACKED).reshape(2, 16384, 8), PACKED),
    "lift_taps": lambda: _core.lift_taps(PACKED[:1]),
    "isosurface": lambda: _core.isosurface(VOLUME[0], 0.5, PACKED[0], 64),
    "bilateral": lambda: extract_mesh(BATCH.world[0].astype(np.float32)).vertices,
    "trace": lambda: _core.trace(DRAWINGS[0], 64, 4, True),
    "generate": lambda: _arrays(sk.generate(3, 2, views=2)),
    "generate, one thread": lambda: _arrays(sk.generate(3, 2, views=2, threads=1)),
    "generate, three threads": lambda: _arrays(sk.generate(3, 2, views=2, threads=3)),
    "generate vases": lambda: _arrays(sk.generate(3, 1, grammar="vase", threads=2)),
}


def _arrays(batch: sk.Batch) -> list[Any]:
    return [batch.drawings, batch.world, batch.frusta, batch.packed_cameras, *batch.packed_shapes]


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, Sequence):
        return len(a) == len(b) and all(map(_same, a, b))
    return np.array_equal(a, b)


@pytest.mark.slow
def test_all_kernels_at_once_give_what_each_gives_alone() -> None:
    alone = {name: call() for name, call in CALLS.items()}
    together = threading.Barrier(THREADS)

    def work(seed: int) -> list[str]:
        order = np.random.default_rng(seed).permutation(list(CALLS))
        together.wait()
        return [name for name in order if not _same(CALLS[name](), alone[name])]

    with ThreadPoolExecutor(THREADS) as pool:
        assert list(pool.map(work, range(THREADS))) == [[]] * THREADS


@pytest.mark.parametrize("name", CALLS)
def test_one_kernel_in_many_threads_gives_what_it_gives_alone(name: str) -> None:
    call = CALLS[name]
    alone = call()
    together = threading.Barrier(THREADS)

    def work(_: int) -> bool:
        together.wait()
        return _same(call(), alone)

    with ThreadPoolExecutor(THREADS) as pool:
        assert all(pool.map(work, range(THREADS)))


def test_an_array_that_a_call_writes_to_is_lent_to_no_other() -> None:
    """Whoever comes second is refused, or waits its turn; nobody reads or writes half a result."""
    out = sk.generate(3, 6, threads=1)
    alone = out.drawings.copy(), out.world.copy()
    refused = []

    def work(_: int) -> None:
        try:
            sk.generate(3, 6, threads=1, out=out)
        except TypeError as error:
            refused.append(str(error))

    with ThreadPoolExecutor(THREADS) as pool:
        list(pool.map(work, range(THREADS)))
    assert set(refused) <= {"The given array is already borrowed"}
    assert len(refused) < THREADS
    np.testing.assert_array_equal(out.drawings, alone[0])
    np.testing.assert_array_equal(out.world, alone[1])


def test_a_result_that_many_threads_read_stays_as_it_is() -> None:
    grids = sk.to_camera_grid(VOLUME, VIEWS)
    before = grids.copy()
    with ThreadPoolExecutor(THREADS) as pool:
        backs = list(pool.map(lambda _: sk.to_world_grid(grids, VIEWS), range(THREADS)))
    np.testing.assert_array_equal(grids, before)
    assert all(np.array_equal(back, backs[0]) for back in backs)


def test_a_batch_that_is_stopped_stops_no_other() -> None:
    class StopError(Exception):
        pass

    def stop(_: int) -> None:
        raise StopError

    alone = sk.generate(5, 8, threads=2)

    def work(number: int) -> bool:
        if number % 2:
            with pytest.raises(StopError):
                sk.generate(5, 400, threads=2, progress=stop)
            return True
        return _same(_arrays(sk.generate(5, 8, threads=2)), _arrays(alone))

    with ThreadPoolExecutor(4) as pool:
        assert all(pool.map(work, range(8)))
