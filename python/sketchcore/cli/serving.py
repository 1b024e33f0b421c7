"""Servers: the app, and the reconstruction for other programs."""

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


@app.command("serve")
def serve_http(
    host: Annotated[str, typer.Option(help="Where to listen; 127.0.0.1 is this machine alone.")] = "127.0.0.1",
    port: Annotated[int, typer.Option(help="TCP port.", min=1, max=65535)] = 8021,
    model: ModelOption = None,
    device: Annotated[str | None, typer.Option(help="cpu or cuda; the default is the best there is.")] = None,
    workers: Annotated[
        int | None, typer.Option(help="Requests computed at a time; one a core if left out, 8 on a GPU.", min=1)
    ] = None,
    batch: Annotated[
        int | None, typer.Option(help="Objects in a pass of the network; 1 if left out, 8 on a GPU.", min=1)
    ] = None,
    waiting: Annotated[int, typer.Option(help="Requests that may wait beside those; more are refused.", min=0)] = 16,
    seconds: Annotated[float, typer.Option(help="From a request to its answer, at most.", min=0.1)] = 60.0,
    megabytes: Annotated[int, typer.Option(help="Of a request.", min=1)] = 32,
    drawings: Annotated[int, typer.Option(help="Of an object.", min=1)] = 8,
    megapixels: Annotated[int, typer.Option(help="Of a drawing.", min=1, max=100)] = 50,
    name: Annotated[
        list[str] | None, typer.Option("--name", help="A host name that it is called by, as behind a proxy.")
    ] = None,
    log: Annotated[bool, typer.Option("--log/--no-log", help="A line for each request.")] = True,
) -> None:
    """Serve the reconstruction to other programs, over HTTP.

    POST drawings to /v1/reconstruct; /openapi.json says how. It comes with pip install 'sketchcore[serve]'.
    """
    with errors():
        missing = [package for package in ("fastapi", "uvicorn", "python_multipart") if find_spec(package) is None]
        if missing:
            raise ValueError(f"the server needs {', '.join(missing)}; install by: pip install 'sketchcore[serve]'")
        from sketchcore.nets.loading import on_cpu
        from sketchcore.serve.launch import launch
        from sketchcore.serve.service import Limits, cores

        gpu = not on_cpu(device)
        limits = Limits(
            workers or (8 if gpu else cores()),
            batch or (8 if gpu else 1),
            waiting,
            seconds,
            megabytes,
            drawings,
            megapixels,
        )
        launch(host, port, model, device, limits, name or (), log)
