"""The designs of a space: every combination, lists, samples, and how they are written."""

from __future__ import annotations

import numpy as np
import pytest

import softreach as sr
from softreach.atlas import DesignSpace, parameter_units
from softreach.atlas.space_file import parse_space
from softreach.errors import InvalidInput
from tests.atlas.families import small_space


def test_a_grid_has_every_combination_in_c_order():
    space = small_space()
    assert (space.dims, space.shape, space.size) == (("revolution", "taper"), (2, 2), 4)
    assert space.values(1) == {"revolution": 0.5, "taper": np.radians(2.0)}
    arm = space.design(1)
    assert arm.taper == np.radians(2.0)
    np.testing.assert_allclose(np.abs(arm.revolutions[:2]), 0.5)


def test_a_list_takes_values_together():
    space = DesignSpace.listed(sr.designs.minimal_trunk(), taper=[0.0, 0.01], offset_left=[1, 2])
    assert (space.dims, space.size) == (("design",), 2)
    assert space.design(1).fibers[0].offset == 2


@pytest.mark.parametrize("method", ["sobol", "latin"])
def test_sampled_designs_fill_each_stratum_once(method):
    arm = sr.designs.minimal_trunk()
    space = DesignSpace.sampled(arm, 16, method=method, taper=(0.0, 0.04), extent=(0.5, 1.0))
    for name, values in space.parameters:
        low, high = {"taper": (0.0, 0.04), "extent": (0.5, 1.0)}[name]
        strata = np.floor((np.array(values) - low) / (high - low) * 16)
        assert sorted(strata) == list(range(16))


@pytest.mark.parametrize("name", list(parameter_units(sr.designs.minimal_trunk())))
def test_every_parameter_changes_the_design_and_its_own_value_changes_nothing(name):
    base = sr.designs.minimal_trunk()
    value = {"bundles": 2, "lower": -1.0, "upper": 0.5, "length": 1.1, "outer_radius": 0.07}
    new = next((v for key, v in value.items() if name.startswith(key)), 0.3)
    new = {"taper": 0.01}.get(name, new)
    changed = DesignSpace.listed(base, **{name: [new]}).design(0)
    assert changed != base
    same = {"taper": base.taper, "poisson_ratio": 0.5, "length": 1.0, "radius_ratio": 0.75}
    if name in same:
        np.testing.assert_allclose(
            sr.tip_positions(
                DesignSpace.listed(base, **{name: [same[name]]}).design(0), [[-1] * 3]
            ),
            sr.tip_positions(base, [[-1] * 3]),
            atol=1e-12,
        )


def test_a_valid_design_behind_an_invalid_one_is_found():
    base = sr.designs.minimal_trunk(taper=np.radians(3))
    space = DesignSpace.listed(base, outer_radius=[0.01], taper=[0.0])
    assert space.design(0).outer_radius == 0.01


def test_bounds_of_one_fiber_follow_its_bundles():
    base = sr.designs.minimal_trunk()
    space = DesignSpace.listed(base, bundles_left=[2], lower_left=[-1.0], upper=[0.1])
    expected = [[-1, 0.1], [-1, 0.1], [-5 / 3, 0.1], [-5 / 3, 0.1]]
    np.testing.assert_allclose(space.design(0).bounds, expected)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "parameters = none"),
        ({"tapper": [0]}, "parameter = tapper: must be one of revolution, taper"),
        ({"taper": []}, "taper = .*: must be one finite value"),
        ({"taper": [np.nan]}, "taper = .*: must be one finite value"),
        ({"taper": [0.01, 0.01]}, "taper = .*: must be values that differ"),
    ],
)
def test_faulty_spaces_are_refused_in_one_line(values, message):
    with pytest.raises(InvalidInput, match=message) as caught:
        DesignSpace.grid(sr.designs.minimal_trunk(), **values)
    assert "\n" not in str(caught.value)


def test_a_space_survives_being_written():
    space = small_space(offset_left=[1.0, 2.0])
    assert DesignSpace.from_dict(space.to_dict()) == space


def test_written_spaces_speak_in_degrees_and_ranges():
    text = """
        design = "minimal_trunk"
        [parameters]
        revolution_deg = "0:108:4"
        taper_deg = [0, 1.5]
        outer_radius_m = 0.0625
    """
    space = parse_space(text, lambda name: getattr(sr.designs, name)())
    assert space.shape == (4, 2, 1)
    np.testing.assert_allclose(np.degrees(space.values(3)["revolution"]), 36)
    np.testing.assert_allclose(np.degrees(space.values(3)["taper"]), 1.5)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            'layout = "circle"\n[parameters]\ntaper_deg = [0]',
            "layout = circle: must be one of grid",
        ),
        (
            "[parameters]\ntaper = [0]",
            "parameter = taper: must be one of revolution_deg, taper_deg",
        ),
        ('[parameters]\ntaper_deg = "0:3"', "taper_deg = 0:3: must be numbers"),
        ('layout = "sobol"\n[parameters]\ntaper_deg = [0]', "taper = .*: must be two ends"),
        ("lay_out = 1", "key = lay_out: must be one of design"),
        ("=", "must be valid TOML"),
    ],
)
def test_faulty_space_files_are_refused(text, message):
    with pytest.raises(InvalidInput, match=message):
        parse_space(text, lambda name: getattr(sr.designs, name)())


def test_sampled_spaces_can_be_written_too():
    text = 'layout = "latin"\ndesigns = 5\n[parameters]\ntaper_deg = [0, 3]'
    space = parse_space(text, lambda name: getattr(sr.designs, name)())
    assert (space.dims, space.shape) == (("design",), (5,))
