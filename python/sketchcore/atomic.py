"""Files that appear whole or not at all."""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_FULL = {errno.ENOSPC: "the disk is full", errno.EDQUOT: "the quota is used up", errno.EFBIG: "the file is too large"}


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A fresh file in the same folder to write to, with the same suffix; it takes the place of `path` at the end.

    If the block raises, or the process is killed, `path` is left as it was.

    Raises:
        FileNotFoundError: if the folder does not exist.
        OSError: if the disk is full; the message says which file is missing for it.
    """
    target = Path(path)
    if not target.parent.is_dir():
        raise FileNotFoundError(f"no folder {target.parent} to write {target.name} into")
    fresh = target.with_name(f".{target.stem}-{secrets.token_hex(4)}{target.suffix}")
    try:
        yield fresh
        with fresh.open("rb+") as file:
            os.fsync(file.fileno())
        fresh.replace(target)
    except OSError as error:
        if error.errno not in _FULL:
            raise
        was = "is as it was before" if target.exists() else "was not written"
        raise OSError(error.errno, f"{_FULL[error.errno]}; {target} {was}") from error
    finally:
        fresh.unlink(missing_ok=True)


def sweep(path: str | os.PathLike[str]) -> None:
    """Takes away what is left in the folder of writers of a file that were killed. None may be writing it."""
    target = Path(path)
    for left in target.parent.glob(f".{target.stem}-{'[0-9a-f]' * 8}{target.suffix}"):
        left.unlink(missing_ok=True)


def write_atomically(path: str | os.PathLike[str], data: bytes) -> None:
    """Writes bytes to a file, whole or not at all."""
    with replacing(path) as fresh:
        fresh.write_bytes(data)
