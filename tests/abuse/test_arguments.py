"""Arguments that no function is meant for: each converter and each public function refuses them."""

import inspect
import math

import numpy as np
import pytest

import softreach as sr
from softreach.support import arguments, arrays
from softreach.support.errors import InvalidInput
from tests.abuse.refusals import raised_by
from tests.test_names import FUNCTIONS, parameters


class Stranger:
    """Right for no argument."""


STRANGERS = (None, "abc", b"abc", {"a": 1}, {1.0}, Stranger(), Stranger, 1j)
SCALARS = (*STRANGERS, "1", True, np.True_, math.nan, math.inf, [1.0], np.ones(2), np.ma.masked)
ROWS = (
    *STRANGERS,
    [["1", "2", "3"]],
    [[1.0, 2.0, 3.0], [1.0]],
    [[None, 2.0, 3.0]],
    np.zeros((1, 3), bool),
    np.zeros((1, 3), complex),
    np.zeros((1, 3), "datetime64[s]"),
    np.ma.masked_equal([[1.0, -1.0, 2.0]], -1.0),
)
NOT_FINITE = ([[math.nan] * 3], [[0.0, math.inf, 0.0]])
SHAPES = (np.zeros((1, 7)), np.zeros((1,) * 7))

CONVERTERS = {
    "as_number": (arguments.as_number, (), SCALARS),
    "as_integer": (arguments.as_integer, (), (*SCALARS, 1.5, 1.0, -1)),
    "as_flag": (arguments.as_flag, (), (*STRANGERS, 1, np.ones(2, bool))),
    "as_text": (arguments.as_text, (), (None, b"abc", 5, Stranger)),
    "as_path": (arguments.as_path, (), (None, b"abc", 5, "", "a\0b.toml", Stranger)),
    "as_one_of": (arguments.as_one_of, (["front"],), (*STRANGERS, 1, ["front"])),
    "as_names": (arguments.as_names, (), (None, 1, [1, 2], {1.0}, Stranger)),
    "as_mapping": (arguments.as_mapping, (arguments.as_number,), (None, "abc", 5, [1.0], {1: 1})),
    "as_instance": (arguments.as_instance, (sr.Manipulator, "an arm"), (*STRANGERS, 1.0)),
    "as_function": (arguments.as_function, (), (None, "abc", 5)),
    "as_dataset": (arguments.as_dataset, (), (*STRANGERS, 1.0, np.ones((4, 3)))),
    "as_floats": (arrays.as_floats, (), ROWS),
    "as_rows": (arrays.as_rows, (3, "rows"), (*ROWS, *NOT_FINITE, *SHAPES)),
    "as_points": (arrays.as_points, (), (*ROWS, *NOT_FINITE, *SHAPES)),
    "as_stations": (arrays.as_stations, (), (*ROWS, [math.nan], np.zeros((2, 2)))),
    "as_directions": (arrays.as_directions, (), (*ROWS, *NOT_FINITE, *SHAPES, [0.0, 0.0, 0.0])),
    "as_indices": (arrays.as_indices, (3, "rows"), (*ROWS, [0.5], [-1], [3], [[1]])),
    "as_faces": (arrays.as_faces, (3,), (*ROWS, [[0.5, 1, 2]], [[0, 1, 3]], [0, 1, 2])),
}
"""A function of the name and the value of an argument, what it takes besides, and bad values."""


@pytest.mark.parametrize("name", CONVERTERS)
def test_a_converter_refuses_what_it_is_not_meant_for_in_one_line(name):
    converter, others, bad = CONVERTERS[name]
    for value in bad:
        with pytest.raises(InvalidInput, match=r"^asked.*: must be ") as caught:
            converter("asked", value, *others)
        assert "\n" not in str(caught.value)


def test_every_converter_is_tried():
    every = {name for name in {**vars(arguments), **vars(arrays)} if name.startswith("as_")}
    assert every - {"as_given"} <= {*CONVERTERS}


def test_scalars_of_numpy_are_what_they_are_in_python():
    assert arguments.as_number("x", np.float32(0.5)) == 0.5
    assert arguments.as_integer("n", np.int16(3)) == 3
    assert arguments.as_flag("f", np.True_) is True


ARM = sr.designs.minimal_trunk()
OF_OBJECTS = {
    "Manipulator.outline": ARM.outline,
    "Manipulator.save": ARM.save,
    "Manipulator.with_bounds": ARM.with_bounds,
    "Box.distance": sr.requirements.Box((0, 0, 0), (1, 1, 1)).distance,
    "Requirements.save": sr.Requirements().save,
    "TipMap.tips": sr.rod.as_tip_map(ARM).tips,
}
SHEETS = {"atlas_figures", "plot_cloud_sheet", "plot_hull_sheet", "plot_metric_map"}
"""Functions of an atlas, whose arguments are checked where they are used."""

PUBLIC = {
    name: function
    for name, function in FUNCTIONS.items()
    if name.rpartition(".")[2] == function.__qualname__
    and parameters(function)
    and name.rpartition(".")[2] not in SHEETS | {"plot_payload_curve"}
} | OF_OBJECTS


@pytest.mark.parametrize("name", PUBLIC)
def test_a_public_function_refuses_a_stranger_in_one_line_that_names_the_argument(name):
    function = PUBLIC[name]
    asked = parameters(function)
    needed = [
        argument
        for argument, parameter in asked.items()
        if parameter.default is inspect.Parameter.empty
        and parameter.kind not in (parameter.VAR_KEYWORD, parameter.VAR_POSITIONAL)
    ] or list(asked)[:1]
    text = str(raised_by(lambda: function(**dict.fromkeys(needed, Stranger()))))
    assert "\n" not in text
    assert any(argument in text for argument in needed)
