"""What fuzzing found, and what it was built to find, each made by hand: a sentence, and nothing worse."""

from __future__ import annotations

import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import trimesh
from numpy.typing import NDArray
from safetensors.numpy import save as save_arrays
from safetensors.torch import save

import sketchcore as sk
from sketchcore import gltfcheck, meshfile, untrusted, volume
from sketchcore.app.photo import read_photo
from sketchcore.app.session import Session
from sketchcore.app.sessionfile import read_session, write_session
from sketchcore.datagen.prepared import VERSION, Prepared, load_found, load_object
from sketchcore.meshfile import load_mesh
from sketchcore.nets import weights
from sketchcore.nets.config import CompactConfig
from sketchcore.nets.loading import build_model
from sketchcore.nets.storing import save_weights
from sketchcore.nets.unet import PaperNet
from sketchcore.nets.weights import load_weights
from sketchcore.train.checkpoint import Progress, load_checkpoint, save_checkpoint

# Pictures


def _png(*chunks: tuple[bytes, bytes], size: tuple[int, int] = (8, 8)) -> bytes:
    every = [(b"IHDR", struct.pack(">IIBBBBB", *size, 8, 0, 0, 0, 0)), *chunks, (b"IEND", b"")]
    body = b"".join(struct.pack(">I", len(c)) + k + c + struct.pack(">I", zlib.crc32(k + c)) for k, c in every)
    return b"\x89PNG\r\n\x1a\n" + body


@pytest.mark.parametrize(
    "data",
    [
        b"P5 99999999999 4 255 \0\0\0\0",
        b"P5 -1e1e-320 4 255 \0\0\0\0",
        b"P2 4 4 255 0 0 0",
        b"P1 9 9 012",
        _png((b"acTL", struct.pack(">II", 2, 0)), (b"fcTL", b"\0\0")),
        _png((b"IDAT", zlib.compress(b"\0" * 20))),
        _png((b"IDAT", b"nonsense")),
        _png(),
    ],
)
def test_broken_pictures_are_refused_by_both_readers(data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "picture"
    path.write_bytes(data)
    with pytest.raises(ValueError, match=r"picture (is no image of a known kind|cannot be read as an image)|no ink"):
        sk.load_drawing(path)
    with pytest.raises(ValueError, match=r"this is no picture of a known kind|no ink|no line drawing"):
        read_photo(data)


def test_a_picture_says_how_large_it_is_before_it_is_decoded(tmp_path: Path) -> None:
    path = tmp_path / "bomb.png"
    path.write_bytes(_png((b"IDAT", b""), size=(20_000, 20_000)))
    with pytest.raises(ValueError, match="up to 100 megapixels"):
        sk.load_drawing(path)
    with pytest.raises(ValueError, match="up to 50 megapixels"):
        read_photo(path.read_bytes())


# Meshes


def _gltf(**changes: Any) -> dict[str, Any]:
    """A tetrahedron whose numbers lie in part.bin."""
    tree = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5121, "count": 12, "type": "SCALAR"},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 12}],
        "buffers": [{"uri": "part.bin", "byteLength": 60}],
    }
    return tree | changes


@pytest.fixture
def scene(tmp_path: Path) -> Callable[[dict[str, Any]], Path]:
    numbers = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], "<f4").tobytes()
    numbers += bytes([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3])
    folder = tmp_path / "scene"
    folder.mkdir()
    for place in (folder, tmp_path):
        (place / "part.bin").write_bytes(numbers)
    (folder / "link.bin").symlink_to(tmp_path / "part.bin")
    (folder / "inner").mkdir()

    def write(tree: dict[str, Any]) -> Path:
        (folder / "mesh.gltf").write_text(json.dumps(tree))
        return folder / "mesh.gltf"

    return write


def test_a_gltf_may_name_files_beside_it(scene: Callable[[dict[str, Any]], Path]) -> None:
    assert len(load_mesh(scene(_gltf())).faces) == 4


