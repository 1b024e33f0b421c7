"""A folder of meshes, good and bad, becomes a data set; and what training takes from it."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy import ndimage
from typer.testing import CliRunner

import deadly
import sketchcore as sk
from sketchcore.camera import VIEWPOINTS
from sketchcore.cli import app
from sketchcore.datagen.cleaning import LeftOutError, place
from sketchcore.datagen.prepare import Preparation, _Workers, prepare, shares_of
from sketchcore.datagen.prepared import MeshObject, Prepared, load_object
from sketchcore.datagen.upright import AXES, elect, facing, turn
from sketchcore.meshfile import load_mesh
from sketchcore.train.chains import start_chain
from sketchcore.train.presets import PRESETS


def box(low, high):
    return trimesh.creation.box(bounds=np.array([low, high], float))


def chair(back=0.5, seat=0.45):
    """A chair in the world's axes: y up, looking along +x, of overlapping boxes."""
    legs = [box((x, 0, z), (x + 0.06, seat, z + 0.06)) for x in (-0.2, 0.14) for z in (-0.2, 0.14)]
    return trimesh.util.concatenate(
        [*legs, box((-0.2, seat - 0.06, -0.2), (0.2, seat, 0.2)), box((-0.2, seat, -0.2), (-0.14, seat + back, 0.2))]
    )


def lying(mesh, up, front):
    """The mesh as a file has it in which these directions are up and the front."""
    turned = mesh.copy()
    turned.vertices = mesh.vertices @ turn(up, front)
    return turned


