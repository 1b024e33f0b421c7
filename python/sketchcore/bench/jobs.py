"""The jobs, their peers and the ratios that we hold ourselves to, measured side by side."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import torch
import trimesh

import sketchcore as sk
from sketchcore.bench.drawings import embree_drawing, opengl_drawing
from sketchcore.bench.machine import Machine, measure
from sketchcore.bench.network import torch_passes
from sketchcore.bench.resampling import numba_resampling, torch_resampling
from sketchcore.bench.solids import open3d_solid, torus
from sketchcore.bench.timing import medians
from sketchcore.bench.voxels import numpy_voxels
from sketchcore.nets.compactmodel import CompactModel
from sketchcore.nets.sketches import Sketches

CAMERA = sk.VIEWPOINTS["quarter-037"]
SHAPES = 4
SAMPLES = 16
COUNT = 64
TRIANGLES = 5000
_VOXELS, _PIXELS, _FLOAT = 64**3, 256**2, 4
_INSTALL = "pip install 'sketchcore[bench]'"

Call = Callable[[], object]


@dataclass(frozen=True)
class Contest:
    """One job: ours, and each peer with the least ratio we want; `made` builds a peer's call, or says why it cannot.

    Attributes:
        job: what is done.
        ours: does it, `units` times.
        peers: (name, bar, how to make the call); the call does the same number of units.
        units: over how many the time is divided.
        moved: bytes a unit that have to be read and written, at the least.
        sums: float operations a unit, at the least.
        cost: the ratio is ours over the peer's, and must be at most the bar.
    """

    job: str
    ours: Call
    peers: list[tuple[str, float, Callable[[], Call]]]
    units: int = 1
    moved: float = 0.0
    sums: float = 0.0
    cost: bool = False


@dataclass(frozen=True)
class Peer:
    """A peer's figures; `seconds`, `ratio` and `met` are None where it is missing, and `missing` says why."""

    name: str
    bar: float
    seconds: float | None = None
    ratio: float | None = None
    met: bool | None = None
    missing: str | None = None


@dataclass(frozen=True)
class Row:
    """One job's figures: seconds of ours and of the floor, and peers. If `cost`, ratios are ours over the peer's."""

    job: str
    seconds: float
    floor: float
    cost: bool
    peers: list[Peer]


@dataclass(frozen=True)
class Report:
    """What `bench` measured."""

    machine: Machine
    repetitions: int
    rows: list[Row]

    def to_dict(self) -> dict[str, Any]:
        """The report as plain data."""
        return asdict(self)


def bench(repetitions: int = 15, progress: Callable[[int, int], None] | None = None) -> Report:
    """Measures all jobs; one thread each, unless the job's name says otherwise.

    The threads of our own kernels are fixed when the first of them starts: call this early, or with the environment
    variable RAYON_NUM_THREADS=1.

    Args:
        repetitions: each figure is the median of so many, interleaved with the peers'.
        progress: called as `progress(done, total)` after each job.

    Raises:
        ValueError: for less than one repetition.
    """
    os.environ.setdefault("RAYON_NUM_THREADS", "1")
    with _one_torch_thread():
        machine = measure(repetitions)
        all_contests = contests()
        rows = []
        for i, contest in enumerate(all_contests):
            rows.append(_held(contest, machine, repetitions))
            if progress is not None:
                progress(i + 1, len(all_contests))
    return Report(machine, repetitions, rows)


@contextmanager
def _one_torch_thread() -> Iterator[None]:
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def _held(contest: Contest, machine: Machine, repetitions: int) -> Row:
    calls: list[Call] = []
    missing: list[str | None] = []
    for _, _, make in contest.peers:
        why = None
        try:
            calls.append(make())
        except ModuleNotFoundError as error:
            why = f"{error.name} is not installed: {_INSTALL}"
        except (ImportError, OSError, RuntimeError) as error:
            why = str(error)
        missing.append(why)
    ours, *theirs = (seconds / contest.units for seconds in medians([contest.ours, *calls], repetitions))
    times = iter(theirs)
    peers = []
    for (name, bar, _), why in zip(contest.peers, missing, strict=True):
        if why is not None:
            peers.append(Peer(name, bar, missing=why))
            continue
        seconds = next(times)
        ratio = ours / seconds if contest.cost else seconds / ours
        peers.append(Peer(name, bar, seconds, ratio, ratio <= bar if contest.cost else ratio >= bar))
    return Row(contest.job, ours, machine.floor(contest.moved, contest.sums), contest.cost, peers)


def contests() -> list[Contest]:
    """The jobs, each on fixed inputs."""
    return [_voxels(), _drawing(), *_resampling(), _solid(), *_network(), *_samples(), _style()]


def _voxels() -> Contest:
    shapes = sk.generate(0, SHAPES).shapes
    packed = [shape.packed for shape in shapes]
    return Contest(
        "shape -> world voxels, uint8",
        lambda: [sk.voxelize(shape) for shape in shapes],
        [("NumPy slabs on half the grid, mirrored", 10.0, lambda: lambda: [numpy_voxels(rows) for rows in packed])],
        units=SHAPES,
        moved=_VOXELS,
    )


