"""Wrong inputs, each tried: what is refused, by which error, and whether the message says what would be right."""

import re

import numpy as np
import pytest

from sketchcore import _core
from sketchcore.camera import VIEWPOINTS, Camera, pack_cameras
from sketchcore.grids import (
    as_drawings,
    buffers,
    carve,
    draw,
    frustum,
    silhouette,
    to_camera_grid,
    to_world_grid,
    voxelize,
)
from sketchcore.shape import Cuboid, Cylinder, Shape

SHAPE = Shape([Cuboid((0, 0, 0), (0.3, 0.2, 0.25)), Cylinder((0, 0.2, 0), (0.1, 0.1, 0.1), "y", "subtract")])
FRONT = VIEWPOINTS["front"]
ROWS, CAMERA = SHAPE.packed, FRONT.packed
CAMERAS = pack_cameras([FRONT, VIEWPOINTS["top"]])
VOLUMES = np.random.default_rng(0).random((2, 64, 64, 64), np.float32)
DRAWINGS = np.stack([draw(SHAPE, FRONT), draw(SHAPE, VIEWPOINTS["top"])])
FIELDS = _core.evidence_fields(DRAWINGS)
DEPTH, NORMAL = buffers(SHAPE, FRONT, 64)

# Each kernel with arguments that it takes; the arrays among them are what the tests below spoil.
KERNELS = {
    "voxelize": (_core.voxelize, {"shape": ROWS}),
    "frustum": (_core.frustum, {"shape": ROWS, "camera": CAMERA, "rays": 1}),
    "buffers": (_core.buffers, {"shape": ROWS, "camera": CAMERA, "size": 16}),
    "lines": (_core.lines, {"depth": DEPTH, "normal": NORMAL, "depth_step": 0.01, "crease_degrees": 30.0}),
    "draw": (_core.draw, {"shape": ROWS, "camera": CAMERA}),
    "to_camera_grid": (_core.to_camera_grid, {"volumes": VOLUMES, "cameras": CAMERAS}),
    "to_world_grid": (
        _core.to_world_grid,
        {"volumes": VOLUMES, "cameras": CAMERAS, "into": np.zeros_like(VOLUMES)},
    ),
    "silhouettes": (_core.silhouettes, {"drawings": DRAWINGS}),
    "carve": (_core.carve, {"drawings": DRAWINGS, "cameras": CAMERAS}),
    "evidence_fields": (_core.evidence_fields, {"drawings": DRAWINGS}),
    "evidence": (_core.evidence, {"fields": FIELDS, "cameras": CAMERAS}),
    "heed_outlines": (
        _core.heed_outlines,
        {
            "volume": VOLUMES[0],
            "depths": VOLUMES[:, 0].copy(),
            "cameras": CAMERAS,
            "hull": np.zeros((64, 64, 32), np.uint8),
        },
    ),
    "lift": (_core.lift, {"features": np.zeros((2, 65536, 2), np.float32), "cameras": CAMERAS}),
    "lift_transposed": (
        _core.lift_transposed,
        {"gradient": np.zeros((2, 16384, 2), np.float32), "cameras": CAMERAS},
    ),
    "lift_taps": (_core.lift_taps, {"cameras": CAMERAS}),
}
ARRAYS = [(k, a) for k, (_, given) in KERNELS.items() for a, v in given.items() if isinstance(v, np.ndarray)]
# What networks make is handed on as it is.
FLOATS = [(k, a) for k, a in ARRAYS if KERNELS[k][1][a].dtype != np.uint8 and a not in ("features", "gradient")]


def call(kernel, **changes):
    function, arguments = KERNELS[kernel]
    return function(**(arguments | changes))


def spread(array):
    """The same array with another number between each two: strided along the last axis."""
    return np.repeat(array, 2, -1)[..., ::2]


@pytest.mark.parametrize("kernel", KERNELS)
def test_what_is_given_here_is_taken(kernel):
    call(kernel)


@pytest.mark.parametrize(("kernel", "name"), ARRAYS)
def test_strided_arrays_are_refused_with_the_remedy(kernel, name):
    array = spread(KERNELS[kernel][1][name])
    with pytest.raises(ValueError, match=f"{name} must be C-contiguous; numpy.ascontiguousarray makes it so"):
        call(kernel, **{name: array})