@pytest.mark.parametrize(
    "uri",
    [
        "../part.bin",
        "link.bin",
        "inner/../part.bin",
        "/etc/passwd",
        "file:///etc/passwd",
        "http://127.0.0.1:9/x",
        "..",
        "",
        "inner",
    ],
)
def test_a_gltf_may_name_no_others(scene: Callable[[dict[str, Any]], Path], uri: str) -> None:
    with pytest.raises(ValueError, match="which is no file in its folder"):
        load_mesh(scene(_gltf(buffers=[{"uri": uri, "byteLength": 60}])))


def test_the_files_that_a_gltf_names_count_each_time(
    scene: Callable[[dict[str, Any]], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = scene(_gltf(buffers=[{"uri": "part.bin", "byteLength": 60}] * 99))
    monkeypatch.setattr(meshfile, "MAX_BYTES", path.stat().st_size)
    with pytest.raises(ValueError, match="the files that it names have more than"):
        load_mesh(path)


def test_a_broken_gltf_reads_no_other_file_instead(scene: Callable[[dict[str, Any]], Path]) -> None:
    whole = scene(_gltf())
    whole.rename(whole.with_name("model.gltf"))
    whole.write_text("nonsense")
    with pytest.raises(ValueError, match="not valid JSON"):
        load_mesh(whole)


_MANY = {"componentType": 5126, "count": 10**9, "type": "VEC3"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"accessors": [_MANY, _MANY]}, "would take more than 512 MiB"),
        ({"bufferViews": [{"buffer": 0, "byteLength": 10**8}] * 6}, "would take more than 512 MiB"),
        ({"accessors": [{**_MANY, "count": -1}]}, "no whole number"),
        ({"accessors": [{**_MANY, "count": 1e3}]}, "no whole number"),
        ({"nodes": [{"mesh": 0, "children": [0]}]}, "hangs on two others, or on itself"),
        ({"nodes": [{"children": [1]}, {"children": [0]}]}, "hangs on two others, or on itself"),
        ({"nodes": [{"children": [i + 1]} for i in range(4999)] + [{"mesh": 0}]}, "hang on each other"),
        ({"nodes": {"mesh": 0}}, "no list of objects"),
        ({"nodes": []}, "cannot be read as .gltf"),
        ({"scene": "first"}, "cannot be read as .gltf"),
    ],
)
def test_what_a_gltf_asks_for_is_added_up_first(
    scene: Callable[[dict[str, Any]], Path], changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        load_mesh(scene(_gltf(**changes)))


def test_meshes_that_nodes_place_again_and_again_count_each_time(
    scene: Callable[[dict[str, Any]], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = scene(_gltf(nodes=[{"mesh": 0}] * 50, scenes=[{"nodes": list(range(50))}]))
    assert len(load_mesh(path).faces) == 200
    monkeypatch.setattr(meshfile, "MAX_TRIANGLES", 199)
    with pytest.raises(ValueError, match="up to 199 triangles, this one would have 200"):
        load_mesh(path)
    box = path.with_name("box.stl")
    trimesh.creation.icosphere(2).export(box)
    with pytest.raises(ValueError, match="up to 199 triangles, this one has 320"):
        load_mesh(box)


@pytest.mark.parametrize("suffix", meshfile.READ_SUFFIXES)
def test_mesh_files_have_a_largest_size(suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / f"mesh{suffix}"
    path.write_bytes(b"\0" * 2**21)
    monkeypatch.setattr(meshfile, "MAX_BYTES", 2**20)
    with pytest.raises(ValueError, match="may have up to 1 MiB"):
        load_mesh(path)


def test_vertices_of_two_numbers_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "flat.obj"
    path.write_text("v 0 0\nv 1 0\nv 1 1\nf 1 2 3\n")
    with pytest.raises(ValueError, match=r"cannot be read as \.obj"):
        load_mesh(path)


def test_an_obj_with_materials_reads_no_other_file(tmp_path: Path) -> None:
    (tmp_path / "pipe.mtl").symlink_to("/dev/zero")  # would never end
    path = tmp_path / "mesh.obj"
    path.write_text("mtllib pipe.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert len(load_mesh(path).faces) == 1


# Arrays


def test_numbers_that_overflow_are_refused_without_warnings() -> None:
    row = sk.VIEWPOINTS["front"].packed.copy()
    row[3:12] = 1e200
    with pytest.raises(ValueError, match="rotation must be orthonormal"):
        sk.Camera.from_packed(row)
    grid = np.full((32, 32, 32), 1e308)
    with pytest.raises(ValueError, match="NaN or infinite"):
        sk.to_camera_grid(grid, sk.VIEWPOINTS["front"])
    with pytest.raises(ValueError, match="NaN or infinite"):
        sk.to_world_grid(grid, sk.VIEWPOINTS["front"])


@pytest.mark.parametrize("angles", [(np.inf, 20.0), (30.0, -np.inf), (np.nan, 0.0)])
def test_cameras_at_no_angle_are_refused(angles: tuple[float, float]) -> None:
    with pytest.raises(ValueError, match="must be finite"):
        sk.Camera.orbit(*angles)
    with pytest.raises(ValueError, match="must be finite"):
        sk.Camera.orbit(30.0, 20.0, fov_degrees=float("nan"))


# Configs


@pytest.mark.parametrize("text", ["{", "", "\0", "[" * 100_000, '{"primitives": NaN}', "9" * 5000, '"\ud800"'])
def test_text_that_is_no_config_is_refused_by_the_package(text: str) -> None:
    for read in (sk.Shape.from_json, sk.LineStyle.from_json):
        with pytest.raises(ValueError, match=r"shape|line style|digits") as caught:
            read(text)
        assert type(caught.value) is ValueError


# Weights


@pytest.fixture
def net(tmp_path: Path) -> Path:
    path = tmp_path / "net.safetensors"
    state = {f"single.{name}": tensor for name, tensor in PaperNet(width=1).state_dict().items()}
    save_weights(path, state, {"network": "paper", "options": {"width": 1}})
    assert sk.load_model(path, "cpu") is not None
    return path


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"network": "paper", "options": 3}, "options of a network are an object"),
        ({"network": "paper", "options": {"depth": 3}}, "another version of the network 'paper'"),
        ({"network": "paper", "options": {"width": "1"}}, "width must be a whole number"),
        ({"network": "paper", "options": {"width": 1.5}}, "width must be a whole number"),
        ({"network": "paper", "options": {"width": 2}}, "single.*must be|must be .*, got"),
        ({"network": "paper", "options": {"width": 10**6}}, "must be .*, got"),
        ({"network": "paper", "options": {"width": 10**30}}, "config is wrong"),
        ({"network": "compact", "options": {"stem": 10**9}}, "must be whole, 1 to 4096"),
        ({"network": "compact", "options": {"image": [96, 192]}}, "must be 3 widths"),
        ({"network": "compact", "options": {"world": [32, 96, 12]}}, "config is wrong"),
        ({"network": "compact", "options": {"groups": 7}}, "config is wrong"),
        ({"network": "compact"}, "there is no"),
        ({"network": "multiscale", "options": {"width": 10**7}}, "there is no"),
        ({"network": "multiscale", "options": {"width": [2]}}, "even number"),
        ({"network": ["paper"]}, "unknown network"),
        ({}, "unknown network None"),
    ],
)
def test_a_config_that_does_not_fit_its_weights_takes_no_memory(net: Path, config: object, message: str) -> None:
    net.with_suffix(".json").write_text(json.dumps(config))
    with pytest.raises(ValueError, match=message) as caught:
        sk.load_model(net, "cpu")
    assert len(str(caught.value)) < 500


def test_compact_networks_have_a_widest_layer() -> None:
    for wrong in ({"stem": 0}, {"stem": True}, {"image": (1, 2, 5000)}, {"world": 8}):
        with pytest.raises(ValueError, match="must be"):
            CompactConfig(**wrong)  # type: ignore[arg-type]


def _safetensors(header: object, body: bytes = b"") -> bytes:
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + body


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ((2**40).to_bytes(8, "little") + b"{}", "header would have more than 16 MiB"),
        (_safetensors({"a": {"dtype": "F8_E4M3", "shape": [2], "data_offsets": [0, 2]}}, b"\0\0"), "F8_E4M3"),
        (_safetensors({"a": {"dtype": "C64", "shape": [1], "data_offsets": [0, 8]}}, b"\0" * 8), "C64"),
        (_safetensors({"a": {"dtype": "F32", "shape": [2**40], "data_offsets": [0, 4]}}, b"\0" * 4), "corrupt"),
        (_safetensors({"a": {"dtype": "F32", "shape": [1], "data_offsets": [0, 2**50]}}, b"\0" * 4), "corrupt"),
        (_safetensors([]), "corrupt"),
    ],
)
def test_weights_that_lie_are_refused(net: Path, data: bytes, message: str) -> None:
    net.write_bytes(data)
    with pytest.raises(ValueError, match=message):
        load_weights(net)


