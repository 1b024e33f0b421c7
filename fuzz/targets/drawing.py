"""Pictures as files: `load_drawing`, and the app's `read_photo`."""

from __future__ import annotations

import io
from random import Random

import numpy as np
import skimage.filters
import skimage.measure
import skimage.morphology
from PIL import Image, ImageDraw

from harness import SCRATCH, Target
from mutations import of_bytes, of_png
from sketchcore.app.photo import read_photo
from sketchcore.drawing import load_drawing

_LOADED = skimage.filters, skimage.measure, skimage.morphology  # before memory is limited


def attempt(data: bytes) -> None:
    """Reads a file in one of three ways, told by its length."""
    path = SCRATCH / "drawing"
    path.write_bytes(data)
    reads = (lambda: load_drawing(path), lambda: load_drawing(path, compose=False), lambda: read_photo(data))
    drawing = reads[len(data) % 3]()
    assert drawing.dtype == np.uint8
    assert drawing.shape == (256, 256)
    assert drawing.max() > 0


def _picture(size: tuple[int, int] = (256, 256), ink: int = 255) -> Image.Image:
    """Light on dark and as large as drawings are: such pictures are taken as they are, which is fast."""
    picture = Image.new("L", size, 255 - ink)
    pen = ImageDraw.Draw(picture)
    width, height = size
    pen.rectangle((width // 4, height // 4, width * 3 // 4, height * 3 // 4), outline=ink, width=2)
    pen.line((width // 4, height // 4, width * 3 // 4, height * 3 // 4), fill=ink, width=2)
    return picture


def _file(image: Image.Image, kind: str, **options: object) -> bytes:
    file = io.BytesIO()
    image.save(file, kind, **options)  # type: ignore[arg-type]
    return file.getvalue()


def seeds() -> list[bytes]:
    """Every format that is let in, in the modes and with the compressions that it has."""
    grey = _picture()
    modes = {mode: grey.convert(mode) for mode in ("1", "L", "LA", "P", "RGB", "RGBA", "CMYK", "YCbCr", "I", "F")}
    modes["I;16"] = Image.fromarray(np.asarray(grey).astype(np.uint16) * 257)
    exif = Image.Exif()
    exif[0x0112] = 6
    frames = [grey.rotate(turn, fillcolor=0).convert("P") for turn in (0, 30, 60)]
    files = [_file(modes[m], "PNG", exif=exif) for m in ("1", "L", "LA", "P", "RGB", "RGBA", "I;16")]
    files += [
        _file(_picture((1, 1)), "PNG"),
        _file(_picture((9000, 2), ink=0), "PNG"),
        _file(_picture((80, 60), ink=0), "PNG"),
    ]
    files.append(_file(frames[0], "PNG", save_all=True, append_images=frames[1:]))
    files += [_file(modes[m], "JPEG", exif=exif) for m in ("L", "RGB", "CMYK")]
    files.append(_file(grey, "JPEG", progressive=True, quality=30))
    files += [_file(modes["RGB"], "WEBP"), _file(modes["RGBA"], "WEBP", lossless=True)]
    files.append(_file(frames[0].convert("RGB"), "WEBP", save_all=True, append_images=frames[1:]))
    files += [_file(grey, "GIF"), _file(frames[0], "GIF", save_all=True, append_images=frames[1:], transparency=0)]
    files += [_file(modes[m], "BMP") for m in ("1", "L", "P", "RGB", "RGBA")]
    for compression in (None, "tiff_lzw", "tiff_deflate", "packbits", "jpeg", "group4"):
        mode = "1" if compression == "group4" else "L"
        files.append(_file(modes[mode], "TIFF", compression=compression))
    files += [_file(modes[m], "TIFF") for m in ("1", "P", "RGBA", "CMYK", "YCbCr", "I", "F", "I;16")]
    files.append(_file(grey, "TIFF", save_all=True, append_images=frames[1:]))
    files += [_file(modes[m], "PPM") for m in ("1", "L", "RGB", "I", "F")]
    files.append(b"P2 4 4 255 " + b"255 0 255 255 " * 4)
    files.append(b"P1 40 40 " + (b"0 " * 19 + b"1 ") * 80)
    return files


def mutate(data: bytes, random: Random) -> bytes:
    """Chunks of PNGs with their sums made right; anything else as bytes."""
    return of_png(data, random) if data[:4] == b"\x89PNG" and random.random() < 0.8 else of_bytes(data, random)


TARGET = Target(attempt, seeds, mutate, (ValueError,), megabytes=3072)
