"""Derivatives of tips by parameters of the design: against differences, and in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

from softreach.arm import Base, Loads, Manipulator, designs
from softreach.arm.parameters import changed, find_parameters
from softreach.rod.rods import tip_map
from softreach.support.arrays import Array
from softreach.workspace.shifts import shifts_along
from softreach.workspace.tip_derivatives import TipDerivatives
from tests.laws import arms

NAMES = ("taper", "outer_radius", "extent", "lower")


def derivatives(arm: Manipulator, names: tuple[str, ...], tol: float) -> TipDerivatives:
    return TipDerivatives(tip_map(arm, tol), list(find_parameters(arm, names).values()))


def places(arm: Manipulator, n: int = 40) -> Array:
    return np.random.default_rng(0).random((n, tip_map(arm).box.dimension))


def by_six_neighbors(arm: Manipulator, name: str, cube: Array, tol: float, step: float) -> Array:
    shifts = shifts_along(arm, find_parameters(arm, (name,))[name], 3, step)
    rods = [tip_map(each, tol) for each in shifts.arms]
    tips = [rod.tips(rod.box.from_free_cube(cube)) for rod in rods]
    return np.tensordot(shifts.weights, tips, 1)


@settings(max_examples=5)
@given(arms())
def test_two_neighbors_in_equal_steps_tell_what_six_of_finer_steps_tell(arm):
    free = arm.bounds[:, 1] > arm.bounds[:, 0]
    names = tuple(find_parameters(arm, NAMES if free.all() else NAMES[:3]))
    cube, found = places(arm), derivatives(arm, names, 1e-9)
    for k, (name, value) in enumerate(zip(names, found.at(cube).T, strict=True)):
        expected = by_six_neighbors(arm, name, cube, 1e-11, 2e-3).T
        assert np.abs(value - expected).max() < 1e-6 * np.abs(expected).max() + found.error[k]


def test_under_loads_they_are_as_good_as_equilibria_are_found():
    arm = designs.lce_arm().replace(loads=Loads(gravity=(0, 0, 9.81)))
    cube, found = places(arm, 20), derivatives(arm, ("taper", "upper"), 1e-9)
    for k, name in enumerate(("taper", "upper")):
        expected = by_six_neighbors(arm, name, cube, 1e-11, 1e-2)
        assert found.at(cube)[:, :, k] == pytest.approx(expected, abs=2e-5 * np.abs(expected).max())


def test_by_a_bound_the_tip_moves_as_its_activation_does():
    arm = designs.minimal_trunk()
    rod, cube = tip_map(arm, 1e-9), places(arm)
    found = derivatives(arm, ("left.lower", "right.upper"), 1e-9).at(cube)
    slopes = rod.tips_and_slopes(rod.box.from_free_cube(cube))[1]
    names = [actuator.name for actuator in arm.actuators]
    left, right = names.index("left"), names.index("right")
    expected = [
        (1 - cube[:, left, None]) * slopes[:, :, left],
        cube[:, right, None] * slopes[:, :, right],
    ]
    assert found == pytest.approx(np.stack(expected, axis=2), abs=1e-7)


def test_all_actuators_turned_turn_the_tip_about_the_axis():
    arm = changed(designs.minimal_trunk(), {"left.offset": 0.3})
    names = tuple(f"{actuator.name}.offset" for actuator in arm.actuators)
    rod, cube = tip_map(arm), places(arm)
    tips = rod.tips(rod.box.from_free_cube(cube))
    found = derivatives(arm, names, 1e-6).at(cube).sum(axis=2)
    assert found == pytest.approx(np.cross([0.0, 0.0, 1.0], tips), abs=1e-5)


def test_at_the_end_of_a_range_they_are_those_of_the_side_that_exists():
    arm = designs.minimal_trunk(np.radians(108), 0.0)
    cube = places(arm)
    found = derivatives(arm, ("taper",), 1e-9).at(cube)[:, :, 0]
    expected = by_six_neighbors(arm, "taper", cube, 1e-12, 1e-3)
    assert found == pytest.approx(expected, rel=1e-4, abs=1e-5)


def test_they_turn_with_the_base():
    arm = designs.minimal_trunk()
    base = Base(points="down", position=(1.0, 2.0, 3.0))
    cube = places(arm)
    found, turned = (
        derivatives(each, ("taper",), 1e-9).at(cube)[:, :, 0]
        for each in (arm, arm.replace(base=base))
    )
    assert turned == pytest.approx(found @ base.rotation.T, abs=1e-6)
