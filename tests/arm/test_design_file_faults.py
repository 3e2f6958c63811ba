"""Faults of design files: all at once, each with its place, its value and what is allowed."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

import softreach as sr
from tests.arm.test_design_file import BODY, FIBER

BAD_FILE = """
version = 2
length_m = 3.0
[profile]
length_m = "1"
outer_radius_m = 0.01
tapper_deg = 3
[materials.lce]
young_modulus = 3
[materials."a b"]
poisson_ratio = 0.7
density_kg_m3 = -3
[section]
core = "ecoflex_00_31"
[[rings]]
inner_ratio = 0.7
outer_ratio = 0.6
material = "lce"
[[rings]]
inner_ratio = 0.5
material = { poisson = 0.3 }
[[rings]]
material = "nothing"
[[actuators]]
kind = "fiber"
helical_angle_deg = 95
offset_deg = nan
extent_deg = 400.0
bundles = 1.5
[[actuators]]
kind = "fiber"
name = "a"
extent = 3
revolution_deg = 10
helical_angle_deg = 3.0
[[actuators]]
kind = "fiber"
name = "a"
extent_deg = 3
helical_angle_deg = { stations_over_length = [0, 0.5, 1], values = [1, 2, 3, 4] }
[[actuators]]
kind = "fiber"
extent_deg = 3
helical_angle_deg = { stations = [0, 0.5, 1], values = [1, 2, 95] }
[[actuators]]
kind = "Tendon"
[[actuators]]
kind = "tendon"
distance_m = 0.1
distance_ratio = 0.2
activation_bounds = [0, 1]
[[actuators]]
kind = "tendon"
distance_m = 0.1
tension_bounds_n = [-1, 0]
routing_deg = 3
[[actuators]]
kind = "chamber"
distance_m = 0.1
radius_m = 0.0
pressure_bounds_pa = [0, "1 bar"]
start_over_length = 0.5
end_over_length = 0.4
[[actuators]]
name = "b"
[[actuators]]
kind = "fibre"
"""

FAULTS = """
length_m = 3: unknown key; it belongs in [profile]
profile.length_m = '1': must be a valid number
profile.tapper_deg = 3: unknown key; did you mean "taper_deg"?
materials.lce.young_modulus = 3: unknown key; did you mean "young_modulus_pa"?
materials."a b".poisson_ratio = 0.7: must be a finite number >= 0 and <= 0.5
materials."a b".density_kg_m3 = -3: must be a finite number >= 0 kg/m³
rings[0].inner_ratio = 0.7: must be below outer_ratio = 0.6
rings[1].material.poisson = 0.3: unknown key; did you mean "poisson_ratio"?
rings[2].inner_ratio: required key is missing
rings[2].material = 'nothing': must be a material of this file (lce, a b), or of the library;
section.core = 'ecoflex_00_31': must be a material of this file (lce, a b), or of the library;
actuators[0].bundles = 1.5: must be a valid integer
actuators[0].offset_deg = nan: must be a finite number in deg
actuators[0].extent_deg = 400: must be a finite number > 0 and <= 360 deg
actuators[0].helical_angle_deg = 95: must be a finite number > -90 and < 90 deg
actuators[1].extent_deg: required key is missing
actuators[1].extent = 3: unknown key; did you mean "extent_deg"?
actuators[1].helical_angle_deg, actuators[1].revolution_deg = (3.0, 10): give exactly one of
actuators[2].helical_angle_deg.values = [1, 2, 3, 4]: must be 3 finite numbers
actuators[3].helical_angle_deg.stations_over_length: required key is missing
actuators[3].helical_angle_deg.values[2] = 95: must be a finite number > -90 and < 90 deg
actuators[3].helical_angle_deg.stations = [0, 0.5, 1]: unknown key
actuators[4].kind = 'Tendon': must be the kind of a file; did you mean "tendon"?
actuators[5].tension_bounds_n: required key is missing
actuators[5].activation_bounds = [0, 1]: unknown key; did you mean "tension_bounds_n"?
actuators[5].distance_m, actuators[5].distance_ratio = (0.1, 0.2): give exactly one of distance_m
actuators[6].routing_deg = 3: must be a table
actuators[6].tension_bounds_n = [-1, 0]: must be at least 0 N
actuators[7].radius_m = 0: must be a finite number > 0 m
actuators[7].pressure_bounds_pa = [0, '1 bar']: must be a pair (lower, upper)
actuators[7].end_over_length = 0.4: must be above start_over_length = 0.5
actuators[8].kind: required key is missing: one of fiber
actuators[9].kind = 'fibre': must be one of fiber, oblique_muscle, radial_muscle, tendon, length_tendon, chamber
actuators[2].name = 'a': must differ from actuators[1].name
"""  # noqa: E501


def faults_of(text: str) -> list[str]:
    with pytest.raises(sr.InvalidDesign) as error:
        sr.Manipulator.from_toml(text, source="bad.toml")
    head, *lines = str(error.value).splitlines()
    assert head == f"bad.toml: {len(lines)} problem{'s' if len(lines) > 1 else ''}"
    return [line.removeprefix("  ") for line in lines]


def test_every_fault_of_a_file_is_reported_with_its_key_value_and_what_is_allowed():
    expected = FAULTS.strip().splitlines()
    found = faults_of(BAD_FILE)
    assert len(found) == len(expected)
    for line in expected:
        assert sum(one.startswith(line) for one in found) == 1, line


TENDON = "[[actuators]]\nkind = 'tendon'\ndistance_m = 0.03\ntension_bounds_n = [0, 1]\n"
TWO = BODY.replace("0.5 }", "0.5, material = 'a' }, { inner_ratio = 0.6 }")


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        (BODY + TENDON, "rings[0].material.young_modulus_pa: must be given in Pa for tendon"),
        (BODY + FIBER + TENDON + TENDON, "rings[0].material.young_modulus_pa: must be given"),
        (
            BODY.replace("0.5 }", "0.5, material = {} }") + TENDON,
            "rings[0].material.young_modulus_pa: must be given in Pa",
        ),
        (
            BODY.replace("0.5 }", "0.5, material = 'ecoflex_00_30' }")
            + f"[section]\ncore = {{ poisson_ratio = 0.1 }}\n{FIBER}",
            "section.core.young_modulus_pa: must be given in Pa where materials differ",
        ),
        (f"{BODY}{FIBER}ring = 1", "actuators[0].ring = 1: must be one of the section's rings: 0"),
        (f"{BODY}{FIBER}ring = 'x'", "actuators[0].ring = 'x': must be one of the section's"),
        (
            f"{BODY}{FIBER}activation_bounds = [[0, 1], [0, 2]]",
            "actuators[0].activation_bounds = [[0, 1], [0, 2]]: must be one pair",
        ),
        (
            BODY.replace("0.05 }", "0.05, taper_deg = 3 }") + FIBER,
            "profile.taper_deg = 3: leaves no tip",
        ),
        (f"{BODY}[section]\nbore_ratio = 0.6{FIBER}", "section.bore_ratio = 0.6: must be at most"),
        (BODY.replace("0.5 }", "0.5, outer_ratio = 0.9 }") + FIBER, "rings[0].outer_ratio = 0.9"),
        (BODY.replace("length_m", "kind = 'round', length_m") + FIBER, "profile.kind = 'round'"),
        (BODY.replace("version = 2", "version = 3") + FIBER, "version = 3: must be 2"),
        (BODY.replace("version = 2", "version = 1") + FIBER, "version = 1: must be 2"),
        (BODY.replace("version = 2", "version = true") + FIBER, "version = True: must be 2"),
        (BODY.replace("version = 2", "") + FIBER, "version: required key is missing"),
        (f"{BODY}[[tendons]]\n{FIBER}", "tendons = [{}]: unknown key; write [[actuators]] with"),
        (f"{BODY}actuators = 3", "actuators = 3: must be a list"),
    ],
)
def test_what_does_not_fit_together_is_told_once_and_where(text, fault):
    (found,) = faults_of(text)
    assert found.startswith(fault)


def test_a_modulus_that_different_materials_need_is_asked_of_each_where_it_stands():
    assert faults_of(f"{TWO}{FIBER}[materials.a]\npoisson_ratio = 0.3") == [
        "materials.a.young_modulus_pa: must be given in Pa where materials differ",
        "rings[1].material.young_modulus_pa: must be given in Pa where materials differ",
    ]


@pytest.mark.parametrize(
    "text",
    [
        "",
        "x =",
        "version = 2\nprofile = 3\nrings = [1]\nactuators = [[]]\nmaterials = 3\nsection = []",
        "version = 2\nmaterials.a = 3\nprofile.kind = [1]\nrings = [{material = 3}]",
        "version = 2\nrings = [[[[]]]]\nactuators = [{kind = 'fiber', ring = [1]}]",
        BODY.replace("1.0", "1e400") + FIBER,
        f"{BODY}{FIBER}bundles = 1000000",
        f"{BODY}{FIBER}offset_deg = 1e400",
        f"{BODY}{FIBER}activation_bounds = [[[[0]]]]",
        f"{BODY}{FIBER}# {'x' * 1_000_000}",
    ],
)
def test_no_text_makes_the_reader_crash(text):
    for line in faults_of(text):
        assert len(line) < 1200


@given(text=st.text(max_size=60))
def test_no_short_text_makes_the_reader_crash(text):
    with pytest.raises(sr.InvalidDesign):
        sr.Manipulator.from_toml(text)


@given(data=st.data())
def test_no_value_in_place_of_another_makes_the_reader_crash(data):
    lines = [line for line in BAD_FILE.splitlines() if "=" in line]
    values = ["true", "-1", "[]", "{}", "'x'", "[[0]]", "1e999", "1979-05-27", "{a=[{b=1}]}"]
    text = BAD_FILE
    for line in data.draw(st.lists(st.sampled_from(lines), min_size=1, max_size=8)):
        key = line.partition("=")[0]
        text = text.replace(line, f"{key}= {data.draw(st.sampled_from(values))}", 1)
    with pytest.raises(sr.InvalidDesign):
        sr.Manipulator.from_toml(text)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("name = 'Süd'".encode("latin-1"), "must be text in UTF-8, but byte 9 is none"),
        ("version = 2".encode("utf-16"), "must be text in UTF-8"),
        (bytes(range(256)), "must be"),
        (b"#" * 5_000_000, "must be at most 0.25 MB large"),
    ],
)
def test_a_file_that_is_no_text_or_too_long_is_refused(content, message, tmp_path):
    path = tmp_path / "bad.toml"
    path.write_bytes(content)
    with pytest.raises((sr.InvalidDesign, sr.InvalidInput), match=message):
        sr.Manipulator.load(path)
