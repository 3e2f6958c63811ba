"""What a design says of its parameters."""

from __future__ import annotations

import pytest

from softreach.atlas.parameter import changed, parameter_units
from softreach.errors import InvalidInput
from softreach.studio.parameter_value import parameter_value

VALUES = {"bundles": 2, "length": 1.3, "outer_radius": 0.05, "lower": -0.8, "upper": -0.05}


def test_a_parameter_that_was_changed_has_its_new_value(trunk):
    for name in parameter_units(trunk):
        fields = [field for field in VALUES if name.startswith(field)]
        value = VALUES[fields[0]] if fields else 0.3
        if name in ("taper", "helical_angle_longitudinal"):
            value = 0.01
        made = changed(trunk, {name: value})
        assert parameter_value(made, name) == pytest.approx(value, rel=1e-12), name


def test_an_arm_without_helical_fibers_does_not_turn(trunk):
    straight = trunk.replace(fibers=trunk.fibers[2:])
    assert parameter_value(straight, "revolution") == 0.0


def test_other_names_are_refused(trunk):
    with pytest.raises(InvalidInput, match="parameter"):
        parameter_value(trunk, "color")
