"""The process that `cost.py` measures: run as a script, so that nothing is imported before its time counts."""

from __future__ import annotations

import json
import sys
import time


def main() -> None:
    """Reads the task from stdin; writes `[done, total]` after each shape, and the figures, a line of JSON each."""
    task = json.load(sys.stdin)
    started = time.perf_counter()
    import numpy as np  # what the package imports anyway

    import sketchcore as sk

    objects = []
    for entry in task["objects"]:
        cameras = [sk.Camera.from_packed(np.array(row)) for row in entry["cameras"]]
        shape = sk.Shape.from_json(entry["shape"])
        objects.append(([sk.draw(shape, camera) for camera in cameras], cameras))
    model = sk.load_model(task["model"])
    drawings, cameras = objects[0]
    sk.reconstruct(drawings[:1], cameras[:1], model=model)
    first_call = time.perf_counter() - started

    counts = range(1, len(drawings) + 1)
    seconds: list[list[float]] = [[] for _ in counts]
    rounds: list[list[int]] = [[] for _ in counts]
    for done, (drawings, cameras) in enumerate(objects, 1):
        for repetition in range(1 + task["repetitions"]):
            for n in counts:
                begun = time.perf_counter()
                solid = sk.reconstruct(drawings[:n], cameras[:n], model=model)
                if repetition:  # the first time is for warming up
                    seconds[n - 1].append(time.perf_counter() - begun)
                    rounds[n - 1].append(len(solid.trace))
        print(json.dumps([done, len(objects)]), flush=True)
    from sketchcore.serve.service import cores

    figures = {
        "first_call": first_call,
        "seconds": seconds,
        "rounds": rounds,
        "peak": peak_memory(),
        "threads": cores(),
    }
    print(json.dumps(figures))


def peak_memory() -> int:
    """The most bytes of memory that this process has held.

    On Linux as the kernel counts it since the process began: `getrusage` there starts from what its parent held.
    """
    try:
        with open("/proc/self/status") as status:
            [line] = (line for line in status if line.startswith("VmHWM:"))
        return 1024 * int(line.split()[1])
    except (FileNotFoundError, ValueError):
        import resource

        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)


if __name__ == "__main__":
    main()
