"""Where a server listens, and whom that lets in."""

from __future__ import annotations

import ipaddress
import sys


def is_local(host: str) -> bool:
    """Whether only this machine can reach what listens at a host."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def own_names(host: str) -> tuple[str, ...]:
    """The names that a server at a local host is called by."""
    return ("localhost", "127.0.0.1", "::1", host)


def announce(title: str, host: str, port: int) -> None:
    """Says where a server listens; warns where others than this machine reach it."""
    shown = f"[{host}]" if ":" in host else host
    print(f"{title}: http://{shown}:{port} (Ctrl+C ends it)", flush=True)
    if not is_local(host):
        print(
            f"warning: it listens on {host}, so others may reach it from the network; there are no passwords. "
            "Leave out --host to keep it to this machine.",
            file=sys.stderr,
            flush=True,
        )
