"""Photographs of paper sketches, made: uneven light, shadows, blur, grain, a table around the sheet."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter, rotate

Grey = NDArray[np.float64]


def photo_of(
    drawing: NDArray[np.uint8],
    *,
    side: int = 1200,
    margin: float = 0.15,
    light: tuple[float, float] = (0.5, 1.0),
    shadow: float = 0.0,
    noise: float = 4.0,
    blur: float = 1.5,
    ink: float = 0.25,
    table: float | None = None,
    turn: float = 0.0,
    seed: int = 0,
) -> Image.Image:
    """A photograph of a drawing, uint8 [256, 256], on a sheet of white paper.

    Args:
        drawing: ink 255 on 0.
        side: pixels of the square picture.
        margin: what of it lies beyond the drawing's own frame, as a share on each side.
        light: from one corner to the other, 1 is white paper.
        shadow: how much darker a soft-edged shadow across a corner is.
        noise: grain, grey levels.
        blur: pixels.
        ink: brightness of the pen, 0 to 1 of the paper's.
        table: brightness of the table around the paper; None if the paper fills the picture.
        turn: degrees that the sheet lies askew.
        seed: of the grain.
    """
    random = np.random.default_rng(seed)
    inner = round(side * (1 - 2 * margin))
    frame = Image.new("L", (side, side), 0)
    frame.paste(Image.fromarray(drawing).resize((inner, inner), Image.Resampling.BICUBIC), (round(side * margin),) * 2)
    covered = np.asarray(frame, np.float64) / 255
    reflect: Grey = 1 - (1 - ink) * covered
    ys, xs = np.mgrid[:side, :side] / side
    if table is not None:
        sheet = (np.abs(xs - 0.5) < 0.44) & (np.abs(ys - 0.5) < 0.46)
        wood = table + 0.06 * np.sin(60 * ys + 4 * np.sin(9 * xs))
        reflect = np.where(sheet, reflect, wood)
    if turn:
        reflect = rotate(reflect, turn, reshape=False, order=1, mode="nearest")
    shading = light[0] + (light[1] - light[0]) * (xs + ys) / 2
    if shadow:
        shading *= 1 - shadow / (1 + np.exp((xs + 0.6 * ys - 0.75) * 80))
    seen = gaussian_filter(reflect * shading * 240, blur) + random.normal(0, noise, (side, side))
    return Image.fromarray(np.clip(seen, 0, 255).astype(np.uint8))


def as_file(image: Image.Image, kind: str = "JPEG", **options: object) -> bytes:
    """The image as the bytes of a file."""
    file = io.BytesIO()
    image.save(file, format=kind, **options)  # type: ignore[arg-type]
    return file.getvalue()


def recall(found: NDArray[np.uint8], drawn: NDArray[np.uint8], reach: int = 2) -> tuple[float, float]:
    """Shares of what was drawn that is found, and of what is found that was drawn, within so many pixels."""

    def near(a: NDArray[np.bool_], b: NDArray[np.bool_]) -> float:
        wide = gaussian_filter(b.astype(np.float32), 0.01) > 0
        for _ in range(reach):
            p = np.pad(wide, 1)
            wide = p[1:-1, 1:-1] | p[:-2, 1:-1] | p[2:, 1:-1] | p[1:-1, :-2] | p[1:-1, 2:]
        return float(wide[a].mean()) if a.any() else 0.0

    return near(drawn >= 64, found >= 64), near(found >= 64, drawn >= 64)
