"""Designs are values: checked, frozen, replaceable, and the same after a trip through a file."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given

import softreach as sr
from softreach.arm import designs
from softreach.arm.summary import describe, design_warnings
from tests.laws import arm_of, arms, single

FILES = Path(__file__).parent.parent / "designs"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"inner_radius": 1 / 12},
            r"inner_radius = 0.0833333: must be below outer_radius = 0.0625 m",
        ),
        ({"taper": 0.07}, r"taper = 0.07: leaves no tip.*must be below 0.0624188 rad \(3.576°\)"),
        ({"poisson_ratio": 0.6}, "poisson_ratio = 0.6: .*>= 0 and <= 0.5"),
        ({"poisson_ratio": -0.1}, "poisson_ratio = -0.1"),
        ({"length": 0.0}, "length = 0: .*> 0 m"),
        ({"length": "1"}, "length = '1'"),
        ({"outer_radius": math.inf}, "outer_radius = inf"),
        ({"taper": math.nan}, "taper = nan"),
        ({"activation_bounds": (0.5, -0.5)}, "lower <= upper"),
        ({"activation_bounds": (math.nan, 0)}, "finite"),
        ({"activation_bounds": ((-1, 0),) * 2}, "one pair, or 3 pairs"),
        ({"activation_bounds": 3}, "must be a pair"),
        ({"activation_bounds": (-9.0, 0.0)}, r"reaches extension ζ = -0.5\d+; must keep ζ > 0"),
        ({"fibers": ()}, "one FiberArchitecture or more"),
        ({"fibers": (3,)}, r"fibers\[0\] = 3: must be a FiberArchitecture"),
    ],
)
def test_an_impossible_arm_is_refused_with_value_and_allowed_range(trunk, change, message):
    with pytest.raises(sr.InvalidDesign, match=message):
        trunk.replace(**change)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"helical_angle": math.pi / 2}, "helical_angle = 1.5708"),
        ({"extent": 0.0}, "extent = 0: .*> 0"),
        ({"extent": 7.0}, "extent = 7: .*<= 6.28319 rad"),
        ({"bundles": 0}, "whole number >= 1"),
        ({"bundles": 1.5}, "whole number >= 1"),
        ({"bundles": True}, "whole number >= 1"),
        ({"offset": math.inf}, "offset = inf: must be a finite number rad"),
        ({"revolution": 1.0, "helical_angle": 0.2}, "exactly one of helical_angle and revolution"),
        ({"revolution": None, "helical_angle": None}, "exactly one"),
    ],
)
def test_an_impossible_fiber_is_refused(change, message):
    with pytest.raises(sr.InvalidDesign, match=message):
        sr.FiberArchitecture(**({"extent": 0.5, "helical_angle": 0.1} | change))


def test_all_faults_are_named_at_once(trunk):
    with pytest.raises(sr.InvalidDesign) as error:
        trunk.replace(inner_radius=1.0, poisson_ratio=2.0, activation_bounds=(1, 0))
    assert {fault.path for fault in error.value.faults} == {
        "inner_radius",
        "poisson_ratio",
        "activation_bounds",
    }


def test_designs_are_frozen_hashable_values(trunk):
    assert trunk == designs.minimal_trunk()
    assert hash(trunk) == hash(designs.minimal_trunk())
    with pytest.raises(dataclasses.FrozenInstanceError):
        trunk.length = 2.0
    with pytest.raises(ValueError, match="read-only"):
        trunk.bounds[0, 0] = 1.0


def test_numpy_scalars_are_taken_as_numbers():
    fiber = sr.FiberArchitecture(
        helical_angle=np.float64(0.1), extent=np.float32(0.5), bundles=np.int64(2)
    )
    assert (type(fiber.extent), type(fiber.bundles)) == (float, int)


def test_replacing_an_angle_by_a_revolution_and_back():
    fiber = sr.FiberArchitecture(helical_angle=0.1, extent=0.5)
    wound = fiber.replace(revolution=1.0)
    assert (wound.helical_angle, wound.revolution) == (None, 1.0)
    assert wound.replace(helical_angle=0.1) == fiber


@given(arm=arms())
def test_revolution_and_helical_angle_say_the_same(arm):
    by_angle = tuple(
        fiber.replace(helical_angle=float(angle))
        for fiber, angle in zip(arm.fibers, arm.helical_angles, strict=True)
    )
    np.testing.assert_allclose(
        arm.replace(fibers=by_angle).revolutions, arm.revolutions, atol=1e-12
    )
    np.testing.assert_allclose(arm.revolutions, [f.revolution for f in arm.fibers], atol=1e-12)


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


def test_bundle_geometry_follows_the_architecture():
    arm = arm_of(
        sr.FiberArchitecture(helical_angle=0.0, extent=0.3, offset=0.2, bundles=3, name="ring")
    )
    np.testing.assert_allclose(arm.bundle_angles, 0.2 + 2 * np.pi / 3 * np.arange(3))
    assert arm.bundle_names == ("ring 1", "ring 2", "ring 3")


def test_the_helical_bundles_of_the_trunk_meet_the_longitudinal_one_at_the_tip(trunk):
    """Section 3: at Ω = 108° the sectors touch at the distal end, and do not overlap before it."""
    angles = np.degrees(trunk.fiber_angles([0.0, trunk.length]))
    np.testing.assert_allclose(angles, [[66, 114, 270], [-42, 222, 270]], atol=1e-12)
    assert not any("overlap" in line for line in design_warnings(trunk))


def test_the_paper_s_taper_of_three_degrees_thins_the_tip_sixfold():
    report = describe(designs.minimal_trunk(taper=math.radians(3)))
    assert report.taper_ratio == pytest.approx(6.2, abs=0.02)
    assert report.tip_radius == pytest.approx(1 / 16 - math.tan(math.radians(3)))


def test_overlapping_sectors_are_warned_of_with_their_angle_and_place():
    arm = designs.minimal_trunk(revolution=math.radians(150))
    lines = [line for line in design_warnings(arm) if "left and longitudinal" in line]
    assert len(lines) == 1
    assert "by up to 42°" in lines[0]
    # They touch when 66° - Ω(Z) = 318°, that is Ω(Z) = 108°, of 150° at the tip.
    from softreach import taper

    place = float(lines[0].split("Z = ")[1].split()[0])
    turned = taper.slender_coordinate(place, arm.outer_radius, arm.taper)
    whole = taper.slender_coordinate(1.0, arm.outer_radius, arm.taper)
    assert turned / whole == pytest.approx(108 / 150, abs=0.01)


def test_sectors_of_one_architecture_overlap_when_wider_than_their_spacing():
    arm = arm_of(
        sr.FiberArchitecture(helical_angle=0.2, extent=2.2, bundles=3), activation_bounds=(-0.1, 0)
    )
    assert sum("overlap" in line for line in design_warnings(arm)) == 3


def test_bending_beyond_the_theory_and_large_activations_are_warned_of():
    sharp = design_warnings(designs.redundant_trunk())
    assert any("|κ| R2 = 1.05" in line for line in sharp)
    assert any("|γ| = 1.67" in line for line in sharp)
    assert design_warnings(single(activation_bounds=(-0.9, 0.0))) == ()


@pytest.mark.parametrize("bounds", [(-0.8, -0.3), (-0.5, 0.2), (-0.4, -0.4)])
def test_the_range_of_curvature_is_that_of_all_activations(trunk, bounds):
    from softreach.arm.tables import actuation

    arm = trunk.replace(activation_bounds=bounds)
    ticks = np.linspace(*bounds, 13)
    gamma = np.stack(np.meshgrid(ticks, ticks, ticks), axis=-1).reshape(-1, 3)
    u = actuation(arm, np.linspace(0, 1, 11)).curvature[:, :2] @ gamma.T
    kappa = np.linalg.norm(u, axis=1)
    low, high = describe(arm).curvature
    assert low <= kappa.min() + 1e-9
    assert kappa.min() - low < 0.2
    assert kappa.max() == pytest.approx(high, rel=1e-5)
