"""Laws of the tables: the paper's equations of extension and curvature, and their ranges."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given

from softreach.arm import designs
from softreach.arm.actuators.ring_integrals import ring_integrals
from softreach.arm.tables import check_extension, extension_range, tables
from softreach.support.errors import InvalidDesign
from tests.laws import arms, in_box, single


@given(arm=arms())
def test_the_map_is_the_papers_equations_of_extension_and_curvature(arm):
    """Section 2: a0, a1, b1 summed over bundles, with δ from the integrals."""
    z = np.linspace(0, arm.length, 5)
    gamma = in_box(arm, 1)[0]
    table = tables(arm, z)
    radius, ring = arm.profile.radius(z), arm.section.rings[0]
    nu = ring.material.poisson_ratio
    zeta, u = np.ones(5), np.zeros((5, 3))
    bundle = iter(gamma)
    for fiber in arm.fibers:
        alpha = fiber.helical_angle_on(arm.profile, arm.section)
        i0, i1, i3 = ring_integrals(ring.inner_ratio, arm.profile.taper, alpha, nu)
        d0, d1, d3 = 4 * radius**2 * i0, 6 * radius**3 * i1, 6 * radius**3 * i3
        turn = math.tan(alpha) * arm.profile.surface_coordinate(z)
        for j in range(fiber.bundles):
            g = next(bundle)
            theta = fiber.offset + 2 * math.pi * j / fiber.bundles
            a0 = fiber.extent / math.pi * g
            chord = 2 * math.sin(fiber.extent / 2) / math.pi * g
            a1, b1 = chord * math.cos(theta), chord * math.sin(theta)
            size, phase = np.hypot(a1, b1), -np.arctan2(b1, a1)
            zeta += d0 * a0 / (4 * radius**2)
            u[:, 0] += -2 / (3 * radius**4) * d1 * size * np.sin(phase - turn)
            u[:, 1] += -2 / (3 * radius**4) * d1 * size * np.cos(phase - turn)
            u[:, 2] += 2 * (1 + nu) / (3 * radius**4) * d3 * a0
    np.testing.assert_allclose(1 + table.extension @ gamma, zeta, rtol=1e-12)
    np.testing.assert_allclose(table.curvature @ gamma, u, rtol=1e-9, atol=1e-11 / arm.length)


@given(arm=arms())
def test_the_range_of_extension_holds_every_sample(arm):
    corners = np.array(list(itertools.islice(itertools.product(*arm.bounds), 1024)))
    gamma = np.concatenate([in_box(arm, 200), corners])
    table = tables(arm, np.linspace(0.0, arm.length, 101))
    zeta = 1 + gamma @ table.extension.T
    low, high = extension_range(arm)
    assert low - 1e-12 <= zeta.min()
    assert zeta.max() <= high + 1e-12


def test_curvature_grows_as_the_arm_thins():
    z = np.array([0.0, 1.0])
    arm = designs.minimal_trunk(taper=math.radians(3))
    table = tables(arm, z)
    size = np.linalg.norm(table.curvature[:, :, 2], axis=1)
    assert size[1] / size[0] == pytest.approx(np.divide(*arm.profile.radius(z)), rel=1e-12)


def test_contraction_shortens():
    table = tables(single(), [0.0])
    assert table.extension[0, 0] > 0


def test_an_arm_that_an_activation_would_shorten_to_nothing_is_refused(trunk):
    with pytest.raises(InvalidDesign, match=r"reaches extension ζ = -0.5\d+; must keep ζ > 0"):
        check_extension(trunk.with_bounds((-9.0, 0.0)))
    with pytest.raises(InvalidDesign, match="extension"):
        check_extension(trunk.split("longitudinal", 98))


@given(arm=arms())
def test_stations_do_not_see_each_other(arm):
    z = np.linspace(0, arm.length, 5)
    whole, alone = tables(arm, z), tables(arm, z[3])
    np.testing.assert_array_equal(whole.extension[3], alone.extension[0])
    np.testing.assert_array_equal(whole.curvature[3], alone.curvature[0])
