"""What follows from a design: its numbers, and the limits that it touches."""

from __future__ import annotations

import cmath
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
from softreach.arm.actuators.fiber import ring_integrals
from softreach.arm.driving import extension_range
from softreach.arm.tables import check_extension, tables
from softreach.requirements import Limits, Requirements
from softreach.rod.bending import (
    bending_at,
    bending_over_bounds,
    largest_bending,
    sharpest_bending,
    smallest_bending,
)
from softreach.rod.rods import as_tip_map
from softreach.rod.summary import describe, design_warnings
from softreach.support.errors import InvalidDesign
from tests.laws import arm_of, arms, in_box, single
from tests.made_arms import antagonists


def test_the_helical_bundles_of_the_trunk_meet_the_longitudinal_one_at_the_tip(trunk):
    """Section 3: at Ω = 108° the sectors touch at the distal end, and do not overlap before it."""
    angles = np.degrees(trunk.outline([0.0, trunk.length]).center)
    np.testing.assert_allclose(angles, [[66, 114, 270], [-42, 222, 270]], atol=1e-12)
    assert not any("overlap" in line for line in design_warnings(trunk))


def test_the_paper_s_taper_of_three_degrees_thins_the_tip_sixfold():
    report = describe(designs.minimal_trunk(taper=math.radians(3)))
    assert report.taper_ratio == pytest.approx(6.2, abs=0.02)
    radius = report.rows["outer radius at tip"][0]
    assert radius == pytest.approx(1 / 16 - math.tan(math.radians(3)))


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


@pytest.mark.parametrize("name", ["three_tendon_robot", "minimal_trunk"])
def test_a_summary_prints_what_the_command_does(name, capsys):
    from softreach.cli.app import run

    summary = describe(getattr(designs, name)())
    assert run(["design", name]) == 0
    (title, *lines), warnings = map(str.splitlines, capsys.readouterr())
    assert title == f"design {name}"
    assert [line.removeprefix("  ") for line in lines] + warnings == str(summary).splitlines()


def test_a_summary_prints_equal_tendons_as_one_line():
    (line,) = [x for x in str(describe(designs.three_tendon_robot())).splitlines() if "|κ| R2" in x]
    assert line.startswith("activation tendon 1 to tendon 3  0 to 8 N: length -7.866 to 0 %")


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


# Laws of the tables: the paper's equations of extension and curvature, and their ranges


@given(arm=arms())
def test_the_range_of_extension_holds_every_sample(arm):
    corners = np.array(list(itertools.islice(itertools.product(*arm.bounds), 1024)))
    gamma = np.concatenate([in_box(arm, 200), corners])
    table = tables(arm, np.linspace(0.0, arm.length, 101))
    zeta = 1 + gamma @ table.extension.T
    low, high = extension_range(arm)
    assert low - 1e-12 <= zeta.min()
    assert zeta.max() <= high + 1e-12


def test_an_arm_that_an_activation_would_shorten_to_nothing_is_refused(trunk):
    with pytest.raises(InvalidDesign, match=r"with extension ζ = -0.5\d+; must keep ζ > 0"):
        check_extension(trunk.with_bounds((-9.0, 0.0)))


@given(arm=arms())
def test_stations_do_not_see_each_other(arm):
    z = np.linspace(0, arm.length, 5)
    whole, alone = tables(arm, z), tables(arm, z[3])
    np.testing.assert_array_equal(whole.extension[3], alone.extension[0])
    np.testing.assert_array_equal(whole.curvature[3], alone.curvature[0])


# Laws of the ring integrals: the closed forms of Appendix A, their limits, symmetries