def _drawing() -> Contest:
    # What subtracts would need a mesh of booleans, which would only hold the peers up.
    shapes = sk.generate(0, SHAPES, config={"grammar": {"subtracted": 0.0}}).shapes
    packed = [shape.packed for shape in shapes]

    def opengl() -> Call:
        prepare = opengl_drawing(CAMERA)
        draws = [prepare(rows) for rows in packed]
        return lambda: [draw() for draw in draws]

    def embree() -> Call:
        draw = embree_drawing(CAMERA)
        return lambda: [draw(rows) for rows in packed]

    return Contest(
        "shape -> depth, normals, lines; 256 x 256",
        lambda: [sk.draw(shape, CAMERA) for shape in shapes],
        [
            ("moderngl and OpenCV; mesh not counted", 3.0, opengl),
            ("embreex and OpenCV; mesh and tree counted", 20.0, embree),
        ],
        units=SHAPES,
        moved=_PIXELS,
        # One intersection and one edge test a pixel.
        sums=_PIXELS * (30 + 20),
    )


def _style() -> Contest:
    shapes = sk.generate(0, SHAPES).shapes
    return Contest(
        "a drawing in the style sketchy",
        lambda: [sk.draw(shape, CAMERA, style="sketchy") for shape in shapes],
        [("one clean draw", 3.0, lambda: lambda: [sk.draw(shape, CAMERA) for shape in shapes])],
        units=SHAPES,
        moved=2 * _PIXELS,
        # A drawing's.
        sums=_PIXELS * (30 + 20),
        cost=True,
    )


def _resampling() -> list[Contest]:
    world = sk.generate(0, 1).world[0].astype(np.float32)
    camera = sk.to_camera_grid(world, CAMERA)
    jobs = [
        ("to_camera_grid, float32", sk.to_camera_grid, world, 0),
        ("to_world_grid, float32", sk.to_world_grid, camera, 1),
    ]
    return [
        Contest(
            job,
            lambda ours=ours, volume=volume: ours(volume, CAMERA),  # type: ignore[misc]
            [
                ("torch grid_sample, coordinates at hand", 8.0, _bound(torch_resampling, which, volume)),
                ("Numba, transform and lerp in one loop", 4.0, _bound(numba_resampling, which, volume)),
            ],
            moved=2 * _FLOAT * _VOXELS,
            # Projection and seven interpolations a cell.
            sums=_VOXELS * (9 + 14),
        )
        for job, ours, volume, which in jobs
    ]


def _bound(both: Callable[[sk.Camera], Any], which: int, volume: Any) -> Callable[[], Call]:
    def make() -> Call:
        resample = both(CAMERA)[which]
        return lambda: resample(volume)

    return make


def _solid() -> Contest:
    vertices, faces = torus(TRIANGLES)
    mesh = trimesh.Trimesh(vertices, faces, process=False)

    def open3d() -> Call:
        solid = open3d_solid(faces)
        return lambda: solid(vertices)

    return Contest(
        f"mesh of {len(faces):,} triangles -> solid",
        lambda: sk.voxelize(mesh),
        [("Open3D, 4,096 rays and parity; all cores", 30.0, open3d)],
        moved=vertices.nbytes + faces.nbytes + _VOXELS,
        # A face's bounds, its edges and its plane.
        sums=len(faces) * 40,
    )


def _network() -> list[Contest]:
    batch = sk.generate(0, 1)
    samples = [Sketches(batch.drawings[0], batch.packed_cameras[0])]
    ready = samples[0].fields, samples[0].evidence
    model = sk.load_model(device="cpu")
    assert isinstance(model, CompactModel)
    passes = model.passes
    readings = passes.read(samples)
    prior = passes.decide(readings, None, [1])

    def torch_in(dtype: torch.dtype, which: int) -> Callable[[], Call]:
        return lambda: torch_passes(samples, prior, dtype)[which]

    jobs = [
        ("the network reads a drawing", lambda: passes.read(samples), sum(array.nbytes for array in ready), 0.9e9),
        (
            "a round of the network",
            lambda: passes.decide(readings, prior, [1]),
            prior.nbytes + readings[0].nbytes,
            2.0e9,
        ),
    ]
    return [
        Contest(
            job,
            ours,
            [
                ("torch, float32", 1.5, torch_in(torch.float32, which)),
                ("torch, bfloat16", 1.5, torch_in(torch.bfloat16, which)),
            ],
            moved=moved,
            # Those of Winograd's algorithm, about: by their formula, convolutions take 2.8 and 10.4 GFLOP.
            sums=sums,
        )
        for which, (job, ours, moved, sums) in enumerate(jobs)
    ]


def _samples() -> list[Contest]:
    few, many = sk.generate(0, SAMPLES), sk.generate(0, COUNT)
    views = [cameras[0] for cameras in few.cameras]

    def draws() -> Call:
        return lambda: [sk.draw(shape, view) for shape, view in zip(few.shapes, views, strict=True)]

    def two() -> Call:
        if (os.cpu_count() or 1) < 2:
            raise RuntimeError("this machine has one core")
        return lambda: sk.generate(0, COUNT, threads=1, out=many)

    sample = Contest(
        "one whole sample of generate",
        lambda: sk.generate(0, SAMPLES, threads=1, out=few),
        [("one draw", 2.5, draws)],
        units=SAMPLES,
        moved=_PIXELS + 2 * _VOXELS,
        # A drawing's, and for each ray of the camera grid one intersection.
        sums=_PIXELS * (30 + 20) + 128**2 * 30,
        cost=True,
    )
    threads = Contest(
        f"generate, {COUNT} samples, two threads",
        lambda: sk.generate(0, COUNT, threads=2, out=many),
        [("itself on one thread", 1.85, two)],
        moved=COUNT * sample.moved / 2,
        sums=COUNT * sample.sums / 2,
    )
    return [sample, threads]
