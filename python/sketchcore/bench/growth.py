"""How the cost grows with the work."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import trimesh

import sketchcore as sk
from sketchcore.atomic import replacing
from sketchcore.bench.solids import torus
from sketchcore.bench.timing import medians
from sketchcore.grids import SIDES

CAMERA = sk.VIEWPOINTS["quarter-037"]
PRIMITIVES = (2, 4, 8, 16, 32, 64)
SIZES = (64, 128, 256, 512, 1024)
TRIANGLES = (100, 1_000, 10_000, 100_000, 1_000_000)
SAMPLES = 64


@dataclass(frozen=True)
class Curve:
    """Seconds a call against the amount of work.

    Attributes:
        name: what is called.
        unit: what `work` counts.
        work: how much of it, ascending.
        seconds: a call each.
        samples: how many a call makes, if it makes any: their number in a second is what counts then.
    """

    name: str
    unit: str
    work: list[int]
    seconds: list[float]
    samples: int = 0


def growth(repetitions: int = 5, progress: Callable[[int, int], None] | None = None) -> list[Curve]:
    """Measures what each kernel costs as its work grows: primitives, pixels, triangles, cells, threads.

    Args:
        repetitions: each figure is the median of so many.
        progress: called as `progress(done, total)` after each curve.

    Raises:
        ValueError: for less than one repetition.
    """
    shapes = [_shape(count) for count in PRIMITIVES]
    meshes = [trimesh.Trimesh(*torus(count), process=False) for count in TRIANGLES]
    grids = [np.random.default_rng(side).random((side,) * 3, np.float32) for side in SIDES]
    threads = range(1, (os.cpu_count() or 1) + 1)
    batch = sk.generate(0, SAMPLES)
    measured: list[tuple[str, str, Iterable[int], Sequence[Callable[[], object]]]] = [
        ("voxelize(shape)", "primitives", PRIMITIVES, [partial(sk.voxelize, shape) for shape in shapes]),
        ("draw(shape)", "primitives", PRIMITIVES, [partial(sk.draw, shape, CAMERA) for shape in shapes]),
        ("buffers(shape)", "pixels a side", SIZES, [partial(sk.buffers, shapes[3], CAMERA, n) for n in SIZES]),
        (
            "voxelize(mesh)",
            "triangles",
            (len(m.faces) for m in meshes),
            [partial(sk.voxelize, mesh) for mesh in meshes],
        ),
        (
            "to_camera_grid",
            "cells a side",
            SIDES,
            [partial(sk.to_camera_grid, grid, CAMERA, out=np.empty_like(grid)) for grid in grids],
        ),
        (
            "to_world_grid",
            "cells a side",
            SIDES,
            [partial(sk.to_world_grid, grid, CAMERA, out=np.empty_like(grid)) for grid in grids],
        ),
        (
            f"generate, {SAMPLES} samples",
            "threads",
            threads,
            [partial(sk.generate, 0, SAMPLES, threads=n, out=batch) for n in threads],
        ),
    ]
    curves = []
    for i, (name, unit, work, calls) in enumerate(measured):
        samples = SAMPLES if unit == "threads" else 0
        curves.append(Curve(name, unit, list(work), medians(calls, repetitions), samples))
        if progress is not None:
            progress(i + 1, len(measured))
    return curves


def _shape(count: int) -> sk.Shape:
    """The first so many primitives of the first random shapes."""
    primitives = [primitive for shape in sk.generate(0, 16).shapes for primitive in shape.primitives]
    return sk.Shape(primitives[:count])


def save_plot(curves: list[Curve], path: str | os.PathLike[str]) -> None:
    """Seconds against work, a panel for each unit, as a PNG.

    Raises:
        ValueError: if the path does not end in .png.
        FileNotFoundError: if the folder does not exist.
    """
    if Path(path).suffix.lower() != ".png":
        raise ValueError(f"a plot is written as .png, got {path}")
    from matplotlib.figure import Figure

    units = list(dict.fromkeys(curve.unit for curve in curves))
    rows = -(-len(units) // 3)
    canvas = Figure(figsize=(12, 3.5 * rows), layout="constrained")
    for i, unit in enumerate(units):
        panel = canvas.add_subplot(rows, 3, i + 1)
        shown = [curve for curve in curves if curve.unit == unit]
        for curve in shown:
            cost = [1e3 * seconds for seconds in curve.seconds]
            rate = [curve.samples / seconds for seconds in curve.seconds]
            panel.plot(curve.work, rate if curve.samples else cost, marker="o", label=curve.name)
        if shown[0].samples:
            panel.margins(y=0.1)
            panel.set(ylim=(0, None), ylabel="samples a second")
        else:
            panel.set(xscale="log", yscale="log", ylabel="milliseconds")
            panel.yaxis.set_major_formatter("{x:g}")
        panel.set_xlabel(unit)
        panel.set_xticks(shown[0].work, [f"{work:,}" for work in shown[0].work])
        panel.set_xticks([], minor=True)
        panel.legend(fontsize="small")
        panel.grid(alpha=0.3)
    with replacing(path) as fresh:
        canvas.savefig(fresh, dpi=120)
