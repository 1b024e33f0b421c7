"""The fuzzers' valid inputs, and changes of them that are the same each time: none ends other than it should."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

FUZZ = Path(__file__).parents[1] / "fuzz"
TARGETS = sorted(path.stem for path in (FUZZ / "targets").glob("[a-z]*.py"))
pytestmark = pytest.mark.slow


def test_every_reader_has_a_target() -> None:
    assert TARGETS == ["arrays", "config", "dataset", "drawing", "http", "mesh", "session", "volume", "weights"]


@pytest.mark.parametrize("target", TARGETS)
def test_no_input_is_a_finding(target: str, tmp_path: Path) -> None:
    if target == "http":
        pytest.importorskip("nicegui", reason="the app's routes need NiceGUI (pip install 'sketchcore[app]')")
    command = [sys.executable, FUZZ / "run.py", "--plain", "--inputs", "150", "--findings", tmp_path, target]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    texts = "\n".join(path.read_text() for path in tmp_path.rglob("*.txt"))
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}\n{texts}"
    row = json.loads(done.stdout)
    assert row["executions"] >= 150
    assert row["found"] == []


def test_the_harness_tells_bad_ends_from_good_ones() -> None:
    """What it would say of ends that no target has any more."""
    told = subprocess.run([sys.executable, "-c", _ENDS], cwd=FUZZ, capture_output=True, text=True, check=False)
    assert told.returncode == 0, told.stderr
    assert json.loads(told.stdout) == {
        "a result": None,
        "an own sentence": None,
        "a library's error": "this comes out of a library as it is",
        "another exception": "this is not promised",
        "no sentence": "this is no sentence",
        "a panic": "this is not promised",
        "a hang": "this is not promised",
        "a file elsewhere": "open",
        "a pickle": "pickle.find_class",
        "a network": "socket.",
    }


_ENDS = """
import json, pickle, socket, uuid
from pathlib import Path
import harness, sketchcore as sk
harness.SECONDS = 2.0
class Panic(BaseException):
    pass
def panic():
    raise Panic("called `Option::unwrap()` on a `None` value")
def hang():
    while True:
        pass
def network():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
short = compile("raise ValueError('no')", str(harness.PACKAGE / "made.py"), "exec")
trap = pickle.dumps(json.JSONDecoder)
ends = {
    "a result": lambda: 1,
    "an own sentence": lambda: sk.Shape.from_json("{"),
    "a library's error": lambda: uuid.UUID("x"),
    "another exception": lambda: sk.VIEWPOINTS["nowhere"],
    "no sentence": lambda: exec(short),
    "a panic": panic,
    "a hang": hang,
    "a file elsewhere": lambda: Path("/etc/hostname-of-nobody").exists() or open("/etc/passwd").close(),
    "a pickle": lambda: pickle.loads(trap),
    "a network": network,
}
told = {}
for name, end in ends.items():
    finding = harness.judge(harness.Target(lambda _: end(), list, None), b"")
    told[name] = None if finding is None else next(
        word for word in ("this comes out of a library as it is", "this is not promised", "this is no sentence",
                          "pickle.find_class", "socket.", "open") if word in finding.text)
print(json.dumps(told))
"""
