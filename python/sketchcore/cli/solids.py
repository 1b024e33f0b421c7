"""Drawings to solids."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

import sketchcore as sk
from sketchcore.cli.application import JsonOption, ModelOption, app, errors, progress_bar


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
    model: ModelOption = None,
    as_json: JsonOption = False,
) -> None:
    """Turn drawings of one object into a solid.

    The viewpoints are quarter-037 -052 -127 -142 -217 -232 -307 -322 (three-quarter views by azimuth, the front
    of an object looks along azimuth 0), front, right, back, left and top.
    """
    with errors():
        from sketchcore.picture import save_picture

        with progress_bar("rounds", iterations, quiet=as_json) as show:
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
