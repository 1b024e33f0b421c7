"""The bench: that its table is whole, and that the peers do the same job as ours."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
import trimesh
from PIL import Image
from scipy import ndimage
from typer.testing import CliRunner

import sketchcore as sk
from sketchcore.bench import growth, jobs
from sketchcore.bench.drawings import embree_drawing, opengl_drawing
from sketchcore.bench.machine import Machine
from sketchcore.bench.present import as_table
from sketchcore.bench.resampling import numba_resampling, torch_resampling
from sketchcore.bench.solids import open3d_solid, torus
from sketchcore.bench.timing import medians
from sketchcore.bench.voxels import numpy_voxels
from sketchcore.cli import app

CAMERA = sk.VIEWPOINTS["quarter-127"]
BATCH = sk.generate(5, 4)
ADDED = sk.generate(5, 4, config={"grammar": {"subtracted": 0.0}}).shapes


def _ready(import_, *arguments):
    """A peer's call, or a skipped test where the peer is missing."""
    try:
        return import_(*arguments)
    except (ImportError, OSError, RuntimeError) as error:
        pytest.skip(str(error))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_the_command_reports_every_job(monkeypatch):
    for name, small in (("SHAPES", 1), ("SAMPLES", 1), ("COUNT", 2), ("TRIANGLES", 200)):
        monkeypatch.setattr(jobs, name, small)
    result = CliRunner().invoke(app, ["bench", "--repetitions", "1", "--json"])
    assert result.exit_code == 0, result.output
    report = json.loads(result.stdout)
    rows = report["rows"]
    assert [len(row["peers"]) for row in rows] == [1, 2, 2, 2, 1, 2, 2, 1, 1, 1]
    bars = [10, 3, 20, 8, 4, 8, 4, 30, *4 * [1.5], 2.5, 1.85, 3]
    assert [peer["bar"] for row in rows for peer in row["peers"]] == bars
    assert all(math.isfinite(report["machine"][key]) for key in ("bandwidth", "arithmetic"))
    for row in rows:
        assert 0 < row["floor"] < math.inf
        assert 0 < row["seconds"] < math.inf
        for peer in row["peers"]:
            if peer["missing"]:
                assert peer["seconds"] is None
                continue
            ratio = peer["seconds"] / row["seconds"]
            assert peer["ratio"] == pytest.approx(1 / ratio if row["cost"] else ratio)
            assert peer["met"] == (peer["ratio"] <= peer["bar"] if row["cost"] else peer["ratio"] >= peer["bar"])
    # These come with the package.
    assert all(rows[i]["peers"][0]["missing"] is None for i in (0, 2, 3, 5, 6, 7, 9))


@pytest.mark.slow
def test_growth_is_measured_and_plotted(monkeypatch, tmp_path):
    for name, small in (
        ("PRIMITIVES", (1, 2, 3, 4)),
        ("SIZES", (64, 65)),
        ("TRIANGLES", (100, 200)),
        ("SIDES", (32, 64)),
        ("SAMPLES", 2),
    ):
        monkeypatch.setattr(growth, name, small)
    done = []
    curves = growth.growth(1, progress=lambda *at: done.append(at))
    assert done == [(i, 7) for i in range(1, 8)]
    assert [len(curve.work) for curve in curves[:6]] == [4, 4, 2, 2, 2, 2]
    for curve in curves:
        assert len(curve.seconds) == len(curve.work)
        assert sorted(curve.work) == curve.work
        assert all(0 < seconds < 10 for seconds in curve.seconds)
    growth.save_plot(curves, tmp_path / "growth.png")
    with Image.open(tmp_path / "growth.png") as image:
        assert image.width > 1000
    with pytest.raises(ValueError, match=r"written as \.png"):
        growth.save_plot(curves, tmp_path / "growth.pdf")


def test_repetitions_are_checked():
    result = CliRunner().invoke(app, ["bench", "--repetitions", "0"])
    assert result.exit_code == 1
    assert "repetitions must be at least 1, got 0" in result.stderr


