"""What is written beside shards, so that an export can be resumed, checked and made again.

URL/export.json         what is exported, written first; a folder holds one export
URL/shard-000000.tar    the shards, and
URL/shard-000000.json   what is in each, and its hash: written after the shard, so what has it is whole
URL/manifest.json       all of this, written last: what has it is complete
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from importlib.metadata import version
from typing import Any

from sketchcore.datagen.places import Place
from sketchcore.datagen.shards import SCHEMA

FORMAT = 1
EXPORT, MANIFEST = "export.json", "manifest.json"


@dataclass(frozen=True)
class Shard:
    """A shard that is there.

    Attributes:
        name: of the file.
        first: index of its first sample.
        count: how many.
        bytes: of the file.
        sha256: of the file.
    """

    name: str
    first: int
    count: int
    bytes: int
    sha256: str


def shard_name(number: int) -> str:
    """What shard number 0, 1, ... is called."""
    return f"shard-{number:06d}.tar"


def sidecar_name(shard: str) -> str:
    """What the file beside a shard is called."""
    return shard.removesuffix(".tar") + ".json"


def write_sidecar(place: Place, shard: Shard) -> None:
    """Says that a shard is whole."""
    place.write(sidecar_name(shard.name), _text(asdict(shard)))


def begin(place: Place, data: Mapping[str, Any]) -> None:
    """Says in a folder what is exported into it, or finds that it is the same as before.

    Args:
        place: the folder.
        data: what is exported.

    Raises:
        ValueError: if the folder holds another export; it names what differs.
    """
    asked: dict[str, Any] = json.loads(_text({"format": FORMAT, "sketchcore": version("sketchcore"), **data}))
    if EXPORT not in place.sizes():
        place.write(EXPORT, _text(asked))
        return
    try:
        found = json.loads(place.read([EXPORT])[0])
        there = {name: found[name] for name in asked}
    except (ValueError, KeyError, TypeError) as error:
        raise ValueError(f"{place.url}/{EXPORT} is damaged: {error}; name another folder") from error
    differing = [_difference(name, there[name], asked[name]) for name in asked if there[name] != asked[name]]
    if differing:
        raise ValueError(f"{place.url} holds another export: {'; '.join(differing)}; name another folder")


def _difference(name: str, there: Any, asked: Any) -> str:
    if isinstance(there, dict) and isinstance(asked, dict):
        for key in sorted({*there, *asked}):
            if there.get(key) != asked.get(key):
                return _difference(f"{name}.{key}", there.get(key), asked.get(key))
    return f"{name} is {json.dumps(there)} there and {json.dumps(asked)} here"


def whole_shards(place: Place, expected: Mapping[str, tuple[int, int]], verify: bool = False) -> dict[str, Shard]:
    """The shards that are there, whole, by name.

    Args:
        place: the folder.
        expected: first sample and count of each shard, by name.
        verify: read them, and compare their hashes; else their sizes alone, since no shard appears in part.
    """
    sizes = place.sizes()
    there = [name for name in expected if name in sizes and sidecar_name(name) in sizes]
    whole = {}
    for name, text in zip(there, place.read([sidecar_name(name) for name in there]), strict=True):
        try:
            shard = Shard(**json.loads(text))
        except (ValueError, TypeError):
            continue
        same = (shard.name, (shard.first, shard.count), shard.bytes) == (name, expected[name], sizes[name])
        if same and (not verify or place.digest(name) == shard.sha256):
            whole[name] = shard
    return whole


def write_manifest(place: Place, data: Mapping[str, Any], shards: list[Shard]) -> dict[str, Any]:
    """Says that an export is complete.

    Returns:
        the manifest.
    """
    manifest = {
        "format": FORMAT,
        "sketchcore": version("sketchcore"),
        "encoders": {"pillow": version("pillow"), "zlib": zlib.ZLIB_RUNTIME_VERSION},
        "data": dict(data),
        "schema": dict(SCHEMA),
        "samples": sum(shard.count for shard in shards),
        "bytes": sum(shard.bytes for shard in shards),
        "shards": [asdict(shard) for shard in shards],
    }
    place.write(MANIFEST, _text(manifest))
    return manifest


def _text(entries: Mapping[str, Any]) -> bytes:
    return (json.dumps(entries, indent=1, allow_nan=False) + "\n").encode()
