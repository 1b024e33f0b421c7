"""`sketchcore app`: where it listens, where it keeps sessions, and how it ends."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

from sketchcore.asgi.address import announce, is_local, own_names

_GOODBYE = 2
"""Seconds that open connections get once the server is told to end."""


def sessions_folder() -> Path:
    """The folder of the sessions where none is named: among the user's data, as the platform has it."""
    home = Path.home()
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    elif sys.platform == "darwin":
        base = home / "Library" / "Application Support"
    else:
        base = Path(os.environ.get("XDG_DATA_HOME") or home / ".local" / "share")
    return base / "sketchcore" / "sessions"


def launch(
    host: str = "127.0.0.1",
    port: int = 8020,
    sessions: str | os.PathLike[str] | None = None,
    model: Any = None,
    show: bool = True,
) -> None:
    """Serves the app until it is told to end.

    Args:
        host: where to listen; anything but this machine itself is warned of.
        port: TCP port.
        sessions: folder of the sessions; None for `sessions_folder()`.
        model: as for `sketchcore.reconstruct`.
        show: open the page in the user's browser.

    Raises:
        ModuleNotFoundError: where NiceGUI is not installed.
        OSError: if the folder cannot be made.
    """
    from nicegui import app, ui

    from sketchcore.app.page import build_page
    from sketchcore.app.server import Server, build_router
    from sketchcore.app.store import Store
    from sketchcore.asgi.guard import Guard

    store = Store(Path(sessions) if sessions is not None else sessions_folder())
    local = is_local(host)
    server = Server(store, model, open=local)
    app.include_router(build_router(server))
    app.add_middleware(Guard, hosts=own_names(host) if local else None)
    build_page()
    app.on_shutdown(server.close)
    announce("sketchcore app", host, port)
    print(f"sessions: {store.folder}", flush=True)
    ui.run(
        host=host,
        port=port,
        title="sketchcore",
        reload=False,
        show=show,
        tailwind=False,
        show_welcome_message=False,
        reconnect_timeout=30.0,
        timeout_graceful_shutdown=_GOODBYE,
    )
