"""The command line: thin callers of the package's functions."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

import sketchcore as sk

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    help="Line drawings in, solid 3D shapes out; and the data to learn it from.",
)
_console = Console()

Json = Annotated[bool, typer.Option("--json", help="Print plain JSON instead of a table.")]
Grammar = Annotated[
    str | None,
    typer.Option("--grammar", help="What shapes are of: chair, vase, or a Python file with a grammar; else abstract."),
]
Model = Annotated[Path | None, typer.Option("--model", help="Weights to use instead of those in the package.")]


@contextmanager
def _errors() -> Iterator[None]:
    """What went wrong in one sentence, and exit code 1, for what the user can mend."""
    try:
        yield
    except (ValueError, TypeError, OSError, KeyError, RuntimeError) as error:
        message = error.args[0] if isinstance(error, KeyError) else error
        typer.echo(f"error: {message}", err=True)
        raise typer.Exit(1) from None


@contextmanager
def _bar(title: str, total: int | None = None, quiet: bool = False) -> Iterator[Any]:
    """A bar, and what moves it: `show(done)`, or `show(done, total)` where only the work knows how much it is."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), disable=quiet) as bar:
        task = bar.add_task(title, total=total)
        yield lambda done, total=None: bar.update(task, completed=done, total=total)


@app.command()
def reconstruct(
    drawings: Annotated[list[Path], typer.Argument(help="One or more drawings of one object (PNG, JPEG, ...).")],
    out: Annotated[Path, typer.Option("-o", "--out", help="What to write: .glb .obj .stl .ply .npz .binvox")],
    view: Annotated[
        list[str] | None,
        typer.Option("--view", help="Viewpoint of each drawing, in order; a single one's may be left out."),
    ] = None,
    iterations: Annotated[int, typer.Option(help="Rounds over all drawings.")] = 5,
    align: Annotated[bool, typer.Option(help="Look for where drawings made by hand belong, and move them.")] = True,
    picture: Annotated[Path | None, typer.Option(help="Also write a PNG of drawings and solid side by side.")] = None,
    model: Model = None,
    as_json: Json = False,
) -> None:
    """Turn drawings of one object into a solid.

    The viewpoints are quarter-037 -052 -127 -142 -217 -232 -307 -322 (three-quarter views by azimuth, the front
    of an object looks along azimuth 0), front, right, back, left and top.
    """
    with _errors():
        from sketchcore.picture import save_picture

        with _bar("rounds", iterations, quiet=as_json) as show:
            solid = sk.reconstruct(
                drawings,
                view or None,
                iterations=iterations,
                align=align,
                model=model,
                progress=lambda number, total, volume: show(number),
            )
            show(len(solid.trace), len(solid.trace))  # rounds end early where the solid has settled
        solid.save(out)
        if picture is not None:
            save_picture(solid, picture)
    if as_json:
        occupied = float((solid.probability > 0.5).mean())
        report = {"out": str(out), "guessed": solid.guessed, "trace": solid.trace, "occupied": occupied}
        typer.echo(json.dumps(report))
    else:
        if solid.guessed:
            typer.echo(f"viewpoint: {solid.guessed} (guessed)")
        typer.echo(f"wrote {out}")


@app.command()
def generate(
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder to write into.")],
    count: Annotated[int, typer.Option(help="How many samples.")] = 100,
    seed: Annotated[int, typer.Option(help="Which data set.")] = 0,
    first: Annotated[int, typer.Option(help="Index of the first sample.")] = 0,
    views: Annotated[int, typer.Option(help="Drawings a sample, 1 to 13.")] = 1,
    config: Annotated[Path | None, typer.Option(help="JSON file of what differs from the default config.")] = None,
    grammar: Grammar = None,
    meshes: Annotated[
        int | None, typer.Option(help="Write so many shapes as meshes instead, and nothing else; of a grammar's.")
    ] = None,
    suffix: Annotated[str, typer.Option("--format", help="Of meshes: obj, glb, ply, stl.")] = "obj",
) -> None:
    """Write synthetic samples as files: INDEX.npz (drawings, world, frusta, cameras, shape) and INDEX-VIEW.png.

    Or shapes as meshes: INDEX.obj. Training needs no files: see `sketchcore train` and `sketchcore.datasets.Generated`.
    """
    with _errors():
        from sketchcore.datagen.files import write_meshes, write_samples

        settings = json.loads(config.read_text()) if config else None
        with _bar("samples" if meshes is None else "meshes", meshes or count) as show:
            if meshes is None:
                write_samples(
                    out, seed, count, first=first, views=views, config=settings, grammar=grammar, progress=show
                )
            else:
                write_meshes(
                    out, seed, meshes, first=first, config=settings, grammar=grammar, suffix=suffix, progress=show
                )


