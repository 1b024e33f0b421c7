"""Pictures of paper sketches, as phones take them, to drawings.

`sketchcore.load_drawing` takes scans and exports: it finds ink on paper of which the brightness changes slowly. A phone
adds the hard shadows of a hand, and the table around the sheet. So the light is divided out first: the brightness of
the paper is what is left of the picture when everything thinner than a few hundredths of it is closed over, which
follows the edge of a shadow or of the sheet; and what lies outside the sheet is wiped.
"""

# mypy: disable-error-code="no-untyped-call"
# (scikit-image says that it is typed, and is not.)

from __future__ import annotations

import io
import warnings

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps

from sketchcore.drawing import FORMATS, load_drawing

Grey = NDArray[np.float32]
Mask = NDArray[np.bool_]

MAX_BYTES = 32 * 2**20
"""Of a picture as a file."""
MAX_PIXELS = 50_000_000
_WORK = 1024
"""Pixels of the longer side that everything is done at."""
_UNIFORM = 0.5
"""From this share of pixels of the very same colour on, a picture comes from a program, not from a camera."""
_PEN = 0.04
"""Of the picture's longer side: what is wider is no line."""
_THIN = 0.01
"""As much: what is thinner tells whether ink is dark or light; spaces between lines are wider."""
_TABLE = 0.5
"""A table is seen along this share of the picture's border or more,"""
_PAPER = 1.2
"""at its edge the paper is so many times as bright,"""
_LEAST_SHEET = 0.1
"""and covers this share of the picture or more."""
_FAINT = 0.04
"""Ink reflects this much less than the paper, or more."""
_TONES = 0.15
"""Three quarters of a drawing are this much as dark as its ink, or less: photos of drawings (made ones, grain, shadows
and tables included) have up to 0.04, most photographs of other things 0.12 to 0.35."""
_SOFT = 1.0
"""How much more is between ink and paper than is ink: 0.3 to 0.5 in photos of drawings, 0.7 to 3.3 in others (the
pictures of `skimage.data`). One of both gives them away."""
_MUST = "A drawing is dark lines on plain paper that fills most of the picture."


def read_photo(data: bytes) -> NDArray[np.uint8]:
    """A photo, scan or export of a line drawing, as the networks know drawings.

    Uneven light, shadows and the table are taken away, the ink brought to full strength, specks dropped; the ink is
    moved and scaled to where drawings usually are, if it is not there, and its lines to about 2 px.

    Args:
        data: a file: PNG, JPEG, WebP, GIF, BMP, TIFF or PPM.

    Returns:
        uint8 [256, 256], ink 255 on 0.

    Raises:
        ValueError: for what is no picture, too large, or no line drawing; it says what would be right.
    """
    image = _decoded(data)
    if image.has_transparency_data or image.mode not in ("L", "RGB") or _is_uniform(image):
        return load_drawing(image)
    if max(image.size) > _WORK:
        image = image.reduce(-(-max(image.size) // _WORK))
    grey = np.asarray(image.convert("L"), np.float32)
    reflectance, paper = _without_light(grey)
    _check(reflectance, paper)
    return load_drawing(np.rint(255 * np.where(paper, reflectance, 1)).astype(np.uint8))


def _decoded(data: bytes) -> Image.Image:
    if len(data) > MAX_BYTES:
        raise ValueError(f"a picture may have up to {MAX_BYTES // 2**20} MB, this one has more")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # refused below
            image = Image.open(io.BytesIO(data), formats=FORMATS)
        if image.width * image.height > MAX_PIXELS:
            raise Image.DecompressionBombError
        image.draft("L", (2 * _WORK, 2 * _WORK))  # JPEG: large ones are decoded smaller
        upright = ImageOps.exif_transpose(image)
        if upright.mode in ("1", "P", "CMYK", "YCbCr") and not upright.has_transparency_data:
            return upright.convert("RGB")
        return upright
    except Image.DecompressionBombError as error:
        raise ValueError(f"a picture may have up to {MAX_PIXELS // 1_000_000} megapixels, this one has more") from error
    except MemoryError:
        raise
    except Exception as error:  # readers raise whatever their parsing stumbled over
        raise ValueError(f"this is no picture of a known kind ({', '.join(FORMATS)}), or it is damaged") from error


def _is_uniform(image: Image.Image) -> bool:
    histogram = image.convert("L").histogram()
    return max(histogram) >= _UNIFORM * sum(histogram)


def _without_light(grey: Grey) -> tuple[Grey, Mask]:
    """What the paper reflects, 1 where there is no ink, and where the paper is."""
    from scipy.ndimage import gaussian_filter, grey_closing, grey_opening

    smooth = gaussian_filter(grey, 1)
    thin = 2 * round(_THIN * max(grey.shape) / 2) + 1
    dark, bright = grey_closing(smooth, (thin, thin)) - smooth, smooth - grey_opening(smooth, (thin, thin))
    if (bright**3).sum(dtype=np.float64) > (dark**3).sum(dtype=np.float64):  # chalk
        grey, smooth = 255 - grey, 255 - smooth
    pen = 2 * round(_PEN * max(grey.shape) / 2) + 1
    light = gaussian_filter(grey_closing(smooth, (pen, pen)), 2)
    reflectance: Grey = (grey / np.maximum(light, 1)).clip(0, 1)
    return reflectance, _sheet(light, pen)


def _sheet(light: Grey, pen: int) -> Mask:
    """Where the sheet of paper is: all of the picture, unless something darker lies around it."""
    from scipy.ndimage import binary_dilation, binary_erosion, binary_fill_holes, label
    from skimage.filters import threshold_otsu

    whole = np.ones(light.shape, np.bool_)
    if light.max() - light.min() < 8:
        return whole
    bright = light > threshold_otsu(light)
    # A shadow comes in from one side; a table is seen around most of the picture.
    if np.concatenate([bright[0], bright[-1], bright[:, 0], bright[:, -1]]).mean() > 1 - _TABLE:
        return whole
    labels, _ = label(bright)
    sheet = binary_fill_holes(labels == int(np.bincount(labels[bright]).argmax()))
    inner: Mask = binary_erosion(sheet, iterations=pen // 2)
    beyond = binary_dilation(sheet, iterations=pen // 2) & ~sheet
    # Light fades gradually; paper ends at an edge.
    if inner.mean() < _LEAST_SHEET or np.median(light[sheet & ~inner]) < _PAPER * np.median(light[beyond]):
        return whole
    return inner


def _check(reflectance: Grey, sheet: Mask) -> None:
    """Refuses what has no lines, or is no paper."""
    from scipy.ndimage import gaussian_filter

    darkness = 1 - gaussian_filter(reflectance, 2)[sheet]
    darkness -= np.median(darkness)  # grain makes paper darker than the lightest of it
    peak = float(np.percentile(darkness, 99.7))
    ink, between = (darkness > 0.5 * peak).sum(), ((darkness > 0.2 * peak) & (darkness <= 0.5 * peak)).sum()
    if peak < _FAINT:
        raise ValueError(f"there is no ink in this picture: nothing stands out from the paper. {_MUST}")
    if float(np.percentile(darkness, 75)) > _TONES * peak or between > _SOFT * ink:
        raise ValueError(
            f"this looks like a photograph, not like a drawing: it has tones where paper should be. {_MUST}"
        )
