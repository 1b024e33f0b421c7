import json

import numpy as np
import pytest
from hypothesis import given

import reference
from sketchcore.shape import Cuboid, Cylinder, Shape

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
        (lambda: Shape([]), ValueError, "at least one primitive"),
        (lambda: Shape([BOX, "box"]), TypeError, "made of Cuboid and Cylinder, got str"),
        (lambda: Shape.from_json("{"), ValueError, "Expecting property name"),
        (lambda: Shape.from_json("[]"), ValueError, '"primitives"'),
        (lambda: Shape.from_json('{"primitives": []}'), ValueError, "at least one primitive"),
        (
            lambda: Shape.from_json({"primitives": [{"kind": "cone"}]}),
            ValueError,
            "primitive 0 has kind 'cone'",
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
