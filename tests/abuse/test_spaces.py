"""Spaces of designs and metrics as nobody should ask for them: refused in one line."""

import pytest

from softreach.atlas import DesignSpace, Metric, Need
from softreach.cli.atlas import grid_of
from tests.abuse.refusals import raised_by

NUMBERS = "must be numbers; several as 1,2,3 or start:stop:count"

SPACES = {
    "taper_deg=true": NUMBERS,
    "taper_deg=nan": NUMBERS,
    "taper_deg=0:1:2:3": NUMBERS,
    "taper_deg=0:3": f"taper_deg = 0:3: {NUMBERS}",
    "taper_deg=0:3:0": NUMBERS,
    "taper=1": "with its unit (deg, °, rad)",
    "taper_deg=0,0": "values that differ",
    "tapper_deg=1": 'did you mean "taper_deg"',
}
SAMPLED = {
    "count": {"count": 1e9, "taper": (0.0, 0.04)},
    "seed": {"count": 4, "seed": -1, "taper": (0.0, 0.04)},
    "two numbers, the lower one first": {"count": 4, "taper": (0.04, 0.0)},
    "at least one of": {"count": 4},
}


@pytest.mark.parametrize(("text", "expected"), SPACES.items())
def test_a_grid_that_is_none_is_refused_in_one_line(text, expected, trunk):
    error = raised_by(lambda: grid_of(trunk, [text]))
    assert expected in str(error)
    assert "\n" not in str(error)


@pytest.mark.parametrize(("expected", "arguments"), SAMPLED.items())
def test_a_sample_that_is_none_is_refused_in_one_line(expected, arguments, trunk):
    error = raised_by(lambda: DesignSpace.sampled(trunk, **arguments))
    assert expected in str(error)


@pytest.mark.parametrize("number", [-1, 4, 1.5, "a", None, True])
def test_a_number_that_no_design_has_is_refused(trunk, number):
    space = DesignSpace.grid(trunk, taper=[0.0, 0.01])
    assert "from 0 to 1" in str(raised_by(lambda: space.design(number)))


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"name": 5}, "must be text"),
        ({"name": "a b"}, "letters, digits and underscores"),
        ({"name": ""}, "letters, digits and underscores"),
        ({"unit": 5}, "unit of metric m = 5: must be text"),
        ({"meaning": None}, "must be text"),
        ({"nan_if": True}, "must be text"),
        ({"needs": 5}, "must be a tuple"),
        ({"needs": ("TIPS",)}, "some of Need.ARM"),
        ({"compute": None}, "must be a function"),
        ({"over": "x"}, "must be () or"),
    ],
)
def test_a_metric_that_is_none_is_refused(change, expected):
    fine = {"name": "m", "unit": "1", "meaning": "x", "needs": (Need.TIPS,), "compute": len}
    assert expected in str(raised_by(lambda: Metric(**{**fine, **change})))
