"""Drawings from photographs of paper, and what is refused."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
from paper import as_file, photo_of, recall
from PIL import Image

from sketchcore.app import photo
from sketchcore.app.photo import read_photo
from sketchcore.drawing import INK
from sketchcore.evaluate.testset import load_testset
from sketchcore.strokes import render, trace

DRAWINGS = [render(trace(example.drawings[0]), 2.0) for example in load_testset(3)]


def aligned(drawing: np.ndarray) -> np.ndarray:
    """The ink's box in the middle, as large for all."""
    ys, xs = np.nonzero(drawing >= INK)
    side = (max(np.ptp(xs), np.ptp(ys)) + 1) / 0.8
    middle = (xs.min() + xs.max() + 1) / 2, (ys.min() + ys.max() + 1) / 2
    box = tuple(round(m + s) for s in (-side / 2, side / 2) for m in middle)
    return np.asarray(Image.fromarray(drawing).crop(box).resize((256, 256)))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("number", "circumstances"),
    [
        (0, {}),
        (1, {"light": (0.2, 1.0)}),
        (2, {"light": (1.0, 0.4), "shadow": 0.5}),
        (0, {"light": (0.6, 1.0), "shadow": 0.65}),
        (1, {"noise": 12.0}),
        (2, {"ink": 0.7, "noise": 8.0}),
        (0, {"blur": 4.0}),
        (1, {"margin": 0.35}),
        (2, {"table": 0.3}),
        (0, {"table": 0.7}),
        (1, {"table": 0.1}),
        (2, {"table": 0.45, "turn": 3.0}),
        (0, {"ink": 4.0, "light": (0.15, 0.25)}),  # chalk
    ],
)
def test_a_sketch_is_found_on_its_paper(number: int, circumstances: dict[str, Any]) -> None:
    drawn = DRAWINGS[number]
    found = read_photo(as_file(photo_of(drawn, seed=number, side=1000, **circumstances)))
    assert found.shape == (256, 256)
    assert found.dtype == np.uint8
    there, alone = recall(aligned(found), aligned(drawn), 4 if not circumstances.get("turn") else 7)
    assert there > 0.95
    assert alone > 0.95
    box = np.argwhere(found >= INK)
    assert 0.25 < max(np.ptp(box, axis=0)) / 256 < 0.76
    assert 1.0 < found.sum() / 255 / sum(len(line) for line in trace(found)) < 3.6


def test_exports_come_as_they_are() -> None:
    np.testing.assert_array_equal(read_photo(as_file(Image.fromarray(DRAWINGS[0]), "PNG")), DRAWINGS[0])
    clear = Image.merge("RGBA", [Image.new("L", (256, 256))] * 3 + [Image.fromarray(DRAWINGS[0])])
    there, alone = recall(read_photo(as_file(clear, "PNG")), DRAWINGS[0])
    assert min(there, alone) > 0.98


def test_a_phone_held_upright() -> None:
    upright = photo_of(DRAWINGS[0], side=800)
    lying = upright.transpose(Image.Transpose.ROTATE_90)
    exif = Image.Exif()
    exif[0x0112] = 6  # turn clockwise to show
    there, _ = recall(aligned(read_photo(as_file(lying, exif=exif))), aligned(DRAWINGS[0]), 4)
    assert there > 0.95


def clouds() -> Image.Image:
    """Tones of all scales, as landscapes have them."""
    random = np.random.default_rng(0)
    frequency = np.fft.fftfreq(512)
    amplitude = 1 / np.maximum(np.hypot(frequency[:, None], frequency), 1 / 512) ** 1.3
    field = np.fft.ifft2(amplitude * np.exp(2j * np.pi * random.random((512, 512)))).real
    return Image.fromarray((255 * (field - field.min()) / np.ptp(field)).astype(np.uint8))


def grain(level: float) -> Image.Image:
    values = np.random.default_rng(0).normal(level, 4, (600, 600))
    return Image.fromarray(values.clip(0, 255).astype(np.uint8))


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (photo_of(np.zeros((256, 256), np.uint8), side=600), "no ink"),
        (grain(20), "no ink|photograph"),
        (grain(200), "no ink"),
        (clouds(), "looks like a photograph"),
        (Image.new("L", (300, 300), 255), "no ink"),
        (Image.new("L", (300, 300), 0), "no ink"),
    ],
)
def test_what_is_no_line_drawing_is_refused(image: Image.Image, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        read_photo(as_file(image))


@pytest.mark.parametrize("data", [b"", b"GIF89a", b"\x89PNG\r\n\x1a\n" + b"x" * 50, b"<svg/>", b"%PDF-1.4"])
def test_what_is_no_picture_is_refused(data: bytes) -> None:
    with pytest.raises(ValueError, match="no picture of a known kind"):
        read_photo(data)


def test_a_cut_file_is_refused() -> None:
    data = as_file(photo_of(DRAWINGS[0], side=500))
    for length in (100, len(data) // 2):
        with pytest.raises(ValueError, match=r"picture|read"):
            read_photo(data[:length])


def test_sizes_are_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    huge = io.BytesIO()
    Image.new("1", (30_000, 30_000)).save(huge, format="PNG")
    with pytest.raises(ValueError, match="megapixels"):
        read_photo(huge.getvalue())
    monkeypatch.setattr(photo, "MAX_BYTES", 100)
    with pytest.raises(ValueError, match="MB"):
        read_photo(huge.getvalue())