@app.command()
def prepare(
    folder: Annotated[
        Path, typer.Argument(help="Folder of meshes: .obj .off .stl .ply .glb .gltf, in folders or not.")
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="The data set; what is there already is kept.")],
    up: Annotated[
        str, typer.Option(help="What is up in the files: x, y, z, -x, -y, -z; auto tells by how the meshes stand.")
    ] = "auto",
    front: Annotated[
        str, typer.Option(help="Where the objects look, in the files' axes, beside --up; auto tells by their looks.")
    ] = "auto",
    split: Annotated[str, typer.Option(help="Shares for training, validation and tests.")] = "0.8,0.1,0.1",
    thin: Annotated[
        bool,
        typer.Option("--thin/--no-thin", help="Fill what is thinner than a voxel; else it is missing, as in voxelize."),
    ] = True,
    jobs: Annotated[int | None, typer.Option(help="Processes; the default is one a core.")] = None,
    as_json: Json = False,
) -> None:
    """Make a data set to train on of a folder of meshes, whatever they are.

    Each is turned upright and to the front, scaled so that the world is 120 % of its largest side, cleaned and
    voxelised, solid even where it is open. What was repaired, and what was left out and why, is printed, and written
    to DATASET/report.json. A file's split depends on its content alone. `sketchcore train --data` goes on from there.
    """
    with _errors():
        from sketchcore.datagen.prepare import Preparation, shares_of
        from sketchcore.datagen.prepare import prepare as prepare_meshes

        told = Preparation(up, front, shares_of(split), thin)
        with _bar("meshes", quiet=as_json) as show:
            report = prepare_meshes(folder, out, told, jobs=jobs, progress=show)
    typer.echo(json.dumps(report.to_dict()) if as_json else report.summary())


@app.command()
def train(
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for weights and checkpoints.")],
    preset: Annotated[
        str,
        typer.Option(
            help="compact; laptop (one hour on two cores) or gpu (25 minutes on a GPU), which are compact as well; "
            "paper (the paper's networks and procedure); and alternatives to compact on the same samples, by the same "
            "optimisers: fractional and distance (other truths), paper-matched and multiscale (other networks); chair "
            "and vase, compact on shapes of those grammars."
        ),
    ] = "compact",
    minutes: Annotated[float | None, typer.Option(help="Time for this run; laptop and gpu know theirs.")] = None,
    steps: Annotated[int | None, typer.Option(help="Steps for each network, over all runs.")] = None,
    seed: Annotated[int, typer.Option(help="Of samples and initial weights.")] = 0,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the checkpoint in the folder.")] = False,
    begin: Annotated[
        Path | None,
        typer.Option(
            "--from",
            help="Weights to begin with, of the preset's network; pretrained for those inside the package; else random "
            "ones.",
        ),
    ] = None,
    grammar: Grammar = None,
    data: Annotated[
        Path | None, typer.Option("--data", help="Meshes to learn from (sketchcore prepare), instead of the grammar's.")
    ] = None,
    device: Annotated[str | None, typer.Option(help="cpu or cuda; the default is the best there is.")] = None,
    as_json: Json = False,
) -> None:
    """Train networks on samples straight from the generator; say --minutes or --steps, or take laptop or gpu.

    With --data, samples are drawn from the meshes of a data set's training split, and the held-out IoU is that of its
    validation split; --from begins with weights that know other shapes already.
    """
    with _errors():
        from dataclasses import asdict

        from sketchcore.train import Run
        from sketchcore.train import train as run_training
        from sketchcore.train.presets import grammar_changes

        changes = grammar_changes(preset, grammar)
        run = Run(out, preset, minutes, steps, seed, device, begin=begin, changes=changes, data=data)
        try:
            stages = run_training(run, resume=resume, quiet=as_json)
        except KeyboardInterrupt:
            typer.echo(f"stopped; go on with --resume -o {out}", err=True)
            raise typer.Exit(130) from None
    if as_json:
        typer.echo(json.dumps([asdict(stage) for stage in stages]))
    else:
        typer.echo(f"wrote {out / 'weights.safetensors'}")


