"""Design files: a design survives them to the last bit, in a text that people can read."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest
from hypothesis import given

import softreach as sr
from softreach.arm import (
    Chamber,
    FiberArchitecture,
    LinearTaper,
    Material,
    Pieces,
    Ring,
    Samples,
    Section,
    Tendon,
    designs,
)
from softreach.arm.material import named_material
from tests.arm.drawn_arms import any_arms
from tests.laws import arms

FILES = Path(__file__).parents[2] / "designs"

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


@given(arm=any_arms())
def test_an_arm_of_any_kind_survives_a_file_to_the_last_bit(arm):
    again = sr.Manipulator.from_toml(arm.to_toml())
    assert again == arm
    assert same(again, arm)


@given(arm=arms())
def test_a_design_survives_a_file_to_the_last_bit(arm):
    assert sr.Manipulator.from_toml(arm.to_toml()) == arm


def test_a_saved_design_loads_equal_and_nothing_is_left_beside_it(tmp_path, trunk):
    path = tmp_path / "folder" / "trunk.toml"
    trunk.save(path)
    trunk.save(path, overwrite=True)
    assert sr.Manipulator.load(path) == trunk
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("name", ["minimal_trunk", "redundant_trunk"])
def test_the_named_designs_are_also_files(name):
    assert sr.Manipulator.load(FILES / f"{name}.toml") == getattr(designs, name)()


@pytest.mark.parametrize("name", designs.__all__)
def test_a_named_design_survives_a_file(name):
    arm = getattr(designs, name)()
    assert sr.Manipulator.from_toml(arm.to_toml()) == arm


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


@pytest.mark.parametrize(
    ("interpolation", "expected"),
    [
        ("", Samples(stations_over_length=(0, 0.5, 1), values=(0.0, math.pi / 4, math.pi / 3))),
        (
            "interpolation = 'linear'",
            Samples(
                stations_over_length=(0, 0.5, 1),
                values=(0.0, math.pi / 4, math.pi / 3),
                interpolation="linear",
            ),
        ),
    ],
)
def test_an_angle_may_change_along_the_arm(interpolation, expected):
    along = "stations_over_length = [0, 0.5, 1]\nvalues = [0, 45, 60]"
    text = f"{BODY}{FIBER.replace('helical_angle_deg = 10.0', '')}"
    arm = sr.Manipulator.from_toml(f"{text}[actuators.helical_angle_deg]\n{along}\n{interpolation}")
    assert arm.fibers[0].helical_angle == expected


def test_an_angle_may_be_constant_in_pieces():
    along = "{ stations_over_length = [0, 0.5, 1], values = [0, 45], interpolation = 'constant' }"
    arm = sr.Manipulator.from_toml(BODY + FIBER.replace("10.0", along))
    assert arm.fibers[0].helical_angle == Pieces(
        stations_over_length=(0, 0.5, 1), values=(0.0, math.pi / 4)
    )


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


def test_a_file_with_a_byte_order_mark_loads(tmp_path, trunk):
    path = tmp_path / "trunk.toml"
    path.write_text(trunk.to_toml(), encoding="utf-8-sig")
    assert sr.Manipulator.load(path) == trunk


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
