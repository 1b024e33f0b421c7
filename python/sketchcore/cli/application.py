"""What all commands share: the application they belong to, options, errors in a sentence, progress."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    help="Line drawings in, solid 3D shapes out; and the data to learn it from.",
)
console = Console()

JsonOption = Annotated[bool, typer.Option("--json", help="Print plain JSON instead of a table.")]
GrammarOption = Annotated[
    str | None,
    typer.Option("--grammar", help="What shapes are of: chair, vase, or a Python file with a grammar; else abstract."),
]
ModelOption = Annotated[Path | None, typer.Option("--model", help="Weights to use instead of those in the package.")]


@contextmanager
def errors() -> Iterator[None]:
    """What went wrong in one sentence, and exit code 1, for what the user can mend."""
    try:
        yield
    except (ValueError, TypeError, OSError, KeyError, RuntimeError) as error:
        message = error.args[0] if isinstance(error, KeyError) else error
        typer.echo(f"error: {message}", err=True)
        raise typer.Exit(1) from None


@contextmanager
def progress_bar(title: str, total: int | None = None, quiet: bool = False) -> Iterator[Any]:
    """A bar, and what moves it: `show(done)`, or `show(done, total)` where only the work knows how much it is."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), disable=quiet) as bar:
        task = bar.add_task(title, total=total)
        yield lambda done, total=None: bar.update(task, completed=done, total=total)
