"""Batches that take a while: how far they are, how they are stopped, and what memory they take."""

import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from sketchcore.datagen import generate

FINE = {"frustum_rays": 4}


def test_progress_counts_up_to_the_whole_on_the_calling_thread():
    calls = []
    made = generate(4, 300, config=FINE, progress=lambda n: calls.append((n, time.monotonic(), threading.get_ident())))
    numbers, times, threads = zip(*calls, strict=True)
    assert numbers[-1] == 300
    assert (np.diff(numbers) > 0).all()
    assert set(threads) == {threading.get_ident()}
    # At most 20 times a second, but for the last one.
    assert (np.diff(times)[:-1] >= 0.05).all()
    np.testing.assert_array_equal(made.world[:2], generate(4, 2).world)
    calls.clear()
    generate(4, 0, progress=lambda n: calls.append(n))
    assert calls == []


@pytest.mark.parametrize("threads", [None, 1, 2])
def test_an_exception_of_progress_stops_the_batch(threads):
    out = [np.empty(shape, np.uint8) for shape in ((4000, 1, 256, 256), (4000, 64, 64, 64), (4000, 1, 64, 64, 64))]
    out[1][:, 0, 0, 0] = 77
    calls = []

    def fail(finished):
        calls.append(finished)
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        generate(4, 4000, config=FINE, threads=threads, out=tuple(out), progress=fail)
    assert len(calls) == 1
    assert (out[1][:, 0, 0, 0] == 77).sum() > 2000, "most samples were never begun"


def test_progress_must_be_callable():
    with pytest.raises(TypeError, match="progress must be callable, got int"):
        generate(0, 1, progress=5)


def child(code):
    return subprocess.Popen([sys.executable, "-c", code], text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


INTERRUPTED = """
import signal
import time
import numpy as np
from sketchcore.datagen import generate

signal.signal(signal.SIGINT, signal.default_int_handler)  # what runs in the background ignores it
seen = []
def progress(finished):
    seen.append(finished)  # first: the signal may come before the next line
    if len(seen) == 1:
        print("begun", flush=True)

try:
    generate(4, 4000, config={"frustum_rays": 4}, threads=2, progress=progress)
except KeyboardInterrupt:
    used = time.process_time()
    time.sleep(0.5)
    used = time.process_time() - used
    world = generate(4, 2, threads=2).world
    np.testing.assert_array_equal(world, generate(4, 2, threads=1).world)
    print(seen[-1], used)
"""


def test_ctrl_c_stops_a_batch_and_its_threads():
    process = child(INTERRUPTED)
    assert process.stdout.readline() == "begun\n"
    process.send_signal(signal.SIGINT)
    said, complaints = process.communicate(timeout=60)
    assert process.returncode == 0, complaints
    finished, used = map(float, said.split())
    assert finished < 2000
    assert used < 0.1, "no thread works on"


MEMORY = """
from pathlib import Path
from sketchcore.datagen import generate

def resident(entry):
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith(entry))

before = resident("VmRSS")
made = generate(4, {count}, views=2, threads={threads}, config={{"hand": {{"share": 0.5}}}})
after = resident("VmHWM")
print(after - before - made.drawings.nbytes - made.world.nbytes - made.frusta.nbytes)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="resident memory is read from /proc")
@pytest.mark.parametrize("threads", [1, 2])
def test_a_batch_takes_its_arrays_and_8_megabytes_a_thread(threads):
    process = child(MEMORY.format(count=400, threads=threads))
    said, complaints = process.communicate(timeout=120)
    assert process.returncode == 0, complaints
    print(f"{threads} threads: {int(said) / 2**20:.1f} MB beside the arrays")
    assert int(said) < threads * 8e6