@pytest.mark.parametrize(("kernel", "name"), [(k, a) for k, a in ARRAYS if KERNELS[k][1][a].ndim > 1])
def test_fortran_order_is_refused_with_the_remedy(kernel, name):
    # Numbers read in the wrong order would make a wrong result, silently.
    array = np.asfortranarray(KERNELS[kernel][1][name])
    with pytest.raises(ValueError, match=f"{name} must be C-contiguous; numpy.ascontiguousarray makes it so"):
        call(kernel, **{name: array})


@pytest.mark.parametrize(("kernel", "name"), ARRAYS)
def test_other_dtypes_are_refused_by_name(kernel, name):
    array = KERNELS[kernel][1][name]
    wrong = array.astype(np.float64 if array.dtype == np.float32 else np.float32)
    with pytest.raises((TypeError, ValueError), match=str(array.dtype)):
        call(kernel, **{name: wrong})
    with pytest.raises((TypeError, ValueError), match="ndarray"):
        call(kernel, **{name: array.tolist()})


@pytest.mark.parametrize(("kernel", "name"), ARRAYS)
def test_other_shapes_are_refused_with_the_right_one(kernel, name):
    array = KERNELS[kernel][1][name]
    shorter = array[:, :-1] if name == "features" else array[..., :-1]  # features have any width
    with pytest.raises(ValueError, match=rf"{name} must have shape \[.*\], got \["):
        call(kernel, **{name: np.ascontiguousarray(shorter)})
    with pytest.raises(ValueError, match=rf"{name} must have shape \[.*\], got \["):
        call(kernel, **{name: array[None]})


@pytest.mark.parametrize(("kernel", "name"), FLOATS)
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_nan_and_infinity_are_refused(kernel, name, value):
    if (name, value) == ("depth", np.inf):
        return  # nothing is seen there
    array = KERNELS[kernel][1][name].copy()
    array.flat[5] = value
    with pytest.raises(ValueError, match=r"finite|more than 0 everywhere, infinite where nothing"):
        call(kernel, **{name: array})


@pytest.mark.parametrize("index", [0, 255, 4095, 4096, 64**3 - 1])
def test_no_nan_hides_in_a_volume(index):
    volume = np.zeros((64, 64, 64), np.float32)
    volume.flat[index] = np.nan
    for function in (to_camera_grid, to_world_grid):
        with pytest.raises(ValueError, match="volume has a NaN or infinite number"):
            function(volume, FRONT)


def test_no_nan_comes_in_by_into():
    into = np.zeros((64, 64, 64), np.float32)
    into[0, 0, 0] = np.nan
    with pytest.raises(ValueError, match="into has a NaN or infinite number"):
        to_world_grid(np.zeros((64, 64, 64)), FRONT, into)


def test_large_finite_volumes_are_taken():
    assert np.isfinite(to_camera_grid(np.full((64, 64, 64), 3e38, np.float32), FRONT)).all()


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        (0, 25, "primitive 1 has kind 25; 0 is a cuboid, 1, 2, 3 a cylinder along x, y, z, 4 to 7, .* a wedge"),
        (0, 16, "primitive 1 is a frustum or a torus, whose row has 12 numbers; got 8"),
        (0, 0.5, "primitive 1 has kind 0.5"),
        (0, -1, "primitive 1 has kind -1"),
        (1, 2, "op"),
        (1, np.nan, "op|finite"),
        (5, 0, "primitive 1 has half sizes .*; each must be more than 0"),
        (7, -0.1, "primitive 1 has half sizes .*; each must be more than 0"),
    ],
)
def test_bad_rows_of_a_shape_are_named(column, value, message):
    rows = ROWS.copy()
    rows[1, column] = value
    with pytest.raises(ValueError, match=message):
        _core.voxelize(rows)


