"""Laws of what changes along an arm: pieces, samples, and the rotation of fibers that follow."""

from __future__ import annotations

import math
import pickle
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.interpolate import PchipInterpolator

import softreach as sr
from softreach.arm import (
    FiberArchitecture,
    LengthTendon,
    Manipulator,
    Pieces,
    Ring,
    Samples,
    Section,
)
from softreach.arm.lines import line_lengths, line_strains
from softreach.arm.parameters import changed, parameters
from softreach.arm.part import AlongArm
from softreach.support.errors import InvalidDesign
from tests.kinds import angles_along, fibers_and_a_tendon, profiles, stations, values_at
from tests.laws import arms, in_box, tensions_of_lengths

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
    found = one.rotation(profile, SECTION.ring(ring), np.array([end]))[0]
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


# Laws of the lines along which bundles run: closed forms, and the drawn shape as an oracle


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


# Laws of places along the arm: over L, in m or by name, they mean the same


LENGTH = 0.4
MATTER = sr.Material(young_modulus=1e6)
GAMMA = np.array([[-0.5, 0.2, 1.0, 2e4], [0.0, -1.0, 0.0, 0.0]])


def body(start: dict | None = None, end: dict | None = None, **others) -> sr.Manipulator:
    """One actuator of each kind that has ends, between the same two places."""
    span = (start or {}) | (end or {})
    return sr.Manipulator(
        profile=sr.LinearTaper(length=LENGTH, outer_radius=0.01, taper=0.004),
        section=sr.Section(rings=(sr.Ring(inner_ratio=0.4, material=MATTER),)),
        actuators=(
            sr.FiberArchitecture(name="helix", revolution=2.0, extent=0.8, **span),
            sr.arm.ObliqueMuscle(name="muscle", helical_angle=0.4, extent=0.7, offset=2.0, **span),
            sr.Tendon(
                name="tendon", distance_ratio=0.7, revolution=-1.0, activation_bounds=(0, 2), **span
            ),
            sr.Chamber(
                name="air", distance=0.004, radius=0.001, activation_bounds=(0, 3e4), **span
            ),
        ),
        **others,
    )


START, END = {"start_over_length": 0.25}, {"end_over_length": 0.75}
STATIONS = {"low": 0.1, "high": 0.3}


@pytest.mark.parametrize(
    ("start", "end"),
    [
        ({"start": 0.1}, {"end": 0.3}),
        ({"start": 0.1}, END),
        (START, {"end": 0.3}),
        ({"start": "low"}, {"end": "high"}),
        (START, {"end": "high"}),
    ],
)
def test_a_place_is_the_same_over_length_in_meters_and_by_name(start, end):
    made = body(start, end, stations=STATIONS)
    np.testing.assert_allclose(
        sr.tip_positions(made, GAMMA), sr.tip_positions(body(START, END), GAMMA), atol=1e-12
    )
    np.testing.assert_allclose(made.breakpoints, (0.1, 0.3), rtol=1e-15)
    assert sr.Manipulator.from_toml(made.to_toml()) == made


def test_a_station_moves_all_that_ends_there():
    made = body({"start": "low"}, {"end": "high"}, stations=STATIONS)
    moved = changed(made, {"stations.high": 0.35})
    assert moved == body({"start": "low"}, {"end": "high"}, stations=STATIONS | {"high": 0.35})
    expected = body({"start": 0.1}, {"end": 0.35})
    np.testing.assert_array_equal(sr.tip_positions(moved, GAMMA), sr.tip_positions(expected, GAMMA))
    assert parameters(moved)["stations.high"].value(moved) == 0.35
    again = made.replace(stations=STATIONS | {"high": 0.35})
    assert again == moved


def test_the_end_in_meters_is_a_parameter_and_stays_where_the_length_changes():
    made = body(START, END)
    ends = parameters(made)
    assert ends["tendon.end"].value(made) == pytest.approx(0.3, rel=1e-15)
    fixed = changed(made, {"tendon.end": 0.2, "length": 0.5})
    assert parameters(fixed)["tendon.end"].value(fixed) == 0.2
    assert parameters(fixed)["tendon.end_over_length"].value(fixed) == 0.4
    assert parameters(fixed)["air.end"].value(fixed) == 0.375
    back = changed(fixed, {"tendon.end_over_length": 0.75, "length": LENGTH})
    assert back == made


def test_an_arm_with_stations_can_be_sent_and_is_a_key():
    made = body({"start": "low"}, {"end": "high"}, stations=STATIONS)
    again = pickle.loads(pickle.dumps(made))
    assert again == made
    assert hash(again) == hash(made)
    assert again.to_toml() == made.to_toml()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: body(end={"end": 0.41}), "helix.end = 0.41: must be on the arm, at most 0.4 m"),
        (lambda: body(end={"end": "hihg"}, stations=STATIONS), 'did you mean "high"'),
        (lambda: body({"start": 0.2}, {"end": 0.2}), "helix.end = 0.2: must be above its start"),
        (
            lambda: body(START | {"start": 0.1}),
            "give exactly one of start and start_over_length",
        ),
        (lambda: body(stations={"a": 0.5}), "stations.a = 0.5: must be on the arm"),
        (lambda: body(stations={"a.b": 0.1}), "stations.a.b = 0.1: must be named by one line"),
        (lambda: sr.FiberArchitecture(revolution=0, extent=1, end="x").span(1.0), "in an arm"),
    ],
)
def test_a_place_off_the_arm_or_without_meaning_is_refused(call, message):
    with pytest.raises(InvalidDesign, match=message):
        call()


def test_all_faults_of_places_in_a_file_are_told_at_once():
    text = body({"start": "low"}, {"end": 0.3}, stations=STATIONS).to_toml()
    text = text.replace("end_m = 0.3", 'end_m = 0.3\nend = "y"', 1)
    with pytest.raises(InvalidDesign) as caught:
        sr.Manipulator.from_toml(text.replace('start = "low"', 'start = "lwo"'))
    said = str(caught.value)
    assert "actuators[0].end_m = 0.3: give exactly one of end (a name) and end_m" in said
    assert said.count("= 'lwo': must be Z in m or a station of the arm: low, high") == 3
    with pytest.raises(InvalidDesign, match=r"stations.high = 'x': must be a finite number"):
        sr.Manipulator.from_toml(text.replace("high = 0.3", 'high = "x"'))
