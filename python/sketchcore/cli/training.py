"""Training."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Annotated

import typer

from sketchcore.cli.application import GrammarOption, JsonOption, app, errors


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
    grammar: GrammarOption = None,
    data: Annotated[
        Path | None, typer.Option("--data", help="Meshes to learn from (sketchcore prepare), instead of the grammar's.")
    ] = None,
    device: Annotated[str | None, typer.Option(help="cpu or cuda; the default is the best there is.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Train networks on samples straight from the generator; say --minutes or --steps, or take laptop or gpu.

    With --data, samples are drawn from the meshes of a data set's training split, and the held-out IoU is that of its
    validation split; --from begins with weights that know other shapes already. torchrun -m sketchcore.train takes the
    same options, and trains in several processes.
    """
    with errors():
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
    if os.environ.get("RANK", "0") != "0":  # what torchrun started beside the first
        return
    if as_json:
        typer.echo(json.dumps([asdict(stage) for stage in stages]))
    else:
        typer.echo(f"wrote {out / 'weights.safetensors'}")
