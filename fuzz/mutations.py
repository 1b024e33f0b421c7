"""Inputs made of inputs: of bytes, and of formats whose checksums and lengths plain bytes would never get past."""

from __future__ import annotations

import io
import json
import re
import struct
import warnings
import zipfile
import zlib
from collections.abc import Callable
from random import Random
from typing import Any

_WHOLE = (0, 1, 2, 3, 7, 8, 63, 64, 65, 127, 128, 255, 256, 257, 4096, 32767, 32768, 65535, 65536, 2**31 - 1, 2**31,
          2**32 - 1, 2**32, 2**53, 2**63 - 1, 2**63, 2**64 - 1)  # fmt: skip
_TEXTS = (b"0", b"-1", b"1", b"1e308", b"-1e308", b"1e-320", b"nan", b"inf", b"1e400", b"2147483648", b"99999999999")
_NAMES = (
    *(
        "",
        "x",
        "..",
        "../../etc/passwd",
        "/etc/passwd",
        "file:///etc/passwd",
        "http://127.0.0.1:9/x",
        "data:;base64,AAAA",
    ),
    *("\0", "é" * 9, "\ud800", "a" * 300, "nan", "__class__"),
)
_VALUES: tuple[Any, ...] = (
    *(
        None,
        True,
        False,
        0,
        -1,
        1,
        2,
        0.5,
        1e308,
        -1e308,
        1e-320,
        float("nan"),
        float("inf"),
        2**31,
        2**63,
        2**64,
        10**30,
    ),
    *([], {}, [[]], [None], {"": 0}, [0, 1], [1, 0], [0.0, 1.0, 2.0]),
)


def of_bytes(data: bytes, random: Random) -> bytes:
    """A few changes anywhere: bits, bytes, numbers of several sizes, numbers in text, pieces moved, cut or doubled."""
    out = bytearray(data)
    for _ in range(random.choice((1, 1, 2, 4))):
        at = random.randrange(len(out) + 1)
        match random.randrange(8):
            case 0:
                if at < len(out):
                    out[at] ^= 1 << random.randrange(8)
            case 1:
                out[at : at + 1] = bytes([random.choice((0, 1, 127, 128, 255, random.randrange(256)))])
            case 2 | 3:
                size, order = random.choice((1, 2, 4, 8)), random.choice(("little", "big"))
                number = random.choice(_WHOLE) & (1 << 8 * size) - 1
                out[at : at + size] = number.to_bytes(size, order)
            case 4:
                del out[at : at + 1 + random.randrange(16)]
            case 5:
                piece = out[at : at + 1 + random.randrange(64)]
                there = random.randrange(len(out) + 1)
                out[there:there] = piece * random.choice((1, 1, 2, 50))
            case 6:
                numbers = list(re.finditer(rb"-?\d+(\.\d+)?", bytes(out[:4096])))
                if numbers:
                    found = random.choice(numbers)
                    out[found.start() : found.end()] = random.choice(_TEXTS)
            case _:
                if random.randrange(4) == 0:
                    del out[at:]
    return bytes(out)


def of_json(value: Any, random: Random) -> Any:
    """Plain data with one entry changed, taken away, doubled or added somewhere."""
    if isinstance(value, dict) and value and random.random() < 0.85:
        key = random.choice(list(value))
        copy = dict(value)
        match random.randrange(12):
            case 0:
                del copy[key]
            case 1:
                copy[random.choice((*_NAMES, *value))] = random.choice((*_VALUES, copy[key]))
            case _:
                copy[key] = of_json(copy[key], random)
        return copy
    if isinstance(value, list) and value and random.random() < 0.85:
        copy_, at = list(value), random.randrange(len(value))
        match random.randrange(12):
            case 0:
                del copy_[at]
            case 1:
                copy_ *= random.choice((2, 2, 20))
            case 2:
                copy_.insert(at, random.choice(_VALUES))
            case _:
                copy_[at] = of_json(copy_[at], random)
        return copy_
    if isinstance(value, str) and random.random() < 0.7:
        return random.choice((random.choice(_NAMES), value + value, value[:-1], value.upper()))
    if isinstance(value, int | float) and not isinstance(value, bool) and random.random() < 0.7:
        near = (value + 1, value - 1, -value, value * 2, value / 2, value * 1000)
        return random.choice((*near, random.choice(_WHOLE), -random.choice(_WHOLE), random.random()))
    if random.random() < 0.02:
        deep: Any = 0
        for _ in range(random.choice((50, 5000))):
            deep = [deep]
        return deep
    return random.choice((*_VALUES, *_NAMES))