def test_weights_have_a_largest_size(net: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(weights, "MAX_BYTES", 1000)
    with pytest.raises(ValueError, match="file of weights may have up to"):
        load_weights(net)
    monkeypatch.undo()
    net.with_suffix(".json").write_bytes(b" " * (weights.MAX_CONFIG + 1))
    with pytest.raises(ValueError, match="config may have up to 1 MiB"):
        load_weights(net)


def test_integers_are_no_weights(net: Path) -> None:
    state, config = load_weights(net)
    with pytest.raises(ValueError, match=r"must be .* got .*int64"):
        build_model({name: array.astype(np.int64) for name, array in state.items()}, config, "cpu")


@pytest.mark.parametrize(
    "told",
    [
        None,
        {"progress": "{}"},
        {"progress": "[]", "task": "{}"},
        {"progress": '{"stage": "one", "step": "3"}', "task": "{}"},
        {"progress": '{"stage": "one", "step": -3}', "task": "{}"},
        {"progress": '{"stage": 1}', "task": "{}"},
        {"progress": '{"stage": "one"}', "task": "3"},
        {"progress": "[" * 100_000, "task": "{}"},
    ],
)
def test_checkpoints_that_are_none_say_so(told: dict[str, str] | None, tmp_path: Path) -> None:
    path = tmp_path / "one.safetensors"
    path.write_bytes(save({"model.a": torch.ones(1)}, metadata=told))
    with pytest.raises(ValueError, match="is no checkpoint of sketchcore train"):
        load_checkpoint(path)
    save_checkpoint(path, {"a": torch.ones(1)}, {}, [], Progress("one", 3), {"seed": "0"}, {})
    assert load_checkpoint(path).progress.step == 3


# Volumes


def _npy(array: NDArray[Any], header: bytes | None = None) -> bytes:
    file = io.BytesIO()
    np.save(file, array)
    data = file.getvalue()
    size = int.from_bytes(data[8:10], "little")
    text = data[10 : 10 + size] if header is None else header
    return data[:8] + len(text).to_bytes(2, "little") + text + data[10 + size :]


def _npz(**entries: bytes) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in entries.items():
            archive.writestr(f"{name}.npy", content)
    return file.getvalue()


_CUBE = np.zeros((64, 64, 64), np.float32)
_LIES = b"{'descr': '<f4', 'fortran_order': False, 'shape': (%d, 64, 64), }\n"


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (_npz(probability=_npy(_CUBE, _LIES % 10**6)), "are said to be in"),
        (_npz(probability=_npy(_CUBE, _LIES % 63)), "are said to be in"),
        (_npz(probability=_npy(_CUBE, b"{'descalse, 'shape': (1,), }")), "damaged"),
        (_npz(probability=_npy(_CUBE, b"(" * 5000)), "damaged"),
        (_npz(probability=_npy(_CUBE, b"{'descr': '|O', 'fortran_order': False, 'shape': (1,), }\n")), "damaged"),
        (_npz(probability=b"\x93NUMPY\x09\x00"), "damaged"),
        (_npz(probability=_npy(np.array(["x"] * 8).reshape(2, 2, 2))), "numbers or booleans"),
        (_npz(**{f"a{i}": b"" for i in range(65)}), "up to 64 entries"),
        (_npz(probability=_npy(_CUBE), cameras=_npy(_CUBE), drawings=_npy(_CUBE), trace=_npy(_CUBE)), "float64"),
        (_npz(probability=_npy(_CUBE), cameras=_npy(np.zeros((1, 15))), drawings=_npy(_CUBE), trace=_npy(np.zeros(1))),
         "camera"),
        (_npz(probability=_npy(_CUBE))[:-30] + b"\xff" * 30, "damaged"),
    ],
)  # fmt: skip
def test_volumes_that_lie_are_refused(data: bytes, message: str, tmp_path: Path) -> None:
    path = tmp_path / "solid.npz"
    path.write_bytes(data)
    with pytest.raises(ValueError, match=message):
        sk.load(path)


