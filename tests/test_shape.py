import json

import numpy as np
import pytest
from hypothesis import given

import reference
from sketchcore.shape import Cuboid, Cylinder, Shape, Wedge

BOX = Cuboid((0, 0, 0), (0.1, 0.2, 0.3))


@given(reference.shapes())
def test_shapes_come_back_from_json_and_packed(shape):
    assert Shape.from_json(shape.to_json()) == shape
    assert Shape.from_json(json.loads(shape.to_json())) == shape
    assert Shape.from_packed(shape.packed) == shape
    assert shape.packed.dtype == np.float64
    assert shape.packed.flags.c_contiguous
    assert hash(Shape.from_json(shape.to_json())) == hash(shape)


def test_packed_rows_are_kind_op_center_half():
    shape = Shape([BOX, Cylinder((1, 2, 3), (4, 5, 6), "z", "subtract"), Cylinder((0, 0, 0), (1, 1, 1))])
    expected = [[0, 1, 0, 0, 0, 0.1, 0.2, 0.3], [3, 0, 1, 2, 3, 4, 5, 6], [2, 1, 0, 0, 0, 1, 1, 1]]
    np.testing.assert_array_equal(shape.packed, expected)


def test_a_wedges_kind_has_its_axis_and_its_corner():
    wedges = [Wedge((0, 0, 0), (1, 1, 1), axis, (u, v)) for axis in "xyz" for v in (-1, 1) for u in (-1, 1)]
    assert Shape(wedges).packed[:, 0].tolist() == list(range(4, 16))
    assert Wedge((0, 0, 0), (1, 1, 1)) == wedges[0]


def test_json_of_a_wedge():
    wedge = Wedge((0, 0.5, 0), (1, 2, 3), "y", np.array([1.0, -1.0]), "subtract")
    entry = {
        "kind": "wedge",
        "axis": "y",
        "corner": [1, -1],
        "center": [0, 0.5, 0],
        "half": [1, 2, 3],
        "op": "subtract",
    }
    assert json.loads(Shape([wedge]).to_json()) == {"primitives": [entry]}
    assert all(type(sign) is int for sign in wedge.corner)


def test_json_is_the_fixed_test_sets():
    entry = '{"kind": "cylinder", "axis": "x", "center": [0.1, 0, 0], "half": [1, 2, 3], "op": "add"}'
    text = f'{{"primitives": [{entry}], "cameras": []}}'
    assert Shape.from_json(text) == Shape([Cylinder((0.1, 0, 0), (1, 2, 3), "x")])
    assert json.loads(Shape([BOX]).to_json()) == {
        "primitives": [{"kind": "cuboid", "center": [0, 0, 0], "half": [0.1, 0.2, 0.3], "op": "add"}]
    }


def test_numbers_of_any_kind_become_floats():
    box = Cuboid(np.zeros(3, np.float32), [1, 2, 3])
    assert box == Cuboid((0.0, 0.0, 0.0), (1.0, 2.0, 3.0))
    assert all(type(v) is float for v in (*box.center, *box.half))


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: Cuboid((0, 0), (1, 1, 1)), ValueError, "center must be three finite numbers"),
        (lambda: Cuboid((0, 0, 0), (1, 1, np.nan)), ValueError, "half must be three finite numbers"),
        (lambda: Cylinder((0, np.inf, 0), (1, 1, 1)), ValueError, "center must be three finite numbers"),
        (lambda: Cuboid((0, 0, 0), (1, 0, 1)), ValueError, "half sizes must be more than 0"),
        (lambda: Cylinder((0, 0, 0), (1, -1, 1)), ValueError, "half sizes must be more than 0"),
        (lambda: Cuboid((0, 0, 0), (1, 1, 1), "remove"), ValueError, "'add' or 'subtract', got 'remove'"),
        (lambda: Cylinder((0, 0, 0), (1, 1, 1), "w"), ValueError, "'x', 'y' or 'z', got 'w'"),
        (lambda: Wedge((0, 0, 0), (1, 1, 1), "w"), ValueError, "'x', 'y' or 'z', got 'w'"),
        (lambda: Wedge((0, 0, 0), (1, 1, 1), "x", (1, 0)), ValueError, r"each -1 or 1, got \(1, 0\)"),
        (lambda: Wedge((0, 0, 0), (1, 1, 1), "x", (1, 1, 1)), ValueError, r"each -1 or 1, got \(1, 1, 1\)"),
        (lambda: Wedge((0, 0, 0), (1, 1, 1), "x", (1, np.nan)), ValueError, "each -1 or 1"),
        (lambda: Wedge((0, 0, 0), (1, 1, 1), "x", None), ValueError, "each -1 or 1, got None"),
        (lambda: Wedge((0, 0, 0), (1, 0, 1)), ValueError, "half sizes must be more than 0"),
        (lambda: Wedge((0, 0, 0), (1, 1, 1), op="remove"), ValueError, "'add' or 'subtract', got 'remove'"),
        (lambda: Shape([]), ValueError, "at least one primitive"),
        (lambda: Shape([BOX, "box"]), TypeError, "made of Cuboid, Cylinder and Wedge, Frustum and Torus; got str"),
        (lambda: Shape.from_json("{"), ValueError, "Expecting property name"),
        (lambda: Shape.from_json("[]"), ValueError, '"primitives"'),
        (lambda: Shape.from_json('{"primitives": []}'), ValueError, "at least one primitive"),
        (
            lambda: Shape.from_json({"primitives": [{"kind": "cone"}]}),
            ValueError,
            "primitive 0 has kind 'cone'; the kinds are 'cuboid', 'cylinder', 'wedge', 'frustum' and 'torus'",
        ),
        (
            lambda: Shape.from_json(
                {"primitives": [{"kind": "wedge", "axis": "x", "center": [0, 0, 0], "half": [1, 1, 1]}]}
            ),
            ValueError,
            "primitive 0 has no 'corner'",
        ),
        (
            lambda: Shape.from_json({"primitives": [{"kind": "cuboid"}]}),
            ValueError,
            "primitive 0 has no 'center'",
        ),
        (
            lambda: Shape.from_json({"primitives": [{"kind": "cuboid", "center": [0, 0, 0], "half": [1, 1, "a"]}]}),
            ValueError,
            "primitive 0: ",
        ),
        (lambda: Shape.from_json({"primitives": ["cuboid"]}), ValueError, "primitive 0: "),
    ],
)
def test_bad_shapes_are_refused(make, error, message):
    with pytest.raises(error, match=message):
        make()
