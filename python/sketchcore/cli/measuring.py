"""Measurements: of networks and of kernels."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from sketchcore.cli.application import JsonOption, ModelOption, app, console, errors, progress_bar


@app.command()
def evaluate(
    part: Annotated[
        str,
        typer.Argument(help="What to measure: accuracy, convergence, robustness, cost, drawings, failures, advice."),
    ] = "accuracy",
    model: ModelOption = None,
    shapes: Annotated[
        int | None,
        typer.Option(help="The first so many shapes (all 500; convergence and advice 100, robustness 50, cost 25)."),
    ] = None,
    drawings: Annotated[
        list[Path] | None, typer.Option("--drawings", help="Folders of people's drawings, for the part drawings.")
    ] = None,
    data: Annotated[
        Path | None,
        typer.Option("--data", help="Data set (sketchcore prepare) whose test split accuracy is measured on instead."),
    ] = None,
    align: Annotated[
        bool, typer.Option(help="Move drawings that are plainly out of place; exact ones may all stay (accuracy).")
    ] = True,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Folder for PART.json and PART.png, or drawings' pictures.")
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Measure a network: on the fixed test set, on meshes of one's own, or on people's drawings.

    accuracy: IoU by views and rounds, concavities, carving, ceiling, viewpoint. convergence: ten rounds, and orders of
    the drawings. robustness: faulty drawings. cost: time and memory. drawings: outlines of people's drawings, pieces,
    and pictures from four sides. failures: the shapes that come out worst, with a picture. advice: what the second
    viewpoint that the app advises brings.
    """
    with errors():
        from sketchcore.evaluate.parts import PARTS, measure_part, write_part

        if part not in PARTS:
            raise ValueError(f"unknown part {part!r}; the parts are {', '.join(PARTS)}")
        with progress_bar(part) as show:
            report = measure_part(part, model, shapes, drawings, out, show, data, align)
        if out is not None:
            write_part(part, report, out)
    if as_json:
        typer.echo(json.dumps(report.to_dict()))
    else:
        console.print(PARTS[part].table(report))


@app.command()
def compare(
    reports: Annotated[
        list[Path], typer.Argument(help="NAME.json of two or more networks (evaluate accuracy --json).")
    ],
    as_json: JsonOption = False,
) -> None:
    """Set networks side by side: IoU by views, and the paired difference to the first one's."""
    with errors():
        from sketchcore.evaluate.comparison import compare as measure
        from sketchcore.evaluate.present import comparison_table

        report = measure(reports)
    if as_json:
        typer.echo(json.dumps(report.to_dict()))
    else:
        console.print(comparison_table(report))


@app.command()
def bench(
    repetitions: Annotated[int, typer.Option(help="Each figure is the median of so many.")] = 15,
    growth: Annotated[Path | None, typer.Option(help="Also plot how cost grows with work, as PNG.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Measure the kernels beside what one would otherwise use, on this machine, in one run.

    For each job: our time, the time that no program could beat here (floor), each peer's time, and the ratio. One
    thread, unless the job says otherwise. The peers come with pip install 'sketchcore[bench]'; the missing ones are
    named.
    """
    with errors():
        from dataclasses import asdict

        from sketchcore.bench import bench as measure
        from sketchcore.bench.growth import Curve, save_plot
        from sketchcore.bench.growth import growth as measure_growth
        from sketchcore.bench.present import as_table as table

        with progress_bar("jobs") as show:
            report = measure(repetitions, progress=show)
        curves: list[Curve] = []
        if growth is not None:
            with progress_bar("growth") as show:
                curves = measure_growth(repetitions, progress=show)
            save_plot(curves, growth)
    if as_json:
        typer.echo(json.dumps(report.to_dict() | {"growth": [asdict(curve) for curve in curves]}))
    else:
        console.print(table(report))