def test_a_zip_bomb_is_not_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "solid.npz"
    path.write_bytes(_npz(probability=_npy(np.zeros((128, 128, 128), np.float32))))
    assert path.stat().st_size < 2**14
    monkeypatch.setattr(volume, "MAX_UNPACKED", 2**20)
    with pytest.raises(ValueError, match="is larger than 1048576 bytes"):
        sk.load(path)
    # What is unpacked counts for all arrays together.
    path.write_bytes(_npz(**{f"a{i}": _npy(np.zeros(2**17 - 64, np.uint8)) for i in range(9)}))
    with pytest.raises(ValueError, match="is larger than"):
        sk.load(path)


@pytest.mark.parametrize(
    "array", [np.arange(6).reshape(2, 3), np.asfortranarray(np.eye(3)), np.empty((0, 4)), np.array("abc")]
)
def test_arrays_come_back_as_numpy_wrote_them(array: NDArray[Any]) -> None:
    back = untrusted.parse_array(_npy(array), "it")
    np.testing.assert_array_equal(back, array)
    assert back.dtype == array.dtype
    assert back.flags.writeable


# Sessions


def test_a_session_file_that_points_before_its_beginning_is_refused() -> None:
    data = bytearray(write_session(Session()))
    directory = data.rindex(b"PK\x01\x02")
    data[directory + 42 : directory + 46] = (2**32 - 5).to_bytes(4, "little")
    with pytest.raises(ValueError, match="not a session file of sketchcore"):
        read_session(bytes(data))


