"""Design files: a design survives them to the last bit, in a text that people can read."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import softreach as sr
from softreach.arm import (
    Chamber,
    FiberArchitecture,
    LinearTaper,
    Loads,
    Material,
    Pieces,
    PointLoad,
    Ring,
    Samples,
    Section,
    Tendon,
)
from softreach.arm.section import named_material
from tests.cable import Cable
from tests.kinds import any_arms
from tests.laws import bases

BODY = """
version = 2
profile = { length_m = 1.0, outer_radius_m = 0.05 }
rings = [{ inner_ratio = 0.5 }]
"""
FIBER = """
[[actuators]]
kind = "fiber"
helical_angle_deg = 10.0
extent_deg = 20.0
"""


def same(one: sr.Manipulator, other: sr.Manipulator) -> bool:
    """Equal to the last bit, signs of zeros too."""
    return repr(dataclasses.asdict(one)) == repr(dataclasses.asdict(other))


NAMES = st.text(st.characters(exclude_categories=["C", "Z"], exclude_characters=".[]"), max_size=8)


number = st.floats(-1e3, 1e3)
triples = st.tuples(number, number, number)
points = st.builds(PointLoad, station=st.floats(0, 0.05), force=triples, moment=triples)
loads = st.builds(
    Loads,
    gravity=triples,
    payload=st.floats(0, 1e3),
    payload_arm=triples,
    tip_force=triples,
    tip_moment=triples,
    follower_force=triples,
    follower_moment=triples,
    point_loads=st.lists(points, max_size=2).map(tuple),
    force_per_length=triples,
)


@st.composite
def named_arms(draw: st.DrawFn) -> sr.Manipulator:
    """Any arm with a cable, loads and base, of parts with any names that a file can hold."""
    arm = draw(any_arms())
    cable = Cable(place=draw(st.tuples(number, number)), activation_bounds=(-0.0, 5e-324))
    actuators = [one.replace(name=draw(NAMES)) for one in (*arm.actuators, cable)]
    rings = []
    for k, ring in enumerate(arm.section.rings):
        density = draw(st.none() | st.just(-0.0) | number.map(abs))
        material = ring.material.replace(name=draw(NAMES), density=density)
        rings.append(ring.replace(name=f"{draw(NAMES)}{k}x", material=material))
    kept = [one.replace(ring=0) if hasattr(one, "ring") else one for one in actuators]
    try:
        section = arm.section.replace(rings=tuple(rings))
        weighs = not section.density_faults("")
        others = {"loads": draw(loads) if weighs else None, "base": draw(bases())}
        return arm.replace(section=section, actuators=tuple(kept), **others)
    except sr.InvalidDesign as error:  # names alike
        assume("name" not in str(error))
        raise


@given(arm=named_arms())
def test_an_arm_of_any_kind_survives_a_file_to_the_last_bit(arm):
    again = sr.Manipulator.from_toml(arm.to_toml())
    assert again == arm
    assert same(again, arm)


def test_a_saved_design_loads_equal_and_nothing_is_left_beside_it(tmp_path, trunk):
    path = tmp_path / "folder" / "trunk.toml"
    trunk.save(path)
    trunk.save(path, overwrite=True)
    assert sr.Manipulator.load(path) == trunk
    assert list(path.parent.iterdir()) == [path]


def test_what_is_left_out_has_its_default():
    arm = sr.Manipulator.from_toml(BODY + FIBER)
    assert arm == sr.Manipulator(
        profile=LinearTaper(length=1.0, outer_radius=0.05),
        section=Section(rings=(Ring(inner_ratio=0.5),)),
        actuators=(FiberArchitecture(helical_angle=math.radians(10), extent=math.radians(20)),),
    )


def test_keys_have_the_unit_that_they_say():
    text = """
    [[actuators]]
    kind = "tendon"
    distance_m = 0.04
    offset_deg = 90
    revolution_deg = 180
    tension_bounds_n = [0, 20]
    [[actuators]]
    kind = "chamber"
    distance_ratio = 0.5
    radius_m = 0.004
    pressure_bounds_pa = [[0, 1e5], [0, 2e5]]
    bundles = 2
    start_over_length = 0.5
    """
    body = BODY.replace("0.5 }", '0.5, material = "ecoflex_00_30" }')
    tendon, chamber = sr.Manipulator.from_toml(body + text).actuators
    assert tendon == Tendon(
        name="tendon 1",
        distance=0.04,
        offset=math.pi / 2,
        revolution=math.pi,
        activation_bounds=(0.0, 20.0),
    )
    assert chamber == Chamber(
        name="chamber 2",
        distance_ratio=0.5,
        radius=0.004,
        activation_bounds=((0.0, 1e5), (0.0, 2e5)),
        bundles=2,
        start_over_length=0.5,
    )


@pytest.mark.parametrize("interpolation", ["constant", "cubic", "linear"])
def test_an_angle_may_change_along_the_arm(interpolation):
    values = [0, 45] if interpolation == "constant" else [0, 45, 60]
    along = f"stations_over_length = [0, 0.5, 1], values = {values}"
    text = FIBER.replace("10.0", f"{{ {along}, interpolation = '{interpolation}' }}")
    angle = sr.Manipulator.from_toml(BODY + text).fibers[0].helical_angle
    assert isinstance(angle, Pieces if interpolation == "constant" else Samples)
    assert angle.stations_over_length == (0, 0.5, 1)
    np.testing.assert_allclose(angle.values, np.radians(values))


class TestMaterials:
    def arm(self, materials, ring):
        body = BODY.replace("0.5 }", f"0.5, material = {ring} }}")
        return sr.Manipulator.from_toml(f"{body}{FIBER}{materials}").section.rings[0].material

    def test_a_name_is_looked_up_in_the_file(self):
        table = "[materials.rubber]\nyoung_modulus_pa = 1e5\ndensity_kg_m3 = 1000"
        assert self.arm(table, "'rubber'") == Material(
            young_modulus=1e5, density=1000, name="rubber"
        )

    def test_a_name_that_the_file_lacks_is_looked_up_in_the_library(self):
        assert self.arm("", "'dragon_skin_30'") == named_material("dragon_skin_30")

    def test_the_file_goes_before_the_library(self):
        table = "[materials.dragon_skin_30]\nyoung_modulus_pa = 5e5"
        assert self.arm(table, "'dragon_skin_30'").young_modulus == 5e5

    def test_values_may_stand_where_the_material_is_used(self):
        assert self.arm("", "{ poisson_ratio = 0.4 }") == Material(poisson_ratio=0.4)

    def test_a_saved_material_of_the_library_keeps_its_numbers(self, trunk):
        ring = Ring(inner_ratio=0.5, material=named_material("ecoflex_00_30"))
        text = trunk.replace(section=Section(rings=(ring,))).to_toml()
        assert "[materials.ecoflex_00_30]\nyoung_modulus_pa = 68900.0" in text

    def test_two_materials_of_one_name_stay_apart(self, trunk):
        rings = [
            Ring(inner_ratio=0.5, material=Material(young_modulus=modulus, name="rubber"))
            for modulus in (1e5, 2e5)
        ]
        arm = trunk.replace(section=Section(rings=tuple(rings)))
        assert sr.Manipulator.from_toml(arm.to_toml()) == arm


def test_an_arm_of_one_material_may_be_given_with_its_modulus_and_density():
    arm = sr.Manipulator.tapered(
        length=0.3,
        outer_radius=0.01,
        inner_radius=0.005,
        young_modulus=1e5,
        density=1000.0,
        actuators=[Tendon(distance=0.008, activation_bounds=(0, 1))],
    )
    assert all(ring.material.young_modulus == 1e5 for ring in arm.section.rings)
    assert arm.section.mass_per_length(0.01) == pytest.approx(math.pi * 0.1)


# Faults of design files: all at once, each with its place, its value and what is allowed


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
extent_deg = 3
helical_angle_deg = { stations_over_length = [0, 0.5, 1], values = [1, 2, 3, 4] }
[[actuators]]
kind = "fiber"
extent_deg = 3
helical_angle_deg = { stations = [0, 0.5, 1], values = [1, 2, 3] }
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
profile.length_m = '1': must be a finite number
profile.tapper_deg = 3: unknown key; did you mean "taper_deg"?
materials.lce.young_modulus = 3: unknown key; did you mean "young_modulus_pa"?
materials."a b".poisson_ratio = 0.7: must be a finite number >= 0 and <= 0.5
materials."a b".density_kg_m3 = -3: must be a finite number >= 0 kg/m³
rings[0].inner_ratio = 0.7: must be below outer_ratio = 0.6
rings[1].material.poisson = 0.3: unknown key; did you mean "poisson_ratio"?
rings[2].inner_ratio: required key is missing
rings[2].material = 'nothing': must be a material of this file (lce, a b), or of the library;
section.core = 'ecoflex_00_31': must be a material of this file (lce, a b), or of the library;
actuators[0].bundles = 1.5: must be a whole number >= 1 and <= 100
actuators[0].offset_deg = nan: must be a finite number in deg
actuators[0].extent_deg = 400: must be a finite number > 0 and <= 360 deg
actuators[0].helical_angle_deg = 95: must be a finite number > -90 and < 90 deg
actuators[1].extent_deg: required key is missing
actuators[1].extent = 3: unknown key; did you mean "extent_deg"?
actuators[1].helical_angle_deg, actuators[1].revolution_deg = (3.0, 10): give exactly one of
actuators[2].helical_angle_deg.values = [1, 2, 3, 4]: must be 3 finite numbers
actuators[3].helical_angle_deg.stations_over_length: required key is missing
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
        (
            BODY.replace("0.5 }", "0.5, material = 'ecoflex_00_30' }")
            + f"[section]\ncore = {{ poisson_ratio = 0.1 }}\n{FIBER}",
            "section.core.young_modulus_pa: must be given in Pa where materials differ",
        ),
        (f"{BODY}{FIBER}ring = 'x'", "actuators[0].ring = 'x': must be one of the section's"),
        (f"{BODY}[section]\nbore_ratio = 0.6{FIBER}", "section.bore_ratio = 0.6: must be at most"),
        (BODY.replace("0.5 }", "0.5, outer_ratio = 0.9 }") + FIBER, "rings[0].outer_ratio = 0.9"),
        (BODY.replace("version = 2", "version = 3") + FIBER, "version = 3: must be 2"),
        (BODY.replace("version = 2", "") + FIBER, "version: required key is missing"),
        (f"{BODY}[[tendons]]\n{FIBER}", "tendons: unknown key; write [[actuators]] with"),
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
        f'{BODY}{FIBER}name = "a\\nb"',
        f'{BODY}{FIBER}name = "\\ud800"',
        f"{BODY}{FIBER}[profile]",
        BODY + "[[actuators]]\n" * 10_000,
        BODY + "base = [[0.5]]\n" + FIBER,
        FIBER.replace("[[actuators]]", "[actuators]"),
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
    values += ["nan", "0", "90.0", "[-inf, 0]", "[[0, 1], [0]]", "[true, false]", "'linear'"]
    text = BAD_FILE
    for line in data.draw(st.lists(st.sampled_from(lines), min_size=1, max_size=8)):
        key = line.partition("=")[0]
        text = text.replace(line, f"{key}= {data.draw(st.sampled_from(values))}", 1)
    with pytest.raises(sr.InvalidDesign):
        sr.Manipulator.from_toml(text)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("name = 'Süd'".encode("latin-1"), "must be text in UTF-8, which byte 9 is not"),
        ("version = 2".encode("utf-16"), "must be text in UTF-8"),
        (bytes(range(256)), "must be"),
        ("version = 2".encode("utf-16-le"), "is NUL"),
        (b"#" * 5_000_000, "must be at most 0.25 MB large"),
    ],
)
def test_a_file_that_is_no_text_or_too_long_is_refused(content, message, tmp_path):
    path = tmp_path / "bad.toml"
    path.write_bytes(content)
    with pytest.raises((sr.InvalidDesign, sr.InvalidInput), match=message):
        sr.Manipulator.load(path)
