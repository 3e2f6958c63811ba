"""`tol` is kept over the whole activation box, for light and heavy loads, cylinders and cones."""

from __future__ import annotations

import math

import numpy as np
import pytest

from softreach.arm import designs
from softreach.arm.loads import Loads
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.loaded.solver import Solver
from softreach.rod.tip_map import TipStatus
from tests.bodies import rubber

# The base frame stands upright; seen from it, gravity pulls back (up), aside, or ahead (down).
UP, SIDE, DOWN = (0.0, 0.0, -9.81), (9.81, 0.0, 0.0), (0.0, 0.0, 9.81)


def of_load_number(taper_deg, load, gravity, **loads):
    """The trunk with E such that ρ g L³/(E R2²) is the load number, to a tolerance of 1e-6."""
    trunk = designs.minimal_trunk(taper=math.radians(taper_deg))
    young = 1000 * 9.81 / (load * trunk.profile.outer_radius**2)
    return LoadedRod(rubber(trunk, Loads(gravity=gravity, **loads), young), 1e-6)


def errors(found, gamma):
    """Tip errors where the arm is not about to lose its stability, and the share of these."""
    exact = Solver(found.tables, 4 * found.steps, 1e-10)
    of_rule = found.equilibria(gamma)
    settled = (of_rule.status != TipStatus.NO_EQUILIBRIUM) & (np.abs(of_rule.margin) > 0.02)
    apart = of_rule.tips[settled] - exact.near(gamma[settled], of_rule.of(settled)).tips
    return np.linalg.norm(apart, axis=1), settled.mean()


def samples(box, inside=300):
    random = np.random.default_rng(0).random((inside, box.dimension))
    return np.concatenate([box.corners(), box.from_cube(random)])


@pytest.mark.parametrize(
    ("taper_deg", "load"),
    [
        (0, 12),
        (2, 2.5),
        (3, 0.1),
        (3, 12),
        *(pytest.param(*case, marks=pytest.mark.large) for case in [(0, 0.1), (2, 12), (3, 8)]),
    ],
)
@pytest.mark.parametrize("gravity", [UP, SIDE, DOWN], ids=["up", "side", "down"])
def test_the_tolerance_is_kept_over_the_box(gravity, taper_deg, load):
    found = of_load_number(taper_deg, load, gravity)
    error, settled = errors(found, samples(found.box))
    assert settled > 0.98
    assert error.max() <= 1e-6


@pytest.mark.parametrize("taper_deg", [0.0, 3.0])
def test_the_tolerance_is_kept_under_loads_in_several_directions(taper_deg):
    found = of_load_number(taper_deg, 2.5, SIDE, tip_force=(0.0, 1.0, 0.5))
    error, settled = errors(found, samples(found.box, inside=60))
    assert settled == 1.0
    assert error.max() <= 1e-6


@pytest.mark.parametrize("tol", [1e-4, 1e-8])
def test_other_tolerances_are_kept_too(tol):
    rough = LoadedRod(of_load_number(2.0, 2.5, SIDE).arm, tol)
    error, _ = errors(rough, samples(rough.box))
    assert error.max() <= tol
