"""Data: samples, meshes, and data sets of meshes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sketchcore.cli.application import GrammarOption, JsonOption, app, errors, progress_bar

if TYPE_CHECKING:
    from sketchcore.datagen.export import Export


@app.command()
def generate(
    out: Annotated[
        str, typer.Option("-o", "--out", help="Folder to write into; for shards also s3://... and the like.")
    ],
    count: Annotated[int, typer.Option(help="How many samples.")] = 100,
    seed: Annotated[int, typer.Option(help="Which data set.")] = 0,
    first: Annotated[int, typer.Option(help="Index of the first sample.")] = 0,
    views: Annotated[int, typer.Option(help="Drawings a sample, 1 to 13.")] = 1,
    config: Annotated[Path | None, typer.Option(help="JSON file of what differs from the default config.")] = None,
    grammar: GrammarOption = None,
    meshes: Annotated[
        int | None, typer.Option(help="Write so many shapes as meshes instead, and nothing else; of a grammar's.")
    ] = None,
    suffix: Annotated[str, typer.Option("--format", help="Of meshes: obj, glb, ply, stl.")] = "obj",
    shards: Annotated[
        int | None, typer.Option(help="Write the samples as so many WebDataset shards instead (docs/export.md).")
    ] = None,
    engine: Annotated[
        str, typer.Option(help="Who makes shards: local, this process; processes, several; ray, a Ray cluster.")
    ] = "local",
    workers: Annotated[
        int | None, typer.Option(help="Shards made at a time by processes or ray; the default is one a core.")
    ] = None,
    verify: Annotated[
        bool, typer.Option("--verify", help="Check shards that are there by their hashes, not their sizes alone.")
    ] = False,
) -> None:
    """Write synthetic samples as files: INDEX.npz (drawings, world, frusta, cameras, shape) and INDEX-VIEW.png.

    Or shapes as meshes: INDEX.obj. Or as WebDataset shards, to any URL that fsspec opens; the same command again goes
    on after a kill at any moment. Training needs no files: see `sketchcore train` and `sketchcore.datasets.Generated`.
    """
    with errors():
        from sketchcore.datagen.export import Export
        from sketchcore.datagen.files import write_meshes, write_samples

        settings = json.loads(config.read_text()) if config else None
        if shards is not None:
            if meshes is not None:
                raise ValueError("say either --shards or --meshes, not both")
            _export(Export(seed, count, shards, first, views, settings or {}, grammar), out, engine, workers, verify)
            return
        if "://" in out:
            raise ValueError(f"{out} is no folder; only shards are written to URLs, say how many with --shards")
        with progress_bar("samples" if meshes is None else "meshes", meshes or count) as show:
            if meshes is None:
                write_samples(
                    Path(out), seed, count, first=first, views=views, config=settings, grammar=grammar, progress=show
                )
            else:
                write_meshes(
                    Path(out), seed, meshes, first=first, config=settings, grammar=grammar, suffix=suffix, progress=show
                )


def _export(task: Export, url: str, engine: str, workers: int | None, verify: bool) -> None:
    from sketchcore.datagen.export import export

    try:
        with progress_bar("samples", task.count) as show:
            manifest = export(task, url, engine=engine, workers=workers, verify=verify, progress=show)
    except KeyboardInterrupt:
        typer.echo("stopped; the same command goes on", err=True)
        raise typer.Exit(130) from None
    typer.echo(f"wrote {manifest['samples']} samples in {len(manifest['shards'])} shards, {manifest['bytes']:,} bytes")


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
    as_json: JsonOption = False,
) -> None:
    """Make a data set to train on of a folder of meshes, whatever they are.

    Each is turned upright and to the front, scaled so that the world is 120 % of its largest side, cleaned and
    voxelised, solid even where it is open. What was repaired, and what was left out and why, is printed, and written
    to DATASET/report.json. A file's split depends on its content alone. `sketchcore train --data` goes on from there.
    """
    with errors():
        from sketchcore.datagen.prepare import Preparation, shares_of
        from sketchcore.datagen.prepare import prepare as prepare_meshes

        told = Preparation(up, front, shares_of(split), thin)
        with progress_bar("meshes", quiet=as_json) as show:
            report = prepare_meshes(folder, out, told, jobs=jobs, progress=show)
    typer.echo(json.dumps(report.to_dict()) if as_json else report.summary())
