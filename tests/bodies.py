"""What arms are made of, for tests of loaded rods."""

from collections.abc import Callable
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.polynomial import chebyshev

from softreach.arm import Loads, Manipulator, Measured, designs
from softreach.arm.tables import compliance, tables
from softreach.rod.loaded.postures import Postures
from softreach.rod.loaded.solver import Equilibria, Solver
from softreach.rod.loaded.tables import LoadTables
from tests.oracles import rod

_DEGREE = 40
# The base frame stands upright; seen from it, gravity pulls back (up), aside, or ahead (down).
UP, SIDE, DOWN = (0.0, 0.0, -9.81), (9.81, 0.0, 0.0), (0.0, 0.0, 9.81)


def rubber(arm: Manipulator, loads: Loads, young: float = 1e6, density: float = 1000.0):
    """The arm of one heavy elastic material throughout, under loads."""
    ring = arm.section.rings[0]
    material = ring.material.replace(young_modulus=young, density=density)
    section = arm.section.replace(rings=(ring.replace(material=material),))
    return arm.replace(section=section, loads=loads)


def weighed(arm: Manipulator, load: float, gravity=UP, **loads) -> Manipulator:
    """The arm with E such that its load number ρgL³/(E R2²) is `load`."""
    young = 1000 * 9.81 * arm.length**3 / (load * arm.profile.outer_radius**2)
    return rubber(arm, Loads(gravity=gravity, **loads), young)


def uniform(bending, axial=1e12, torsion=None, mass=0.0) -> Measured:
    """An untapered rod by its stiffnesses and its mass per length."""
    return Measured(
        axial_stiffness=axial,
        bending_stiffness=bending,
        torsion_stiffness=torsion or bending,
        mass_per_length=mass,
    )


def of_body(arm: Manipulator, body: Measured, loads: Loads) -> Manipulator:
    """The arm of rubber but for these stiffnesses and masses, under loads."""
    arm = rubber(arm.replace(loads=None), None)
    return arm.replace(section=arm.section.replace(measured=body), loads=loads)


def straight(body: Measured, loads: Loads, steps=32) -> Solver:
    arm = designs.minimal_trunk(taper=0.0).with_bounds(np.zeros((3, 2)))
    return Solver(LoadTables(arm=of_body(arm, body, loads)), steps, 1e-10)


def by_lines(solver: Solver, gamma: np.ndarray) -> Equilibria:
    equilibria = solver.empty(len(gamma))
    Postures(solver).by_line(gamma, np.arange(len(gamma)), equilibria)
    return equilibria


def oracle_rod(arm: Manipulator, gamma, loads: Loads) -> tuple[rod.Rod, rod.Loads]:
    """An activated arm and its loads as the oracles take them."""
    breaks = tuple(arm.breakpoints)
    at = _polynomials(lambda z: _sections(arm, gamma, z), sorted({0.0, *breaks, arm.length}))
    names = "axial", "bending", "across", "torsion", "mass", "stretch", "rest_length_factor"
    along = {name: (lambda z, k=k: at(z)[k]) for k, name in enumerate(names)}
    along["curvature"] = lambda z: at(z)[7:]
    along["angle"] = arm.section.bending_angle
    return rod.Rod(length=arm.length, breaks=breaks, **along), rod.Loads(
        gravity=loads.gravity,
        payload=loads.payload,
        lever=loads.payload_arm,
        tip_force=loads.tip_force,
        tip_moment=loads.tip_moment,
        following_force=loads.follower_force,
        following_moment=loads.follower_moment,
        points=tuple(
            rod.PointLoad(place=one.station, force=one.force, moment=one.moment)
            for one in loads.point_loads
        ),
        force_per_length=lambda z: loads.force_per_length,
    )


def _sections(arm: Manipulator, gamma, z):
    """K0, K1, K2, K3, mass per length, ζ̂, η and û at stations, shape (station, 10)."""
    table, (axial, yields) = tables(arm, z), compliance(arm, z)
    stiff = 1.0 / np.maximum([axial, *yields.T], 1e-300)
    stretch, eta = 1.0 + table.extension @ gamma, 1.0 + table.rest_length_factor @ gamma
    mass = np.zeros(len(z))
    if any(arm.loads.gravity):
        mass = arm.section.mass_per_length_at(arm.profile, z)
    return np.column_stack([*stiff, mass, stretch, eta, table.curvature @ gamma])


def _polynomials(values: Callable, ends: list[float]) -> Callable:
    """Smooth functions of Z as fast polynomials between ends, exact but for rounding."""
    orders = np.arange(_DEGREE + 1)
    pieces = [(0.5 * (a + b), 0.5 * (b - a)) for a, b in pairwise(ends)]
    coefficients = [
        chebyshev.chebinterpolate(lambda x, m=middle, h=half: values(m + h * x), _DEGREE)
        for middle, half in pieces
    ]

    @lru_cache(maxsize=8)
    def at(z: float):
        inside = int(np.searchsorted(ends[1:-1], z))
        middle, half = pieces[inside]
        x = min(max((z - middle) / half, -1.0), 1.0)
        return np.cos(orders * np.arccos(x)) @ coefficients[inside]

    return at


def posture_shapes(solver, gamma, stations):
    return solver.shapes(gamma, stations, Postures(solver).find(gamma))
