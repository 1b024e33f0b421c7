"""Where an export is written: a folder, or any URL that fsspec opens. A file appears there whole, or not at all."""

from __future__ import annotations

import hashlib
import os
import secrets
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

from sketchcore.atomic import replacing, write_atomically

OBJECT_STORES = {"s3", "s3a", "gs", "gcs", "az", "abfs", "abfss", "adl", "oss", "oci", "r2", "memory"}
"""Protocols whose one put is whole or nothing; elsewhere a file is put under another name first, and moved."""
_FRESH = (".shard-", ".export", ".manifest")
"""What names of files begin with that are still being written."""


class Place(Protocol):
    """A folder of files, wherever it is.

    Attributes:
        url: what it is called, in messages and by other processes.
        shared: whether other processes can write into it.
    """

    @property
    def url(self) -> str: ...

    @property
    def shared(self) -> bool: ...

    def sizes(self) -> dict[str, int]:
        """Bytes of each file, by name, without those that are still being written; {} if there is no such folder."""
        ...

    def read(self, names: Sequence[str]) -> list[bytes]:
        """What is in some files."""
        ...

    def digest(self, name: str) -> str:
        """SHA-256 of a file, in hexadecimal digits."""
        ...

    def writing(self, name: str) -> Any:
        """A context with a local path to write to; what was written is the file afterwards, unless the block raised."""
        ...

    def write(self, name: str, data: bytes) -> None:
        """Writes a small file."""
        ...

    def sweep(self) -> None:
        """Takes away what writers left that were killed."""
        ...


def open_place(url: str | os.PathLike[str]) -> Place:
    """A folder's path, a file:// URL, or any other URL that fsspec has a driver for.

    Raises:
        ValueError: if the driver is missing, or the URL is none.
    """
    text = os.fspath(url)
    if text.startswith("file://"):
        return Folder(Path(text.removeprefix("file://")).absolute())
    return Remote(text) if "://" in text else Folder(Path(text).absolute())


class Folder:
    """A folder of this machine, or one that it has mounted."""

    shared = True

    def __init__(self, path: Path) -> None:
        self._path = path

    @property
    def url(self) -> str:
        """The folder's path."""
        return str(self._path)

    def sizes(self) -> dict[str, int]:
        """See `Place`."""
        if not self._path.is_dir():
            return {}
        with os.scandir(self._path) as entries:
            return {entry.name: entry.stat().st_size for entry in entries if not entry.name.startswith(".")}

    def read(self, names: Sequence[str]) -> list[bytes]:
        """See `Place`."""
        return [(self._path / name).read_bytes() for name in names]

    def digest(self, name: str) -> str:
        """See `Place`."""
        with (self._path / name).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()

    @contextmanager
    def writing(self, name: str) -> Iterator[Path]:
        """See `Place`."""
        self._path.mkdir(parents=True, exist_ok=True)
        with replacing(self._path / name) as fresh:
            yield fresh

    def write(self, name: str, data: bytes) -> None:
        """See `Place`."""
        self._path.mkdir(parents=True, exist_ok=True)
        write_atomically(self._path / name, data)

    def sweep(self) -> None:
        """See `Place`."""
        for left in self._path.glob(".*"):
            if left.name.startswith(_FRESH):
                left.unlink(missing_ok=True)


class Remote:
    """A URL that fsspec opens."""

    def __init__(self, url: str) -> None:
        try:
            import fsspec

            self._fs, root = fsspec.core.url_to_fs(url)
        except (ImportError, ValueError) as error:
            raise ValueError(
                f"{url} cannot be opened: {error}; pip install 'sketchcore[export]' brings fsspec, and fsspec's "
                "documentation names the driver of each protocol"
            ) from None
        self._root = str(root).rstrip("/")
        self._url = url
        protocols = {self._fs.protocol} if isinstance(self._fs.protocol, str) else set(self._fs.protocol)
        self._whole = bool(protocols & OBJECT_STORES)
        self.shared = "memory" not in protocols

    @property
    def url(self) -> str:
        """The URL as it was given."""
        return self._url

    def sizes(self) -> dict[str, int]:
        """See `Place`."""
        with self._telling():
            self._fs.invalidate_cache()
            try:
                found = self._fs.ls(self._root, detail=True)
            except FileNotFoundError:
                return {}
        names = {str(item["name"]).rsplit("/", 1)[-1]: int(item["size"] or 0) for item in found}
        return {name: size for name, size in names.items() if not name.startswith(".")}

    def read(self, names: Sequence[str]) -> list[bytes]:
        """See `Place`."""
        if not names:
            return []
        with self._telling():
            paths = [self._at(name) for name in names]
            found = self._fs.cat(paths)
            return [bytes(found[path]) for path in paths]

    def digest(self, name: str) -> str:
        """See `Place`."""
        digest = hashlib.sha256()
        with self._telling(), self._fs.open(self._at(name), "rb") as file:
            while block := file.read(2**22):
                digest.update(block)
        return digest.hexdigest()

    @contextmanager
    def writing(self, name: str) -> Iterator[Path]:
        """See `Place`."""
        with tempfile.TemporaryDirectory(prefix="sketchcore-") as folder:
            local = Path(folder) / name
            yield local
            with self._telling():
                self._put(local, name)

    def write(self, name: str, data: bytes) -> None:
        """See `Place`."""
        with self.writing(name) as local:
            local.write_bytes(data)

    def sweep(self) -> None:
        """See `Place`."""
        if self._whole:
            return
        with self._telling():
            self._fs.invalidate_cache()
            for path in self._fs.ls(self._root, detail=False) if self._fs.exists(self._root) else ():
                if str(path).rsplit("/", 1)[-1].startswith(_FRESH):
                    self._fs.rm_file(path)

    def _at(self, name: str) -> str:
        return f"{self._root}/{name}"

    def _put(self, local: Path, name: str) -> None:
        self._fs.makedirs(self._root, exist_ok=True)
        if self._whole:
            self._fs.put_file(str(local), self._at(name))
            return
        fresh = self._at(f".{name}-{secrets.token_hex(4)}")
        self._fs.put_file(str(local), fresh)
        if self._fs.exists(self._at(name)):  # not every file system moves a file onto another
            self._fs.rm_file(self._at(name))
        self._fs.mv(fresh, self._at(name))

    @contextmanager
    def _telling(self) -> Iterator[None]:
        """What drivers raise, as OSError."""
        try:
            yield
        except OSError:
            raise
        except Exception as error:  # each driver has exceptions of its own
            raise OSError(f"{self._url}: {type(error).__name__}: {error}") from error
