"""The command line, run as a user runs it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from typer.testing import CliRunner

import sketchcore as sk
from sketchcore.cli import app
from sketchcore.evaluate import robustness

EXAMPLES = Path(__file__).parent.parent / "examples"


def run(*arguments: object, ok: bool = True) -> str:
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert (result.exit_code == 0) == ok, result.output
    return result.stdout if ok else result.stderr


@pytest.mark.parametrize("command", ["reconstruct", "generate", "prepare", "train", "evaluate", "bench", "serve"])
def test_every_command_explains_itself(command: str) -> None:
    assert command in run("--help")
    assert len(run(command, "--help")) > 200


def test_reconstruct_writes_mesh_and_picture(tmp_path: Path) -> None:
    out, picture = tmp_path / "car.glb", tmp_path / "car.png"
    drawings = [EXAMPLES / "car-quarter.png", EXAMPLES / "car-right.png"]
    views = ["--view", "quarter-322", "--view", "right"]
    text = run("reconstruct", *drawings, *views, "-o", out, "--picture", picture, "--iterations", 1)
    assert "wrote" in text
    assert out.stat().st_size > 1000
    with Image.open(picture) as image:
        assert image.size == (1024, 512)


def test_reconstruct_reports_as_json(tmp_path: Path) -> None:
    text = run("reconstruct", EXAMPLES / "house.png", "-o", tmp_path / "h.npz", "--iterations", 0, "--json")
    report = json.loads(text)
    assert report["guessed"] in sk.QUARTER_VIEWS
    assert 0 < report["occupied"] < 1
    assert sk.load(tmp_path / "h.npz").drawings.shape == (1, 256, 256)


def test_errors_are_one_sentence(tmp_path: Path) -> None:
    missing = run("reconstruct", tmp_path / "none.png", "-o", tmp_path / "a.glb", ok=False)
    assert missing.splitlines()[-1].startswith("error: ")
    assert "Traceback" not in missing
    unknown = run("reconstruct", EXAMPLES / "house.png", "--view", "below", "-o", tmp_path / "a.glb", ok=False)
    assert "the viewpoints are" in unknown
    both = run("train", "-o", tmp_path / "t", ok=False)
    assert "either minutes or steps" in both
    assert "between 1 and 500" in run("evaluate", "--shapes", 501, ok=False)


def test_generate_writes_samples(tmp_path: Path) -> None:
    config = tmp_path / "config.json"
    config.write_text('{"hand": {"share": 1.0}}')
    run("generate", "-o", tmp_path / "data", "--count", 3, "--seed", 4, "--first", 10, "--views", 2, "--config", config)
    names = sorted(path.name for path in (tmp_path / "data").iterdir())
    assert len(names) == 9
    batch = sk.generate(4, 1, first=11, views=2, config={"hand": {"share": 1.0}})
    with np.load(tmp_path / "data" / "000000011.npz") as sample:
        np.testing.assert_array_equal(sample["drawings"], batch.drawings[0])
        np.testing.assert_array_equal(sample["world"], batch.world[0])
        assert sk.Shape.from_json(str(sample["shape"])) == batch.shapes[0]
    with Image.open(tmp_path / "data" / "000000011-1.png") as image:
        np.testing.assert_array_equal(255 - np.asarray(image), batch.drawings[0, 1])


def test_generate_takes_a_grammar(tmp_path: Path) -> None:
    bottles = EXAMPLES / "bottles.py"
    run("generate", "-o", tmp_path / "bottles", "--count", 2, "--seed", 4, "--grammar", bottles)
    batch = sk.generate(4, 2, grammar=str(bottles))
    with np.load(tmp_path / "bottles" / "000000001.npz") as sample:
        np.testing.assert_array_equal(sample["drawings"], batch.drawings[1])
    unknown = run("generate", "-o", tmp_path / "none", "--grammar", "tabel", ok=False)
    assert "one of chair, vase" in unknown
    assert not (tmp_path / "none").exists()


@pytest.mark.parametrize("suffix", ["obj", "glb", "ply", "stl"])
def test_generate_writes_meshes(tmp_path: Path, suffix: str) -> None:
    pytest.importorskip("manifold3d")
    chosen = ["--grammar", "chair", "--seed", 5, "--first", 7, "--format", suffix]
    run("generate", "-o", tmp_path / "chairs", "--meshes", 3, *chosen)
    names = [f"00000000{i}.{suffix}" for i in (7, 8, 9)]
    assert sorted(path.name for path in (tmp_path / "chairs").iterdir()) == names
    read = trimesh.load(tmp_path / "chairs" / names[1], force="mesh")
    read.merge_vertices()  # STL knows no shared ones
    expected = sk.generate(5, 1, first=8, grammar="chair").shapes[0].to_mesh()
    assert read.is_watertight
    assert read.volume == pytest.approx(expected.volume, rel=1e-3)
    assert "meshes are written as obj, glb, ply, stl" in run(
        "generate", "-o", tmp_path / "other", "--meshes", 1, "--format", "off", ok=False
    )


def test_evaluate_reports_as_json_and_plots(tmp_path: Path) -> None:
    report = json.loads(run("evaluate", "--shapes", 2, "--json", "-o", tmp_path / "results"))
    assert report["shapes"] == 2
    assert [len(rounds) for rounds in report["network"]] == [6] * 4
    assert 0.9 < report["ceiling"]["mean"] < 1
    assert json.loads((tmp_path / "results" / "accuracy.json").read_text()) == report
    with Image.open(tmp_path / "results" / "accuracy.png") as image:
        assert image.width > 800


@pytest.mark.parametrize("part", ["convergence", "robustness"])
def test_every_part_on_the_test_set_has_a_table_and_a_plot(
    part: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    few = {name: robustness.STRENGTHS[name] for name in ("width", "gaps")}
    monkeypatch.setattr(robustness, "STRENGTHS", few)
    assert "fixed test set" in run("evaluate", part, "--shapes", 1, "-o", tmp_path)
    with Image.open(tmp_path / f"{part}.png") as image:
        assert image.width > 800
    assert json.loads((tmp_path / f"{part}.json").read_text())["shapes"] == 1


def test_wrong_parts_are_refused() -> None:
    assert "the parts are accuracy" in run("evaluate", "speed", ok=False)
    assert "--drawings" in run("evaluate", "drawings", ok=False)
