"""What files from anywhere are made of: JSON, zip archives, arrays. Sizes are checked before anything is unpacked.

The libraries that parse these raise whatever they stumbled over. From here comes ValueError, with a sentence.
"""

from __future__ import annotations

import io
import json
import os
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

_REASON = 200
"""Characters of what a library says that are passed on."""


def reason(error: BaseException) -> str:
    """What a library says of its trouble, in one line that is not too long."""
    text = str(error).strip().split("\n")[0][:_REASON]
    return text if " " in text else f"{type(error).__name__} {text}".strip()


def check_size(path: str | os.PathLike[str], most: int, what: str) -> None:
    """Refuses a file that is larger than its kind may be.

    Raises:
        FileNotFoundError: if there is no such file.
        ValueError: if it has more than `most` bytes.
    """
    if not Path(path).is_file():
        raise FileNotFoundError(f"no {what} at {path}")
    size = Path(path).stat().st_size
    if size > most:
        raise ValueError(f"{path}: a {what} may have up to {most // 2**20} MiB, this one has {size // 2**20 + 1}")


def parse_json(text: bytes | str, what: str) -> Any:
    """Plain data of JSON, without NaN and Infinity.

    Raises:
        ValueError: for what is no JSON, or nested without end.
    """

    def refuse(constant: str) -> None:
        raise ValueError(f"{what} holds {constant}; every number must be finite")

    try:
        return json.loads(text, parse_constant=refuse)
    except UnicodeDecodeError as error:
        raise ValueError(f"{what} is not valid JSON: it is no text in UTF-8") from error
    except json.JSONDecodeError as error:
        raise ValueError(f"{what} is damaged; it is not valid JSON: {error}") from error
    except RecursionError as error:
        raise ValueError(f"{what} is nested too deeply") from error


class Archive:
    """A zip archive. Names inside are looked up, never used as paths.

    Args:
        file: opened for reading.
        what: what it is, in sentences.
        entries: how many it may have.

    Raises:
        ValueError: if it is no archive, or has more entries.
    """

    def __init__(self, file: BinaryIO, what: str, entries: int) -> None:
        self._what = what
        with self._read():
            self._zip = zipfile.ZipFile(file)
        if len(self._zip.infolist()) > entries:
            raise ValueError(f"{what} has up to {entries} entries, this one more")
        self.names = self._zip.namelist()

    def read(self, name: str, most: int) -> bytes:
        """The content of an entry.

        Raises:
            ValueError: if there is no such entry, it is damaged, or has more than `most` bytes.
        """
        if name not in self.names:
            raise ValueError(f"this is not {self._what}, or it is damaged: it has no {name}")
        # What the archive says of its size may be a lie; no more than that much is unpacked.
        with self._read(), self._zip.open(name) as stream:
            content = stream.read(most + 1)
        if len(content) > most:
            raise ValueError(f"{name[:80]} in {self._what} is larger than {most} bytes")
        return content

    @contextmanager
    def _read(self) -> Iterator[None]:
        try:
            yield
        except MemoryError:
            raise
        except Exception as error:
            raise ValueError(f"this is not {self._what}, or it is damaged: {reason(error)}") from error


def parse_array(content: bytes, what: str) -> NDArray[Any]:
    """The array of an `.npy` file; nothing is unpickled.

    Raises:
        ValueError: if it is damaged, says another size than it has, or holds objects.
    """
    file = io.BytesIO(content)
    try:
        version = npy.read_magic(file)
        read = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}.get(version)
        if read is None:
            raise ValueError(f"its version is {version}")
        shape, fortran, dtype = read(file)
        if dtype.hasobject:
            raise ValueError("it holds objects")
        held = len(content) - file.tell()
        needed = dtype.itemsize
        for side in shape:
            needed *= side
        if min(shape, default=0) < 0 or needed != held:
            raise ValueError(f"{list(shape)} numbers of {dtype.itemsize} bytes are said to be in {held} bytes")
        array = np.frombuffer(content, dtype, offset=file.tell()) if needed else np.empty(0, dtype)
        return array.reshape(shape, order="F" if fortran else "C").copy()
    except MemoryError:
        raise
    except Exception as error:
        raise ValueError(f"{what} is damaged: {reason(error)}") from error
