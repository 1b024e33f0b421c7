import io
import os

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from trimesh.exchange import binvox
from trimesh.voxel import VoxelGrid

from sketchcore.atomic import replacing
from sketchcore.volume import as_probability, iou, load_binvox, load_npz, save_binvox, save_npz

CUBES = st.integers(1, 9).flatmap(lambda n: hnp.arrays(np.bool_, (n, n, n)))


def lumpy(n=64):
    # Runs shorter and longer than 255, and no symmetry between the axes.
    volume = np.zeros((n, n, n), np.float32)
    volume[3:9, 10:50, 20:24] = 1.0
    volume[30:, :, 40:] = 0.75
    volume[5, 6, 7] = 0.500001
    volume[6, 6, 7] = 0.5
    return volume


@given(CUBES, st.randoms())
def test_iou_is_that_of_sets(a, random):
    b = a.copy()
    b[random.randrange(len(a))] ^= True
    first, second = set(map(tuple, np.argwhere(a))), set(map(tuple, np.argwhere(b)))
    assert iou(a, b) == pytest.approx(len(first & second) / len(first | second))
    assert iou(a, b) == iou(b, a) == iou(a.astype(np.uint8), b.astype(np.float32))
    assert iou(a, a) == 1.0


def test_iou_thresholds_above_one_half_and_calls_two_empty_volumes_alike():
    half = np.full((4, 4, 4), 0.5, np.float32)
    assert iou(half, np.zeros((4, 4, 4), np.uint8)) == 1.0
    assert iou(half, half + 0.01) == 0.0
    assert isinstance(iou(half, half), float)


def test_iou_refuses_to_broadcast():
    with pytest.raises(ValueError, match=r"\[4, 4, 4\] and \[1, 4, 4\]"):
        iou(np.ones((4, 4, 4)), np.ones((1, 4, 4)))


@pytest.mark.parametrize(
    ("volume", "message"),
    [
        (np.zeros((64, 64)), r"got \[64, 64\]"),
        (np.zeros((4, 4, 5)), r"got \[4, 4, 5\]"),
        (np.zeros((0, 0, 0)), "must be a cube"),
        (np.full((2, 2, 2), np.nan), "NaN"),
        (np.full((2, 2, 2), 1.5), r"lie in \[0, 1\], got 1.5 to 1.5"),
        (np.full((2, 2, 2), -1), "got -1 to -1"),
        (np.full((2, 2, 2), "a"), "numbers or booleans"),
    ],
)
@pytest.mark.parametrize("save", [save_npz, save_binvox])
def test_what_is_no_volume_is_not_written(volume, message, save, tmp_path):
    with pytest.raises(ValueError, match=message):
        save(tmp_path / "volume", volume)
    assert list(tmp_path.iterdir()) == []


def test_npz_brings_back_the_volume_and_its_extras(tmp_path):
    path = tmp_path / "volume.npz"
    views = np.arange(30, dtype=np.float64).reshape(2, 15)
    save_npz(path, lumpy().astype(np.float64), views=views, names=["front", "top"])
    arrays = load_npz(path)
    assert arrays.keys() == {"probability", "views", "names"}
    assert arrays["probability"].dtype == np.float32
    np.testing.assert_array_equal(arrays["probability"], lumpy())
    np.testing.assert_array_equal(arrays["views"], views)
    assert arrays["names"].tolist() == ["front", "top"]
    assert os.listdir(tmp_path) == ["volume.npz"]


def test_npz_takes_no_pickles(tmp_path):
    with pytest.raises(ValueError, match="extra 'what' has dtype object"):
        save_npz(tmp_path / "volume.npz", lumpy(), what=[{}])


def _npz(**arrays):
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "damaged"),
        (b"nonsense", "damaged"),
        (_npz(probability=lumpy())[:5000], "damaged"),
        (_npz(other=lumpy()), "must have an array 'probability', it has other"),
        (_npz(probability=np.zeros((4, 4))), r"got \[4, 4\]"),
        (_npz(probability=np.full((4, 4, 4), 2.0)), r"lie in \[0, 1\]"),
    ],
)
def test_npz_names_what_is_wrong_with_a_file(content, message, tmp_path):
    path = tmp_path / "volume.npz"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=message) as error:
        load_npz(path)
    assert str(path) in str(error.value)


def test_npz_refuses_a_single_array(tmp_path):
    np.save(tmp_path / "volume.npy", lumpy())
    with pytest.raises(ValueError, match=r"no \.npz file"):
        load_npz(tmp_path / "volume.npy")


