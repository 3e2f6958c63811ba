"""Laws of what changes along an arm: pieces, samples, and the rotation of fibers that follow."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.interpolate import PchipInterpolator

from softreach.arm import (
    FiberArchitecture,
    LinearTaper,
    Manipulator,
    Pieces,
    Ring,
    Samples,
    Section,
)
from softreach.arm.along import AlongArm
from softreach.arm.tables import tables
from softreach.support.errors import InvalidDesign
from tests.kinds import angles_along, profiles, stations, values_at

SECTION = Section(
    rings=(
        Ring(inner_ratio=0.7, name="outer"),
        Ring(inner_ratio=0.3, outer_ratio=0.6, name="inner"),
    )
)


def fiber(angle, ring="outer", **changes):
    return FiberArchitecture(helical_angle=angle, extent=0.5, offset=0.4, ring=ring, **changes)


def arm(profile, *fibers):
    return Manipulator(profile=profile, section=SECTION, actuators=fibers)


def same_everywhere(value, places):
    """The same value as pieces, and through samples both ways."""
    ends = {"stations_over_length": places}
    yield Pieces(values=(value,) * (len(places) - 1), **ends)
    for interpolation in ("cubic", "linear"):
        yield Samples(values=(value,) * len(places), interpolation=interpolation, **ends)


@given(
    profile=profiles(),
    places=stations(),
    angle=st.floats(-1.2, 1.2),
    ring=st.sampled_from(["outer", "inner"]),
    start=st.floats(0.0, 0.5),
)
def test_an_angle_of_equal_values_is_the_constant_one(profile, places, angle, ring, start):
    z = np.union1d(np.linspace(0, profile.length, 9), profile.length * np.array(places))
    expected = tables(arm(profile, fiber(angle, ring, start_over_length=start)), z)
    for along in same_everywhere(angle, places):
        found = tables(arm(profile, fiber(along, ring, start_over_length=start)), z)
        np.testing.assert_allclose(found.extension, expected.extension, rtol=1e-11, atol=1e-14)
        np.testing.assert_allclose(
            found.curvature, expected.curvature, rtol=1e-9, atol=1e-10 / profile.length
        )


@given(
    profile=profiles(),
    angle=angles_along(),
    ring=st.sampled_from(["outer", "inner"]),
    start=st.floats(0.0, 0.5),
    share=st.floats(0.0, 1.0),
)
def test_fibers_turn_by_the_integral_of_their_angle_across_all_breakpoints(
    profile, angle, ring, start, share
):
    """Θ(Z) = ∫ tan α/(R cos φ) dZ from where the fiber begins, R its own outer radius."""
    ratio, begin = SECTION.ring(ring).outer_ratio, start * profile.length
    end = begin + share * (profile.length - begin)

    def rate(z):
        alpha = angle(z / profile.length) if isinstance(angle, AlongArm) else angle
        cone = math.hypot(1.0, ratio * profile.slope(z))
        return math.tan(alpha) * cone / (ratio * profile.radius(z))

    breaks = angle.breaks if isinstance(angle, AlongArm) else ()
    inside = [*profile.breakpoints, *(profile.length * x for x in breaks)]
    ends = [begin, *sorted(z for z in inside if begin < z < end), end]
    expected = sum(quad(rate, *piece, epsabs=1e-12, epsrel=1e-12)[0] for piece in pairwise(ends))
    one = fiber(angle, ring, start_over_length=start)
    found = one.rotation(profile, SECTION, np.array([end]))[0]
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-10)


@given(profile=profiles(), revolution=st.floats(-5, 5), start=st.floats(0, 0.5))
def test_a_revolution_is_that_from_where_a_fiber_begins_to_where_it_ends(
    profile, revolution, start
):
    stretch = {"start_over_length": start, "end_over_length": start + 0.4}
    one = FiberArchitecture(revolution=revolution, extent=0.5, ring="inner", **stretch)
    assert one.revolution_on(profile, SECTION) == pytest.approx(revolution, rel=1e-11, abs=1e-12)
    angle = one.helical_angle_on(profile, SECTION)
    again = fiber(angle, "inner", **stretch)
    assert again.revolution_on(profile, SECTION) == pytest.approx(revolution, rel=1e-11, abs=1e-12)


@given(places=stations(), data=st.data())
def test_samples_are_met_and_never_left_behind(places, data):
    """The monotone cubic is SciPy's; straight lines are straight."""
    values = data.draw(values_at(places, -2, 2))
    x = np.linspace(0, 1, 101)
    cubic = Samples(stations_over_length=places, values=values)
    np.testing.assert_allclose(cubic(x), PchipInterpolator(places, values)(x), atol=1e-14)
    linear = cubic.replace(interpolation="linear")
    np.testing.assert_allclose(linear(x), np.interp(x, places, values), atol=1e-14)
    for one in (cubic, linear):
        np.testing.assert_allclose(one(places), values, atol=1e-13)
        assert one(x).min() >= min(values) - 1e-12
        assert one(x).max() <= max(values) + 1e-12


