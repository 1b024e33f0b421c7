"""`sketchcore serve`: where it listens, and how it ends."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import uvicorn

from sketchcore.asgi.address import announce, is_local, own_names
from sketchcore.reconstruction import load_model
from sketchcore.serve.api import build_app
from sketchcore.serve.service import Limits


def launch(
    host: str = "127.0.0.1",
    port: int = 8021,
    model: Any = None,
    device: str | None = None,
    limits: Limits | None = None,
    names: Sequence[str] = (),
    log: bool = True,
) -> None:
    """Serves until it is told to end (SIGTERM, SIGINT); requests that it has taken on are answered first.

    Args:
        host: where to listen; anything but this machine itself is warned of.
        port: TCP port.
        model: as for `sketchcore.reconstruct`.
        device: as for `sketchcore.reconstruct`.
        limits: what is taken on.
        names: more names that it may be called by, as behind a reverse proxy; it takes any where it listens to others
            than this machine.
        log: a line for each request.

    Raises:
        FileNotFoundError: if there are no such weights.
        ValueError: if they are damaged, or there is no such device.
    """
    limits = limits or Limits()
    app = build_app(load_model(model, device), limits, (*own_names(host), *names) if is_local(host) else None)
    announce("sketchcore serve", host, port)
    uvicorn.run(
        app,
        host=host,
        port=port,
        access_log=log,
        log_level="info" if log else "warning",
        ws="none",
        timeout_graceful_shutdown=round(limits.seconds) + 1,
    )
