"""Laws of places along the arm: over L, in m or by name, they mean the same."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import softreach as sr
from softreach.arm.parameters import changed, parameters
from softreach.support.errors import InvalidDesign

LENGTH = 0.4
MATTER = sr.Material(young_modulus=1e6)
GAMMA = np.array([[-0.5, 0.2, 1.0, 2e4], [0.0, -1.0, 0.0, 0.0]])


def arm(start: dict | None = None, end: dict | None = None, **others) -> sr.Manipulator:
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
    made = arm(start, end, stations=STATIONS)
    np.testing.assert_allclose(
        sr.tip_positions(made, GAMMA), sr.tip_positions(arm(START, END), GAMMA), atol=1e-12
    )
    np.testing.assert_allclose(made.breakpoints, (0.1, 0.3), rtol=1e-15)
    assert sr.Manipulator.from_toml(made.to_toml()) == made


def test_the_names_of_stations_change_nothing():
    one = arm({"start": "low"}, {"end": "high"}, stations=STATIONS)
    other = arm({"start": "a b"}, {"end": "ζ"}, stations={"ζ": 0.3, "a b": 0.1, "idle": 0.2})
    np.testing.assert_array_equal(sr.tip_positions(other, GAMMA), sr.tip_positions(one, GAMMA))
    assert one != other


def test_a_station_moves_all_that_ends_there():
    made = arm({"start": "low"}, {"end": "high"}, stations=STATIONS)
    moved = changed(made, {"stations.high": 0.35})
    assert moved == arm({"start": "low"}, {"end": "high"}, stations=STATIONS | {"high": 0.35})
    expected = arm({"start": 0.1}, {"end": 0.35})
    np.testing.assert_array_equal(sr.tip_positions(moved, GAMMA), sr.tip_positions(expected, GAMMA))
    assert parameters(moved)["stations.high"].value(moved) == 0.35
    again = made.replace(stations=STATIONS | {"high": 0.35})
    assert again == moved


def test_the_end_in_meters_is_a_parameter_and_stays_where_the_length_changes():
    made = arm(START, END)
    ends = parameters(made)
    assert ends["tendon.end"].value(made) == pytest.approx(0.3, rel=1e-15)
    fixed = changed(made, {"tendon.end": 0.2, "length": 0.5})
    assert parameters(fixed)["tendon.end"].value(fixed) == 0.2
    assert parameters(fixed)["tendon.end_over_length"].value(fixed) == 0.4
    assert parameters(fixed)["air.end"].value(fixed) == 0.375
    back = changed(fixed, {"tendon.end_over_length": 0.75, "length": LENGTH})
    assert back == made


def test_an_arm_with_stations_can_be_sent_and_is_a_key():
    made = arm({"start": "low"}, {"end": "high"}, stations=STATIONS)
    again = pickle.loads(pickle.dumps(made))
    assert again == made
    assert hash(again) == hash(made)
    assert again.to_toml() == made.to_toml()


def test_a_place_in_meters_is_no_name():
    named = arm({"start": "low"}, stations=STATIONS)
    assert named != arm({"start": 0.1}, stations=STATIONS)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: arm(end={"end": 0.41}), "helix.end = 0.41: must be on the arm, at most 0.4 m"),
        (lambda: arm(end={"end": "hihg"}, stations=STATIONS), 'did you mean "high"'),
        (lambda: arm(end={"end": "high"}), "the arm has no stations by name"),
        (lambda: arm({"start": 0.2}, {"end": 0.2}), "helix.end = 0.2: must be above its start"),
        (lambda: arm({"start": 0.2}, {"end_over_length": 0.5}), "start = 0.2: must be below its"),
        (lambda: arm({"start": 0.2}, {"end": 0.2 + 1e-12}), "must be above its start at Z = 0.2 m"),
        (lambda: arm(START | {"start": 0.1}), "give exactly one of start and start_over_length"),
        (lambda: arm(end={"end": -0.1}), "end = -0.1: must be"),
        (lambda: arm(stations={"a": 0.5}), "stations.a = 0.5: must be on the arm"),
        (lambda: arm(stations={"a": "b"}), "stations.a = 'b': must be a finite number"),
        (lambda: arm(stations={"a.b": 0.1}), "stations.a.b = 0.1: must be named by one line"),
        (lambda: arm(stations=3), "stations = 3: must be a mapping"),
        (lambda: sr.FiberArchitecture(revolution=0, extent=1, end="x").span(1.0), "in an arm"),
        (lambda: changed(arm(stations=STATIONS), {"stations.low": 9.0}), "stations.low = 9"),
    ],
)
def test_a_place_off_the_arm_or_without_meaning_is_refused(call, message):
    with pytest.raises(InvalidDesign, match=message):
        call()


def test_all_faults_of_places_in_a_file_are_told_at_once():
    text = arm({"start": "low"}, {"end": 0.3}, stations=STATIONS).to_toml()
    text = text.replace("end_m = 0.3", 'end_m = 0.3\nend = "y"', 1)
    with pytest.raises(InvalidDesign) as caught:
        sr.Manipulator.from_toml(text.replace('start = "low"', 'start = "lwo"'))
    said = str(caught.value)
    assert "actuators[0].end_m = 0.3: give exactly one of end (a name) and end_m" in said
    assert said.count("= 'lwo': must be Z in m or a station of the arm: low, high") == 3
    with pytest.raises(InvalidDesign, match=r"stations.high = 'x': must be a valid number"):
        sr.Manipulator.from_toml(text.replace("high = 0.3", 'high = "x"'))
