"""The designs of a space: every combination, lists, samples, and how they are written."""

import numpy as np
import pytest

import softreach as sr
from softreach.arm.parameters import changed
from softreach.atlas import DesignSpace
from softreach.cli.atlas import grid_of
from softreach.support.errors import InvalidInput
from tests.atlas.families import small_space


def test_a_grid_has_every_combination_in_c_order():
    space = small_space()
    assert (space.dims, space.shape, space.size) == (("revolution", "taper"), (2, 2), 4)
    assert space.values(1) == {"revolution": 0.5, "taper": np.radians(2.0)}
    assert space.design(1) == changed(sr.designs.minimal_trunk(), space.values(1))


def test_a_list_takes_values_together():
    values = {"taper": [0.0, 0.01], "left.offset": [1, 2]}
    space = DesignSpace.listed(sr.designs.minimal_trunk(), **values)
    assert (space.dims, space.size) == (("design",), 2)
    assert space.design(1).fibers[0].offset == 2


def test_sampled_designs_fill_each_stratum_once():
    ends = {"taper": (0.0, 0.04), "extent": (0.5, 1.0)}
    space = DesignSpace.sampled(sr.designs.minimal_trunk(), 16, **ends)
    for name, values in space.parameters:
        low, high = ends[name]
        strata = np.floor((np.array(values) - low) / (high - low) * 16)
        assert sorted(strata) == list(range(16))


def test_counts_that_are_sampled_are_whole():
    arm = sr.designs.minimal_trunk()
    space = DesignSpace.sampled(arm, 8, **{"left.bundles": (1, 3), "left.offset": (0.0, 1.0)})
    counts, offsets = (np.array(values) for _, values in space.parameters)
    assert set(counts) == {1.0, 2.0, 3.0}
    assert (offsets % 1 != 0).any()


def test_designs_that_would_be_shortened_to_nothing_are_gaps():
    space = DesignSpace.listed(sr.designs.minimal_trunk(), lower=[-1.0, -30.0])
    assert list(space.gaps) == [1]
    assert "must keep ζ > 0" in space.gaps[1]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({}, "parameters = none"),
        ({"tapper": [0]}, "parameter = tapper: must be one of revolution, taper.*did you mean"),
        ({"taper": []}, "taper = .*: must be one finite value"),
        ({"taper": [0.01, 0.01]}, "taper = .*: must be values that differ"),
    ],
)
def test_faulty_spaces_are_refused_in_one_line(values, message):
    with pytest.raises(InvalidInput, match=message) as caught:
        DesignSpace.grid(sr.designs.minimal_trunk(), **values)
    assert "\n" not in str(caught.value)


def test_a_space_survives_being_written():
    space = small_space(**{"left.offset": [1.0, 2.0]})
    assert DesignSpace.from_dict(space.to_dict()) == space


def test_written_grids_speak_in_degrees_and_ranges(trunk):
    written = ["revolution_deg=0:108:4", "taper_deg=0,1.5", "outer_radius_m=0.0625"]
    space = grid_of(trunk, written)
    assert space.shape == (4, 2, 1)
    np.testing.assert_allclose(np.degrees(space.values(3)["revolution"]), 36)
    np.testing.assert_allclose(np.degrees(space.values(3)["taper"]), 1.5)
    units = ["revolution=0deg:108deg:4", "taper=0,1.5°", "outer_radius=62.5mm"]
    same = grid_of(trunk, units)
    for number in range(space.size):
        assert same.values(number) == pytest.approx(space.values(number), rel=1e-15)


def test_parameters_of_one_fiber_are_written_with_its_name_and_a_dot():
    arm = sr.designs.redundant_trunk()
    space = grid_of(arm, ["left.offset_deg=60", "longitudinal 1.bundles=2"])
    wanted = {"left.offset": np.radians(60), "longitudinal 1.bundles": 2}
    assert space.values(0) == pytest.approx(wanted)


def test_a_space_prints_its_parameters_with_their_ends():
    values = {"length": [1.0, 0.5], "taper": [0.0, 0.02], "left.bundles": [1, 2]}
    space = DesignSpace.listed(sr.designs.minimal_trunk(), **values)
    assert str(space).splitlines() == [
        "list of 2 designs",
        "  length: 2 values from 0.5 to 1 m",
        "  taper: 2 values from 0 to 0.02 rad",
        "  left.bundles: 2 values from 1 to 2",
    ]