# Data sets of meshes


@pytest.mark.parametrize(
    "name",
    ["../box.safetensors", "/etc/passwd", "..", "", None, 3, "a" * 300 + ".safetensors", "box.npz", "a\\b.safetensors"],
)
def test_an_index_names_files_in_its_folder_alone(name: object, tmp_path: Path) -> None:
    entry = {"file": name, "split": "train", "sha256": "ab"}
    (tmp_path / "dataset.json").write_text(json.dumps({"format": VERSION, "objects": [entry]}))
    with pytest.raises(ValueError, match=r"plain name that ends in \.safetensors"):
        Prepared(tmp_path)


@pytest.mark.parametrize(
    "index", ["[]", "3", "{", "[" * 100_000, '{"format": 1, "objects": 3}', '{"format": 1, "objects": [3]}']
)
def test_an_index_that_is_none_is_refused(index: str, tmp_path: Path) -> None:
    (tmp_path / "dataset.json").write_text(index)
    with pytest.raises(ValueError, match="is no data set of sketchcore prepare"):
        Prepared(tmp_path)


def test_an_index_whose_hashes_are_none_is_refused(tmp_path: Path) -> None:
    entries = [{"file": "a.safetensors", "split": "train", "sha256": hash} for hash in (1, "..")]
    (tmp_path / "dataset.json").write_text(json.dumps({"format": VERSION, "objects": entries}))
    with pytest.raises(ValueError, match="is no data set of sketchcore prepare"):
        Prepared(tmp_path)