def test_empty_inputs():
    with pytest.raises(ValueError, match="at least one primitive"):
        _core.voxelize(np.zeros((0, 8)))
    with pytest.raises(ValueError, match="at least one drawing"):
        carve(np.zeros((0, 256, 256), np.uint8), [])
    assert to_camera_grid(VOLUMES[:0], []).shape == (0, 64, 64, 64)
    assert _core.evidence_fields(DRAWINGS[:0]).shape == (0, 256, 256, 2)


def test_counts_must_agree():
    for function in (to_camera_grid, to_world_grid):
        with pytest.raises(ValueError, match=r"one for each of the 2 .*got 1"):
            function(VOLUMES, [FRONT])
    with pytest.raises(ValueError, match="2 drawings, 1 cameras"):
        carve(DRAWINGS, [FRONT])
    for kernel, change in (
        ("to_camera_grid", {"cameras": CAMERAS[:1]}),
        ("to_world_grid", {"into": VOLUMES[:1].copy()}),
        ("carve", {"cameras": CAMERAS[:1]}),
        ("evidence", {"fields": FIELDS[:1]}),
        ("heed_outlines", {"depths": VOLUMES[:1, 0].copy()}),
        ("lift", {"features": np.zeros((1, 65536, 2), np.float32)}),
        ("lift_transposed", {"gradient": np.zeros((1, 16384, 2), np.float32)}),
    ):
        with pytest.raises(ValueError, match=r"one for each of the 2 .*, got 1"):
            call(kernel, **change)


NO_SHAPES = {"array": ROWS, "none": None}


@pytest.mark.parametrize("kind", NO_SHAPES)
@pytest.mark.parametrize("name", ["voxelize", "frustum", "buffers", "draw"])
def test_only_shapes_are_shapes(name, kind):
    value = NO_SHAPES[kind]
    functions = {"voxelize": voxelize, "frustum": frustum, "buffers": buffers, "draw": draw}
    arguments = [value] if name == "voxelize" else [value, FRONT]
    with pytest.raises(TypeError, match=f"sketchcore.Shape, got {type(value).__name__}"):
        functions[name](*arguments)


@pytest.mark.parametrize("function", [frustum, buffers, draw])
@pytest.mark.parametrize("value", ["front", CAMERA, None], ids=["name", "array", "none"])
def test_only_cameras_are_cameras(function, value):
    with pytest.raises(TypeError, match=f"expected a sketchcore.Camera, got {type(value).__name__}"):
        function(SHAPE, value)


def test_a_volume_goes_with_a_camera_and_a_batch_with_a_sequence():
    for function in (to_camera_grid, to_world_grid):
        with pytest.raises(TypeError, match="one camera, a batch of volumes with a sequence"):
            function(VOLUMES, FRONT)
        with pytest.raises(TypeError, match="one camera, a batch of volumes with a sequence"):
            function(VOLUMES[0], [FRONT])
        with pytest.raises(TypeError, match=r"sketchcore\.Camera|one camera"):
            function(VOLUMES[0], "front")
        with pytest.raises(TypeError, match="must hold numbers, got dtype complex128"):
            function(np.zeros((64, 64, 64), complex), FRONT)
    with pytest.raises(ValueError, match=r"into must have the volume's shape \[64, 64, 64\], got \[2, 64, 64, 64\]"):
        to_world_grid(VOLUMES[0], FRONT, VOLUMES)
    with pytest.raises(TypeError, match="into must hold numbers"):
        to_world_grid(VOLUMES[0], FRONT, np.full((64, 64, 64), "a"))


@pytest.mark.parametrize("shape", [(16,) * 3, (65,) * 3, (64, 64, 32), (32, 32)])
def test_only_cubes_of_four_sizes_are_resampled(shape):
    sides, got = r"s one of \[32, 64, 128, 256\]", re.escape(str(list(shape)))
    for function in (to_camera_grid, to_world_grid):
        with pytest.raises(
            ValueError, match=rf"volume must have shape \[s, s, s\] or \[n, s, s, s\], {sides}, got {got}"
        ):
            function(np.zeros(shape), FRONT)
    volumes = np.zeros((1, *shape), np.float32)
    got = re.escape(str(list(volumes.shape)))
    for kernel in ("to_camera_grid", "to_world_grid"):
        with pytest.raises(ValueError, match=rf"volumes must have shape \[n, s, s, s\], {sides}, got {got}"):
            call(kernel, volumes=volumes)


