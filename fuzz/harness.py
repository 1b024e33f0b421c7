"""How an input is judged: what every target shares.

An input may end in a result, or in one of the exceptions that the docstrings promise, raised by the package itself and
with a sentence. Everything else is a finding: other exceptions, panics of the Rust core, warnings of arithmetic, more
time or memory than is allowed, files opened elsewhere, networks, processes and pickles.
"""

from __future__ import annotations

import resource
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import Any

import sketchcore

PACKAGE = Path(sketchcore.__file__).parent
SCRATCH = Path(tempfile.mkdtemp(prefix="sketchcore-fuzz-"))
"""Where targets put the files that they read, and where whatever is temporary goes."""
tempfile.tempdir = str(SCRATCH)
SECONDS = 10.0
"""Of the processor, for one input: other processes may have it as well."""
_FORBIDDEN = ("socket.", "subprocess.", "os.system", "os.exec", "os.posix_spawn", "pickle.find_class", "webbrowser.")
_LIBRARIES = (*(str(Path(path).resolve()) for path in (sys.prefix, sys.base_prefix, PACKAGE)), "/proc/", "/sys/")
"""Where code and its data lie: imports open files as well."""


@dataclass(frozen=True)
class Target:
    """Something that reads the outside world.

    Attributes:
        attempt: reads one input.
        seeds: valid inputs, made anew each time.
        mutate: another input, of one that there is.
        refusals: the exceptions that inputs may end in; their subclasses only where they are the package's own.
        megabytes: the memory that an input may take, beyond what the process takes.
    """

    attempt: Callable[[bytes], object]
    seeds: Callable[[], list[bytes]]
    mutate: Callable[[bytes, Random], bytes]
    refusals: tuple[type[Exception], ...] = (ValueError,)
    megabytes: int = 1024


class HangError(BaseException):
    """An input took too long."""


@dataclass(frozen=True)
class Finding:
    """An input that did not end as it should.

    Attributes:
        key: what it is known by: of several inputs that end alike, one is kept.
        text: what happened.
    """

    key: str
    text: str


_trespasses: list[str] = []
_watched = False


def _audit(event: str, arguments: tuple[Any, ...]) -> None:
    if not _watched:
        return
    if event.startswith(_FORBIDDEN):
        _trespasses.append(f"{event} {arguments!r:.200}")
    elif event == "open" and isinstance(arguments[0], str | bytes):
        name = arguments[0] if isinstance(arguments[0], str) else arguments[0].decode(errors="replace")
        if arguments[1] is None and not {"/", ".."} & {*name[:1], name}:
            return  # `shutil.rmtree` names files from the folder that it is in
        if not str(Path(name).resolve()).startswith((str(SCRATCH), *_LIBRARIES)):
            _trespasses.append(f"open {name!r:.200}")


sys.addaudithook(_audit)


@contextmanager
def _watching() -> Iterator[None]:
    global _watched

    def ring(*_: object) -> None:
        raise HangError(f"more than {SECONDS:g} seconds")

    _trespasses.clear()
    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    _watched = True
    try:
        yield
    finally:
        _watched = False
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def judge(target: Target, data: bytes) -> Finding | None:
    """What is wrong with how an input ended."""
    fault: Finding | None = None
    try:
        with _watching(), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.simplefilter("error", RuntimeWarning)
            target.attempt(data)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a panic is no Exception
        fault = _fault(target, error)
    if _trespasses:
        return Finding(f"trespass-{_trespasses[0].split(' ')[0]}", "\n".join(_trespasses))
    return fault


def _fault(target: Target, error: BaseException) -> Finding | None:
    kind = type(error)
    own = kind.__module__.startswith("sketchcore") and isinstance(error, target.refusals)
    *_, last = traceback.extract_tb(error.__traceback__)
    sentence = str(error.args[0] if isinstance(error, KeyError) and error.args else error)
    if kind not in target.refusals and not own:
        wrong = "this is not promised"
    elif not Path(last.filename).is_relative_to(PACKAGE):
        wrong = "this comes out of a library as it is"
    elif len(sentence.split()) < 4 or len(sentence) > 2000:
        wrong = "this is no sentence"
    else:
        return None
    told = "".join(traceback.format_exception(error))
    return Finding(f"{kind.__name__}-{Path(last.filename).stem}-{last.lineno}", f"{wrong}:\n{told}")


def limit_memory(megabytes: int) -> None:
    """From now on this process gets that much more address space than it has, and no more."""
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + megabytes * 2**20, resource.RLIM_INFINITY))


def megabytes() -> int:
    """The memory that this process has."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() // 2**20


def peak_megabytes() -> int:
    """The most memory that this process has had."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024


class Source:
    """Numbers and choices out of an input's bytes; zeros once they are used up."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data, 0

    def take(self, count: int) -> bytes:
        """The next bytes."""
        piece = self._data[self._at : self._at + count]
        self._at += count
        return piece.ljust(count, b"\0")

    def below(self, count: int) -> int:
        """A whole number from 0 to count - 1, of two bytes."""
        return int.from_bytes(self.take(2), "little") % count

    def choice(self, options: Any) -> Any:
        """One of several."""
        return options[self.below(len(options))]

    @property
    def rest(self) -> bytes:
        """What has not been taken."""
        return self._data[self._at :]