TOLD = Preparation(split=(0.5, 0.25, 0.25), thin=False)
CHAIRS = [chair(back, seat) for back in (0.4, 0.5, 0.6) for seat in (0.4, 0.45)]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    """Chairs with z up, in five formats, and everything that can go wrong."""
    folder, out = tmp_path_factory.mktemp("meshes"), tmp_path_factory.mktemp("data") / "chairs"
    (folder / "deep").mkdir()
    for number, (mesh, suffix) in enumerate(zip(CHAIRS, ("obj", "off", "stl", "ply", "stl", "obj"), strict=True)):
        lying(mesh, "z", "-y").export(folder / "deep" / f"chair {number}.{suffix}")
    CHAIRS[0].export(folder / "chair.glb")
    open_chair = chair(0.55)
    open_chair.update_faces(np.arange(len(open_chair.faces)) != 5)
    lying(open_chair, "z", "-y").export(folder / "deep" / "open.stl")
    (folder / "empty.obj").write_text("")
    (folder / "points.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    (folder / "noise.glb").write_bytes(b"glTF" + bytes(100))
    (folder / "cut.stl").write_bytes((folder / "deep" / "open.stl").read_bytes()[:150])
    (folder / "nan.obj").write_text("v 0 0 0\nv 1 nan 0\nv 0 1 0\nf 1 2 3\n")
    (folder / "sheet.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n")
    (folder / "dot.obj").write_text("v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n")
    shutil.copy(folder / "deep" / "chair 0.obj", folder / "deep" / "twin.obj")
    (folder / "readme.txt").write_text("no mesh")
    report = prepare(folder, out, TOLD, jobs=1)
    return folder, out, report


def test_every_good_file_is_an_object_and_every_bad_one_is_named(dataset):
    _, out, report = dataset
    made = {item["source"] for item in report.objects}
    assert made == {f"deep/chair {i}.{s}" for i, s in enumerate(("obj", "off", "stl", "ply", "stl", "obj"))} | {
        "chair.glb",
        "deep/open.stl",
    }
    reasons = {item["source"]: item["reason"] for item in report.left_out}
    assert set(reasons) == {
        *("empty.obj", "points.obj", "noise.glb", "cut.stl", "nan.obj", "sheet.obj", "dot.obj", "deep/twin.obj")
    }
    assert "no faces" in reasons["points.obj"]
    assert "unreadable" in reasons["noise.glb"]
    assert "NaN" in reasons["nan.obj"]
    assert "encloses nothing" in reasons["sheet.obj"]
    assert "no extent" in reasons["dot.obj"]
    assert reasons["deep/twin.obj"] == "the same as deep/chair 0.obj"
    assert json.loads((out / "report.json").read_text()) == report.to_dict()
    text = report.summary()
    assert "8 objects" in text
    assert "sheet.obj: encloses nothing" in text
    assert "open or folded" in text


def test_chairs_stand_and_look_ahead_whatever_their_files_say(dataset):
    _, out, report = dataset
    for item in report.objects:
        found = load_object(out / "objects" / item["file"])
        assert item["up"] == ("y" if item["source"].endswith("glb") else "z")
        if "chair" in item["source"].split("/")[-1]:
            number = 0 if item["source"] == "chair.glb" else int(item["source"][11])
            expected = sk.voxelize(CHAIRS[number])
            assert sk.iou(found.world, expected) > 0.97
            assert item["front"] == ("x" if item["source"] == "chair.glb" else "-y")
        assert item["symmetry"] > 0.9
        assert item["filled"] > 0.9
        # The drawing, the voxels and the file say the same.
        mesh = trimesh.Trimesh(found.vertices, found.faces, process=False)
        assert (sk.voxelize(mesh) != found.world).sum() <= 0.002 * found.world.sum()
        assert found.vertices.dtype == np.float32
        assert found.faces.dtype == np.int32
        np.testing.assert_allclose(np.abs(found.vertices).max(), 0.5 / 1.2, atol=1e-6)
    opened = next(item for item in report.objects if item["source"] == "deep/open.stl")
    assert not opened["closed"]
    assert opened["open_edges"] == 3


def test_a_second_run_makes_nothing_and_mends_what_is_damaged(dataset, tmp_path):
    folder, out, report = dataset
    copy = tmp_path / "copy"
    shutil.copytree(out, copy)
    again = prepare(folder, copy, TOLD, jobs=1)
    assert again.made == 0
    assert again.objects == report.objects
    victim = copy / "objects" / report.objects[2]["file"]
    victim.write_bytes(victim.read_bytes()[:-7])
    (copy / "dataset.json").unlink()
    mended = prepare(folder, copy, TOLD, jobs=1)
    assert mended.made == 1
    assert mended.objects == report.objects
    other = prepare(folder, copy, Preparation(up="z", front="-y", split=(1, 0, 0), thin=False), jobs=1)
    assert {item["split"] for item in other.objects} == {"train"}
    assert other.made == len(report.objects)


def test_splits_do_not_depend_on_other_files(dataset, tmp_path):
    folder, _, report = dataset
    fewer = tmp_path / "fewer"
    shutil.copytree(folder / "deep", fewer / "deep")
    (fewer / "deep" / "chair 3.ply").unlink()
    made = prepare(fewer, tmp_path / "out", TOLD, jobs=1)
    before = {item["sha256"]: item["split"] for item in report.objects}
    assert made.objects
    assert all(before[item["sha256"]] == item["split"] for item in made.objects)


@pytest.mark.slow
def test_several_processes_say_the_same_as_one(dataset, tmp_path):
    folder, _, report = dataset
    parallel = prepare(folder, tmp_path / "out", TOLD, jobs=2)
    assert parallel.objects == report.objects
    assert parallel.left_out == report.left_out


@pytest.mark.slow
def test_a_file_that_kills_its_process_stops_nothing(tmp_path):
    with _Workers(2) as workers:
        results = dict(workers.each(deadly.square, list(range(6))))
    assert results == {0: 0, 1: 1, 2: 4, 3: "the process that read it died", 4: 16, 5: 25}


@pytest.mark.parametrize("up", AXES)
def test_turning_is_a_rotation(up):
    for front in (None, *(f for f in AXES if f[-1] != up[-1])):
        rotation = turn(up, front)
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3))
        assert np.linalg.det(rotation) == pytest.approx(1)
        mesh = lying(CHAIRS[0], up, front)
        np.testing.assert_allclose(mesh.vertices @ rotation.T, CHAIRS[0].vertices, atol=1e-12)


@pytest.mark.parametrize("front", ["x", "-x", "z", "-z"])
def test_the_back_is_behind(front):
    assert facing(sk.voxelize(lying(CHAIRS[0], "y", front))) == front


def test_votes_need_a_majority():
    clear = {"x": 0.1, "y": 0.2, "z": 1.5}
    assert elect([clear] * 3, "y") == ("z", {"z": 3})
    assert elect([clear, {"x": 0, "y": 1, "z": 0.95}], "y")[0] == "z", "one that cannot tell does not vote"
    assert elect([clear, {"x": 0, "y": 1, "z": 0}], "y")[0] == "y"
    assert elect([], "z") == ("z", {})