def test_a_long_header_of_a_volume_is_told_in_short(tmp_path: Path) -> None:
    path = tmp_path / "volume.binvox"
    path.write_bytes(b"#binvox 1\ndim 64" + b" \x00x" * 5000 + b"\ndata\n")
    with pytest.raises(ValueError, match="a cube up to 1024") as caught:
        sk.load(path)
    assert len(str(caught.value)) < 500


_OBJECT = {
    "vertices": np.zeros((3, 3), np.float32),
    "faces": np.zeros((1, 3), np.int32),
    "world": np.zeros((64, 64, 8), np.uint8),
}


@pytest.mark.parametrize(
    "change",
    [
        {"vertices": np.zeros((3, 2), np.float32)},
        {"vertices": np.zeros((3, 3))},
        {"faces": np.zeros((1, 4), np.int32)},
        {"faces": np.zeros(3, np.int32)},
        {"world": np.zeros((64, 64, 8), np.int32)},
        {"world": np.zeros((64, 64, 9), np.uint8)},
        {"world": np.zeros(3, np.uint8)},
    ],
)
def test_objects_that_do_not_fit_are_refused(change: dict[str, NDArray[Any]], tmp_path: Path) -> None:
    path = tmp_path / "box.safetensors"
    path.write_bytes(save_arrays(_OBJECT | change, metadata={"found": "{}"}))
    with pytest.raises(ValueError, match="is no object of a data set"):
        load_object(path)
    assert load_found(path) is None
    path.unlink()
    with pytest.raises(FileNotFoundError, match="no object of a data set at"):
        load_object(path)


@pytest.mark.parametrize("found", ["3", "[]", "nonsense", "[" * 100_000])
def test_what_is_known_of_an_object_is_an_object(found: str, tmp_path: Path) -> None:
    path = tmp_path / "box.safetensors"
    path.write_bytes(save_arrays(_OBJECT, metadata={"found": found}))
    assert load_found(path) is None
    path.write_bytes(save_arrays(_OBJECT, metadata={"found": '{"up": "y"}'}))
    assert load_found(path) == {"up": "y"}


def test_one_check_says_how_large_files_may_be(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no thing at"):
        untrusted.check_size(tmp_path, 1, "thing")
    path = tmp_path / "sparse"
    with path.open("wb") as file:
        file.truncate(3 * 2**20)
    with pytest.raises(ValueError, match="a thing may have up to 2 MiB, this one has 4"):
        untrusted.check_size(path, 2 * 2**20, "thing")
    untrusted.check_size(path, 3 * 2**20, "thing")


def test_limits_are_what_the_threat_model_says() -> None:
    text = (Path(__file__).parents[1] / "SECURITY.md").read_text()
    for said in (
        f"{meshfile.MAX_BYTES // 2**20} MiB",
        f"{meshfile.MAX_TRIANGLES:,} triangles",
        f"{gltfcheck.MAX_STEPS:,} steps",
        f"{weights.MAX_BYTES // 2**30} GiB",
        f"{weights.MAX_HEADER // 2**20} MiB",
        f"{weights.MAX_CONFIG // 2**20} MiB",
        f"{volume.MAX_UNPACKED // 2**20} MiB",
    ):
        assert said in text, said
