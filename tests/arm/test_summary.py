"""What follows from a design: its numbers, and the limits that it touches."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given

import softreach as sr
import softreach.arm.tables
from softreach.arm import (
    Chamber,
    LinearTaper,
    Manipulator,
    Material,
    ObliqueMuscle,
    Ring,
    Section,
    Tendon,
    designs,
)
from softreach.arm.tables import extension_range, tables
from softreach.rod.bending import bending_over_bounds
from softreach.rod.summary import describe, design_warnings
from tests.laws import arm_of, arms, single


def test_the_helical_bundles_of_the_trunk_meet_the_longitudinal_one_at_the_tip(trunk):
    """Section 3: at Ω = 108° the sectors touch at the distal end, and do not overlap before it."""
    angles = np.degrees(trunk.outline([0.0, trunk.length]).center)
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
    place = float(lines[0].split("Z = ")[1].split()[0])
    turned = arm.profile.slender_coordinate(place)
    assert turned / arm.profile.slender_length == pytest.approx(108 / 150, abs=0.01)


def test_sectors_of_one_architecture_overlap_when_wider_than_their_spacing():
    arm = arm_of(
        sr.FiberArchitecture(helical_angle=0.2, extent=2.2, bundles=3), activation_bounds=(-0.1, 0)
    )
    assert sum("overlap" in line for line in design_warnings(arm)) == 3


class TestOverlaps:
    """Within one ring and one stretch alone."""

    def lines(self, section, *actuators):
        profile = LinearTaper(length=1.0, outer_radius=0.06, taper=0.01)
        arm = Manipulator(profile=profile, section=section, actuators=actuators)
        return [line for line in design_warnings(arm) if "overlap" in line]

    def fiber(self, offset_deg, **changes):
        return sr.FiberArchitecture(
            **{
                "helical_angle": 0.0,
                "extent": math.radians(50),
                "offset": math.radians(offset_deg),
                "activation_bounds": (-0.1, 0.0),
            }
            | changes
        )

    ONE = Section(rings=(Ring(inner_ratio=0.6, name="one"),))
    SHARED = Section(rings=(Ring(inner_ratio=0.6, name="one"), Ring(inner_ratio=0.6, name="two")))

    def test_of_one_ring_are_warned_of_whatever_it_is_called_by(self):
        for which in (0, "one"):
            (line,) = self.lines(self.ONE, self.fiber(0), self.fiber(30, ring=which))
            assert "by up to 20°" in line
        assert not self.lines(self.ONE, self.fiber(0), self.fiber(51))

    def test_of_rings_that_share_their_radii_on_purpose_are_not(self):
        assert not self.lines(self.SHARED, self.fiber(0), self.fiber(30, ring="two"))
        assert len(self.lines(self.SHARED, self.fiber(0, ring=1), self.fiber(30, ring="two"))) == 1

    def test_of_equal_rings_without_names_are_not(self):
        ring = Ring(inner_ratio=0.6)
        section = Section(rings=(ring, ring))
        assert not self.lines(section, self.fiber(0), self.fiber(30, ring=1))

    def test_of_stretches_that_follow_each_other_are_not(self):
        lower = self.fiber(0, end_over_length=0.4)
        assert not self.lines(self.ONE, lower, self.fiber(30, start_over_length=0.4))
        (line,) = self.lines(self.ONE, lower, self.fiber(30, start_over_length=0.3))
        assert "from Z = 0.30 L" in line

    def test_between_a_fiber_and_a_muscle_of_one_ring_are_warned_of(self):
        muscle = ObliqueMuscle(helical_angle=0.5, extent=0.8, activation_bounds=(-0.1, 0.0))
        assert len(self.lines(self.ONE, self.fiber(10), muscle)) == 1

    def test_with_tendons_and_chambers_are_not(self):
        ring = Ring(inner_ratio=0.6, material=Material(young_modulus=1e6))
        others = (
            Tendon(distance_ratio=0.8, activation_bounds=(0, 1)),
            Chamber(distance_ratio=0.8, radius_ratio=0.1, activation_bounds=(0, 1)),
        )
        assert not self.lines(Section(rings=(ring,)), self.fiber(0), *others)


def test_bending_beyond_the_theory_and_large_activations_are_warned_of():
    sharp = design_warnings(designs.redundant_trunk())
    assert any("|κ| R2 = 1.05" in line for line in sharp)
    assert any("|γ| = 1.67" in line for line in sharp)
    assert design_warnings(single(activation_bounds=(-0.9, 0.0))) == ()


@pytest.mark.parametrize("bounds", [(-0.8, -0.3), (-0.5, 0.2), (-0.4, -0.4)])
def test_the_range_of_curvature_is_that_of_all_activations(trunk, bounds):
    arm = trunk.with_bounds(bounds)
    ticks = np.linspace(*bounds, 13)
    gamma = np.stack(np.meshgrid(ticks, ticks, ticks), axis=-1).reshape(-1, 3)
    u = tables(arm, np.linspace(0, 1, 11)).curvature[:, :2] @ gamma.T
    kappa = np.linalg.norm(u, axis=1)
    low, high = describe(arm).curvature
    assert low <= kappa.min() + 1e-9
    assert kappa.min() - low < 0.2
    assert kappa.max() == pytest.approx(high, rel=1e-5)


@given(arm=arms())
def test_a_summary_is_that_of_the_parts(arm):
    facts = describe(arm)
    assert facts.base_radius == arm.profile.outer_radius
    assert facts.tip_radius == arm.profile.radius(arm.length)
    assert facts.radius_ratio == arm.section.rings[0].inner_ratio
    assert facts.taper_ratio == facts.base_radius / facts.tip_radius
    assert facts.extension == extension_range(arm)
    assert facts.warnings == design_warnings(arm)


def test_a_design_beyond_the_theory_has_no_summary(trunk):
    with pytest.raises(sr.InvalidDesign, match="must keep ζ > 0"):
        describe(trunk.with_bounds((-9.0, 0.0)))


def test_the_summary_of_twice_as_many_bundles_costs_twice_as_much(trunk, monkeypatch):
    """Each bundle alone is asked about without the others."""
    asked = []
    plain = softreach.arm.tables._resultants
    monkeypatch.setattr(
        softreach.arm.tables, "_resultants", lambda *a: asked.append(1) or plain(*a)
    )

    def calls(count: int) -> int:
        arm = trunk.split("longitudinal", count)
        arm = arm.with_bounds((-0.01, 0.0))
        asked.clear()
        bending_over_bounds.cache_clear()
        describe(arm)
        return len(asked)

    ten, twenty, forty = map(calls, (10, 20, 40))
    assert forty - twenty == 2 * (twenty - ten)