@given(CUBES)
def test_binvox_brings_back_the_occupancy(tmp_path_factory, volume):
    path = tmp_path_factory.mktemp("binvox") / "volume.binvox"
    save_binvox(path, volume)
    loaded = load_binvox(path)
    assert loaded.dtype == np.float32
    np.testing.assert_array_equal(loaded, volume)


def test_binvox_agrees_with_trimesh_on_axes_and_place(tmp_path):
    path = tmp_path / "volume.binvox"
    save_binvox(path, lumpy())
    with path.open("rb") as file:
        grid = binvox.load_binvox(file, axis_order="xzy")
    np.testing.assert_array_equal(grid.matrix, lumpy() > 0.5)
    # The specification puts the file's cube, [0, 1]^3 scaled and then translated, at [-1/2, 1/2]^3.
    # (trimesh's own transform spreads the voxel centres over that cube instead, so it is not compared.)
    assert path.read_bytes().startswith(b"#binvox 1\ndim 64 64 64\ntranslate -0.5 -0.5 -0.5\nscale 1\ndata\n")


def test_binvox_reads_what_trimesh_writes(tmp_path):
    path = tmp_path / "volume.binvox"
    occupied = lumpy(64) > 0.5
    path.write_bytes(binvox.export_binvox(VoxelGrid(occupied), axis_order="xzy"))
    np.testing.assert_array_equal(load_binvox(path), occupied)


def test_binvox_order_is_x_then_z_then_y(tmp_path):
    path = tmp_path / "volume.binvox"
    volume = np.zeros((4, 4, 4))
    volume[1, 2, 3] = 1
    save_binvox(path, volume)
    runs = path.read_bytes().partition(b"\ndata\n")[2]
    assert list(runs) == [0, (1 * 4 + 3) * 4 + 2, 1, 1, 0, 63 - 30]


HEADER = b"#binvox 1\ndim 2 2 2\ntranslate 0 0 0\nscale 1\ndata\n"


def test_binvox_version_2_counts_any_value_as_occupied(tmp_path):
    path = tmp_path / "volume.binvox"
    path.write_bytes(HEADER.replace(b"1\n", b"2\n", 1) + bytes([0, 4, 7, 4]))
    assert load_binvox(path).ravel().tolist() == [0, 0, 0, 0, 1, 1, 1, 1]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "must start with '#binvox 1'"),
        (b"ply\ndata\n", "must start with '#binvox 1'"),
        (b"#binvox 1\ndim 2 2 2\n", "a line 'data'"),
        (HEADER.replace(b"dim 2 2 2\n", b"") + b"\0\x08", "a line such as 'dim 64 64 64'"),
        (HEADER.replace(b"2 2 2", b"2 2 4") + b"\0\x10", "a cube"),
        (HEADER.replace(b"2 2 2", b"2 x 2") + b"\0\x08", "a cube"),
        (HEADER.replace(b"2 2 2", b"9999 9999 9999"), "up to 1024"),
        (HEADER + b"\0\x08\1", "pairs of bytes"),
        (HEADER + b"\0\x07", "must fill 8 voxels, got 7"),
        (HEADER + b"\0\x09", "must fill 8 voxels, got 9"),
        (HEADER, "must fill 8 voxels, got 0"),
    ],
)
def test_binvox_names_what_is_wrong_with_a_file(content, message, tmp_path):
    path = tmp_path / "volume.binvox"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=message):
        load_binvox(path)


@pytest.mark.parametrize("load", [load_npz, load_binvox])
def test_a_missing_file_is_a_missing_file(load, tmp_path):
    with pytest.raises(FileNotFoundError):
        load(tmp_path / "absent")


def test_an_error_while_writing_leaves_the_old_file_alone(tmp_path):
    path = tmp_path / "file.txt"
    path.write_text("old")

    def write() -> None:
        with replacing(path) as temporary:
            temporary.write_text("half of the n")
            raise RuntimeError("disk full")

    with pytest.raises(RuntimeError, match="disk full"):
        write()
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["file.txt"]


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no folder .*absent"):
        save_npz(tmp_path / "absent" / "volume.npz", lumpy())


def test_as_probability_copies_and_converts():
    ones = np.ones((2, 2, 2), np.float32)
    assert as_probability(ones) is not ones
    assert as_probability(ones > 0).dtype == np.float32