def test_what_is_taken_away_is_counted():
    mesh = CHAIRS[0]
    faces = np.concatenate([mesh.faces, mesh.faces[:2], mesh.faces[3:5, ::-1], [[0, 0, 1]]])
    vertices = np.concatenate([mesh.vertices, [[np.nan] * 3]])
    made = place(vertices, faces, "y", "x")
    assert made.found["doubled_faces"] == 4
    assert made.found["degenerate_faces"] == 1
    assert made.found["faces"] == len(mesh.faces)
    assert made.found["closed"]
    # Two solids side by side: the face between them counts twice, and is left alone.
    pair = trimesh.util.concatenate([box((0, 0, 0), (1, 1, 1)), box((1, 0, 0), (2, 1, 1))])
    made = place(np.array(pair.vertices), np.array(pair.faces), "y", "x")
    assert (made.found["faces"], made.found["doubled_faces"], made.found["merged_vertices"]) == (24, 0, 4)
    assert made.found["closed"]
    with pytest.raises(LeftOutError, match="a face names a vertex that is not there"):
        place(mesh.vertices, mesh.faces + 7, "y", "x")
    thin = trimesh.creation.box((1, 1, 1e-3))
    with pytest.raises(LeftOutError, match=r"encloses nothing|too thin"):
        place(np.array(thin.vertices), np.array(thin.faces), "y", "x", thin=False)


def placed_by(mesh, thin):
    return place(np.array(mesh.vertices), np.array(mesh.faces), "y", "x", thin)


def test_what_is_thinner_than_a_voxel_is_filled():
    # A sheet is one voxel thick, wherever it lies, and has no holes.
    for x in (0.0, 0.003, 0.011):
        sheet = trimesh.Trimesh([[0, 0, 0], [0, 1, 0], [0, 1, 0.6], [0, 0, 0.6]], [[0, 1, 2], [0, 2, 3]])
        mesh = trimesh.util.concatenate([sheet, trimesh.creation.box(bounds=[[x - 0.2, 0, 0], [x - 0.1, 0.1, 0.6]])])
        made = placed_by(mesh, True)
        slab = made.world[:, 12:58].sum(axis=0)
        assert set(np.unique(slab[:, 18:46])) == {1}
        assert made.found["thin_voxels"] > 1000
        assert made.found["filled"] == 1
        camera = VIEWPOINTS["right"]
        cells = MeshObject(made.vertices, made.faces, made.world).frusta(camera.packed[None])[0]
        assert cells.astype(float).sum() > 0.8 * 255 * sk.to_camera_grid(made.world, camera).sum()
    # A tilted rod hangs together; nothing is added to what voxels show.
    rod = trimesh.creation.cylinder(0.004, segment=[[0, 0, 0], [0.3, 1, 0.2]])
    world = placed_by(rod, True).world
    assert ndimage.label(world, np.ones((3, 3, 3)))[1] == 1
    assert 50 < world.sum() < 220
    for solid in (CHAIRS[0], trimesh.creation.icosphere(3), trimesh.creation.cylinder(0.3, 1.0, sections=7)):
        assert placed_by(solid, True).found["thin_voxels"] == 0


def test_a_thin_wall_is_whole():
    # A vessel whose wall is half a voxel: centres catch it here and there.
    outer, inner = trimesh.creation.icosphere(4, 1.0), trimesh.creation.icosphere(4, 0.99)
    inner.invert()
    ball = trimesh.util.concatenate([outer, inner])
    speckled, whole = placed_by(ball, False).world, placed_by(ball, True).world
    hollow = ndimage.binary_fill_holes(whole) & (whole == 0)
    assert not (ndimage.binary_fill_holes(speckled) & (speckled == 0)).sum() > 0.5 * hollow.sum()
    assert hollow.sum() > 0.8 * 4 / 3 * np.pi * 26**3


def test_a_scene_is_put_together(tmp_path):
    scene = trimesh.Scene([box((0, 0, 0), (1, 1, 1))])
    scene.add_geometry(box((0, 0, 0), (1, 1, 1)), transform=trimesh.transformations.translation_matrix((3, 0, 0)))
    scene.export(tmp_path / "two.glb")
    mesh = load_mesh(tmp_path / "two.glb")
    np.testing.assert_allclose(mesh.extents, (4, 1, 1))
    with pytest.raises(ValueError, match=r"a mesh is read from \.obj"):
        load_mesh(tmp_path / "two.blend")


