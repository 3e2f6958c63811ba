"""Design files of version 1, which have no version: they load for good."""

from __future__ import annotations

import math

import pytest

import softreach as sr
from softreach.arm import designs
from tests.cable import Cable

HEAD = "length_m = 1.0\nouter_radius_m = 0.1\n"
FIBER = "[[fibers]]\nhelical_angle_deg = 10.0\nextent_deg = 20.0\n"


TRUNK = """
length_m = 1.0
outer_radius_m = 0.0625
inner_radius_m = 0.046875
taper_deg = 2.0
poisson_ratio = 0.5
activation_bounds = [-1.6666666666666667, 0.0]

[[fibers]]
name = "left"
revolution_deg = -108.0
offset_deg = 66.0
extent_deg = 48.0

[[fibers]]
name = "right"
revolution_deg = 108.0
offset_deg = 114.0
extent_deg = 48.0
bundles = 1

[[fibers]]
name = "longitudinal"
helical_angle_deg = 0.0
offset_deg = 270.0
extent_deg = 48.0
"""


@pytest.mark.parametrize("version", ["", "version = 1"])
def test_the_trunk_of_old_is_that_of_today(version):
    assert sr.Manipulator.from_toml(version + TRUNK) == designs.minimal_trunk()


def test_what_is_left_out_is_as_it_was():
    arm = sr.Manipulator.from_toml(f"{HEAD}inner_ratio = 0.7\n{FIBER}")
    assert arm == sr.Manipulator.tapered(
        length=1.0,
        outer_radius=0.1,
        inner_radius=0.07,
        actuators=[sr.FiberArchitecture(helical_angle=math.radians(10), extent=math.radians(20))],
    ).replace(section=arm.section)
    assert arm.section.rings[0].material == sr.arm.Material(poisson_ratio=0.5)


BAD_FILE = """
length_m = "1"
outer_radius_m = 0.01
inner_radius_m = 0.02
tapper_deg = 3
poisson_ratio = 0.7
activation_bounds = [1, 0]
[[fibers]]
helical_angle_deg = 95
offset_deg = nan
extent_deg = 400.0
bundles = 1.5
[[fibers]]
extent = 3
revolution_deg = 10
helical_angle_deg = 3.0
"""


def test_every_fault_of_a_file_is_reported_with_its_key_value_and_what_is_allowed():
    with pytest.raises(sr.InvalidDesign) as error:
        sr.Manipulator.from_toml(BAD_FILE, source="bad.toml")
    lines = str(error.value).splitlines()
    assert lines[0] == "bad.toml: 12 problems"
    for expected in (
        "length_m = '1': must be a valid number",
        'tapper_deg = 3: unknown key; did you mean "taper_deg"?',
        "poisson_ratio = 0.7: must be a finite number >= 0 and <= 0.5",
        "inner_radius_m = 0.02: must be below outer_radius = 0.01 m",
        "activation_bounds = [1, 0]: must have lower <= upper",
        "fibers[0].helical_angle_deg = 95: must be a finite number > -90 and < 90 deg",
        "fibers[0].offset_deg = nan: must be a finite number in deg",
        "fibers[0].extent_deg = 400: must be a finite number > 0 and <= 360 deg",
        "fibers[0].bundles = 1.5: must be a valid integer",
        'fibers[1].extent = 3: unknown key; did you mean "extent_deg"?',
        "fibers[1].extent_deg: required key is missing",
        "fibers[1].helical_angle_deg, fibers[1].revolution_deg = (3.0, 10.0): give exactly one of "
        "helical_angle and revolution (0 for a longitudinal fiber)",
    ):
        assert f"  {expected}" in lines


@pytest.mark.parametrize("text", ["", "fibers = 3", "x =", "fibers = [1]", "taper_deg = [[1]]"])
def test_no_text_makes_the_reader_crash(text):
    with pytest.raises(sr.InvalidDesign):
        sr.Manipulator.from_toml(text)


def test_the_ring_may_be_given_by_its_ratio():
    arm = sr.Manipulator.from_toml(f"{HEAD}inner_ratio = 0.7\n{FIBER}")
    assert arm.section.rings[0].inner_ratio == 0.7


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("", "give exactly one of inner_radius_m and inner_ratio"),
        ("inner_ratio = 0.5\ninner_radius_m = 0.05", "give exactly one of"),
        ("inner_ratio = 1.0", "inner_ratio = 1: must be a finite number >= 0 and < 1"),
        ("inner_ratio = -0.1", "inner_ratio = -0.1: must be"),
        ("inner_ratio = 'a'", "inner_ratio = 'a': must be a valid number"),
    ],
)
def test_the_ring_is_given_once_and_lies_inside(lines, message):
    with pytest.raises(sr.InvalidDesign, match=message) as error:
        sr.Manipulator.from_toml(f"{HEAD}{lines}\n{FIBER}", source="ring.toml")
    assert len(error.value.faults) == 1


def test_two_fibers_of_one_name_are_refused_with_their_places():
    named = f'{FIBER}name = "a"\n'
    with pytest.raises(
        sr.InvalidDesign, match=r"fibers\[1\].name = 'a': must differ from fibers\[0\].name"
    ):
        sr.Manipulator.from_toml(f"{HEAD}inner_ratio = 0.7\n{named}{named}")


def test_bounds_of_every_bundle_are_shared_out():
    each = "activation_bounds = [[-1.0, 0.0], [-0.5, 0.25]]"
    arm = sr.Manipulator.from_toml(f"{HEAD}inner_ratio = 0.7\n{each}\n{FIBER}{FIBER}")
    assert [one.activation_bounds for one in arm.fibers] == [(-1.0, 0.0), (-0.5, 0.25)]


class TestOwnKinds:
    def written(self, text):
        return TRUNK.partition("activation_bounds")[0] + text

    def test_fibers_and_other_kinds_may_stand_together(self):
        arm = sr.Manipulator.from_toml(
            self.written(
                "[[actuators]]\nkind = 'Cable'\nplace = [0.03, 0.0]\n"
                "[[fibers]]\nname = 'left'\nhelical_angle_deg = 10.0\nextent_deg = 20.0\n"
            )
        )
        assert arm.bundle_names == ("left", "cable 2")
        assert arm.actuators[1] == Cable(place=(0.03, 0.0), name="cable 2")

    @pytest.mark.parametrize(
        ("table", "message"),
        [
            ("kind = 'Cables'", r"actuators\[0\].kind = 'Cables': must be a kind of actuator"),
            ("kind = {a = 1}", r"actuators\[0\].kind = {'a': 1}: must be a kind of actuator"),
            ("place = [0, 0]", r"actuators\[0\].kind: must be a kind of actuator"),
            ("kind = 'Cable'", r"actuators\[0\] = 'Cable': has other fields: .*'place'"),
            ("kind = 'Cable'\nplace = [0, 0]\nx = 1", r"has other fields: .*'x'"),
            (
                "kind = 'FiberArchitecture'\nhelical_angle = 0\nextent = 7.0",
                r"actuators\[0\].extent = 7: must be",
            ),
        ],
    )
    def test_a_faulty_table_is_refused_with_its_place(self, table, message):
        with pytest.raises(sr.InvalidDesign, match=message):
            sr.Manipulator.from_toml(self.written(f"[[actuators]]\n{table}\n"))
