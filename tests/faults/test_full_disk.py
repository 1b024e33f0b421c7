"""A disk that is full: a clear error, and whatever was there before is as it was."""

from __future__ import annotations

import asyncio
import errno
import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import trimesh

from sketchcore.datagen.export import Export, export
from sketchcore.mesh import save_mesh
from sketchcore.nets.storing import save_weights
from sketchcore.nets.weights import load_weights
from sketchcore.train.checkpoint import Progress, load_checkpoint, save_checkpoint
from sketchcore.volume import save_binvox, save_npz

ROOM = 2**17


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of its own, of 128 KiB; where none may be mounted, a limit on the size of files."""
    place = tmp_path / "disk"
    place.mkdir()
    mounted = os.geteuid() == 0 and _run("mount", "-t", "tmpfs", "-o", f"size={ROOM}", "tmpfs", str(place))
    if mounted:
        yield place
        _run("umount", "-l", str(place))
        return
    before, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (ROOM, before[1]))
    yield place
    resource.setrlimit(resource.RLIMIT_FSIZE, before)
    signal.signal(signal.SIGXFSZ, handler)


def _run(*command: str) -> bool:
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


def weights(path: Path, size: int) -> None:
    save_weights(path, {"w": torch.randn(size)}, {"network": f"of {size}"})


def checkpoint(path: Path, size: int) -> None:
    save_checkpoint(path, {"w": torch.randn(size)}, {}, [], Progress("compact"), {"network": "none"}, {})


def mesh(path: Path, size: int) -> None:
    save_mesh(trimesh.creation.icosphere(subdivisions=6 if size > 1 else 0), path)


def volume(path: Path, size: int) -> None:
    noise = np.random.default_rng(0).random((64, 64, 64), np.float32) if size > 1 else np.ones((8, 8, 8), np.float32)
    (save_npz if path.suffix == ".npz" else save_binvox)(path, noise)


WRITERS: dict[str, Callable[[Path, int], None]] = {
    "a.safetensors": weights,
    "compact.checkpoint.safetensors": checkpoint,
    "a.glb": mesh,
    "a.obj": mesh,
    "a.stl": mesh,
    "a.ply": mesh,
    "a.npz": volume,
    "a.binvox": volume,
}


@pytest.mark.parametrize("name", WRITERS)
def test_a_file_is_whole_or_as_it_was(disk: Path, name: str) -> None:
    write = WRITERS[name]
    with pytest.raises(OSError, match="was not written"):
        write(disk / name, 300_000)
    assert list(disk.iterdir()) == [], "nothing is left of it"
    write(disk / name, 1)
    before = {path: path.read_bytes() for path in disk.iterdir()}
    with pytest.raises(OSError, match=r"(the disk is full|the file is too large); .* is as it was before"):
        write(disk / name, 300_000)
    assert {path: path.read_bytes() for path in disk.iterdir()} == before
    if name == "a.safetensors":
        assert load_weights(disk / name)[0]["w"].shape == (1,)
    if write is checkpoint:
        assert load_checkpoint(disk / name).progress.stage == "compact"


def test_an_export_goes_on_once_there_is_room(disk: Path, tmp_path: Path) -> None:
    task, out = Export(0, 20, 2), disk / "data"
    ballast = disk / "ballast"
    if os.path.ismount(disk):
        ballast.write_bytes(bytes(ROOM - 2**15))
    else:  # no file may be as large as a shard
        task = Export(0, 40, 1)
    with pytest.raises(OSError, match=r"; .*shard-000000.tar was not written"):
        export(task, out)
    assert [path.name for path in out.iterdir()] == ["export.json"]
    if not os.path.ismount(disk):
        return
    ballast.unlink()
    export(task, tmp_path / "whole")
    with pytest.raises(OSError, match=r"; .*shard-000001.tar was not written"):
        export(task, out)
    assert (out / "shard-000000.tar").read_bytes() == (tmp_path / "whole" / "shard-000000.tar").read_bytes()
    assert not (out / "manifest.json").exists()


def no_room(path: Path, data: bytes) -> None:
    raise OSError(errno.ENOSPC, "the disk is full")


def test_the_app_says_so_and_keeps_all_once_there_is_room(disk: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("nicegui")
    import httpx
    from fastapi import FastAPI

    from sketchcore.app.server import Server, build_router
    from sketchcore.app.store import Store

    server = Server(Store(disk / "sessions"))
    api = FastAPI()
    api.include_router(build_router(server))

    def post(path: str, body: Any = None) -> httpx.Response:
        async def asked() -> httpx.Response:
            async with httpx.AsyncClient(transport=httpx.ASGITransport(api), base_url="http://app") as client:
                return await client.post(path, json=body)

        return asyncio.run(asked())

    id = post("/api/sessions").json()["id"]

    def stroke(number: int) -> Any:
        line = [[float(number), float(i), 0.5] for i in range(200)]
        drawn = {"id": f"stroke-{number}", "kind": "ink", "points": line}
        return post(f"/api/s/{id}/strokes", {"op": f"op-{number}", "viewpoint": "quarter-037", "strokes": [drawn]})

    assert stroke(1).status_code == 200
    ballast = disk / "ballast"
    if os.path.ismount(disk):
        room = os.statvfs(disk)
        ballast.write_bytes(bytes(room.f_bavail * room.f_bsize))
    else:
        monkeypatch.setattr("sketchcore.app.store.write_atomically", no_room)
    before = {path: path.read_bytes() for path in (disk / "sessions").rglob("*") if path.is_file()}
    failed = stroke(2)
    assert failed.status_code == 507
    assert "could not be kept" in failed.json()["error"]
    assert post("/api/sessions").status_code == 507
    assert {path: path.read_bytes() for path in (disk / "sessions").rglob("*") if path.is_file()} == before
    assert stroke(2).status_code == 507, "asked again, it is not said to be kept"
    ballast.unlink(missing_ok=True)
    monkeypatch.undo()
    assert stroke(2).status_code == 200
    found = Store(disk / "sessions").get(id)
    assert [s.id for s in found.document.sheets[0].strokes] == ["stroke-1", "stroke-2"]
    assert found.undo()
    assert found.undo()
    assert not found.undo()
    server.close()


def test_a_history_that_was_cut_short_is_whole_again(tmp_path: Path) -> None:
    pytest.importorskip("nicegui")
    from sketchcore.app.store import _append

    path = tmp_path / "history.jsonl"
    _append(path, ['{"begin": 1}'])
    code = (
        "import resource, signal, sys; from pathlib import Path; from sketchcore.app.store import _append\n"
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN); resource.setrlimit(resource.RLIMIT_FSIZE, (40, 40))\n"
        "_append(Path(sys.argv[1]), ['x' * 100])"
    )
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True, check=False)
    assert "File too large" in done.stderr
    assert path.read_text() == '{"begin": 1}\n'