def test_grids_of_two_sizes_do_not_mix():
    small = np.zeros((32, 32, 32), np.float32)
    with pytest.raises(ValueError, match=r"into must have the volume's shape \[64, 64, 64\], got \[32, 32, 32\]"):
        to_world_grid(VOLUMES[0], FRONT, small)
    with pytest.raises(ValueError, match=r"out must have shape \[64, 64, 64\], got \[32, 32, 32\]"):
        to_camera_grid(VOLUMES[0], FRONT, small)
    with pytest.raises(ValueError, match=r"into must have shape \[n, 64, 64, 64\], got \[1, 32, 32, 32\]"):
        call("to_world_grid", into=small[None])
    with pytest.raises(ValueError, match=r"out must have shape \[2, 64, 64, 64\], got \[1, 32, 32, 32\]"):
        call("to_camera_grid", out=small[None])


def test_carving_takes_a_sequence_of_cameras():
    with pytest.raises(TypeError, match=r"sequence|sketchcore\.Camera"):
        carve(DRAWINGS[:1], FRONT)


@pytest.mark.parametrize("function", [frustum, buffers, draw])
def test_an_eye_inside_the_shape_is_refused(function):
    inside = Camera((0.2, 0.1, 0), FRONT.rotation)
    with pytest.raises(ValueError, match=r"position \[0.2, 0.1, 0.0\] lies inside the shape; move it outside"):
        function(SHAPE, inside)
    # In the hole, and in the box's hull, but not inside.
    function(SHAPE, Camera((0, 0.15, 0), FRONT.rotation))


def test_an_eye_in_a_hollow_sees_its_walls():
    hollow = Shape([Cuboid((0, 0, 0), (0.4, 0.4, 0.4)), Cuboid((0, 0, 0), (0.3, 0.3, 0.3), "subtract")])
    depth, normal = buffers(hollow, Camera((0, 0, 0), FRONT.rotation), 32)
    np.testing.assert_allclose(depth, 0.3, atol=1e-6)
    assert (normal == [1, 0, 0]).all()


@pytest.mark.parametrize("rays", [0, 17])
def test_rays_are_one_to_sixteen(rays):
    with pytest.raises(ValueError, match=f"rays must lie between 1 and 16, got {rays}"):
        frustum(SHAPE, FRONT, rays)


@pytest.mark.parametrize("size", [0, 4097])
def test_sizes_are_one_to_4096(size):
    with pytest.raises(ValueError, match=f"size must lie between 1 and 4096 pixels, got {size}"):
        buffers(SHAPE, FRONT, size)


def test_negative_counts_are_value_errors():
    with pytest.raises(ValueError, match="rays must lie between 1 and 16, got -1"):
        frustum(SHAPE, FRONT, -1)
    with pytest.raises(ValueError, match="size must lie between 1 and 4096 pixels, got -1"):
        buffers(SHAPE, FRONT, -1)


def test_depth_must_be_positive():
    for value in (0.0, -1.0, np.nan):
        depth = DEPTH.copy()
        depth[3, 3] = value
        with pytest.raises(ValueError, match="depth must be more than 0 everywhere, infinite where"):
            call("lines", depth=depth)


@pytest.mark.parametrize("change", [{"depth_step": np.nan}, {"crease_degrees": np.nan}], ids=str)
def test_thresholds_of_lines_must_be_numbers(change):
    with pytest.raises(ValueError, match=next(iter(change))):
        call("lines", **change)


def test_drawings_are_checked():
    for wrong in (np.zeros((256, 256)), np.zeros((256, 256), bool), np.zeros((256, 256), np.int64)):
        for function in (silhouette, as_drawings):
            with pytest.raises(TypeError, match=r"drawings must be uint8 \(ink 255 on 0\), got " + str(wrong.dtype)):
                function(wrong)
        with pytest.raises(TypeError, match="drawings must be uint8"):
            carve(wrong, [FRONT])
    for size in ((255, 256), (1, 256, 256, 3), (256,)):
        with pytest.raises(ValueError, match=r"drawings must have shape \[n, 256, 256\], got \["):
            as_drawings(np.zeros(size, np.uint8))
    assert as_drawings(DRAWINGS[0]).shape == (1, 256, 256)
    assert as_drawings(list(DRAWINGS)).flags.c_contiguous
    np.testing.assert_array_equal(as_drawings(np.asfortranarray(DRAWINGS)), DRAWINGS)


