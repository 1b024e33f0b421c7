"""Drawings as people have them (scans, photographs, exports) brought to what the networks were trained on."""

# mypy: disable-error-code="no-untyped-call"
# (scikit-image says that it is typed, and is not.)

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps

from sketchcore.grids import IMAGE, as_drawings
from sketchcore.untrusted import reason

# scikit-image is imported by what needs it: half a second, and clean drawings do without.

Grey = NDArray[np.float32]
Mask = NDArray[np.bool_]
Box = tuple[int, int, int, int]  # top, left, bottom, right; the last two exclusive

MAX_PIXELS = 100_000_000
_TOO_LARGE = f"a drawing may have up to {MAX_PIXELS // 1_000_000} megapixels, this one has more"
FORMATS = ("PNG", "JPEG", "WEBP", "GIF", "BMP", "TIFF", "PPM")
INK = 64  # from here on a pixel of a drawing is part of a line, as for silhouettes

# Where training drawings lie in their frame, by the bounding box of pixels >= INK: `generate(7, 800, views=1)`
# and `views=4`, exact lines. Longest side as share of the frame: 1st to 99th percentile 0.37 to 0.73 in first
# drawings, 0.27 to 0.73 in all four; median of first ones 0.54. Centre, the larger of both offsets: 99th
# percentile 0.09 in both.
LONGEST = (0.27, 0.73)
LONGEST_MEDIAN = 0.54
MAX_OFFSET = 0.09

MAX_COVER = 0.4  # more ink than this is no line drawing
_WORK = 2048  # larger pictures are averaged down to at most this before anything else
_FINE = 4  # lines are measured and redrawn at this many times the resolution of a drawing
_WIDTHS = (1.2, 3.5)  # area / skeleton pixels, in px; trained drawings measure 1.4 to 3.6 (5th to 95th percentile)
_THICKENED, _THINNED = 1.5, 2.0  # what lines outside become


@dataclass(frozen=True)
class Composition:
    """Where the ink's bounding box lies in the frame.

    Attributes:
        offset: of its centre from the frame's, to the right and down, as shares of the frame.
        longest: its longest side as share of the frame.
    """

    offset: tuple[float, float]
    longest: float

    @property
    def fits(self) -> bool:
        """Whether training drawings lie like this; if not, the networks may take the object's size wrong."""
        return LONGEST[0] <= self.longest <= LONGEST[1] and max(map(abs, self.offset)) <= MAX_OFFSET


def composition(drawing: NDArray[np.uint8]) -> Composition:
    """Where a drawing's ink lies; uint8 [256, 256], ink 255 on 0.

    Raises:
        ValueError: for another shape, or no ink.
        TypeError: for another dtype.
    """
    return _composition(_box(as_drawings(drawing)[0] >= INK), 0, 0, IMAGE)


def load_drawing(
    source: str | os.PathLike[str] | Image.Image | NDArray[np.generic], *, compose: bool = True
) -> NDArray[np.uint8]:
    """A line drawing, from whatever holds it, as the networks know drawings: uint8 [256, 256], ink 255 on 0.

    Paper is subtracted, ink brought to full strength, specks dropped; the picture is padded to a square (never
    stretched or cropped), averaged down, and lines much thinner or thicker than the trained 1 to 3 px redrawn.
    A clean drawing of 256 x 256 comes back bit for bit: light on dark always, as `sketchcore.draw` makes them;
    dark on light as its exact inverse, unless its lines are too thick.

    Args:
        source: an image file (PNG, JPEG, WebP, GIF, BMP, TIFF, PPM), a PIL image, or an array [H, W] or
            [H, W, 3 or 4] of uint8, bool, uint16 or float in [0, 1]. Dark on light or light on dark; what is
            transparent is paper.
        compose: the networks know objects at one distance. So a picture whose ink is too large, too small or too
            far off centre for that (`Composition.fits`) is moved and scaled until its ink is centred and as large
            as the median of first drawings. False keeps it where it is. Clean 256 x 256 drawings always stay.

    Raises:
        FileNotFoundError: if there is no such file.
        ValueError: for a file that is no image or damaged, more than 100 megapixels, an array of a wrong shape or with
            NaN or values outside [0, 1], a picture without ink, without even paper, or with ink over more than
            40 % of it.
        TypeError: for another kind of source, or another dtype.
    """
    grey = _grey(source)
    clean = _clean(grey)
    if clean is not None:
        return clean
    ink, mask = _ink(grey)
    box = _box(mask)
    side = max(ink.shape)
    left, top = (ink.shape[1] - side) // 2, (ink.shape[0] - side) // 2
    cover = np.count_nonzero(mask) / mask.size
    if cover > MAX_COVER:
        raise ValueError(f"ink covers {cover:.0%} of the picture: this is no line drawing")
    if compose and not _composition(box, left, top, side).fits:
        side = round(max(box[2] - box[0], box[3] - box[1]) / LONGEST_MEDIAN)
        left, top = round((box[1] + box[3] - side) / 2), round((box[0] + box[2] - side) / 2)
    frame = Image.fromarray(ink).crop((left, top, left + side, top + side))  # beyond the picture: paper
    return _lines(frame)


