import io
import struct
import zlib

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, example, given, settings
from hypothesis import strategies as st
from PIL import Image, ImageDraw
from skimage.morphology import skeletonize

from sketchcore import _core
from sketchcore.camera import VIEWPOINTS
from sketchcore.drawing import INK, LONGEST_MEDIAN, Composition, composition, load_drawing
from sketchcore.grids import draw
from sketchcore.shape import Cuboid, Cylinder, Shape

CORNERS = [(0.25, 0.35), (0.55, 0.25), (0.75, 0.37), (0.45, 0.5), (0.26, 0.63), (0.45, 0.75), (0.73, 0.61)]
EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (3, 5), (2, 6), (4, 5), (5, 6)]
BOX_AREA = 12400  # of the silhouette at 256 x 256, scale 1


def box(size=400, pen=3.0, scale=1.0, shift=(0.0, 0.0)):
    """A box in black pen on white, anti-aliased; 0.5 of the frame wide, centred."""
    fine = max(1, min(4, 2400 // size))
    image = Image.new("L", (size * fine, size * fine), 255)
    brush = ImageDraw.Draw(image)
    points = (((np.array(CORNERS) - 0.5) * scale + 0.5) + shift) * size * fine
    radius = max(0.0, (pen * fine - 1) / 2)
    for a, b in EDGES:
        brush.line([*points[a], *points[b]], fill=0, width=max(1, round(pen * fine)))
    for x, y in points:
        brush.ellipse([x - radius, y - radius, x + radius, y + radius], fill=0)
    return image.resize((size, size), Image.Resampling.BOX)


def width(drawing):
    return drawing.sum() / 255 / np.count_nonzero(skeletonize(drawing >= INK))


def filled(drawing):
    return int(_core.silhouettes(drawing[None])[0].sum())


def alike(a, b):
    """Lines of each within 1 px of the other's."""
    near = [np.maximum.reduce([np.roll(d, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)]) for d in (a, b)]
    return not ((a >= 128) & (near[1] < INK)).any() and not ((b >= 128) & (near[0] < INK)).any()


def png_header(width, height):
    """A PNG that claims a size and holds no pixels."""
    chunk = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    empty = b"IDAT" + zlib.compress(b"")
    parts = [struct.pack(">I", len(c) - 4) + c + struct.pack(">I", zlib.crc32(c)) for c in (chunk, empty)]
    return b"\x89PNG\r\n\x1a\n" + b"".join(parts)


PLAIN = load_drawing(box())


def test_plain_drawing():
    assert PLAIN.shape == (256, 256)
    assert PLAIN.dtype == np.uint8
    assert PLAIN.max() == 255
    assert np.median(PLAIN) == 0
    assert filled(PLAIN) == pytest.approx(BOX_AREA, rel=0.03)


# Sources that must say the same


def test_path_image_and_array_agree(tmp_path):
    image = box()
    image.save(tmp_path / "box.png")
    for source in (tmp_path / "box.png", str(tmp_path / "box.png"), image, np.asarray(image), image.convert("RGB")):
        np.testing.assert_array_equal(load_drawing(source), PLAIN)


def test_polarity():
    np.testing.assert_array_equal(load_drawing(255 - np.asarray(box())), PLAIN)


def test_dtypes():
    grey = np.asarray(box())
    assert alike(load_drawing(grey / 255), PLAIN)
    assert alike(load_drawing((grey / 255).astype(np.float32)), PLAIN)
    assert alike(load_drawing(grey.astype(np.uint16) * 257), PLAIN)
    assert alike(load_drawing(grey < 128), PLAIN)
    np.testing.assert_array_equal(load_drawing(np.stack([grey / 255] * 3, axis=-1)), PLAIN)


@pytest.mark.parametrize("mode", ["1", "P", "LA", "CMYK", "I;16", "I", "F"])
def test_image_modes(mode, tmp_path):
    grey = np.asarray(box())
    image = {
        "I;16": lambda: Image.fromarray(grey.astype(np.uint16) * 257),
        "I": lambda: Image.fromarray(grey.astype(np.int32) * 257),
        "F": lambda: Image.fromarray(grey.astype(np.float32) / 255),
    }.get(mode, lambda: Image.fromarray(grey).convert(mode))()
    assert image.mode == mode
    assert alike(load_drawing(image), PLAIN)
    if mode in ("1", "P", "LA", "I;16"):
        image.save(tmp_path / "box.png")
        np.testing.assert_array_equal(load_drawing(tmp_path / "box.png"), load_drawing(image))


def test_palette_with_transparency(tmp_path):
    image = Image.fromarray((np.asarray(box()) < 128).astype(np.uint8)).convert("P")
    image.putpalette([255, 0, 0, 0, 0, 0])
    image.save(tmp_path / "box.png", transparency=0)
    assert alike(load_drawing(tmp_path / "box.png"), PLAIN)


@pytest.mark.parametrize("ink", [(0, 0, 0), (20, 24, 60), (200, 30, 30), (255, 255, 255), (250, 240, 200)])
@pytest.mark.parametrize("hidden", [(0, 0, 0), (255, 255, 255), (12, 200, 90)])
def test_transparent_paper(ink, hidden):
    alpha = 255 - np.asarray(box())
    array = np.empty((400, 400, 4), np.uint8)
    array[..., :3] = np.where(alpha[..., None] > 0, np.array(ink), np.array(hidden))
    array[..., 3] = alpha
    assert alike(load_drawing(array), PLAIN)


def test_transparent_margin_around_white_paper():
    image = Image.new("RGBA", (400, 400), (0, 0, 0, 0))
    image.paste(box().crop((50, 50, 350, 350)).convert("RGBA"), (50, 50))
    assert alike(load_drawing(image), PLAIN)


def test_large_transparent_picture_is_averaged_by_alpha():
    alpha = 255 - np.asarray(box(2200, 8))
    array = np.concatenate([np.zeros((2200, 2200, 3), np.uint8), alpha[..., None]], axis=-1)
    array[alpha == 0, :3] = 90
    assert filled(load_drawing(array)) == pytest.approx(BOX_AREA, rel=0.03)


def test_exif_orientation(tmp_path):
    exif = Image.Exif()
    exif[0x0112] = 6  # to be turned by 90 degrees clockwise
    box().transpose(Image.Transpose.ROTATE_90).save(tmp_path / "box.jpg", quality=95, exif=exif)
    assert alike(load_drawing(tmp_path / "box.jpg"), PLAIN)


# Clean drawings


SHAPES = [
    Shape([Cuboid((0, 0, 0), (0.3, 0.2, 0.25))]),
    Shape([Cuboid((0, 0, 0), (0.41, 0.41, 0.41)), Cylinder((0.4, 0, 0), (0.1, 0.1, 0.1), axis="x", op="subtract")]),
    Shape([Cuboid((0.3, 0.3, 0.3), (0.02, 0.02, 0.02))]),
]


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("view", ["quarter-037", "quarter-217", "front", "top"])
def test_own_drawings_pass_bit_for_bit(shape, view, tmp_path):
    drawing = draw(shape, VIEWPOINTS[view])
    Image.fromarray(255 - drawing).save(tmp_path / "dark.png")
    for source in (drawing, Image.fromarray(drawing), drawing / 255, 255 - drawing, tmp_path / "dark.png"):
        np.testing.assert_array_equal(load_drawing(source), drawing)
    layer = np.zeros((256, 256, 4), np.uint8)
    layer[..., 3] = drawing
    np.testing.assert_array_equal(load_drawing(layer), drawing)


def test_clean_dark_drawing_is_inverted_exactly():
    image = box(256, 2, shift=(0.2, 0))
    np.testing.assert_array_equal(load_drawing(image), 255 - np.asarray(image))


def test_thick_dark_drawing_of_256_is_thinned():
    assert width(load_drawing(box(256, 8))) < 2.5


# Lines


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(st.integers(100, 2000), st.floats(0, 1), st.booleans())
@example(1201, 0.0, False)
def test_line_width(size, thickness, dark):
    pen = 0.8 + thickness * (0.03 * size - 0.8)
    assume(size != 256)  # clean ones of that size pass as they are
    image = np.asarray(box(size, pen))
    drawing = load_drawing(image if dark else 255 - image)
    assert 1 <= width(drawing) <= 3.5
    assert filled(drawing) == pytest.approx(BOX_AREA, rel=0.06)
    assert np.percentile(drawing[drawing >= INK], 75) > 200


def test_hairline_in_a_large_picture():
    image = Image.new("L", (2000, 2000), 255)
    ImageDraw.Draw(image).ellipse((500, 500, 1500, 1500), outline=0, width=1)
    drawing = load_drawing(image)
    assert 1 <= width(drawing) <= 2
    assert filled(drawing) == pytest.approx(np.pi * 64**2, rel=0.03)


def shaded(image, low, high, noise=2.0, strength=1.0):
    """The drawing on paper lit from one side, with noise; strength of the ink from 0 to 1."""
    ink = strength * (1 - np.asarray(image) / 255)
    y, x = np.mgrid[: ink.shape[0], : ink.shape[1]] / ink.shape[0]
    paper = low + (high - low) * (0.6 * x + 0.4 * y) + 5 * np.sin(9 * x) * np.cos(7 * y)
    grain = np.random.default_rng(3).normal(0, noise, ink.shape)
    return (paper * (1 - ink) + grain).clip(0, 255).astype(np.uint8)


@pytest.mark.parametrize(
    ("low", "high", "strength"), [(180, 230, 1.0), (200, 240, 0.15), (80, 230, 0.6), (150, 170, 0.9)]
)
def test_uneven_paper(low, high, strength):
    picture = shaded(box(800, 4), low, high, strength=strength)
    for polarity in (picture, 255 - picture):
        drawing = load_drawing(polarity)
        assert alike(drawing, PLAIN)
        assert (drawing == 0).mean() > 0.9


def test_jpeg_noise():
    stream = io.BytesIO()
    box(600, 4).save(stream, "JPEG", quality=12)
    drawing = load_drawing(Image.open(stream))
    assert alike(drawing, PLAIN)
    assert (drawing == 0).mean() > 0.9


def test_specks_are_dropped():
    picture = np.array(box())
    picture[20:22, 20:22] = 0
    np.testing.assert_array_equal(load_drawing(picture), PLAIN)


# Composition


def test_composition_of_a_plain_drawing():
    found = composition(PLAIN)
    assert found.longest == pytest.approx(0.51, abs=0.02)
    assert found.offset == pytest.approx((0, 0), abs=0.01)
    assert found.fits


@pytest.mark.parametrize(
    ("offset", "longest", "fits"),
    [
        ((0, 0), 0.5, True),
        ((0.08, -0.08), 0.7, True),
        ((0.1, 0), 0.5, False),
        ((0, -0.1), 0.5, False),
        ((0, 0), 0.25, False),
        ((0, 0), 0.75, False),
    ],
)
def test_composition_limits(offset, longest, fits):
    assert Composition(offset, longest).fits is fits


@pytest.mark.parametrize(("scale", "shift"), [(1.2, (0.05, -0.05)), (0.7, (-0.06, 0.0))])
def test_fitting_composition_is_kept(scale, shift):
    picture = box(700, 5, scale, shift)
    np.testing.assert_array_equal(load_drawing(picture), load_drawing(picture, compose=False))
    assert composition(load_drawing(picture)).offset == pytest.approx(shift, abs=0.01)


@pytest.mark.parametrize(
    ("scale", "shift"), [(1.9, (0.0, 0.0)), (0.3, (0.3, -0.3)), (0.15, (-0.4, 0.2)), (1.0, (0.2, 0.1))]
)
def test_unfit_composition_is_centred_and_scaled(scale, shift):
    picture = box(900, max(1, 5 * scale), scale, shift)
    drawing = load_drawing(picture)
    assert composition(drawing).longest == pytest.approx(LONGEST_MEDIAN, abs=0.02)
    assert composition(drawing).offset == pytest.approx((0, 0), abs=0.01)
    assert filled(drawing) == pytest.approx(BOX_AREA * (LONGEST_MEDIAN / 0.5) ** 2, rel=0.07)
    kept = composition(load_drawing(picture, compose=False))
    assert not kept.fits
    assert kept.offset == pytest.approx(shift, abs=0.01)


def test_padded_never_stretched_nor_cropped():
    tall = np.asarray(box()).T[:, 80:320]  # 400 x 240
    drawing = load_drawing(tall, compose=False)
    assert alike(drawing, load_drawing(np.pad(tall, ((0, 0), (80, 80)), constant_values=255), compose=False))


def test_composition_errors():
    with pytest.raises(ValueError, match="no ink"):
        composition(np.zeros((256, 256), np.uint8))
    with pytest.raises(ValueError, match="shape"):
        composition(np.zeros((64, 64), np.uint8))
    with pytest.raises(TypeError, match="uint8"):
        composition(np.zeros((256, 256)))


# Errors


def test_missing_file(tmp_path):
    with pytest.raises(FileNotFoundError):
        load_drawing(tmp_path / "none.png")


def test_folder(tmp_path):
    with pytest.raises(ValueError, match="folder"):
        load_drawing(tmp_path)


def test_unreadable_files(tmp_path):
    path = tmp_path / "box.png"
    path.write_bytes(b"no image")
    with pytest.raises(ValueError, match="no image of a known kind"):
        load_drawing(path)
    box().save(path)
    path.write_bytes(path.read_bytes()[:1500])
    with pytest.raises(ValueError, match="cannot be read"):
        load_drawing(path)


@pytest.mark.parametrize("side", [10_500, 30_000])
def test_decompression_bomb(side, tmp_path):
    (tmp_path / "bomb.png").write_bytes(png_header(side, side))
    with pytest.raises(ValueError, match="100 megapixels"):
        load_drawing(tmp_path / "bomb.png")
    with pytest.raises(ValueError, match="100 megapixels"):
        load_drawing(np.broadcast_to(np.uint8(0), (side, side)))


@pytest.mark.parametrize("value", [0, 3, 128, 255])
@pytest.mark.parametrize("size", [1, 50, 256, 300])
def test_no_ink(value, size):
    with pytest.raises(ValueError, match="no ink"):
        load_drawing(np.full((size, size), value, np.uint8))


def test_noise_alone_is_no_ink():
    noise = np.random.default_rng(1).normal(200, 4, (500, 500)).astype(np.uint8)
    with pytest.raises(ValueError, match="no ink"):
        load_drawing(noise)
    speck = np.full((500, 500), 255, np.uint8)
    speck[100:103, 100:103] = 0
    with pytest.raises(ValueError, match="only specks"):
        load_drawing(speck)


def test_too_much_ink():
    blocks = np.random.default_rng(2).random((13, 13)) < 0.45
    with pytest.raises(ValueError, match="ink covers 41% of the picture: this is no line drawing"):
        load_drawing(np.kron(blocks, np.ones((30, 30))) > 0)


def test_no_even_paper():
    noise = np.random.default_rng(2).integers(0, 256, (300, 300)).astype(np.uint8)
    for picture in (noise, np.broadcast_to(np.arange(400) % 46 >= 20, (400, 400))):
        with pytest.raises(ValueError, match="no line drawing"):
            load_drawing(picture)


@pytest.mark.parametrize("shape", [(300,), (300, 300, 2), (300, 300, 5), (2, 300, 300, 3), (0, 300), ()])
def test_wrong_shapes(shape):
    with pytest.raises(ValueError, match="shape"):
        load_drawing(np.zeros(shape, np.uint8))


@pytest.mark.parametrize("value", [np.nan, np.inf, -0.1, 1.5])
def test_wrong_values(value):
    array = np.asarray(box(100)) / 255
    array[3, 3] = value
    with pytest.raises(ValueError, match=r"\[0, 1\]"):
        load_drawing(array)


@pytest.mark.parametrize("source", [np.zeros((300, 300), np.int64), np.zeros((300, 300), complex), [[0, 1]], None, 7])
def test_wrong_types(source):
    with pytest.raises(TypeError):
        load_drawing(source)
