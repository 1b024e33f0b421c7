"""The main verb with the weights that ship: arguments, files, errors."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import sketchcore as sk
from sketchcore.evaluate.testset import load_testset
from sketchcore.rounds import crossing

SHAPE = sk.Shape([sk.Cuboid((0, -0.2, 0), (0.35, 0.15, 0.25)), sk.Cuboid((-0.25, 0.1, 0), (0.1, 0.3, 0.25))])
EXAMPLES = Path(__file__).parent.parent / "examples"


@pytest.fixture(scope="module")
def drawing() -> np.ndarray:
    return sk.draw(SHAPE, sk.VIEWPOINTS["quarter-037"])


@pytest.fixture(scope="module")
def solid(drawing: np.ndarray) -> sk.Reconstruction:
    return sk.reconstruct(drawing, "quarter-037", iterations=2, tolerance=0.0)


def test_a_drawing_becomes_the_shape_it_shows(solid: sk.Reconstruction) -> None:
    assert solid.probability.shape == (64, 64, 64)
    assert solid.probability.dtype == np.float32
    assert solid.probability.min() >= 0
    assert solid.probability.max() <= 1
    assert sk.iou(solid.probability, sk.voxelize(SHAPE)) > 0.6
    assert solid.views == (sk.VIEWPOINTS["quarter-037"],)
    assert len(solid.trace) == 2
    assert solid.guessed is None


def test_every_kind_of_drawing_is_the_same_drawing(
    drawing: np.ndarray, solid: sk.Reconstruction, tmp_path: Path
) -> None:
    Image.fromarray(255 - drawing).save(tmp_path / "d.png")
    sources = [
        drawing,
        np.repeat(drawing[..., None], 3, axis=2),
        255 - drawing,
        Image.fromarray(drawing),
        tmp_path / "d.png",
        str(tmp_path / "d.png"),
        [drawing],
    ]
    for source in sources:
        made = sk.reconstruct(source, ["quarter-037"] if isinstance(source, list) else "quarter-037", iterations=0)
        np.testing.assert_array_equal(made.drawings[0], drawing)


def test_update_adds_a_drawing_and_leaves_the_old_one_alone(solid: sk.Reconstruction) -> None:
    before = solid.probability.copy()
    back = sk.draw(SHAPE, sk.VIEWPOINTS["left"])
    more = solid.update(back, "left", iterations=1)
    assert len(more.views) == 2
    assert more.drawings.shape == (2, 256, 256)
    np.testing.assert_array_equal(solid.probability, before)
    together = sk.reconstruct([solid.drawings[0], back], ["quarter-037", "left"], iterations=1)
    np.testing.assert_allclose(more.probability, together.probability, atol=1e-6)


def test_progress_sees_every_round(drawing: np.ndarray) -> None:
    seen: list[tuple[int, int]] = []
    sk.reconstruct(
        drawing, "quarter-037", iterations=2, tolerance=0.0, progress=lambda r, n, volume: seen.append((r, n))
    )
    assert seen == [(0, 2), (1, 2), (2, 2)]


def test_rounds_stop_when_the_solid_has_settled(drawing: np.ndarray) -> None:
    volumes: list[np.ndarray] = []
    to_the_end = sk.reconstruct(drawing, "quarter-037", tolerance=0.0, progress=lambda *call: volumes.append(call[2]))
    assert len(to_the_end.trace) == len(volumes) - 1 == 5
    np.testing.assert_array_equal(to_the_end.probability, volumes[-1])
    changes = [np.sqrt(np.mean((b - a) ** 2)) for a, b in itertools.pairwise(volumes)]
    np.testing.assert_allclose(to_the_end.trace, changes, rtol=1e-5)
    sides = [crossing(a, b) for a, b in itertools.pairwise(volumes)]
    for tolerance in (*sorted(sides), sides[0] / 3, 1.5 * max(sides)):
        seen: list[tuple[int, int]] = []
        made = sk.reconstruct(
            drawing, "quarter-037", tolerance=tolerance, progress=lambda r, n, _, seen=seen: seen.append((r, n))
        )
        allowed = [3.5 * tolerance, *[tolerance] * 4]
        last = next((r for r in range(1, 6) if sides[r - 1] < allowed[r - 1]), 5)
        assert seen == [(r, 5) for r in range(last + 1)]
        np.testing.assert_allclose(made.trace, to_the_end.trace[:last])
        np.testing.assert_array_equal(made.probability, volumes[last])


def test_going_on_would_hardly_change_what_has_settled() -> None:
    for example in load_testset(3):
        for count in (1, 4):
            drawings, cameras = list(example.drawings[:count]), example.cameras[:count]
            settled = sk.reconstruct(drawings, cameras)
            on_and_on = sk.reconstruct(drawings, cameras, tolerance=0.0)
            assert 1 <= len(settled.trace) <= len(on_and_on.trace) == 5
            assert sk.iou(settled.probability, on_and_on.probability) > 0.92
            gained = sk.iou(on_and_on.probability, example.world) - sk.iou(settled.probability, example.world)
            assert gained < 0.02


def test_the_viewpoint_is_guessed_and_named(drawing: np.ndarray) -> None:
    made = sk.reconstruct(drawing, iterations=0)
    assert made.guessed in sk.QUARTER_VIEWS
    assert made.views == (sk.VIEWPOINTS[made.guessed],)


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".stl", ".ply", ".npz", ".binvox"])
def test_every_format_is_written(solid: sk.Reconstruction, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"solid{suffix}"
    solid.save(path)
    assert path.stat().st_size > 1000


def test_npz_brings_everything_back(solid: sk.Reconstruction, tmp_path: Path) -> None:
    solid.save(tmp_path / "solid.npz")
    back = sk.load(tmp_path / "solid.npz")
    np.testing.assert_array_equal(back.probability, solid.probability)
    np.testing.assert_array_equal(back.drawings, solid.drawings)
    assert back.views == solid.views
    assert back.trace == solid.trace
    again = back.update(sk.draw(SHAPE, sk.VIEWPOINTS["top"]), "top", iterations=0)
    assert len(again.views) == 2


def test_binvox_brings_the_voxels_back_and_takes_a_drawing(solid: sk.Reconstruction, tmp_path: Path) -> None:
    solid.save(tmp_path / "solid.binvox")
    back = sk.load(tmp_path / "solid.binvox")
    np.testing.assert_array_equal(back.probability, solid.probability > 0.5)
    more = back.update(sk.draw(SHAPE, sk.VIEWPOINTS["top"]), "top", iterations=1)
    assert sk.iou(more.probability, back.probability) > 0.5


def test_the_mesh_is_watertight(solid: sk.Reconstruction) -> None:
    mesh = solid.mesh()
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(float((solid.probability > 0.5).mean()), rel=0.1)


def test_an_empty_volume_is_an_error() -> None:
    with pytest.raises(ValueError, match="no voxel is above"):
        sk.Reconstruction(np.zeros((64, 64, 64), np.float32)).mesh()


def test_wrong_arguments_say_what_would_be_right(drawing: np.ndarray, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="at least one drawing"):
        sk.reconstruct([])
    with pytest.raises(ValueError, match="need a view each"):
        sk.reconstruct([drawing, drawing])
    with pytest.raises(ValueError, match="got 1 drawings, 2 views"):
        sk.reconstruct(drawing, ["front", "top"])
    with pytest.raises(KeyError, match="the viewpoints are quarter-037"):
        sk.reconstruct(drawing, "quarter-038")
    with pytest.raises(TypeError, match="a view is"):
        sk.reconstruct(drawing, [3])  # type: ignore[list-item]
    with pytest.raises(ValueError, match="iterations must be 0 or more"):
        sk.reconstruct(drawing, "front", iterations=-1)
    with pytest.raises(ValueError, match="tolerance must be 0 or more, got nan"):
        sk.reconstruct(drawing, "front", tolerance=float("nan"))
    with pytest.raises(FileNotFoundError):
        sk.reconstruct(tmp_path / "none.png", "front")
    with pytest.raises(FileNotFoundError):
        sk.reconstruct(drawing, "front", model=tmp_path / "none.safetensors")
    with pytest.raises(ValueError, match="unknown device"):
        sk.reconstruct(drawing, "front", model=None, device="abacus")


def test_wrong_files_say_what_would_be_right(solid: sk.Reconstruction, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="the suffixes are"):
        solid.save(tmp_path / "solid.step")
    with pytest.raises(FileNotFoundError):
        solid.save(tmp_path / "none" / "solid.npz")
    with pytest.raises(ValueError, match=r"\.npz and \.binvox"):
        sk.load(tmp_path / "solid.glb")
    with pytest.raises(FileNotFoundError):
        sk.load(tmp_path / "none.npz")


def test_examples_are_one_solid_piece_each() -> None:
    from scipy.ndimage import label

    made = sk.reconstruct(EXAMPLES / "house.png", "quarter-322", iterations=1)
    _, pieces = label(made.probability > 0.5)
    assert pieces == 1