def _grey(source: object) -> Grey:
    """Luminance, float32 [H, W], 0 to 255, no side longer than _WORK."""
    if isinstance(source, np.ndarray):
        return _flattened(_from_array(source))
    if isinstance(source, Image.Image):
        return _decoded(source, "the picture")
    if not isinstance(source, (str, os.PathLike)):
        raise TypeError(f"a drawing is a path, a PIL image or a numpy array, got {type(source).__name__}")
    name = os.fspath(source)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # `_check_size` refuses instead
        try:
            image = Image.open(name, formats=FORMATS)
        except (FileNotFoundError, PermissionError):
            raise
        except IsADirectoryError as error:
            raise ValueError(f"{name} is a folder, not an image") from error
        except Image.DecompressionBombError as error:
            raise ValueError(f"{name}: {_TOO_LARGE}") from error
        except MemoryError:
            raise
        except Exception as error:  # readers raise whatever their parsing stumbled over
            raise ValueError(f"{name} is no image of a known kind ({', '.join(FORMATS)}): {reason(error)}") from error
    with image:
        return _decoded(image, name)


def _decoded(image: Image.Image, name: str) -> Grey:
    if image.height * image.width > MAX_PIXELS:
        raise ValueError(f"{name}: {_TOO_LARGE}")
    try:
        image = ImageOps.exif_transpose(image)  # decodes
        if image.mode == "F" or image.mode.startswith("I"):
            values = np.asarray(image)
            return _flattened(_from_array(values if image.mode == "F" else values.clip(0, 65535).astype("u2")))
        if image.has_transparency_data:
            return _flattened(image.convert("RGBA"))
        return _flattened(image if image.mode == "L" else image.convert("RGB").convert("L"))
    except MemoryError:
        raise
    except Exception as error:
        raise ValueError(f"{name} cannot be read as an image: {reason(error)}") from error


def _from_array(array: NDArray[np.generic]) -> Image.Image:
    """An image of mode L or F (0 to 255) or, of colours, RGB or RGBA."""
    channels = array.shape[2:]
    if array.ndim not in (2, 3) or channels not in ((), (3,), (4,)) or array.size == 0:
        raise ValueError(f"a drawing must have shape [H, W] or [H, W, 3 or 4], got {list(array.shape)}")
    if array.shape[0] * array.shape[1] > MAX_PIXELS:
        raise ValueError(_TOO_LARGE)
    if array.dtype == np.uint8:
        return Image.fromarray(np.ascontiguousarray(array))
    if array.dtype in (np.bool_, np.uint16):
        values = array.astype(np.float32) / (257 if array.dtype == np.uint16 else 1 / 255)
    elif array.dtype.kind == "f":
        values = array.astype(np.float32)
        if not ((values >= 0) & (values <= 1)).all():
            raise ValueError("a drawing of floats must lie in [0, 1], without NaN")
        values *= 255
    else:
        raise TypeError(f"a drawing must be uint8, bool, uint16 or float in [0, 1], got {array.dtype}")
    return Image.fromarray(np.rint(values).astype(np.uint8) if channels else values)


