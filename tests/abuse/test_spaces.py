"""Spaces of designs and metrics as nobody should ask for them: refused in one line."""

import pytest

import softreach as sr
from softreach.atlas import DesignSpace, Metric, Need
from softreach.atlas.space import parse_space
from tests.abuse.refusals import raised_by

NUMBERS = "must be numbers; for several write a list or start:stop:count"
ENDS = "two numbers, the lower one first"
COUNT = "must be a whole number, from 1 to 1,000,000"


def sampled(line: str) -> str:
    return f'layout = "latin"\n{line}\n'


SPACES = {
    "[parameters]\ntaper_deg = [true]": NUMBERS,
    "[parameters]\ntaper_deg = [[0, 1], [2]]": NUMBERS,
    "[parameters]\ntaper_deg = [nan]": "finite value",
    '[parameters]\ntaper_deg = "0:1:2:3"': NUMBERS,
    '[parameters]\ntaper_deg = "0:3"': f"taper_deg = 0:3: {NUMBERS}",
    "[parameters]\ntaper = [1]": "with its unit (deg, °, rad)",
    "[parameters]\n'left.lower' = [-1]\nleft.lower = [-2]": "given once",
    "lay_out = 1": "key = 'lay_out': must be one of design",
    "=": "must be valid TOML",
    'layout = "circle"\n[parameters]\ntaper_deg = [0]': "layout = 'circle': must be one of grid",
    "parameters = 5": "a table of parameters",
    "[parameters]": "at least one of",
    "layout = 5": "one of grid, list, sobol, latin",
    sampled("[parameters]\ntaper_deg = [0]"): "must be two ends",
    sampled("designs = 1e9\n[parameters]\ntaper_deg = [0, 3]"): COUNT,
    sampled("seed = -1\n[parameters]\ntaper_deg = [0, 3]"): "seed = -1: must be a whole number",
    sampled("[parameters]\ntaper_deg = [3, 0]"): ENDS,
}


@pytest.mark.parametrize(("text", "expected"), SPACES.items())
def test_a_space_that_is_none_is_refused_in_one_line(text, expected):
    error = raised_by(lambda: parse_space(text, lambda name: getattr(sr.designs, name)()))
    assert expected in str(error)
    assert "\n" not in str(error)


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