@app.command()
def evaluate(
    part: Annotated[
        str,
        typer.Argument(help="What to measure: accuracy, convergence, robustness, cost, drawings, failures, advice."),
    ] = "accuracy",
    model: Model = None,
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
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Folder for PART.json and PART.png, or drawings' pictures.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Measure a network: on the fixed test set, on meshes of one's own, or on people's drawings.

    accuracy: IoU by views and rounds, concavities, carving, ceiling, viewpoint. convergence: ten rounds, and orders of
    the drawings. robustness: faulty drawings. cost: time and memory. drawings: outlines of people's drawings, pieces,
    and pictures from four sides. failures: the shapes that come out worst, with a picture. advice: what the second
    viewpoint that the app advises brings.
    """
    with _errors():
        from sketchcore.evaluate.parts import PARTS, measure_part, write_part

        if part not in PARTS:
            raise ValueError(f"unknown part {part!r}; the parts are {', '.join(PARTS)}")
        with _bar(part) as show:
            report = measure_part(part, model, shapes, drawings, out, show, data)
        if out is not None:
            write_part(part, report, out)
    if as_json:
        typer.echo(json.dumps(report.to_dict()))
    else:
        _console.print(PARTS[part].table(report))


@app.command()
def compare(
    reports: Annotated[
        list[Path], typer.Argument(help="NAME.json of two or more networks (evaluate accuracy --json).")
    ],
    as_json: Json = False,
) -> None:
    """Set networks side by side: IoU by views, and the paired difference to the first one's."""
    with _errors():
        from sketchcore.evaluate.comparison import compare as measure
        from sketchcore.evaluate.present import comparison_table

        report = measure(reports)
    if as_json:
        typer.echo(json.dumps(report.to_dict()))
    else:
        _console.print(comparison_table(report))


@app.command()
def bench(
    repetitions: Annotated[int, typer.Option(help="Each figure is the median of so many.")] = 15,
    growth: Annotated[Path | None, typer.Option(help="Also plot how cost grows with work, as PNG.")] = None,
    as_json: Json = False,
) -> None:
    """Measure the kernels beside what one would otherwise use, on this machine, in one run.

    For each job: our time, the time that no program could beat here (floor), each peer's time, and the ratio. One
    thread, unless the job says otherwise. The peers come with pip install 'sketchcore[bench]'; the missing ones are
    named.
    """
    with _errors():
        from dataclasses import asdict

        from sketchcore.bench import bench as measure
        from sketchcore.bench.growth import Curve, save_plot
        from sketchcore.bench.growth import growth as measure_growth
        from sketchcore.bench.present import as_table as table

        with _bar("jobs") as show:
            report = measure(repetitions, progress=show)
        curves: list[Curve] = []
        if growth is not None:
            with _bar("growth") as show:
                curves = measure_growth(repetitions, progress=show)
            save_plot(curves, growth)
    if as_json:
        typer.echo(json.dumps(report.to_dict() | {"growth": [asdict(curve) for curve in curves]}))
    else:
        _console.print(table(report))


@app.command("app")
def serve_app(
    host: Annotated[str, typer.Option(help="Where to listen; 127.0.0.1 is this machine alone.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="TCP port.", min=1, max=65535)] = 8020,
    sessions: Annotated[
        Path | None, typer.Option(help="Folder of the sessions, instead of the one among the user's data.")
    ] = None,
    model: Model = None,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
) -> None:
    """Draw in the browser: an object from a few sides, and its shape beside it.

    The page is served from this machine. It comes with pip install 'sketchcore[app]'.
    """
    with _errors():
        if find_spec("nicegui") is None:
            raise ValueError("the app needs NiceGUI; install it by: pip install 'sketchcore[app]'")
        from sketchcore.app.launch import launch

        launch(host, port, sessions, model, show=browser)


if __name__ == "__main__":
    app()
