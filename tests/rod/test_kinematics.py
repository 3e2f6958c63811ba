"""Laws of forward kinematics: closed forms, symmetries, oracles."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softreach as sr
from softreach.rod.free import FreeRod
from softreach.rod.rods import as_tip_map
from softreach.support.errors import InvalidInput
from tests.kinds import fibers_and_a_tendon
from tests.laws import arms, in_box
from tests.oracles import free_rod as reference


def nodes_of(arm, tol):
    """Tables at the nodes of the steps that `tol` needs."""
    rod = FreeRod(arm, tol)
    return rod.rule.nodes(np.linspace(0.0, arm.profile.slender_length, rod.steps + 1))


@given(arm=arms(), factor=st.floats(0.01, 100))
def test_scaling_length_and_radii_scales_the_cloud(arm, factor):
    lengths = {name: factor * getattr(arm.profile, name) for name in ("length", "outer_radius")}
    scaled = arm.replace(profile=arm.profile.replace(**lengths))
    gamma = in_box(arm, 20)
    tips = factor * sr.tip_positions(arm, gamma, tol=1e-9)
    np.testing.assert_allclose(
        sr.tip_positions(scaled, gamma, tol=1e-9), tips, atol=3e-9 * scaled.length
    )


@given(arm=arms() | st.just(fibers_and_a_tendon()))
def test_kernels_equal_the_reference(arm):
    gamma = in_box(arm, 5)
    nodes = nodes_of(arm, 1e-9)
    expected = np.array([reference.tip(*nodes, g) for g in gamma])
    tips = sr.tip_positions(arm, gamma, tol=1e-9)
    np.testing.assert_allclose(tips, expected, atol=1e-12 * arm.length)


@given(arm=arms() | st.just(fibers_and_a_tendon()))
def test_derivatives_are_the_complex_step_derivatives_of_the_reference(arm):
    gamma = in_box(arm, 2)
    nodes = nodes_of(arm, 1e-6)
    jacobian, (_, slopes) = sr.tip_jacobian(arm, gamma), as_tip_map(arm).tips_and_slopes(gamma)
    scale = np.array([1, 1, 1, 1 / arm.length, 1 / arm.length, 1 / arm.length])[:, None]
    for sample, bundle in itertools.product(range(2), range(arm.bundles)):
        stepped = gamma[sample].astype(complex)
        stepped[bundle] += 1e-30j
        frame = reference.frames(*nodes, stepped)[-1]
        twist = (frame.imag / 1e-30) @ np.linalg.inv(frame.real)
        vee = np.array([*twist[:3, 3], twist[2, 1], twist[0, 2], twist[1, 0]])
        error = (jacobian[sample, :, bundle] - vee) / scale[:, 0]
        allowed = 1e-11 * arm.length * max(1, np.abs(vee / scale[:, 0]).max())
        assert np.abs(error).max() < allowed
        assert np.abs(slopes[sample, :, bundle] - frame[:3, 3].imag / 1e-30).max() < allowed


@pytest.mark.parametrize("singular", ["taper = 0", "angle = 0", "angle = taper"])
def test_tips_are_continuous_where_the_printed_closed_forms_are_singular(singular, trunk):
    gamma = in_box(trunk, 50)

    def tips(offset):
        angle = {"angle = 0": 0.0, "angle = taper": 0.03}.get(singular, 0.08) + offset
        taper = (0.0 if singular == "taper = 0" else 0.03) + (singular == "taper = 0") * offset
        profile = trunk.profile.replace(taper=taper)
        fibers = tuple(
            f.replace(helical_angle=sign * angle)
            for f, sign in zip(trunk.fibers, (-1, 1, 0), strict=True)
        )
        arm = trunk.replace(profile=profile, actuators=fibers)
        return sr.tip_positions(arm, gamma, tol=1e-11)

    at = tips(0.0)
    for offset in (1e-4, 1e-7, 1e-10, 1e-13, 1e-300):
        for sign in (-1, 1):
            assert np.abs(tips(sign * offset) - at).max() <= 100 * offset + 1e-10


def test_one_activation_gives_one_shape_without_a_sample_axis(trunk):
    shape = sr.configuration(trunk, [-1, 0, -0.5], stations=11)
    assert shape.position.dims == ("station", "axis")
    assert shape.sizes["station"] == 11
    np.testing.assert_allclose(shape.radius, trunk.profile.radius(shape.Z))
    with pytest.raises(InvalidInput, match="stations = 1: must be 2 or more"):
        sr.configuration(trunk, [0, 0, 0], stations=1)


def test_a_tip_map_may_stand_for_its_arm(trunk):
    gamma = in_box(trunk, 10)
    rod = as_tip_map(trunk, 1e-9)
    np.testing.assert_array_equal(sr.tip_positions(rod, gamma), rod.tips(gamma))
    np.testing.assert_array_equal(sr.tip_jacobian(rod, gamma), rod.tip_twists(gamma)[1])
    assert sr.configuration(rod, gamma, 7).identical(sr.configuration(trunk, gamma, 7, tol=1e-9))
