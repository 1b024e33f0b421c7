"""Servers: the app."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from sketchcore.cli.application import ModelOption, app, errors


@app.command("app")
def serve_app(
    host: Annotated[str, typer.Option(help="Where to listen; 127.0.0.1 is this machine alone.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="TCP port.", min=1, max=65535)] = 8020,
    sessions: Annotated[
        Path | None, typer.Option(help="Folder of the sessions, instead of the one among the user's data.")
    ] = None,
    model: ModelOption = None,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
) -> None:
    """Draw in the browser: an object from a few sides, and its shape beside it.

    The page is served from this machine. It comes with pip install 'sketchcore[app]'.
    """
    with errors():
        if find_spec("nicegui") is None:
            raise ValueError("the app needs NiceGUI; install it by: pip install 'sketchcore[app]'")
        from sketchcore.app.launch import launch

        launch(host, port, sessions, model, show=browser)
