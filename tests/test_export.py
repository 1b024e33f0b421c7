"""Data sets as WebDataset shards: what is in them, and that they are whole, the same, and read without sketchcore."""

from __future__ import annotations

import gzip
import hashlib
import io
import json
import os
import re
import subprocess
import sys
import tarfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from typer.testing import CliRunner

import sketchcore as sk
from sketchcore.cli import app
from sketchcore.datagen.export import Export, export, make_shard
from sketchcore.datagen.places import open_place

ROOT = Path(__file__).parent.parent
HAND = {"hand": {"share": 0.5}}
TASK = Export(seed=3, count=11, shards=3, first=20, views=2, config=HAND)


def files(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("export") / "data"
    export(TASK, folder)
    return folder


def members(path: Path) -> dict[str, bytes]:
    with tarfile.open(path) as tar:
        assert all((m.mtime, m.uid, m.gid, m.uname, m.gname) == (0, 0, 0, "", "") for m in tar)
        return {member.name: tar.extractfile(member).read() for member in tar}  # type: ignore[union-attr]


def test_shards_hold_the_generators_samples(exported: Path) -> None:
    batch = sk.generate(3, 11, first=20, views=2, config=HAND)
    found = {}
    for shard in ("shard-000000.tar", "shard-000001.tar", "shard-000002.tar"):
        found |= members(exported / shard)
    assert len(found) == 11 * 5
    for i in range(11):
        key = f"{20 + i:012d}"
        for view in range(2):
            with Image.open(io.BytesIO(found[f"{key}.{view}.png"])) as image:
                np.testing.assert_array_equal(255 - np.asarray(image), batch.drawings[i, view])
        packed = np.load(io.BytesIO(gzip.decompress(found[f"{key}.world.npy.gz"])))
        np.testing.assert_array_equal(np.unpackbits(packed, axis=2), batch.world[i])
        cameras = [sk.Camera(**camera) for camera in json.loads(found[f"{key}.cameras.json"])]
        assert cameras == batch.cameras[i]
        assert sk.Shape.from_json(found[f"{key}.shape.json"].decode()) == batch.shapes[i]


def test_the_manifest_says_what_is_there(exported: Path) -> None:
    manifest = json.loads((exported / "manifest.json").read_text())
    assert [(s["first"], s["count"]) for s in manifest["shards"]] == [(20, 3), (23, 4), (27, 4)]
    assert manifest["samples"] == 11
    assert manifest["sketchcore"] == sk.__version__
    for shard in manifest["shards"]:
        data = (exported / shard["name"]).read_bytes()
        assert (shard["bytes"], shard["sha256"]) == (len(data), hashlib.sha256(data).hexdigest())
    said = manifest["data"]
    again = sk.generate(said["seed"], said["count"], first=said["first"], views=said["views"], config=said["config"])
    np.testing.assert_array_equal(again.drawings, sk.generate(3, 11, first=20, views=2, config=HAND).drawings)


@given(first=st.integers(0, 2**40), count=st.integers(1, 500), data=st.data())
def test_every_sample_is_in_one_shard(first: int, count: int, data: st.DataObject) -> None:
    shards = data.draw(st.integers(1, count))
    task = Export(0, count, shards, first)
    ranges = [task.range(number) for number in range(shards)]
    assert [i for start, size in ranges for i in range(start, start + size)] == list(range(first, first + count))
    assert max(size for _, size in ranges) - min(size for _, size in ranges) <= 1


def test_what_is_whole_is_kept_and_what_is_not_is_made_again(exported: Path, tmp_path: Path) -> None:
    want = files(exported)
    for name, data in want.items():
        (tmp_path / name).write_bytes(data)
    (tmp_path / "manifest.json").unlink()
    (tmp_path / "shard-000000.json").unlink()  # killed between the two
    (tmp_path / "shard-000001.tar").write_bytes(want["shard-000001.tar"][:5000])
    (tmp_path / ".shard-000001-00112233.tar").write_bytes(b"left by a writer that was killed")
    kept = (tmp_path / "shard-000002.tar").stat().st_mtime_ns
    shown: list[int] = []
    export(TASK, tmp_path, progress=shown.append)
    assert files(tmp_path) == want
    assert (tmp_path / "shard-000002.tar").stat().st_mtime_ns == kept
    assert shown[0] == 4
    assert shown[-1] == 11


def test_hashes_are_checked_when_asked(exported: Path, tmp_path: Path) -> None:
    want = files(exported)
    for name, data in want.items():
        (tmp_path / name).write_bytes(data)
    turned = bytearray(want["shard-000001.tar"])
    turned[700] ^= 1
    (tmp_path / "shard-000001.tar").write_bytes(turned)
    export(TASK, tmp_path)
    assert files(tmp_path) != want
    export(TASK, tmp_path, verify=True)
    assert files(tmp_path) == want


def test_what_is_interrupted_leaves_no_part_of_a_shard(tmp_path: Path) -> None:
    def stop(done: int) -> None:
        if done > 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        export(TASK, tmp_path, progress=stop)
    assert sorted(files(tmp_path)) == ["export.json", "shard-000000.json", "shard-000000.tar"]
    with pytest.raises(KeyboardInterrupt):
        make_shard(TASK, str(tmp_path / "new"), 1, progress=lambda done: stop(9))
    assert files(tmp_path / "new") == {}


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"seed": 4}, "seed is 3 there and 4 here"),
        ({"count": 12}, "count is 11 there and 12 here"),
        ({"config": {"hand": {"share": 0.25}}}, r"config.hand.share is 0.5 there and 0.25 here"),
        ({"grammar": "chair"}, 'grammar is null there and {"name": "chair"} here'),
        ({"views": 1}, "views is 2 there and 1 here"),
    ],
)
def test_a_folder_holds_one_export(exported: Path, change: dict[str, Any], said: str) -> None:
    before = files(exported)
    with pytest.raises(ValueError, match=re.escape(said)):
        export(replace(TASK, **change), exported)
    assert files(exported) == before


