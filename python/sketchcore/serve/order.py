"""What a request asks for, and the file that is made of it."""

from __future__ import annotations

import io
import json
import struct
import tempfile
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from sketchcore.asgi.guard import TooLargeError
from sketchcore.camera import Camera
from sketchcore.drawing import FORMATS
from sketchcore.nets.compactmodel import CompactModel
from sketchcore.nets.model import Model
from sketchcore.nets.passes import Passes
from sketchcore.nets.together import Watched
from sketchcore.reconstruction import Reconstruction, reconstruct
from sketchcore.serve.views import Pinhole


class AbandonedError(Exception):
    """Nobody waits for the file any more."""


@dataclass(frozen=True)
class Order:
    """What a request asks for.

    Attributes:
        drawings: image files.
        views: a camera for each; none for a single drawing whose camera is to be found.
        iterations: rounds, at most.
        align: as for `sketchcore.reconstruct`.
        suffix: of the file: .glb, .obj, .stl, .ply, .npz or .binvox.
        megapixels: that an image may have.
    """

    drawings: tuple[bytes, ...]
    views: tuple[Camera, ...]
    iterations: int
    align: bool | None
    suffix: str
    megapixels: int


@dataclass(frozen=True)
class Made:
    """The file, and what is said about it in the answer's headers."""

    content: bytes
    headers: dict[str, str]


def make(order: Order, model: Model, passes: Passes | None, check: Callable[[], None]) -> Made:
    """Reconstructs.

    Args:
        order: what is asked for.
        model: the network.
        passes: who makes its passes, if it is the compact one.
        check: called again and again; it raises once nobody waits for the file any more, and that ends the work.

    Raises:
        ValueError: for what is no drawing, or a solid that is empty.
        TooLargeError: for an image with too many pixels.
    """
    images = [_opened(data, number, order.megapixels) for number, data in enumerate(order.drawings, 1)]
    if isinstance(model, CompactModel):
        model = model.by(Watched(passes or model.passes, check))
    solid = reconstruct(
        images,
        list(order.views) or None,
        iterations=order.iterations,
        align=order.align,
        model=model,
        progress=lambda number, rounds, volume: check(),
    )
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"solid{order.suffix}"
        solid.save(path)
        return Made(path.read_bytes(), _headers(solid))


def _headers(solid: Reconstruction) -> dict[str, str]:
    cameras = [Pinhole.of(camera).model_dump() for camera in solid.views]
    said = {
        "Sketchcore-Views": json.dumps(cameras, separators=(",", ":")),
        "Sketchcore-Trace": json.dumps([round(change, 6) for change in solid.trace]),
    }
    return said if solid.guessed is None else said | {"Sketchcore-Guessed": solid.guessed}


def _opened(data: bytes, number: int, megapixels: int) -> Image.Image:
    """An image, looked at and not decoded yet."""
    too_large = f"drawing {number} has more than {megapixels} megapixels, which is the most that is taken"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # refused below
            image = Image.open(io.BytesIO(data), formats=FORMATS)
    except Image.DecompressionBombError:
        raise TooLargeError(too_large) from None
    except (OSError, SyntaxError, ValueError, struct.error):
        raise ValueError(f"drawing {number} is no image of a known kind ({', '.join(FORMATS)})") from None
    if image.width * image.height > megapixels * 1_000_000:
        raise TooLargeError(too_large)
    return image