def dump(value: Any) -> bytes:
    """Plain data as JSON, however deep it is."""
    try:
        return json.dumps(value).encode("utf-8", "surrogatepass")
    except RecursionError:
        return b"[" * 5000 + b"]" * 5000


def of_json_text(data: bytes, random: Random) -> bytes:
    """JSON changed as data mostly, and sometimes as text."""
    try:
        value = json.loads(data)
    except (ValueError, RecursionError):
        return of_bytes(data, random)
    return of_bytes(data, random) if random.random() < 0.1 else dump(of_json(value, random))


def of_zip(data: bytes, random: Random, entry: Callable[[str, bytes, Random], bytes]) -> bytes:
    """An archive packed anew with an entry changed, so that its sums are right; and sometimes its bytes as they are."""
    if random.random() < 0.25:
        return of_bytes(data, random)
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            entries = [(info.filename, archive.read(info)) for info in archive.infolist()]
    except Exception:  # it is a broken one already
        return of_bytes(data, random)
    if not entries:
        return of_bytes(data, random)
    at = random.randrange(len(entries))
    name, content = entries[at]
    match random.randrange(10):
        case 0:
            del entries[at]
        case 1:
            entries.append((random.choice(("../../evil", "/evil", name, name + "\\..\\x", "a" * 300)), content))
        case 2:
            entries[at] = name, content + bytes(random.choice((1, 10**6, 3 * 10**7)))
        case _:
            entries[at] = name, entry(name, content, random)
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of names that come twice
        for name, content in entries:
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    return file.getvalue()


def of_png(data: bytes, random: Random) -> bytes:
    """A PNG with the content of a chunk changed, and its sum right again."""
    chunks, at = [], 8
    while at + 8 <= len(data):
        size = int.from_bytes(data[at : at + 4], "big")
        chunks.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + size]))
        at += 12 + size
    if not chunks:
        return of_bytes(data, random)
    i = random.randrange(len(chunks))
    kind, content = chunks[i]
    match random.randrange(6):
        case 0:
            chunks.insert(random.randrange(len(chunks) + 1), (random.choice((b"acTL", b"fcTL", b"tRNS", b"PLTE",
                          b"iCCP", b"zTXt", b"eXIf", b"gAMA", kind)), of_bytes(content[:64], random)))  # fmt: skip
        case 1 if kind == b"IDAT":
            try:
                chunks[i] = kind, zlib.compress(of_bytes(zlib.decompress(content), random))
            except zlib.error:
                chunks[i] = kind, of_bytes(content, random)
        case _:
            chunks[i] = kind, of_bytes(content, random)
    out = data[:8]
    for kind, content in chunks:
        out += struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))
    return out


def of_safetensors(data: bytes, random: Random) -> bytes:
    """A safetensors file with its header changed as JSON, its length right again; or its numbers changed."""
    size = int.from_bytes(data[:8], "little")
    try:
        header = json.loads(data[8 : 8 + size])
    except (ValueError, RecursionError):
        return of_bytes(data, random)
    body = data[8 + size :]
    match random.randrange(4):
        case 0:
            return of_bytes(data, random)
        case 1:
            body = of_bytes(body, random)
        case 2:
            body = body[:-2] + random.choice((b"\xff\xff", b"\x00\x7c", b"\x00\xfc"))  # NaN and infinity
        case _:
            header = of_json(header, random)
    text = dump(header)
    text += b" " * (-len(text) % 8)
    return len(text).to_bytes(8, "little") + text + body
