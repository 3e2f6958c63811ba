"""What follows from a design: its numbers, and the limits that it touches."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

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
from softreach.arm.bending import (
    bending_at,
    largest_bending,
    sharpest_bending,
    smallest_bending,
)
from softreach.arm.summary import describe, design_warnings
from softreach.arm.tables import extension_range, tables
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
        describe(arm)
        return len(asked)

    ten, twenty, forty = map(calls, (10, 20, 40))
    assert forty - twenty == 2 * (twenty - ten)


# Laws of the range of bending: zonogons against all corners, their extremes along the arm


def at_corners(arm, stations):
    """Bending at every corner of the box, shape (station, corner)."""
    corners = np.array(list(itertools.product(*arm.bounds)))
    plane = tables(arm, stations).curvature[:, :2]
    return np.linalg.norm(np.einsum("scb,nb->snc", plane, corners), axis=-1)


def least(arm, stations):
    """Least bending by bounded least squares, for bundles that are free."""
    plane = tables(arm, stations).curvature[:, :2]
    bounds, active = tuple(arm.bounds.T), {"method": "bvls", "tol": 1e-15, "max_iter": 100}
    solved = [lsq_linear(u, [0.0, 0.0], bounds, **active) for u in plane]
    return np.array([np.linalg.norm(one.fun) for one in solved])


@given(arm=arms())
def test_the_largest_bending_is_that_of_the_farthest_corner(arm):
    z = np.linspace(0, arm.length, 5)
    found = bending_at(arm, z)[1]
    np.testing.assert_allclose(found, at_corners(arm, z).max(axis=1), rtol=1e-12, atol=1e-14)


@given(arm=arms(), low=st.floats(-0.8, 0.2), width=st.floats(0.01, 0.5))
def test_the_least_bending_is_that_of_bounded_least_squares(arm, low, width):
    arm = arm.with_bounds((low, low + width))
    z = np.linspace(0, arm.length, 5)
    found = bending_at(arm, z)[0]
    np.testing.assert_allclose(found, least(arm, z), rtol=1e-6, atol=1e-6 / arm.length)


def test_held_bundles_and_bundles_side_by_side_bend_as_one_corner_says():
    held = designs.minimal_trunk().with_bounds((-0.4, -0.4))
    line = single(activation_bounds=(-0.6, -0.2))
    opposite = arm_of(
        *(sr.FiberArchitecture(helical_angle=0.0, offset=k, extent=0.5) for k in (0.0, math.pi)),
        activation_bounds=(-0.6, -0.2),
    )
    z = np.linspace(0, 1, 5)
    for arm in (held, line):
        corners = at_corners(arm, z)
        low, high = bending_at(arm, z)
        np.testing.assert_allclose(low, corners.min(axis=1), rtol=1e-12)
        np.testing.assert_allclose(high, corners.max(axis=1), rtol=1e-12)
    np.testing.assert_allclose(bending_at(opposite, z)[0], 0.0, atol=1e-12)


def wound(turns: float, **changes: object) -> sr.Manipulator:
    """A fiber that winds beside a straight one."""
    fibers = (
        sr.FiberArchitecture(revolution=2 * math.pi * turns, offset=0.3, extent=0.6),
        sr.FiberArchitecture(helical_angle=0.0, offset=2.0, extent=0.5),
    )
    return arm_of(*fibers, **({"activation_bounds": (-0.7, -0.1)} | changes))


@pytest.mark.parametrize("turns", [0.1, 0.7, 3.0, 40.0])
@pytest.mark.parametrize("taper", [0.0, 0.03, -0.02])
def test_no_station_bends_more_or_less_than_the_extremes(turns, taper):
    arm = wound(turns, taper=taper)
    z = np.linspace(0, 1, 60_001)
    low, high = bending_at(arm, z)
    assert largest_bending(arm).value == pytest.approx(high.max(), rel=3e-6)
    assert largest_bending(arm).value >= high.max() * (1 - 1e-9)
    assert smallest_bending(arm).value == pytest.approx(low.min(), abs=2e-3 * high.max())
    assert smallest_bending(arm).value <= low.min() * (1 + 1e-9)
    assert sharpest_bending(arm).value >= (high * arm.profile.radius(z)).max() * (1 - 1e-9)


def test_extremes_are_reached_where_they_are_said_to_be():
    arm = wound(1.7, taper=0.01)
    largest, smallest, sharpest = largest_bending(arm), smallest_bending(arm), sharpest_bending(arm)
    assert bending_at(arm, largest.station)[1] == pytest.approx(largest.value, rel=1e-9)
    assert bending_at(arm, smallest.station)[0] == pytest.approx(
        smallest.value, abs=1e-9 * largest.value
    )
    relative = bending_at(arm, sharpest.station)[1] * arm.profile.radius(sharpest.station)
    assert relative == pytest.approx(sharpest.value, rel=1e-9)


def test_an_arm_that_bends_alike_everywhere_does_so_from_its_base_on():
    arm = single(activation_bounds=(-0.6, -0.2))
    assert largest_bending(arm).station == sharpest_bending(arm).station == 0.0
    assert smallest_bending(arm).value == pytest.approx(largest_bending(arm).value / 3, rel=1e-12)


def test_an_arm_that_is_straight_at_one_station_only_bends_nowhere_less():
    arm = wound(40.0)
    assert smallest_bending(arm).value == 0.0
    assert bending_at(arm, smallest_bending(arm).station)[0] < 1e-9 * largest_bending(arm).value


def test_an_arm_that_can_rest_can_be_straight(trunk):
    assert smallest_bending(trunk) == (0.0, 0.0)
