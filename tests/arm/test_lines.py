"""Laws of the lines along which bundles run: closed forms, and the drawn shape as an oracle."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings

import softreach as sr
from softreach.arm import LengthTendon
from softreach.arm.lines import (
    limit_shortening,
    line_lengths,
    line_strains,
)
from tests.kinds import fibers_and_a_tendon
from tests.laws import arms, in_box, tensions_of_lengths


def drawn_lengths(arm, gamma, stations=4001):
    """Lengths of polygons on the middle lines of a drawn shape; lines that act everywhere."""
    shape = sr.configuration(arm, gamma, stations=stations)
    outline = arm.outline(shape.Z.values)
    ratio = 0.5 * (outline.inner_ratio + outline.outer_ratio)
    middle = ratio * shape.radius.values[:, None]
    across, up = shape.directors.values[:, 0, None], shape.directors.values[:, 1, None]
    x, y = middle * np.cos(outline.center), middle * np.sin(outline.center)
    places = shape.position.values[:, None] + x[..., None] * across + y[..., None] * up
    return np.linalg.norm(np.diff(places, axis=0), axis=-1).sum(axis=0)


@settings(max_examples=8)
@given(arm=arms())
def test_lengths_are_those_of_the_drawn_shape(arm):
    gamma = in_box(arm, 1)
    lengths, drawn = line_lengths(arm, gamma)[0], drawn_lengths(arm, gamma[0])
    np.testing.assert_allclose(lengths, drawn, rtol=2e-5)


def test_forces_bend_per_length_at_rest_here_too():
    arm = fibers_and_a_tendon()
    gamma = in_box(arm, 1)
    lengths, drawn = line_lengths(arm, gamma)[0], drawn_lengths(arm, gamma[0])
    np.testing.assert_allclose(lengths, drawn, rtol=2e-5)


def test_a_parallel_tendon_shortens_by_its_work():
    """T (1/K0 + d²/K1) at small tension: half the energy that it puts into the arm."""
    arm = sr.designs.three_tendon_robot()
    stiffness = sr.describe(arm).stiffness
    tension, distance = 1e-3, arm.actuators[0].distance
    strain = line_strains(arm.with_bounds((0.0, tension)))
    expected = tension * (1 / stiffness.axial[0] + distance**2 / stiffness.bending[0])
    np.testing.assert_allclose(strain[:, 0], -expected, rtol=1e-4)
    np.testing.assert_allclose(strain[:, 1], 0.0, atol=1e-15)


def test_a_longitudinal_fiber_shortens_by_less_than_its_activation(trunk):
    strain = line_strains(trunk)
    assert (strain[:, 0] > trunk.bounds[:, 0]).all()
    assert (strain[:, 0] < 0).all()
    assert strain[:, 1] == pytest.approx(0.0, abs=1e-12)


def test_no_bundle_shortens_by_more_than_the_limit_and_one_that_does_not_reach_it_is_as_it_was(
    trunk,
):
    arm = trunk.with_bounds([(-1.6, 0.2), (-0.2, 0.1), (-1.0, 0.0)])
    limited = limit_shortening(arm, 0.15)
    assert line_strains(limited)[[0, 2], 0] == pytest.approx(-0.15, abs=1e-9)
    np.testing.assert_array_equal(limited.bounds[1], arm.bounds[1])
    np.testing.assert_array_equal(limited.bounds[:, 1], arm.bounds[:, 1])
    assert limit_shortening(limited, 0.15) == limited
    with pytest.raises(sr.InvalidInput, match="most = 2"):
        limit_shortening(arm, 2)


@pytest.mark.parametrize("loads", [None, sr.Loads(payload=0.1, tip_force=(0.2, 0, 0))])
def test_a_configuration_has_the_lengths_that_it_draws(loads):
    arm = fibers_and_a_tendon().replace(loads=loads)
    gamma = in_box(arm, 1)
    shape = sr.configuration(arm, gamma[0])
    np.testing.assert_allclose(shape.line_length, drawn_lengths(arm, gamma[0]), rtol=2e-5)
    assert list(shape.line.values) == list(arm.bundle_names)


def test_a_configuration_has_the_tensions_that_displacements_lead_to():
    """And lengths that are as much shorter, where the tendon is parallel and does not stretch."""
    arm = sr.designs.three_tendon_robot()
    pulled = LengthTendon(distance=0.01, bundles=3, activation_bounds=(-0.01, 0.01))
    arm = arm.replace(actuators=(pulled,))
    shape = sr.configuration(arm, [0.004, -0.01, 0.001])
    tension = tensions_of_lengths(arm, [[0.004, -0.01, 0.001]])[0]
    np.testing.assert_allclose(shape.bundle_activation, tension, rtol=1e-9)
    assert shape.bundle_activation.attrs["units"] == "N"
    assert tension[1] == 0
    length = arm.length - np.array([0.004, 0.001])
    np.testing.assert_allclose(shape.line_length.values[[0, 2]], length, rtol=1e-9)