def test_a_silhouette_is_of_one_drawing():
    # Two drawings would give the silhouette of the first alone, none an IndexError.
    for drawings in (DRAWINGS, DRAWINGS[:0]):
        with pytest.raises(ValueError, match=r"256, 256|one drawing"):
            silhouette(drawings)


def test_into_must_be_writeable_and_an_array_of_its_own():
    into = np.zeros_like(VOLUMES)
    into.flags.writeable = False
    with pytest.raises((TypeError, ValueError), match="not writeable"):
        call("to_world_grid", into=into)
    with pytest.raises((TypeError, ValueError), match="borrowed"):
        call("to_world_grid", into=VOLUMES)


OUT = {
    "voxelize": (lambda out: voxelize(SHAPE, out), voxelize(SHAPE)),
    "draw": (lambda out: draw(SHAPE, FRONT, out), draw(SHAPE, FRONT)),
    "to_camera_grid": (lambda out: to_camera_grid(VOLUMES[0], FRONT, out), to_camera_grid(VOLUMES[0], FRONT)),
    "to_world_grid": (
        lambda out: to_world_grid(VOLUMES[0], FRONT, VOLUMES[1], out),
        to_world_grid(VOLUMES[0], FRONT, VOLUMES[1]),
    ),
    "to_camera_grid of a batch": (
        lambda out: to_camera_grid(VOLUMES, [FRONT] * 2, out=out),
        to_camera_grid(VOLUMES, [FRONT] * 2),
    ),
    "to_world_grid of a batch": (
        lambda out: to_world_grid(VOLUMES, [FRONT] * 2, out=out),
        to_world_grid(VOLUMES, [FRONT] * 2),
    ),
}


@pytest.mark.parametrize("name", OUT)
def test_out_is_written_whole_and_returned(name):
    function, expected = OUT[name]
    out = np.full_like(expected, 77)
    assert function(out) is out
    np.testing.assert_array_equal(out, expected)


@pytest.mark.parametrize("name", OUT)
def test_an_out_that_does_not_fit_is_refused(name):
    function, expected = OUT[name]
    dtype = str(expected.dtype)
    for wrong in (expected.astype(np.int16), expected.tolist()):
        with pytest.raises(TypeError, match=f"out must be a {dtype} array"):
            function(wrong)
    with pytest.raises(ValueError, match=r"out must have shape \[.*, got \["):
        function(np.zeros((*expected.shape, 1), dtype))
    frozen = expected.copy()
    frozen.flags.writeable = False
    for wrong in (np.repeat(expected, 2, -1)[..., ::2], np.asfortranarray(expected), frozen):
        with pytest.raises(ValueError, match="out must be C-contiguous and writeable"):
            function(wrong)


def test_out_may_be_into_but_not_the_volume():
    into = VOLUMES[1].copy()
    assert to_world_grid(VOLUMES[0], FRONT, into, out=into) is into
    np.testing.assert_array_equal(into, OUT["to_world_grid"][1])
    both = VOLUMES.copy()
    for function in (to_camera_grid, to_world_grid):
        with pytest.raises(ValueError, match="out must not overlap volume"):
            function(both[0], FRONT, out=both[0])


def test_the_core_refuses_an_out_that_does_not_fit():
    with pytest.raises(ValueError, match=r"out must have shape \[64, 64, 64\], got \[64, 64\]"):
        _core.voxelize(ROWS, np.zeros((64, 64), np.uint8))
    with pytest.raises(ValueError, match=r"out must have shape \[2, 64, 64, 64\], got \[1, "):
        _core.to_camera_grid(VOLUMES, CAMERAS, VOLUMES[:1].copy())
    with pytest.raises(ValueError, match="out must be C-contiguous"):
        _core.draw(ROWS, CAMERA, np.zeros((256, 512), np.uint8)[:, ::2])
