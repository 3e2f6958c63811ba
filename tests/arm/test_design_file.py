"""Design files: a design survives them to the last bit, and every fault is named."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import softreach as sr
from softreach.arm import LinearTaper, Material, Ring, Section, designs
from tests.cable import Cable
from tests.laws import arms

FILES = Path(__file__).parents[2] / "designs"

numbers = st.floats(allow_nan=False, allow_infinity=False)
names = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
"""Any text that a file can hold: control characters, quotes and signs of other scripts too."""


def pairs(ends: st.SearchStrategy[float]) -> st.SearchStrategy[tuple[float, float]]:
    return st.tuples(ends, ends).map(sorted).map(tuple)


@st.composite
def fibers(draw: st.DrawFn) -> sr.FiberArchitecture:
    """Any architecture, of angles and bounds with all their digits."""
    bundles = draw(st.integers(1, 3))
    angle = {"revolution": draw(numbers)}
    if draw(st.booleans()):
        angle = {"helical_angle": draw(st.floats(-1.57, 1.57))}
    each = pairs(numbers)
    return sr.FiberArchitecture(
        name=draw(names),
        offset=draw(numbers),
        extent=draw(st.floats(0, 2 * math.pi, exclude_min=True)),
        bundles=bundles,
        activation_bounds=draw(each | st.tuples(*[each] * bundles)),
        **angle,
    )


cables = st.builds(
    Cable, name=names, place=st.tuples(numbers, numbers), activation_bounds=pairs(numbers)
)


@st.composite
def any_arms(draw: st.DrawFn, kinds: st.SearchStrategy) -> sr.Manipulator:
    """An arm of these actuators and any profile and section that a file has keys for."""
    actuators = draw(st.lists(kinds, min_size=1, max_size=3))
    radius = draw(st.floats(1e-6, 1e6))
    profile = LinearTaper(
        length=draw(st.floats(1e-6, 1e6)), outer_radius=radius, taper=-draw(st.floats(0, 1.5))
    )
    material = Material(poisson_ratio=draw(st.floats(0, 0.5)))
    ring = Ring(inner_ratio=draw(st.floats(0, 1, exclude_max=True)), material=material)
    try:
        return sr.Manipulator(
            profile=profile, section=Section(rings=(ring,)), actuators=tuple(actuators)
        )
    except sr.InvalidDesign as error:  # two names alike
        assume("name" not in str(error))
        raise


def same(one: sr.Manipulator, other: sr.Manipulator) -> bool:
    """Equal to the last bit, signs of zeros too."""
    return repr(dataclasses.asdict(one)) == repr(dataclasses.asdict(other))


@given(arm=any_arms(fibers()))
def test_an_arm_of_fibers_survives_a_file_to_the_last_bit(arm):
    again = sr.Manipulator.from_toml(arm.to_toml())
    assert again == arm
    assert same(again, arm)


@given(arm=any_arms(fibers() | cables))
def test_an_arm_of_several_kinds_survives_a_file_to_the_last_bit(arm):
    again = sr.Manipulator.from_toml(arm.to_toml())
    assert again == arm
    assert same(again, arm)


@given(arm=arms())
def test_a_design_survives_a_file_to_the_last_bit(arm):
    assert sr.Manipulator.from_toml(arm.to_toml()) == arm


def test_a_saved_design_loads_equal_and_nothing_is_left_beside_it(tmp_path, trunk):
    path = tmp_path / "folder" / "trunk.toml"
    trunk.save(path)
    trunk.save(path)
    assert sr.Manipulator.load(path) == trunk
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("name", ["minimal_trunk", "redundant_trunk"])
def test_the_named_designs_are_also_files(name):
    assert sr.Manipulator.load(FILES / f"{name}.toml") == getattr(designs, name)()


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
        "fibers[0].offset_deg = nan: must be a finite number deg",
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


HEAD = "length_m = 1.0\nouter_radius_m = 0.1\n"
FIBER = "[[fibers]]\nhelical_angle_deg = 10.0\nextent_deg = 20.0\n"


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
