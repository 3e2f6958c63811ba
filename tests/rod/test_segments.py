"""Laws of segments: straight where nothing acts, and end to end as arms of their own."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softreach as sr
from softreach.arm import FiberArchitecture, LinearTaper, Manipulator, Material, Ring, Section

SECTION = Section(
    rings=(Ring(inner_ratio=0.8, material=Material(young_modulus=1e6, poisson_ratio=0.45)),),
    core=Material(young_modulus=2e5),
)


@given(start=st.floats(0.0, 0.5), width=st.floats(0.2, 0.5), revolution=st.floats(-2, 2))
def test_outside_its_stretch_a_segment_is_straight(start, width, revolution):
    fiber = FiberArchitecture(
        revolution=revolution,
        extent=0.8,
        start_over_length=start,
        end_over_length=start + width,
        activation_bounds=(-0.8, 0),
    )
    profile = LinearTaper(length=1.0, outer_radius=0.06, taper=0.01)
    arm = Manipulator(profile=profile, section=SECTION, actuators=(fiber,))
    end = start + width
    z = np.array([0.0, 0.5 * start, start, end, 0.5 * (end + 1.0), 1.0])
    shape = sr.configuration(arm, [-0.7], z, tol=1e-9)
    frames, places = shape.directors.values, shape.position.values
    np.testing.assert_allclose(frames[:3], np.broadcast_to(np.eye(3), (3, 3, 3)), atol=1e-13)
    np.testing.assert_allclose(places[:3], z[:3, None] * [0, 0, 1], atol=1e-13)
    np.testing.assert_allclose(frames[3:], np.broadcast_to(frames[3], (3, 3, 3)), atol=1e-13)
    beyond = places[3] + (z[3:, None] - end) * frames[3, 2]
    np.testing.assert_allclose(places[3:], beyond, atol=1e-13)


@pytest.mark.parametrize("cut", [0.25, 0.6])
def test_two_segments_in_series_are_two_arms_end_to_end(cut):
    profile = LinearTaper(length=1.0, outer_radius=0.06, taper=0.02)
    lower = FiberArchitecture(
        name="lower", helical_angle=0.3, extent=0.8, end_over_length=cut, bundles=2
    )
    upper = FiberArchitecture(
        name="upper", helical_angle=-0.5, extent=0.6, offset=1.0, start_over_length=cut
    )
    gamma = np.array([-0.5, -0.2, -0.6])
    whole = Manipulator(profile=profile, section=SECTION, actuators=(lower, upper))
    below = Manipulator(
        profile=profile.replace(length=cut),
        section=SECTION,
        actuators=(lower.replace(end_over_length=1.0),),
    )
    above = Manipulator(
        profile=profile.replace(length=1 - cut, outer_radius=float(profile.radius(cut))),
        section=SECTION,
        actuators=(upper.replace(start_over_length=0.0),),
    )
    base = sr.configuration(below, gamma[:2], [below.length], tol=1e-11)
    end = sr.configuration(above, gamma[2:], [above.length], tol=1e-11)
    expected = base.position.values[0] + end.position.values[0] @ base.directors.values[0]
    np.testing.assert_allclose(sr.tip_positions(whole, [gamma], tol=1e-11)[0], expected, atol=1e-10)
