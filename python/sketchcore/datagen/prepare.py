"""A folder of meshes becomes a data set: every file on its own, whatever is wrong with the others.

The split of an object, and its place in it, depend on what is in its file alone: adding files moves none of the others,
and a file that comes twice is kept once.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from sketchcore.atomic import write_atomically
from sketchcore.datagen.cleaning import LeftOutError, place
from sketchcore.datagen.prepared import INDEX, OBJECTS, SPLITS, VERSION, MeshObject, load_found, save_object
from sketchcore.datagen.processes import process_pool
from sketchcore.datagen.upright import AXES, CUSTOM, FIXED, check_axis, elect, standing
from sketchcore.meshfile import READ_SUFFIXES, load_mesh

VOTERS = 48
"""So many files of each kind say what is up."""
REPORT = "report.json"


@dataclass(frozen=True)
class Preparation:
    """What `prepare` was told.

    Attributes:
        up: which axis is up in the files, one of `upright.AXES`; "auto" to tell by their looks.
        front: which axis the objects look along, likewise.
        split: shares of the splits train, val and test.
        thin: fill what is thinner than a voxel (`thin.fill_thin`); else it is missing, and sheets are left out.
    """

    up: str = "auto"
    front: str = "auto"
    split: tuple[float, float, float] = (0.8, 0.1, 0.1)
    thin: bool = True

    def __post_init__(self) -> None:
        check_axis(self.up, ("auto", *AXES), "up")
        check_axis(self.front, ("auto", *AXES), "front")
        if "auto" not in (self.up, self.front) and self.up[-1] == self.front[-1]:
            raise ValueError(f"up and front must be different axes; got {self.up} and {self.front}")
        if self.front != "auto" and self.up == "auto":
            raise ValueError("a front goes with an up; say both")
        if len(self.split) != 3 or not all(0 <= share <= 1 for share in self.split) or abs(sum(self.split) - 1) > 1e-6:
            raise ValueError(f"split must be three shares that sum up to 1, such as 0.8,0.1,0.1; got {self.split}")


def shares_of(text: str) -> tuple[float, float, float]:
    """Shares as the command line takes them: "0.8,0.1,0.1".

    Raises:
        ValueError: for anything but three numbers.
    """
    try:
        first, second, third = (float(part) for part in text.split(","))
    except ValueError:
        raise ValueError(f"split must be three shares that sum up to 1, such as 0.8,0.1,0.1; got {text!r}") from None
    return first, second, third


@dataclass(frozen=True)
class Report:
    """What `prepare` made of a folder.

    Attributes:
        objects: one dictionary for each object: file, source, sha256, split, and what `cleaning.place` found.
        left_out: source and reason of each file that is in no split.
        ups: for each kind of file (folder and suffix), which axis is up, by what, and the votes.
        made: how many objects were made in this run; the others were there.
    """

    objects: list[dict[str, Any]]
    left_out: list[dict[str, str]]
    ups: list[dict[str, Any]]
    made: int

    def to_dict(self) -> dict[str, Any]:
        """As plain data."""
        return asdict(self)

    def summary(self) -> str:
        """In a few lines of words."""
        sizes = ", ".join(f"{sum(o['split'] == s for o in self.objects)} {s}" for s in SPLITS)
        lines = [f"{len(self.objects)} objects ({sizes}), {self.made} of them new"]
        for kind in self.ups:
            where = f"{kind['suffix']} in {kind['folder']}" if kind["folder"] != "." else kind["suffix"]
            lines.append(f"  up is {kind['up']} in {kind['files']} {where} ({kind['because']})")
        repairs = {
            "closed": sum(o["closed"] for o in self.objects),
            "open or folded, solid by vote of rays": sum(not o["closed"] for o in self.objects),
            "with faces turned over": sum(o["turned_edges"] > 0 for o in self.objects),
            "with vertices merged": sum(o["merged_vertices"] > 0 for o in self.objects),
            "with faces without area taken away": sum(o["degenerate_faces"] > 0 for o in self.objects),
            "with doubled faces taken away": sum(o["doubled_faces"] > 0 for o in self.objects),
            "thinner than voxels in part (above 10 % of theirs)": sum(
                o["thin_voxels"] > 0.1 * 64**3 * o["occupied"] for o in self.objects
            ),
            "hollow, seen from where they are open": sum(o["hollow_voxels"] > 0 for o in self.objects),
            "not symmetric about z = 0 (below 0.9)": sum(o["symmetry"] < 0.9 for o in self.objects),
        }
        lines += [f"  {count} {what}" for what, count in repairs.items() if count]
        if self.left_out:
            lines.append(f"{len(self.left_out)} files left out:")
            lines += [f"  {item['source']}: {item['reason']}" for item in self.left_out]
        return "\n".join(lines)


@dataclass(frozen=True)
class _Job:
    source: Path
    name: str  # relative to the folder
    up: str
    front: str | None
    thin: bool
    target: Path


def prepare(
    folder: Path,
    out: Path,
    preparation: Preparation | None = None,
    *,
    jobs: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Report:
    """Makes a data set of all mesh files in a folder and the folders in it.

    Objects that are there already, from the same file by the same options, are kept: a run that was stopped goes on
    where it was. Files appear whole or not at all; the index is written last.

    Args:
        folder: of .obj, .off, .stl, .ply, .glb and .gltf files.
        out: the data set, made where it is missing.
        preparation: what is known of the files; None for what can be told by their looks.
        jobs: processes; None for one a core.
        progress: called as `progress(done, total)`.

    Raises:
        FileNotFoundError: if there is no such folder.
        ValueError: if it holds no mesh files, or `out` lies in it and holds something else.
    """
    told = preparation or Preparation()
    if not folder.is_dir():
        raise FileNotFoundError(f"no folder {folder}")
    if jobs is not None and jobs < 1:
        raise ValueError(f"jobs must be at least 1, or None for one a core; got {jobs}")
    files = sorted(p for p in folder.rglob("*") if p.suffix.lower() in READ_SUFFIXES and p.is_file())
    files = [p for p in files if out.resolve() not in p.resolve().parents]
    if not files:
        raise ValueError(f"no mesh files in {folder}; they end in {', '.join(READ_SUFFIXES)}")
    (out / OBJECTS).mkdir(parents=True, exist_ok=True)
    with _Workers(jobs or os.cpu_count() or 1) as workers:
        ups = _upwards(folder, files, told, workers)
        kinds = {(kind["folder"], kind["suffix"]): kind["up"] for kind in ups}
        todo: list[tuple[_Job, dict[str, Any], dict[str, Any]]] = []
        objects: list[dict[str, Any]] = []
        left_out: list[dict[str, str]] = []
        first: dict[str, str] = {}
        front = None if told.front == "auto" else told.front
        for path in files:
            name = path.relative_to(folder).as_posix()
            digest = _digest(path)
            if digest is None:
                left_out.append({"source": name, "reason": "cannot be read"})
                continue
            if digest in first:
                left_out.append({"source": name, "reason": f"the same as {first[digest]}"})
                continue
            first[digest] = name
            up = kinds[_kind(folder, path)]
            target = out / OBJECTS / f"{_plain(name)}-{digest[:8]}.safetensors"
            options = {"up": up, "asked_front": told.front, "thin": told.thin, "format": VERSION}
            entry = {"file": target.name, "source": name, "sha256": digest, "split": _split(digest, told.split)}
            known = load_found(target)
            if known is not None and all(known.get(key) == value for key, value in options.items()):
                objects.append(entry | known)
            else:
                todo.append((_Job(path, name, up, front, told.thin, target), entry, options))
        done, total = len(files) - len(todo), len(files)
        if progress is not None:
            progress(done, total)
        for number, result in workers.each(_make, [(job, options) for job, _, options in todo]):
            job, entry, _ = todo[number]
            if isinstance(result, str):
                left_out.append({"source": job.name, "reason": result})
            else:
                objects.append(entry | result)
            done += 1
            if progress is not None:
                progress(done, total)
    made = len(todo) - sum(job.name in {item["source"] for item in left_out} for job, _, _ in todo)
    report = Report(_sorted(objects), _sorted(left_out), ups, made)
    _write(out, told, report)
    return report


def _sorted(items: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return sorted(items, key=lambda item: str(item["source"]))


def _write(out: Path, told: Preparation, report: Report) -> None:
    index = {"format": VERSION, "options": asdict(told), "objects": report.objects}
    write_atomically(out / REPORT, (json.dumps(report.to_dict(), indent=1) + "\n").encode())
    write_atomically(out / INDEX, (json.dumps(index, indent=1) + "\n").encode())


def _digest(path: Path) -> str | None:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return None


def _split(digest: str, shares: Sequence[float]) -> str:
    """By the hash of what is in the file."""
    place = int(digest[:15], 16) / 16**15
    return SPLITS[min(int(np.searchsorted(np.cumsum(shares)[:2], place, side="right")), 2)]


def _plain(name: str) -> str:
    """A name for a file from the path of another: letters, digits and dashes."""
    return re.sub(r"[^A-Za-z0-9]+", "-", name.rsplit(".", 1)[0]).strip("-")[:80] or "mesh"


def _kind(folder: Path, path: Path) -> tuple[str, str]:
    return path.parent.relative_to(folder).as_posix(), path.suffix.lower()


def _upwards(folder: Path, files: list[Path], told: Preparation, workers: _Workers) -> list[dict[str, Any]]:
    """Which axis is up, for each kind of file."""
    kinds: dict[tuple[str, str], list[Path]] = {}
    for path in files:
        kinds.setdefault(_kind(folder, path), []).append(path)
    ups = []
    for (where, suffix), members in kinds.items():
        entry: dict[str, Any] = {"folder": where, "suffix": suffix, "files": len(members), "votes": {}}
        custom = CUSTOM.get(suffix, "y")
        if told.up != "auto":
            entry |= {"up": told.up, "because": "as told"}
        elif suffix in FIXED:
            entry |= {"up": custom, "because": "the format says so"}
        else:
            asked = members[:: max(1, len(members) // VOTERS)][:VOTERS]
            votes = [vote for _, vote in workers.each(_vote, asked) if isinstance(vote, dict)]
            up, counts = elect(votes, custom)
            most = counts.get(up, 0)
            because = f"{most} of {sum(counts.values())} that tell" if most else "the custom of the format"
            entry |= {"up": up, "because": because, "votes": counts}
        ups.append(entry)
    return ups


def _vote(path: Path) -> dict[str, float] | str:
    """How well a mesh stands, by axis; or why nothing can be said."""
    try:
        mesh = load_mesh(path)
        return standing(np.ascontiguousarray(mesh.vertices, np.float64), np.ascontiguousarray(mesh.faces, np.int64))
    except (ValueError, OSError, MemoryError) as error:
        return str(error)


def _make(task: tuple[_Job, dict[str, Any]]) -> dict[str, Any] | str:
    """Writes an object; returns what was found, or why it is left out."""
    job, options = task
    try:
        mesh = load_mesh(job.source)
        vertices, faces = np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int64)
        made = place(vertices, faces, job.up, job.front, job.thin)
    except LeftOutError as reason:
        return str(reason)
    except (ValueError, OSError, MemoryError) as error:
        return f"unreadable: {str(error).removeprefix(f'{job.source} ')}" if str(error) else type(error).__name__
    found = made.found | options
    save_object(job.target, MeshObject(made.vertices, made.faces, made.world), found)
    return found


class _Workers:
    """Processes that work on one file each; a file that kills its process is told of, and the others go on."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._pool: ProcessPoolExecutor | None = None

    def __enter__(self) -> _Workers:
        return self

    def __exit__(self, *_: object) -> None:
        self._close()

    def _close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
            self._pool = None

    def _submit(self, work: Callable[[Any], Any], task: object) -> Future[Any]:
        if self._pool is None:
            self._pool = process_pool(self._count)
        return self._pool.submit(work, task)

    def each(self, work: Callable[[Any], Any], tasks: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """Numbers of tasks with their results, as they come; a sentence for a task whose process died."""
        if self._count == 1:
            yield from ((number, work(task)) for number, task in enumerate(tasks))
            return
        waiting: dict[Future[Any], int] = {}
        coming = iter(range(len(tasks)))
        while True:
            for number in islice(coming, 2 * self._count - len(waiting)):
                waiting[self._submit(work, tasks[number])] = number
            if not waiting:
                return
            finished, _ = wait(waiting, return_when=FIRST_COMPLETED)
            broken = []
            for future in finished:
                try:
                    yield waiting[future], future.result()
                    del waiting[future]
                except BrokenProcessPool:
                    broken.append(future)
            if broken:
                # One of those that were waiting did it: each is tried alone.
                suspects = sorted(waiting.values())
                waiting.clear()
                for number in suspects:
                    self._close()
                    try:
                        yield number, self._submit(work, tasks[number]).result()
                    except BrokenProcessPool:
                        yield number, "the process that read it died"
                self._close()