@given(places=stations(), data=st.data(), interpolation=st.sampled_from(["cubic", "linear"]))
def test_the_derivative_is_that_of_the_values(places, data, interpolation):
    values = data.draw(values_at(places, -2, 2))
    along = Samples(stations_over_length=places, values=values, interpolation=interpolation)
    for low, high in pairwise(places):
        x, h = low + 0.37 * (high - low), 1e-6 * (high - low)
        rate = (along(x + h) - along(x - h)) / (2 * h)
        assert along.derivative(x) == pytest.approx(rate, rel=1e-6, abs=1e-6)


def test_at_the_end_of_a_piece_holds_what_begins_there():
    pieces = Pieces(stations_over_length=(0, 0.5, 1), values=(1.0, 2.0))
    np.testing.assert_array_equal(pieces([0, np.nextafter(0.5, 0), 0.5, 1]), [1, 1, 2, 2])
    np.testing.assert_array_equal(pieces.derivative([0.2, 0.7]), [0, 0])
    assert pieces.breaks == (0.5,)
    assert hash(pieces) == hash(pieces.replace())


def test_a_ring_between_others_has_the_angle_of_its_own_rim():
    """A straight arm: one turn of the rim R in 2πR/tan α, whatever lies outside of it."""
    section = Section(rings=(Ring(inner_ratio=0.2, outer_ratio=0.5), Ring(inner_ratio=0.7)))
    one = FiberArchitecture(helical_angle=0.6, extent=0.5, ring=0)
    profile = LinearTaper(length=1.0, outer_radius=0.1)
    lead = 2 * math.pi * 0.05 / math.tan(0.6)
    turned = one.rotation(profile, section, np.array([lead]))
    np.testing.assert_allclose(turned, 2 * math.pi, rtol=1e-13)


TWO = {"stations_over_length": (0, 1)}


@pytest.mark.parametrize(
    ("make", "fields", "message"),
    [
        (Pieces, {**TWO, "values": (1, 2)}, "values = .*must be 1 finite"),
        (Pieces, {**TWO, "values": ()}, "one for each gap between stations"),
        (Samples, {**TWO, "values": (1,)}, "must be 2 finite .*each station"),
        (Samples, {**TWO, "values": (1, math.nan)}, r"values = \(1, nan\): must be 2 finite"),
        (Samples, {"stations_over_length": (1, 0), "values": (1, 2)}, "rise from 0"),
        (Samples, {"stations_over_length": (0,), "values": (1,)}, "two or more"),
        (Samples, {**TWO, "values": (1, 2), "interpolation": "spline"}, "must be one of cubic, l"),
        (fiber, {"angle": Samples(values=(0, 2), **TWO)}, "helical_angle = 2: "),
        (fiber, {"angle": (0.1, 0.2)}, r"helical_angle = \(0.1, 0.2\)"),
        (fiber, {"angle": 0.1, "revolution": 0.2}, "give exactly one of helical_angle and revol"),
        (
            fiber,
            {"angle": 0.1, "start_over_length": 0.5, "end_over_length": 0.5},
            "end_over_length = 0.5: must be above start_over_length = 0.5",
        ),
        (
            fiber,
            {"angle": 0.1, "end_over_length": 1e-10},
            "end_over_length = 1e-10: must be above start_over_length = 0",
        ),
    ],
)
def test_what_cannot_be_along_an_arm_is_refused(make, fields, message):
    with pytest.raises(InvalidDesign, match=message):
        make(**fields)
