"""What a pass of the network costs for several objects at once: `python docs/serving/passes.py` prints a table.

Processor time, the least of some runs, so that other work on the machine shows as little as it can.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import sketchcore as sk
from sketchcore.nets.compactmodel import CompactModel
from sketchcore.nets.sketches import Sketches

SIZES = (1, 2, 4, 8)
RUNS = 15


def main() -> None:
    model = sk.load_model()
    assert isinstance(model, CompactModel)
    passes = model.passes
    batch = sk.generate(0, max(SIZES), views=2)
    objects = [Sketches(*pair) for pair in zip(batch.drawings, batch.packed_cameras, strict=True)]
    readings = passes.read(objects)
    prior = passes.decide(readings, None, [2] * len(objects))
    print("| objects in a pass | wall, CPU ms each |\n|---|---|")
    for size in SIZES:
        wall, cpu = least(lambda size=size: passes.decide(readings[:size], prior[:size], [2] * size))
        print(f"| {size} | {1000 * wall / size:.1f}, {1000 * cpu / size:.1f} |", flush=True)


def least(job: Callable[[], object]) -> tuple[float, float]:
    """The least seconds, of the clock and of the processor, of some runs."""
    job()
    found = []
    for _ in range(RUNS):
        wall, cpu = time.perf_counter(), time.process_time()
        job()
        found.append((time.perf_counter() - wall, time.process_time() - cpu))
    return min(wall for wall, _ in found), min(cpu for _, cpu in found)


if __name__ == "__main__":
    main()