def closed_forms(rho, phi, alpha, nu):
    """δ0, δ1, δ3 of Appendix A at R2 = 1, δ3 without its misprint (the 3 multiplies T alone)."""
    cp, ca = math.tan(phi), math.tan(alpha)
    square = cp**2 - ca**2
    ratio = (1 + rho**2 * cp**2) * (1 + ca**2) / ((1 + cp**2) * (1 + rho**2 * ca**2))
    d0 = 2 * (rho**2 - 1) * nu - 2 * (1 + nu) / square * math.log(ratio)
    tans = (math.atan(rho * cp) - math.atan(cp)) * ca
    rest = 3 * (1 + nu) * (math.atan(rho * ca) - math.atan(ca)) + (rho**3 - 1) * nu * ca**3
    d1 = 2 / (cp * ca * square) * (3 * (1 + nu) * tans + (rho**3 - 1) * nu * cp**3 * ca - cp * rest)

    def s(r):
        return cmath.sqrt(square * (1 + cp**2 * r**2))

    def t(r):
        return cmath.atan((ca + 1j * cp**2 * r) / s(r))

    bracket = 3 * cp**2 * (t(-rho) + t(rho) - t(-1) - t(1)) + 6 * ca * (s(1) - s(rho))
    d3 = bracket / (cp**2 * ca**2 * cmath.sqrt(square))
    return d0, d1, d3


@given(
    rho=st.floats(0, 0.95),
    phi=st.floats(0.02, 0.5),
    alpha=st.floats(0.6, 1.3),
    nu=st.floats(0, 0.5),
)
def test_the_integrals_are_the_papers_functions(rho, phi, alpha, nu):
    d0, d1, d3 = closed_forms(rho, phi, alpha, nu)
    axial, bending, torsion = ring_integrals(rho, phi, alpha, nu)
    # The printed arctangents may cross their branch cut, which adds to the imaginary part alone.
    expected = [d0, d1, d3.real]
    np.testing.assert_allclose(
        [4 * axial, 6 * bending, 6 * torsion], expected, rtol=1e-9, atol=1e-10
    )


def test_a_longitudinal_fiber_in_a_full_cylinder_has_elementary_integrals():
    axial, bending, torsion = ring_integrals(0.0, 0.0, 0.0, 0.3)
    np.testing.assert_allclose([axial, bending, torsion], [1 / 2, 1 / 3, 0], rtol=1e-14)


@given(alpha=st.floats(0, 1.4), phi=st.floats(-0.5, 0.5))
def test_torsion_is_odd_and_the_rest_even_in_the_helical_angle(alpha, phi):
    plus, minus = (ring_integrals(0.7, phi, sign * alpha, 0.5) for sign in (1, -1))
    np.testing.assert_array_equal(plus.axial, minus.axial)
    np.testing.assert_array_equal(plus.bending, minus.bending)
    np.testing.assert_array_equal(plus.torsion, -minus.torsion)


def by_adaptive_quadrature(rho, phi, alpha, nu):
    """I0, I1, I3 in v = log x, decade by decade: what is near the axis gets as many nodes."""
    from scipy.integrate import quad

    cp, ca = math.tan(phi), math.tan(alpha)

    def k(x):
        return 1 / ((1 + (cp * x) ** 2) * (1 + (ca * x) ** 2))

    def t(x):
        return ca * x / ((1 + (ca * x) ** 2) * math.sqrt(1 + (cp * x) ** 2))

    ends = np.log([max(rho, 1e-17), *(10.0**e for e in range(-16, 0) if 10.0**e > rho), 1.0])

    def over(f):
        pieces = (
            quad(lambda v: math.exp(v) * f(math.exp(v)), a, b, epsabs=0, epsrel=1e-13)[0]
            for a, b in itertools.pairwise(ends)
        )
        return math.fsum(pieces)

    axial = (1 + nu) * over(lambda x: x * k(x)) - nu * (1 - rho**2) / 2
    bending = (1 + nu) * over(lambda x: x**2 * k(x)) - nu * (1 - rho**3) / 3
    return [axial, bending, over(lambda x: x**2 * t(x))]


@pytest.mark.parametrize("rho", [0.0, 0.01, 0.049, 0.051, 0.5])
@pytest.mark.parametrize("nu", [0.0, 0.5])
@pytest.mark.parametrize("to_circumferential", [1.57, 0.8, 0.1, 0.05, 0.01, 1e-3, 1e-6, 1e-8])
def test_fibers_that_nearly_wind_around_the_axis_keep_all_digits(rho, nu, to_circumferential):
    alpha = math.pi / 2 - to_circumferential
    for phi in (0.0, 0.5):
        found = ring_integrals(rho, phi, alpha, nu)
        np.testing.assert_allclose(found, by_adaptive_quadrature(rho, phi, alpha, nu), rtol=1e-12)