def test_a_config_that_says_the_defaults_is_the_same_export(exported: Path) -> None:
    export(replace(TASK, config=sk.datagen.default_config() | {"hand": {"share": 0.5}}), exported)


def test_another_grammar_in_the_same_file_is_another_export(tmp_path: Path) -> None:
    bottles = (ROOT / "examples" / "bottles.py").read_text()
    path = tmp_path / "bottles.py"
    path.write_text(bottles)
    task = Export(0, 2, 1, grammar=str(path))
    export(task, tmp_path / "data")
    path.write_text(bottles + "\n# changed\n")
    with pytest.raises(ValueError, match=r"grammar.sha256 is"):
        export(task, tmp_path / "data")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"shards": 0}, "11 samples go into 1 to 11 shards, got 0"),
        ({"shards": 12}, "11 samples go into 1 to 11 shards, got 12"),
        ({"count": 0}, "count must be at least 1"),
        ({"views": 14}, "13 viewpoints"),
        ({"first": 2**64 - 5}, "leaves no 11"),
        ({"config": {"pens": 1}}, "pens"),
    ],
)
def test_wrong_exports_say_what_would_be_right(change: dict[str, Any], said: str) -> None:
    with pytest.raises(ValueError, match=re.escape(said)):
        replace(TASK, **change)


def test_wrong_engines_and_places_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="engines are local, processes, ray"):
        export(TASK, tmp_path / "data", engine="slurm")
    with pytest.raises(ValueError, match="at least 1"):
        export(TASK, tmp_path / "data", engine="processes", workers=0)
    with pytest.raises(ValueError, match="memory of one process"):
        export(TASK, "memory://data", engine="processes")
    with pytest.raises(ValueError, match="Protocol not known"):
        export(TASK, "nowhere://data")
    assert not (tmp_path / "data").exists()
    (tmp_path / "export.json").write_text("{}")
    with pytest.raises(ValueError, match="is damaged"):
        export(TASK, tmp_path)


def test_processes_write_the_same_bytes(exported: Path, tmp_path: Path) -> None:
    export(TASK, tmp_path / "data", engine="processes", workers=2)
    assert files(tmp_path / "data") == files(exported)


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="children are found in /proc")
def test_workers_end_with_the_process_that_started_them(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "sketchcore.cli", "generate", "--shards", "100", "--count", "100000"]
    command += ["--engine", "processes", "--workers", "1", "-o", str(tmp_path)]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    until = time.monotonic() + 120
    while not list(tmp_path.glob(".shard-*")) and time.monotonic() < until:
        time.sleep(0.05)
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()
    process.kill()
    process.wait()
    assert children
    while (left := [pid for pid in children if running(pid)]) and time.monotonic() < until:
        time.sleep(0.05)
    assert not left


def running(pid: str) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def test_an_object_store_has_the_same_bytes(exported: Path) -> None:
    fsspec = pytest.importorskip("fsspec")
    export(TASK, "memory://a/data")
    store = fsspec.filesystem("memory")
    found = {path.rsplit("/", 1)[-1]: store.cat_file(path) for path in store.ls("/a/data", detail=False)}
    assert found == files(exported)
    store.rm_file("/a/data/shard-000002.tar")
    export(TASK, "memory://a/data", verify=True)
    assert store.cat_file("/a/data/shard-000002.tar") == found["shard-000002.tar"]
    store.rm("/a", recursive=True)