def test_missing_peers_are_named_with_their_remedy():
    def absent():
        import no_such_module

        return no_such_module

    def broken():
        raise RuntimeError("no driver: install one")

    contest = jobs.Contest(
        "a job", lambda: None, [("one", 2.0, absent), ("two", 3.0, broken), ("three", 4.0, lambda: dict)]
    )
    machine = Machine("a processor", 1, 1e9, 1e9)
    row = jobs._held(contest, machine, 1)
    assert [peer.missing for peer in row.peers] == [
        "no_such_module is not installed: pip install 'sketchcore[bench]'",
        "no driver: install one",
        None,
    ]
    assert [peer.ratio is None for peer in row.peers] == [True, True, False]
    caption = as_table(jobs.Report(machine, 1, [row])).caption
    assert "missing: one: no_such_module is not installed" in caption
    assert "missing: two: no driver" in caption


def test_the_floor_is_what_takes_longer():
    machine = Machine("a processor", 1, bandwidth=1e9, arithmetic=1e10)
    assert machine.floor(1e6, 1e6) == pytest.approx(1e-3)
    assert machine.floor(1e3, 1e8) == pytest.approx(1e-2)


def test_medians_are_of_interleaved_turns():
    turns = []
    calls = [lambda name=name: (turns.append(name), sum(range(200_000))) for name in "ab"]
    times = medians(calls, 5)
    assert all(1e-5 < seconds < 1 for seconds in times)
    order = [name for i, name in enumerate(turns) if i == 0 or turns[i - 1] != name]
    assert order == ["a", "b"] * (len(order) // 2)
    assert len(order) >= 10


@pytest.mark.parametrize("shape", BATCH.shapes)
def test_numpy_makes_the_same_voxels(shape):
    np.testing.assert_array_equal(numpy_voxels(shape.packed), sk.voxelize(shape))


def _near(ink):
    return ndimage.binary_dilation(ink > 0, np.ones((3, 3)))


def _alike(drawing, ours):
    """Lines lie within a pixel of each other: filters put some on the other side of an edge."""
    assert drawing.shape == ours.shape
    assert (_near(drawing) >= (ours > 0)).mean() > 0.995
    assert _near(drawing)[ours > 0].mean() > 0.97
    assert _near(ours)[drawing > 0].mean() > 0.97


@pytest.mark.parametrize("shape", ADDED)
def test_embree_makes_the_same_drawing(shape):
    _alike(_ready(embree_drawing, CAMERA)(shape.packed), sk.draw(shape, CAMERA))


@pytest.mark.parametrize("shape", ADDED)
def test_opengl_makes_the_same_drawing(shape):
    _alike(_ready(opengl_drawing, CAMERA)(shape.packed)(), sk.draw(shape, CAMERA))


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("peer", [torch_resampling, numba_resampling])
def test_resampling_gives_the_same_numbers(peer):
    to_camera, to_world = _ready(peer, CAMERA)
    volume = ndimage.gaussian_filter(BATCH.world[0].astype(np.float32), 1.0)
    seen = sk.to_camera_grid(volume, CAMERA)
    np.testing.assert_allclose(to_camera(volume), seen, atol=1e-3)
    # On the frustum's border a voxel may fall to either side.
    differ = np.abs(to_world(seen) - sk.to_world_grid(seen, CAMERA)) > 1e-3
    assert differ.mean() < 1e-3


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("triangles", [200, 5000])
def test_open3d_makes_the_same_solid(triangles):
    vertices, faces = torus(triangles)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert mesh.is_watertight
    assert abs(len(faces) - triangles) < 0.1 * triangles
    theirs = _ready(open3d_solid, faces)(vertices)
    assert theirs.dtype == np.uint8
    # Its coordinates have 24 bits: voxels on the surface may differ.
    assert (theirs != sk.voxelize(mesh)).sum() <= 10
