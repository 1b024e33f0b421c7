"""The figures of docs/scale.md: what a sample costs to make, to store and to read, and what follows for many of them.

Run as `python docs/scale.py -o docs/scale.json`, with sketchcore, webdataset and torch; it prints the table of the
document. All rates are for one thread and go by the processor's time, not by the clock, so that other work on the
machine disturbs them little: caches and memory are still shared. On a quiet machine they are better.
"""

from __future__ import annotations

import argparse
import json
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import torch
import webdataset
from torch.utils.flop_counter import FlopCounterMode

import sketchcore as sk
from sketchcore.bench.machine import measure as measure_machine
from sketchcore.datagen.export import Export, export
from sketchcore.nets.compact import CompactNet
from sketchcore.nets.unet import PaperNet
from sketchcore.train.chains import PASSES, compact_inputs, start_chain
from sketchcore.train.presets import PRESETS
from sketchcore.train.samples import training_samples

PAPER_SHAPES, PAPER_VIEWS = 20_000, 13
BILLION = 10**9
ASSUMED_FLOPS = 200e12
"""What an H100 is assumed to do of these convolutions in bfloat16, forwards and backwards: a fifth of its 989e12."""
REPEATS = 7
_CHUNK = 64


def rate(make: Callable[[int], object], count: int) -> float:
    """Samples a second of processor time; the median of several runs.

    Args:
        make: makes or reads `count` samples; it is told the number of the run.
        count: how many.
    """
    make(0)
    found = []
    for number in range(1, REPEATS + 1):
        began = time.process_time()
        make(number)
        found.append(count / (time.process_time() - began))
    return statistics.median(found)


def generated(views: int, count: int) -> float:
    """Whole samples of `generate` a second, in a loop that hands the last batch back."""
    batch = sk.generate(0, count, views=views, threads=1)

    def make(number: int) -> None:
        sk.generate(0, count, first=number * count, views=views, threads=1, out=batch)

    return rate(make, count)


def stored(views: int, count: int) -> tuple[float, float, float]:
    """Samples exported a second, bytes of a sample, samples that webdataset decodes a second."""
    with tempfile.TemporaryDirectory() as folder:

        def write(number: int) -> None:
            export(Export(0, count, 1, first=number * count, views=views), f"{folder}/{number}")

        written = rate(write, count)
        sizes = [path.stat().st_size for path in Path(folder).glob("*/*.tar")]

        def read(number: int) -> None:
            data = webdataset.WebDataset(f"{folder}/{number}/shard-000000.tar", shardshuffle=False).decode("l8")
            assert sum(1 for _ in data) == count

        return written, statistics.mean(sizes) / count, rate(read, count)


def chains(count: int) -> float:
    """Shapes a second for the preset compact: drawings by hand and in styles, truth and evidence."""
    preset = PRESETS["compact"]
    return rate(lambda number: [start_chain(preset, 0, number * count + i) for i in range(count)], count)


def paper_batches(count: int) -> float:
    """Samples a second for the preset paper: one drawing and its camera grid."""
    preset = PRESETS["paper"]
    return rate(lambda number: training_samples(preset, 0, number * count, count, 1, None, frusta=True), count)


def training_flops() -> dict[str, float]:
    """Operations of one training step on one sample, forwards and backwards, as torch counts them."""
    found = {}
    preset = PRESETS["compact"]
    some = [start_chain(preset, 0, i) for i in range(16)]
    compact, paper = CompactNet(), PaperNet()
    passes: dict[str, Callable[[], torch.Tensor]] = {
        "compact": lambda: compact(**compact_inputs(some, torch.device("cpu"))),
        "paper": lambda: paper(torch.rand(16, 1, 256, 256)),
    }
    for name, forwards in passes.items():
        with FlopCounterMode(display=False) as counter:
            forwards().float().mean().backward()
        found[name] = counter.get_total_flops() / 16
    return found