def test_elsewhere_files_are_moved_into_place(exported: Path, tmp_path: Path) -> None:
    fsspec = pytest.importorskip("fsspec")
    local = type("Watched", (fsspec.get_filesystem_class("file"),), {"protocol": "watched"})
    moved: list[tuple[str, str]] = []
    put: list[str] = []

    def mv(self: Any, a: str, b: str, **options: Any) -> None:
        moved.append((Path(a).name, Path(b).name))
        os.rename(a, b)

    def put_file(self: Any, a: str, b: str, **options: Any) -> None:
        put.append(Path(b).name)
        Path(b).write_bytes(Path(a).read_bytes())

    local.mv, local.put_file = mv, put_file
    local._strip_protocol = classmethod(lambda cls, path: path.removeprefix("watched://"))
    fsspec.register_implementation("watched", local, clobber=True)
    left = tmp_path / "data" / ".shard-000000.tar-0123"
    left.parent.mkdir()
    left.write_bytes(b"left by a writer that was killed")
    export(TASK, f"watched://{tmp_path}/data")
    assert files(tmp_path / "data") == files(exported)
    assert all(name.startswith(".") for name in put)
    assert [b for _, b in moved] == [
        "export.json",
        *[name for i in range(3) for name in (f"shard-00000{i}.tar", f"shard-00000{i}.json")],
        "manifest.json",
    ]


def test_a_file_url_is_a_folder(tmp_path: Path) -> None:
    assert open_place(f"file://{tmp_path}/x").url == str(tmp_path / "x")


def test_the_command_line_exports_and_goes_on(exported: Path, tmp_path: Path) -> None:
    config = tmp_path / "config.json"
    config.write_text(json.dumps(HAND))
    told = ["generate", "--shards", 3, "--count", 11, "--seed", 3, "--first", 20, "--views", 2, "--config", config]
    command = [str(word) for word in [*told, "-o", tmp_path / "data"]]
    done = CliRunner().invoke(app, command)
    assert done.exit_code == 0, done.output
    assert "11 samples in 3 shards" in done.stdout
    assert files(tmp_path / "data") == files(exported)
    for more, said in (
        (["--seed", "4"], "seed is 3 there"),
        (["--meshes", "3"], "either --shards or --meshes"),
        (["--engine", "slurm"], "the engines are"),
    ):
        failed = CliRunner().invoke(app, [*command, *more])
        assert failed.exit_code == 1
        assert said in failed.stderr
    refused = CliRunner().invoke(app, ["generate", "-o", "s3://bucket/data"])
    assert "with --shards" in refused.stderr


def test_they_are_read_without_sketchcore_as_the_guide_says(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("webdataset")
    guide = (ROOT / "docs" / "export.md").read_text()
    making, example = re.findall(r"```py(?:thon)?\n(.*?)```", guide, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    exec(making, {})
    check = """
import sys
assert "sketchcore" not in sys.modules
print(key, drawings.shape, drawings.dtype, world.shape, int(world.sum()), len(cameras), int(drawings.sum()))
"""
    told = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    done = subprocess.run(
        [sys.executable, "-c", example + check], capture_output=True, text=True, cwd=tmp_path, env=told, check=False
    )
    assert done.returncode == 0, done.stderr
    batch = sk.generate(0, 8, views=2)
    ink = int((255 - batch.drawings[7].astype(int)).sum())
    want = f"000000000007 (2, 256, 256) uint8 (64, 64, 64) {batch.world[7].sum()} 2 {ink}"
    assert done.stdout.splitlines()[-1] == want
    assert len(done.stdout.splitlines()) == 9


SLOW = '''
"""Boxes; the worker that comes to sample 7 first says who it is and waits to be killed."""
import os, time
from pathlib import Path
from sketchcore import Grammar

class Boxes(Grammar):
    def grow(self, parts, dice):
        parts.box((0, 0, 0), (dice.between((0.1, 0.4)), 0.3, 0.2))

    def draw(self, seed, index):
        marker = Path(os.environ["MARKER"])
        if index == 7 and not marker.exists():
            (fresh := marker.with_suffix(".fresh")).write_text(str(os.getpid()))
            fresh.rename(marker)
            time.sleep(300)
        return super().draw(seed, index)
'''

ON_RAY = """
import os, signal, sys, threading, time
from pathlib import Path
import ray
from sketchcore.datagen.export import Export, export

ray.init(num_cpus=3, log_to_driver=False, include_dashboard=False)
marker, folder = Path(os.environ["MARKER"]), Path(sys.argv[2])

def kill():
    while not marker.exists():
        time.sleep(0.05)
    assert not (folder / "many" / "manifest.json").exists()
    os.kill(int(marker.read_text()), signal.SIGKILL)

killer = threading.Thread(target=kill)
killer.start()
task = Export(0, 20, 5, grammar=sys.argv[1])
export(task, folder / "many", engine="ray")
killer.join()
export(task, folder / "one", engine="ray", workers=1)
"""


@pytest.mark.slow
def test_ray_makes_the_shards_of_a_killed_worker_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("ray")
    grammar, marker = tmp_path / "boxes.py", tmp_path / "marker"
    grammar.write_text(SLOW)
    monkeypatch.setenv("MARKER", str(marker))
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", ON_RAY, str(grammar), str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert int(marker.read_text()) > 0
    export(Export(0, 20, 5, grammar=str(grammar)), tmp_path / "here")
    assert files(tmp_path / "many") == files(tmp_path / "here") == files(tmp_path / "one")
