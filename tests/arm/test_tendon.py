"""Laws of tendons: closed forms where they are parallel, the follower load where they are not."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softreach as sr
from softreach.arm import (
    LinearTaper,
    Manipulator,
    Material,
    Ring,
    SampledTaper,
    Samples,
    Section,
    Tendon,
)
from softreach.arm.lines import law_warning, pull_error
from softreach.arm.parameters import changed
from softreach.arm.tables import tables
from softreach.rod.summary import describe
from softreach.support.errors import InvalidDesign
from tests.oracles import tendon_rod
from tests.oracles.tendon_law import linear_shape
from tests.oracles.tendon_rod import follower_shape

LENGTH, RADIUS, MODULUS, NU = 0.3, 0.01, 1e6, 0.4
K0, K1 = math.pi * MODULUS * RADIUS**2, math.pi / 4 * MODULUS * RADIUS**4
SECTION = Section(
    rings=(
        Ring(inner_ratio=0.5, material=Material(young_modulus=MODULUS, poisson_ratio=NU), name="r"),
    )
)
STRAIGHT = LinearTaper(length=LENGTH, outer_radius=RADIUS)
TAPERED = LinearTaper(length=LENGTH, outer_radius=RADIUS, taper=0.015)


def arm(*tendons, profile=STRAIGHT):
    return Manipulator(profile=profile, section=SECTION, actuators=tendons)


def tendon(**fields):
    return Tendon(**({"distance": 0.008, "activation_bounds": (0, 30)} | fields))


def arc(zeta, curvature, heading, length=LENGTH):
    """Tip of an arc of the length ζ L whose curvature is per length at rest."""
    angle, radius = curvature * length, zeta / curvature
    side = radius * (1 - math.cos(angle))
    return [side * math.cos(heading), side * math.sin(heading), radius * math.sin(angle)]


def rod(profile):
    """The arm as the oracle knows it."""
    resists = [lambda z, k=k: SECTION.stiffness(profile.radius(z))[k] for k in range(3)]
    return tendon_rod.Rod(
        length=profile.length, axial=resists[0], bending=resists[1], torsion=resists[2]
    )


def cable(one, profile, tension):
    """A tendon as the oracle knows it: polar coordinates of its path, put down by hand."""
    anchor = one.end_over_length * profile.length

    def radius(z):
        if one.distance_ratio is not None:
            return one.distance_ratio * profile.radius(z)
        if isinstance(one.distance, Samples):
            return one.distance(np.asarray(z) / profile.length)
        return one.distance + 0 * z

    def angle(z):
        if one.routing is not None:
            return one.offset + one.routing(np.asarray(z) / profile.length)
        return one.offset + one.revolution * z / anchor

    return tendon_rod.Tendon(radius=radius, angle=angle, tension=tension, anchor=anchor)


@given(tension=st.floats(0.1, 30), offset=st.floats(-4, 4), distance=st.floats(0.001, 0.012))
def test_a_parallel_tendon_bends_to_an_arc_and_shortens_by_its_tension_over_k0(
    tension, offset, distance
):
    """ζ = 1 - τ/K0, curvature τ ρt/K1 per length at rest, toward the tendon."""
    zeta, curvature = 1 - tension / K0, tension * distance / K1
    one = arm(tendon(distance=distance, offset=offset))
    tip = sr.tip_positions(one, [[tension]], tol=1e-11)[0]
    np.testing.assert_allclose(tip, arc(zeta, curvature, offset), atol=1e-11)


def test_three_even_tendons_of_one_tension_only_shorten():
    tip = sr.tip_positions(arm(tendon(bundles=3, offset=0.4)), [[9.0] * 3])[0]
    np.testing.assert_allclose(tip, [0, 0, LENGTH * (1 - 27 / K0)], atol=1e-12)


@given(
    tension=st.floats(0.1, 3),
    revolution=st.floats(-4, 4),
    profile=st.sampled_from([STRAIGHT, TAPERED]),
    end=st.sampled_from([1.0, 0.6]),
    where=st.sampled_from(
        [
            {"distance": 0.008},
            {"distance_ratio": 0.8},
            {"distance": Samples(stations_over_length=(0, 1), values=(0.009, 0.004))},
        ]
    ),
)
def test_the_tip_is_that_of_the_linear_law_written_down_a_second_time(
    tension, revolution, profile, end, where
):
    """N = -τ t3 and M = -p × τ t with the tangent at rest, walked by SciPy."""
    one = Tendon(
        offset=0.4, revolution=revolution, end_over_length=end, activation_bounds=(0, 30), **where
    )
    expected = linear_shape(rod(profile), [cable(one, profile, tension)], [profile.length])
    found = sr.tip_positions(arm(one, profile=profile), [[tension]], tol=1e-10)[0]
    np.testing.assert_allclose(found, expected.place[0], atol=2e-10)


@pytest.mark.parametrize("tension", [0.3, 3.0])
@pytest.mark.parametrize("end", [1.0, 0.6])
def test_a_parallel_tendon_is_the_follower_load(tension, end):
    one = tendon(offset=0.4, end_over_length=end)
    pulled = [cable(one, TAPERED, tension)]
    exact = follower_shape(rod(TAPERED), pulled, [0.0, LENGTH])
    found = sr.tip_positions(arm(one, profile=TAPERED), [[tension]], tol=1e-10)[0]
    np.testing.assert_allclose(found, exact.place[-1], atol=1e-9)


@pytest.mark.parametrize("revolution", [1.0, 2 * math.pi])
def test_helical_tendons_miss_the_follower_load_by_less_than_their_bending(revolution):
    """Second order in the tension: relative to what the tip moves, of order κρt."""
    one, misses = tendon(revolution=revolution), []
    for tension in (0.02, 0.04, 0.08):
        pulled = [cable(one, STRAIGHT, tension)]
        exact = follower_shape(rod(STRAIGHT), pulled, [LENGTH])
        found = sr.tip_positions(arm(one), [[tension]], tol=1e-10)[0]
        moved = np.linalg.norm(exact.place[0] - [0, 0, LENGTH])
        bend = tension * 0.008 / K1 * 0.008  # κρt
        misses.append(np.linalg.norm(found - exact.place[0]) / moved)
        assert misses[-1] < bend
    np.testing.assert_allclose(np.array(misses[1:]) / misses[:-1], 2.0, rtol=0.05)


@pytest.mark.parametrize(
    ("revolution", "tension", "end"),
    [(2 * math.pi, 1e-3, 1.0), (3.0, 1e-3, 1.0), (4.0, 5e-4, 0.6), (4.0, 1e-4, 1.0)],
)
def test_what_the_linear_law_misses_is_known_before_and_said(revolution, tension, end):
    thin = LinearTaper(length=LENGTH, outer_radius=0.1 * RADIUS)
    one = tendon(revolution=revolution, end_over_length=end, activation_bounds=(0, tension))
    pulled = arm(one, profile=thin)
    exact = follower_shape(rod(thin), [cable(one, thin, tension)], [LENGTH]).place[0]
    apart = np.linalg.norm(sr.tip_positions(pulled, [[tension]], tol=1e-9)[0] - exact)
    assert pull_error(pulled) == pytest.approx(apart, rel=0.05, abs=1e-5 * LENGTH)
    said = f"about {1e3 * pull_error(pulled):.2g} mm" in law_warning(pulled)
    assert said == (apart > 1e-3 * LENGTH)
    assert said == (law_warning(pulled) in describe(pulled).warnings)


@pytest.mark.parametrize("distance", [0.008, (0.008, 0.0)])
def test_parallel_and_convergent_tendons_are_within_the_linear_law(distance):
    assert law_warning(arm(tendon(distance=distance, bundles=3, activation_bounds=(0, 3)))) == ""


def test_a_routing_of_even_rotation_is_a_revolution():
    even = Samples(stations_over_length=(0, 0.4, 1), values=(0, 0.8, 2.0))
    for interpolation in ("cubic", "linear"):
        one = tendon(routing=even.replace(interpolation=interpolation), offset=0.3)
        other = tendon(revolution=2.0, offset=0.3)
        z = np.linspace(0, LENGTH, 7)
        found, expected = (tables(arm(each), z).curvature for each in (one, other))
        np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-12)


@pytest.mark.parametrize("revolution", [0.0, 1.5])
@pytest.mark.parametrize("span", [{}, {"start": 0.06, "end": 0.24}, {"end_over_length": 0.8}])
def test_two_distances_are_a_straight_line_from_where_a_tendon_begins_to_its_anchor(
    span, revolution
):
    pair, z = tendon(distance=(0.009, 0.004), revolution=revolution, **span), [[10.0], [30.0]]
    start, end = pair.span(LENGTH)
    slope = (0.004 - 0.009) / (end - start)
    ends = (0.009 - slope * start, 0.009 + slope * (LENGTH - start))
    samples = Samples(stations_over_length=(0, 1), values=ends, interpolation="linear")
    np.testing.assert_allclose(
        sr.tip_positions(arm(pair), z),
        sr.tip_positions(arm(pair.replace(distance=samples)), z),
        atol=1e-13,
    )


def test_files_and_parameters_hold_distances_that_change_along_the_arm():
    samples = Samples(stations_over_length=(0, 0.5, 1), values=(0.009, 0.008, 0.004))
    made = arm(tendon(name="a", distance=(0.009, 0.004)), tendon(name="b", distance=samples))
    assert "distance_m = [0.009, 0.004]" in made.to_toml()
    assert Manipulator.from_toml(made.to_toml()) == made
    moved = changed(made, {"a.distance[1]": 0.005, "b.distance.values[2]": 0.006})
    assert moved.actuators[0].distance == (0.009, 0.005)
    assert moved.actuators[1].distance.values == (0.009, 0.008, 0.006)
    assert changed(made, {"a.distance": 0.007}).actuators[0].distance == 0.007
    with pytest.raises(InvalidDesign, match=r"a.distance\[1\] = -1: must be"):
        changed(made, {"a.distance[1]": -1.0})
    with pytest.raises(InvalidDesign, match=r"actuators\[0\].distance_m = \[1, 2, 3\]: must be a"):
        Manipulator.from_toml(made.to_toml().replace("[0.009, 0.004]", "[1, 2, 3]", 1))


def test_tendons_break_the_arm_where_they_start_end_and_turn():
    bent = Samples(stations_over_length=(0, 0.3, 1), values=(0, 1, 0), interpolation="linear")
    one = tendon(routing=bent, start_over_length=0.1, end_over_length=0.75)
    profile = SampledTaper(length=1.0, stations_over_length=(0, 0.5, 1), radii=(0.1, 0.1, 0.1))
    np.testing.assert_allclose(arm(one, profile=profile).breakpoints, [0.1, 0.3, 0.5, 0.75])


def test_millimeters_taken_for_meters_are_refused():
    """Such an arm would curl up so far that no search of it ends."""
    with pytest.raises(
        sr.InvalidDesign, match="distance = 8: must be at most the length of the ar"
    ):
        arm(tendon(distance=8.0))