def measure() -> dict[str, Any]:
    """All figures."""
    one, thirteen = generated(1, _CHUNK), generated(PAPER_VIEWS, 8)
    written, size, decoded = stored(1, 256)
    written_13, size_13, decoded_13 = stored(PAPER_VIEWS, 32)
    made = {"compact": chains(_CHUNK), "paper": paper_batches(_CHUNK)}
    flops = training_flops()
    # Each pass of a chain trains, and a new shape is asked for when it has gone through all of its passes.
    passes = {"compact": sum((n + 1) * share for n, share in enumerate(PASSES)), "paper": 1.0}
    asked = {name: ASSUMED_FLOPS / flops[name] / passes[name] for name in made}
    return {
        "processor": measure_machine(3).processor,
        "generate": {"views_1": one, "views_13": thirteen},
        "export": {"views_1": written, "views_13": written_13},
        "bytes": {"views_1": size, "views_13": size_13},
        "decode": {"views_1": decoded, "views_13": decoded_13},
        "paper_core_hours": {
            "generate": PAPER_SHAPES / thirteen / 3600,
            "export": PAPER_SHAPES / written_13 / 3600,
            "gigabytes": PAPER_SHAPES * size_13 / 1e9,
        },
        "billion": {
            "generate_core_hours": BILLION / one / 3600,
            "export_core_hours": BILLION / written / 3600,
            "terabytes": BILLION * size / 1e12,
        },
        "training": {
            "made_a_core": made,
            "gflop_a_pass": {name: each / 1e9 for name, each in flops.items()},
            "passes_a_shape": passes,
            "assumed_flops": ASSUMED_FLOPS,
            "h100_shapes": asked,
            "h100_cores": {name: asked[name] / made[name] for name in made},
        },
    }


def table(found: dict[str, Any]) -> str:
    """The rows of the document."""
    one, many = "views_1", "views_13"
    paper, billion, training = found["paper_core_hours"], found["billion"], found["training"]
    rows: list[tuple[str, str, str]] = [(f"on one core of {found['processor']}", "one view", "13 views")]
    for name, what in (
        ("generate", "samples made a second"),
        ("export", "samples exported a second"),
        ("decode", "samples read by webdataset a second"),
        ("bytes", "bytes of a sample in a shard"),
    ):
        rows.append((what, f"{found[name][one]:,.0f}", f"{found[name][many]:,.0f}"))
    rows.append(("20,000 shapes x 13 views, made: core-minutes", "", f"{60 * paper['generate']:.1f}"))
    rows.append(("the same, exported: core-minutes", "", f"{60 * paper['export']:.1f}"))
    rows.append(("the same, gigabytes", "", f"{paper['gigabytes']:.2f}"))
    rows.append(("a billion samples, made: core-hours", f"{billion['generate_core_hours']:.0f}", ""))
    rows.append(("a billion samples, exported: core-hours", f"{billion['export_core_hours']:.0f}", ""))
    rows.append(("a billion samples, terabytes", f"{billion['terabytes']:.1f}", ""))
    rows.append(("", "compact", "paper"))
    for name, what in (
        ("made_a_core", "shapes made for training a second"),
        ("gflop_a_pass", "GFLOP of a training pass"),
        ("passes_a_shape", "passes of a shape"),
        ("h100_shapes", f"shapes a second at an assumed {training['assumed_flops'] / 1e12:.0f} TFLOP/s"),
        ("h100_cores", "cores that this takes"),
    ):
        rows.append((what, *(f"{training[name][net]:,.3g}" for net in ("compact", "paper"))))
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def main() -> None:
    """Measures, writes JSON, prints the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-o", "--out", type=Path)
    told = parser.parse_args()
    torch.set_num_threads(1)
    found = measure()
    if told.out is not None:
        told.out.write_text(json.dumps(found, indent=1) + "\n")
    print(table(found))


if __name__ == "__main__":
    main()