def _flattened(image: Image.Image) -> Grey:
    """Averaged down to _WORK, transparency taken for paper (PIL weighs colours by alpha when it averages)."""
    factor = -(-max(image.size) // _WORK)
    if factor > 1:
        image = image.reduce(factor)
    grey = np.asarray(image if image.mode == "F" else image.convert("L"), np.float32)
    if image.mode != "RGBA":
        return grey
    alpha = np.asarray(image.getchannel("A"), np.float32) / np.float32(255)
    on_black = grey * alpha
    on_white = on_black + np.float32(255) * (1 - alpha)
    return on_white if on_white.min() < 192 else on_black  # light ink shows on black only


def _clean(grey: Grey) -> NDArray[np.uint8] | None:
    """A drawing that needs nothing done: pure paper, full ink, no haze about the lines."""
    if grey.shape != (IMAGE, IMAGE) or (abs(grey - np.rint(grey)) > 1e-3).any():
        return None
    for dark_ink in (False, True):
        drawing = np.rint(255 - grey if dark_ink else grey).astype(np.uint8)
        lines = np.count_nonzero(drawing >= INK)
        haze = np.count_nonzero(drawing) - np.count_nonzero(drawing >= INK // 2)
        full = (drawing == 0).mean() >= 1 - MAX_COVER and drawing.max() == 255
        if full and 2 * haze <= lines and not (dark_ink and _width(drawing >= INK) > _WIDTHS[1]):
            return drawing
    return None


def _paper(grey: Grey) -> Grey:
    """What the picture would be without ink: wide medians on a coarse grid (lines are few in each)."""
    from skimage.filters import median

    height, width = grey.shape
    size = [max(1, round(64 * n / max(grey.shape))) for n in (width, height)]
    coarse = np.asarray(Image.fromarray(grey).resize(size, Image.Resampling.BOX))
    if min(coarse.shape) > 12:  # continued beyond the border along its slope: shading is not bent there
        coarse = np.pad(coarse, 12, mode="reflect", reflect_type="odd")
        coarse = median(coarse, np.ones((25, 25)))[12:-12, 12:-12]
    else:
        coarse = np.full_like(coarse, np.median(coarse))
    return np.asarray(Image.fromarray(coarse).resize((width, height), Image.Resampling.BILINEAR))


def _ink(grey: Grey) -> tuple[Grey, Mask]:
    """Ink from 0 to 1, and where it is more than noise and specks."""
    from skimage.filters import apply_hysteresis_threshold
    from skimage.measure import label, regionprops

    contrast = grey - _paper(grey)
    if (contrast.astype(np.float64) ** 3).sum() < 0:  # ink is the rare extreme
        contrast = -contrast
    noise = float(np.percentile(np.abs(contrast), 25)) / 0.32  # sigma of normal noise; ink may cover half of it
    if noise > 25:
        raise ValueError("this is no line drawing: there is no even paper behind the ink")
    strong = contrast[contrast > max(6 * noise, 10)]
    if strong.size == 0:
        raise ValueError("there is no ink in the drawing: nothing stands out from the paper")
    peak = float(np.percentile(strong, 80))
    floor = max(3 * noise, 0.12 * peak)
    ink = ((contrast - floor) / (peak - floor)).clip(0, 1)
    labels = label(apply_hysteresis_threshold(ink, 0.05, 0.5))
    kept = np.zeros(labels.max() + 1, np.bool_)
    for region in regionprops(labels):
        top, left, bottom, right = region.bbox
        kept[region.label] = max(bottom - top, right - left) * IMAGE >= 2 * max(grey.shape)
    mask: Mask = kept[labels]
    if not mask.any():
        raise ValueError("there is no ink in the drawing, only specks")
    return ink * mask, mask


def _box(mask: Mask) -> Box:
    rows, cols = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    if not rows.size:
        raise ValueError("there is no ink in the drawing")
    return int(rows[0]), int(cols[0]), int(rows[-1]) + 1, int(cols[-1]) + 1


def _composition(box: Box, left: int, top: int, side: int) -> Composition:
    """Of a box in the square frame of that side at (left, top)."""
    right_by = ((box[1] + box[3]) / 2 - left) / side - 0.5
    down_by = ((box[0] + box[2]) / 2 - top) / side - 0.5
    return Composition((right_by, down_by), max(box[2] - box[0], box[3] - box[1]) / side)


def _resized(frame: Image.Image, side: int) -> Grey:
    """Square ink resized, averaged where it shrinks, its lines at full strength again."""
    method = Image.Resampling.HAMMING if frame.width > side else Image.Resampling.BICUBIC
    ink = np.asarray(frame.resize((side, side), method)).clip(0, 1)
    peak = float(np.percentile(ink[ink > 0.25 * ink.max()], 75))
    return (ink / peak).clip(0, 1)


def _width(mask: Mask) -> float:
    from skimage.morphology import skeletonize

    length = int(np.count_nonzero(skeletonize(mask)))
    return int(np.count_nonzero(mask)) / max(1, length)


def _lines(frame: Image.Image) -> NDArray[np.uint8]:
    """The drawing of a square of ink, its lines of a trained width."""
    from skimage.filters import gaussian
    from skimage.morphology import isotropic_dilation, skeletonize

    fine = _resized(frame, IMAGE * _FINE)
    mask = fine > 0.4
    width = _width(mask) / _FINE
    if _WIDTHS[0] <= width <= _WIDTHS[1]:
        drawing = _resized(frame, IMAGE)
    else:
        if width > _WIDTHS[1]:  # rough edges would grow twigs
            mask = gaussian(fine, 0.15 * width * _FINE) > 0.4
        radius = ((_THINNED if width > _WIDTHS[1] else _THICKENED) * _FINE - 1) / 2
        redrawn = isotropic_dilation(skeletonize(mask), radius).astype(np.float32)
        drawing = redrawn.reshape(IMAGE, _FINE, IMAGE, _FINE).mean((1, 3))
    return np.rint(255 * drawing).astype(np.uint8)