def test_a_sample_is_a_function_of_data_seed_and_index(dataset):
    data = Prepared(dataset[1])
    config = PRESETS["compact"].generator
    batch = data.batch("train", 3, 4, first=5, views=2, config=config)
    for i in range(4):
        one = data.batch("train", 3, 1, first=5 + i, views=2, config=config)
        np.testing.assert_array_equal(one.drawings[0], batch.drawings[i])
        np.testing.assert_array_equal(one.packed_cameras[0], batch.packed_cameras[i])
        np.testing.assert_array_equal(one.world[0], batch.world[i])
    assert len(np.unique(batch.packed_cameras.reshape(8, -1), axis=0)) == 8
    count = data.count("train")
    for epoch in range(3):
        chosen = [data.choose("train", 3, epoch * count + i) for i in range(count)]
        assert sorted(chosen) == list(range(count)), "every object once"
    assert "train" in repr(data)


def test_a_sample_is_drawn_from_its_mesh(dataset):
    data = Prepared(dataset[1])
    batch = data.batch("train", 0, 3, views=2, config={"displacement": 0.02}, frusta=True)
    for i in range(3):
        item = data.load("train", data.choose("train", 0, i))
        mesh = trimesh.Trimesh(item.vertices, item.faces, process=False)
        for view, camera in enumerate(batch.cameras[i]):
            assert (batch.drawings[i, view] != sk.draw(mesh, camera)).sum() <= 4
            np.testing.assert_array_equal(batch.frusta[i, view], sk.frustum(mesh, camera, 2))
        first = batch.cameras[i][0]
        turned = [np.abs(VIEWPOINTS[name].rotation - first.rotation).max() for name in sk.QUARTER_VIEWS]
        assert min(turned) < 1e-9


def test_training_takes_its_shapes_from_the_data(dataset):
    data, preset = Prepared(dataset[1]), PRESETS["compact"]
    chain = start_chain(preset, 5, 9, data)
    again = start_chain(preset, 5, 9, data)
    np.testing.assert_array_equal(chain.sketches.drawings, again.sketches.drawings)
    item = data.load("train", data.choose("train", 5, 9))
    halves = item.world[:, :, 32:].astype(float), item.world[:, :, 31::-1].astype(float)
    np.testing.assert_array_equal(chain.truth, (halves[0] + halves[1]) / 2)


def test_wrong_options_say_what_would_be_right(dataset, tmp_path):
    for options, message in [
        ({"up": "w"}, "up must be one of auto, x, y, z"),
        ({"front": "up"}, "front must be one of auto"),
        ({"up": "y", "front": "-y"}, "different axes"),
        ({"front": "x"}, "a front goes with an up"),
        ({"split": (0.5, 0.2, 0.2)}, "sum up to 1"),
    ]:
        with pytest.raises(ValueError, match=message):
            Preparation(**options)
    assert shares_of("0.5,0.25,0.25") == (0.5, 0.25, 0.25)
    for text in ("0.5,0.5", "a,b,c"):
        with pytest.raises(ValueError, match="three shares"):
            shares_of(text)
    with pytest.raises(FileNotFoundError, match="no folder"):
        prepare(tmp_path / "none", tmp_path / "out")
    with pytest.raises(ValueError, match="no mesh files"):
        prepare(tmp_path, tmp_path / "out")
    with pytest.raises(ValueError, match="jobs must be at least 1"):
        prepare(dataset[0], tmp_path / "out", jobs=0)
    with pytest.raises(FileNotFoundError, match="make one by sketchcore prepare"):
        Prepared(tmp_path)
    (tmp_path / "dataset.json").write_text('{"format": 99}')
    with pytest.raises(ValueError, match="is no data set of sketchcore prepare"):
        Prepared(tmp_path)
    data = Prepared(dataset[1])
    with pytest.raises(ValueError, match="the splits are train, val, test"):
        data.count("training")


def test_the_command_line_prepares(dataset, tmp_path):
    folder, _, report = dataset
    command = ["prepare", str(folder), "-o", str(tmp_path / "data"), "--split", "1,0,0", "--jobs", "1", "--no-thin"]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0
    assert f"{len(report.objects)} objects" in done.stdout
    assert "files left out" in done.stdout
    assert Prepared(tmp_path / "data").count("train") == len(report.objects)
    done = CliRunner().invoke(app, [*command, "--json"])
    assert json.loads(done.stdout)["made"] == 0
    wrong = CliRunner().invoke(app, [*command, "--up", "w"])
    assert wrong.exit_code == 1
    assert "error: up must be one of" in wrong.stderr
    assert Path(tmp_path / "data" / "report.json").is_file()