def test_steep_and_shallow_fibers_in_one_array_do_not_see_each_other():
    alpha = np.array([-1.57, 0.0, 0.4, 1.5, 1.57])
    together = ring_integrals(0.0, 0.05, alpha, 0.5)
    alone = [ring_integrals(0.0, 0.05, one, 0.5) for one in alpha]
    np.testing.assert_array_equal(together, np.transpose(alone))


def of_tendons(kind=sr.Tendon, **changes):
    """A soft rod of 0.3 m with three cables at 8 mm from its axis, beyond 1 mm of it or within."""
    soft = sr.Material(young_modulus=1e5, density=1000.0, poisson_ratio=0.49)
    return sr.Manipulator(
        profile=sr.LinearTaper(length=0.3, outer_radius=0.01),
        section=sr.arm.Section(core=soft, rings=(sr.Ring(inner_ratio=0.5, material=soft),)),
        actuators=(kind(bundles=3, distance=0.008, **changes),),
    )


def sharpness(arm, gamma):
    """Largest κ R2 of a pose by second differences of its centerline."""
    shape = sr.configuration(arm, [gamma], 2001)
    steps = np.diff(shape.position.values[0], axis=0)
    sizes = np.linalg.norm(steps, axis=1)
    turns = np.linalg.norm(np.diff(steps / sizes[:, None], axis=0), axis=1)
    return float((turns / (0.5 * (sizes[1:] + sizes[:-1]))).max()) * 0.01


def pulled(count):
    """That rod by so many inputs: tensions without balance, two of them perhaps of one input."""
    arm = of_tendons(activation_bounds=((1.5, 3.0), (0.0, 0.5), (0.0, 0.5)))
    arm = arm.replace(rest=sr.arm.RestShape(curvature_x=2.0))
    names = arm.bundle_names
    drive = antagonists("b", *names[:2], bounds=(0.1, 0.7), offset=1.0, gain=1.2)
    return arm.replace(drives=(drive,)) if count == 2 else arm


@pytest.mark.parametrize(
    ("arm", "poses", "exact"),
    [
        (of_tendons(activation_bounds=(0, 4)), itertools.product((0, 4), repeat=3), True),
        (
            of_tendons(sr.arm.LengthTendon, activation_bounds=(0, 0.03)),
            itertools.product((0, 0.015, 0.03), repeat=3),
            False,
        ),
        (
            of_tendons(activation_bounds=(0, 0.05)).replace(
                base=sr.Base(points="x"), loads=sr.Loads(gravity=(0, 0, -2.0))
            ),
            [(0, 0, 0), (0.05, 0, 0), (0, 0.05, 0.05)],
            False,
        ),
    ],
    ids=["tensions", "lengths", "loads"],
)
def test_bending_over_bounds_is_that_of_the_centerlines_whatever_drives_or_loads(arm, poses, exact):
    found = bending_over_bounds(arm)
    most = max(sharpness(arm, pose) for pose in poses)
    assert found.exact is exact
    assert most * (1 - 1e-5) <= found.sharpest.value <= most * (1.00001 if exact else 1.02)
    assert found.largest == pytest.approx(found.sharpest.value / 0.01)
    (finding,) = sr.check(arm, Requirements(limits=Limits(bending=0.95 * most))).findings
    assert finding.verdict == "missed"


@given(count=st.sampled_from([2, 3]), seed=st.integers(0, 99))
def test_no_pose_of_forces_bends_more_or_less_than_the_exact_range(count, seed):
    arm = pulled(count)
    z = np.linspace(0, arm.length, 4)
    least, most = bending_at(arm, z)
    gamma = np.random.default_rng(seed).uniform(*arm.input_bounds.T, (500, arm.inputs))
    curvature = as_tip_map(arm).strains(gamma, z).curvature
    kappa = np.hypot(curvature[..., 0], curvature[..., 1])
    assert (kappa.max(axis=0) <= most * (1 + 1e-9)).all()
    assert (kappa.min(axis=0) >= least * (1 - 1e-9)).all()
    assert (0.8 * most < kappa.max(axis=0)).all()
    assert (kappa.min(axis=0) < 1.4 * least).all()
