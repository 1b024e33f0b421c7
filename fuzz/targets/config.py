"""Configs: the generator's, grammars', shapes and line styles, as JSON and as plain data. First byte: which."""

from __future__ import annotations

import json
from random import Random

import numpy as np

import sketchcore as sk
from harness import Target
from mutations import dump, of_json_text
from sketchcore.camera import VIEWPOINTS
from sketchcore.datagen.generate import default_config

_CAMERA = VIEWPOINTS["quarter-037"]


def attempt(data: bytes) -> None:
    """Takes a config, and makes something by it."""
    which, text = data[:1], data[1:].decode(errors="surrogateescape")
    if which == b"s":
        shape = sk.Shape.from_json(text)
        sk.voxelize(shape)
        sk.draw(shape, _CAMERA)
        return
    if which == b"l":
        sk.LineStyle.from_json(text).redraw(np.eye(256, dtype=np.uint8) * 255, 3)
        return
    try:
        config = json.loads(text)
    except (ValueError, RecursionError):
        return  # whoever calls has parsed it
    if isinstance(config, dict):
        grammar = {b"c": "chair", b"v": "vase"}.get(which)
        sk.generate(1, 1, views=1, config=config, grammar=grammar)
        if which == b"r":
            sk.LineStyle.random(0, config.get("styles") if isinstance(config.get("styles"), dict) else {})


def seeds() -> list[bytes]:
    """What the package writes itself."""
    shape = sk.Shape(
        [
            sk.Cuboid((0, 0, 0), (0.3, 0.2, 0.2)),
            sk.Cylinder((0, 0.1, 0), (0.1, 0.2, 0.1), "y", "subtract"),
            sk.Wedge((0, 0.1, 0), (0.1, 0.2, 0.1), "z", (-1, 1)),
            sk.Frustum((0, 0.2, 0), (0.1, 0.2, 0.1), "x", (0.1, 0), 0.5, True),
            sk.Torus((0, 0.2, 0), (0.1, 0.2, 0.1), "y", 0.3, (0, 90)),
        ]
    )
    seeds = [b"s" + shape.to_json().encode()]
    seeds += [b"l" + style.to_json().encode() for style in sk.STYLES.values()]
    seeds += [b"g" + dump(default_config()), b"r" + dump(default_config())]
    seeds += [
        kind + dump({"grammar": default_config(name)["grammar"]}) for kind, name in ((b"c", "chair"), (b"v", "vase"))
    ]
    return [*seeds, b"g{}", b"c{}", b"g" + dump(default_config("chair"))]


def mutate(data: bytes, random: Random) -> bytes:
    """JSON changed, the kind as it is."""
    return data[:1] + of_json_text(data[1:], random)


TARGET = Target(attempt, seeds, mutate, (ValueError, TypeError, RuntimeError), megabytes=512)
