"""The rod with follower tendons against closed forms, and against the balance of its cut parts."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.oracles.tendon_law import linear_law_deviation, linear_shape, linear_strains
from tests.oracles.tendon_rod import Rod, Tendon, balanced_strains, follower_shape

LENGTH = 0.5
ROD = Rod(
    length=LENGTH,
    axial=lambda z: 900.0 + 0 * z,
    bending=lambda z: 0.09 + 0 * z,
    torsion=lambda z: 0.06 + 0 * z,
)
TAPERED = Rod(
    length=LENGTH,
    axial=lambda z: 900.0 * (1 - z) ** 2,
    bending=lambda z: 0.09 * (1 - z) ** 4,
    torsion=lambda z: 0.06 * (1 - z) ** 4,
)
STRAIGHT = Tendon(
    radius=lambda z: 0.015 + 0 * z, angle=lambda z: 0.6 + 0 * z, tension=8.0, anchor=LENGTH
)
HELIX = replace(STRAIGHT, angle=lambda z: 0.6 + 7.0 * z)


def arc(extension, angle, length, heading):
    """Tip of an arc of the length `extension * length` that turns by an angle toward a heading."""
    radius = extension * length / angle
    side = radius * (1 - math.cos(angle))
    return [side * math.cos(heading), side * math.sin(heading), radius * math.sin(angle)]


def test_a_parallel_tendon_bends_to_an_arc_and_shortens_by_its_tension_over_k0():
    """Total angle τ ρt L/K1."""
    zeta, angle = 1 - 8.0 / 900.0, 8.0 * 0.015 * LENGTH / 0.09
    shape = follower_shape(ROD, [STRAIGHT], [0.0, LENGTH])
    np.testing.assert_allclose(shape.extension, zeta, rtol=1e-12)
    np.testing.assert_allclose(shape.place[-1], arc(zeta, angle, LENGTH, 0.6), atol=1e-11)
    np.testing.assert_allclose(np.arccos(shape.frame[-1, 2, 2]), angle, rtol=1e-10)


def test_opposite_tendons_of_the_same_tension_only_shorten():
    other = replace(STRAIGHT, angle=lambda z: 0.6 + math.pi + 0 * z)
    shape = follower_shape(ROD, [STRAIGHT, other], [LENGTH])
    np.testing.assert_allclose(shape.place[0], [0, 0, LENGTH * (1 - 16 / 900)], atol=1e-13)


def test_beyond_its_anchor_the_rod_is_straight():
    anchor = 0.3
    shape = follower_shape(ROD, [replace(STRAIGHT, anchor=anchor)], [anchor, 0.4, LENGTH])
    zeta, angle = 1 - 8.0 / 900.0, 8.0 * 0.015 * anchor / 0.09
    bend = np.array(arc(zeta, angle, anchor, 0.6))
    end = bend + 0.2 * shape.frame[0, 2]
    np.testing.assert_allclose(shape.place[[0, 2]], [bend, end], atol=1e-11)
    np.testing.assert_allclose(shape.extension[1:], 1.0, rtol=1e-12)


def test_distributed_tendon_loads_balance_as_the_cut_part_does():
    """Two tendons, one of them anchored midway, so that the other has a kink."""
    tendons = [HELIX, replace(STRAIGHT, anchor=0.3, tension=5.0, angle=lambda z: 2.0 - 3 * z)]
    z = np.linspace(0, LENGTH, 9)
    walked = follower_shape(TAPERED, tendons, z)
    direct = np.array([balanced_strains(TAPERED, tendons, s) for s in z])
    np.testing.assert_allclose(walked.extension, direct[:, 3], atol=1e-10)
    np.testing.assert_allclose(walked.curvature, direct[:, :3], atol=1e-8)


def test_the_linear_law_is_that_of_the_follower_load_for_parallel_tendons():
    exact = follower_shape(TAPERED, [STRAIGHT], [0.2, LENGTH])
    linear = linear_shape(TAPERED, [STRAIGHT], [0.2, LENGTH])
    np.testing.assert_allclose(linear.place, exact.place, atol=1e-11)
    np.testing.assert_allclose(linear.extension, exact.extension, rtol=1e-12)


def test_the_linear_law_misses_a_helical_tendon_at_second_order_in_the_tension():
    tensions = np.array([0.01, 0.02, 0.04])
    helices = [[replace(HELIX, tension=tension)] for tension in tensions]
    found = [linear_law_deviation(ROD, helix, stations=3) for helix in helices]
    for field, order in (("bend", 1.0), ("tip", 2.0), ("relative", 1.0)):
        values = [getattr(deviation, field) for deviation in found]
        slope = np.polyfit(np.log(tensions), np.log(values), 1)[0]
        assert slope == pytest.approx(order, abs=0.02), field


def test_bending_turns_a_tendon_on_a_solid_rod_by_the_radius_and_poisson_s_ratio():
    """δβ = κρt sin β cos β ((R/2ρt)² - ν), seen in the twist that the linear law misses."""
    outer, radius, nu, slope = 0.02, 0.015, 0.3, 0.015 * 7.0
    area = np.pi * outer**2 * 1e6
    rod = Rod(
        length=LENGTH,
        axial=lambda z: area + 0 * z,
        bending=lambda z: area * outer**2 / 4 + 0 * z,
        torsion=lambda z: area * outer**2 / 4 / (1 + nu) + 0 * z,
    )
    tendon = replace(HELIX, tension=1e-3)
    exact = balanced_strains(rod, [tendon], 0.1)
    linear = linear_strains(rod, [tendon], 0.1)
    bend = radius * np.hypot(*linear[:2])
    turn = bend * slope / (1 + slope**2) * ((outer / (2 * radius)) ** 2 - nu)
    assert exact[2] / linear[2] - 1 == pytest.approx(turn / slope, rel=1e-3)


@pytest.mark.parametrize(
    ("outer", "radius", "bend", "turns", "percent"),
    [
        (0.01, 0.005, 0.02, 0.5, 0.03),
        (0.01, 0.005, 0.1, 0.5, 0.47),
        (0.01, 0.005, 0.1, 1, 0.58),
        (0.002, 0.008, 0.1, 0.5, 0.43),
        (0.002, 0.008, 0.1, 1, 0.77),
        (0.002, 0.008, 0.1, 0, 0.00),
    ],
)
def test_the_linear_law_is_off_by_the_shares_that_the_theory_prints(
    outer, radius, bend, turns, percent
):
    length, area, nu = 0.3, np.pi * outer**2 * 1e6, 0.4
    bending = area * outer**2 / 4
    rod = Rod(
        length=length,
        axial=lambda z: area + 0 * z,
        bending=lambda z: bending + 0 * z,
        torsion=lambda z: bending / (1 + nu) + 0 * z,
    )
    tendon = Tendon(
        radius=lambda z: radius + 0 * z,
        angle=lambda z: 2 * np.pi * turns * z / length,
        tension=bend * bending / radius**2,
        anchor=length,
    )
    deviation = linear_law_deviation(rod, [tendon], stations=3)
    assert 100 * deviation.relative == pytest.approx(percent, abs=0.006)
