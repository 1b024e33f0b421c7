"""Processes that work is shared among end with the one that started them, whatever ended that."""

import os
import signal
import subprocess
import sys
import time

_STARTS = """
import os, time
from sketchcore.datagen.processes import process_pool
if __name__ == "__main__":
    pool = process_pool(2)
    print(*{pool.submit(os.getpid).result() for _ in range(4)}, flush=True)
    pool.submit(time.sleep, 600).result()
"""


def alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_workers_end_when_who_started_them_is_killed(tmp_path):
    script = tmp_path / "starts.py"
    script.write_text(_STARTS)
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True) as started:
        workers = [int(pid) for pid in started.stdout.readline().split()]
        assert workers
        assert all(alive(pid) for pid in workers)
        started.send_signal(signal.SIGKILL)
        started.wait()
    deadline = time.monotonic() + 20
    while any(alive(pid) for pid in workers) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(alive(pid) for pid in workers)
