"""What arms are made of, for tests of loaded rods."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.polynomial import chebyshev

from softreach.arm import Loads, Manipulator, designs
from softreach.arm.tables import tables
from softreach.rod.loaded.postures import Postures
from softreach.rod.loaded.shooting import Equilibria
from softreach.rod.loaded.solver import Solver
from softreach.rod.loaded.tables import ArmBody, LoadTables
from tests.oracles import rod

_DEGREE = 40


def rubber(arm: Manipulator, loads: Loads, young: float = 1e6, density: float = 1000.0):
    """The arm of one heavy elastic material throughout, under loads."""
    ring = arm.section.rings[0]
    material = ring.material.replace(young_modulus=young, density=density)
    section = arm.section.replace(rings=(ring.replace(material=material),))
    return arm.replace(section=section, loads=loads)


def weighed(arm: Manipulator, load: float, gravity=(0.0, 0.0, -9.81), **loads) -> Manipulator:
    """The arm with E such that its load number is `load`."""
    young = 1000 * 9.81 * arm.length**3 / (load * arm.profile.outer_radius**2)
    return rubber(arm, Loads(gravity=gravity, **loads), young)


def straight(body, loads: Loads, length=1.0, steps=32) -> Solver:
    """The solver of a straight passive rod."""
    arm = designs.minimal_trunk(taper=0.0, length=length)
    return Solver(LoadTables(arm, loads, body), steps, 1e-10)


def by_lines(solver: Solver, gamma: np.ndarray) -> Equilibria:
    """Postures found along lines from rest alone."""
    equilibria = solver.empty(len(gamma))
    Postures.of(solver).by_line(gamma, np.arange(len(gamma)), equilibria)
    return equilibria


@dataclass(frozen=True)
class Uniform:
    """The same everywhere."""

    yields: tuple[float, float, float]
    mass: float

    def compliance(self, z):
        return tuple(np.full(np.shape(z), c) for c in self.yields)

    def mass_per_length(self, z):
        return np.full(np.shape(z), self.mass)


def uniform(bending, axial=np.inf, torsion=None, mass=0.0):
    """The body of an untapered rod from its stiffnesses."""
    return Uniform((1.0 / axial, 1.0 / bending, 1.0 / (torsion or bending)), mass)


def oracle_rod(arm: Manipulator, body: ArmBody, gamma, loads: Loads) -> tuple[rod.Rod, rod.Loads]:
    """An activated arm and its loads as the oracles take them."""
    breaks = tuple(arm.breakpoints)
    at = _polynomials(lambda z: _sections(arm, body, gamma, z), sorted({0.0, *breaks, arm.length}))
    return rod.Rod(
        length=arm.length,
        axial=lambda z: at(z)[0],
        bending=lambda z: at(z)[1],
        torsion=lambda z: at(z)[2],
        mass=lambda z: at(z)[3],
        stretch=lambda z: at(z)[4],
        rest_length_factor=lambda z: at(z)[5],
        curvature=lambda z: at(z)[6:],
        breaks=breaks,
    ), rod.Loads(
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


def _sections(arm: Manipulator, body: ArmBody, gamma, z):
    """K0, K1, K3, mass per length, ζ̂, η and û at stations, shape (station, 9)."""
    table, yields = tables(arm, z), body.compliance(z)
    stiff = [1.0 / np.maximum(one, 1e-300) for one in yields]
    stretch, eta = 1.0 + table.extension @ gamma, 1.0 + table.rest_length_factor @ gamma
    bend = table.curvature @ gamma
    return np.column_stack([*stiff, body.mass_per_length(z), stretch, eta, bend])


def _polynomials(values: Callable, ends: list[float]) -> Callable:
    """Smooth functions of Z as fast polynomials between ends, exact but for rounding."""
    orders = np.arange(_DEGREE + 1)
    pieces = [(0.5 * (a + b), 0.5 * (b - a)) for a, b in pairwise(ends)]
    coefficients = [_coefficients(values, *piece) for piece in pieces]

    @lru_cache(maxsize=8)
    def at(z: float):
        inside = int(np.searchsorted(ends[1:-1], z))
        middle, half = pieces[inside]
        x = min(max((z - middle) / half, -1.0), 1.0)
        return np.cos(orders * np.arccos(x)) @ coefficients[inside]

    return at


def _coefficients(values: Callable, middle: float, half: float):
    """Of Chebyshev polynomials."""
    return chebyshev.chebinterpolate(lambda x: values(middle + half * x), _DEGREE)


def posture_shapes(solver, gamma, stations):
    """Shapes of the postures of activations."""
    return solver.shapes(gamma, stations, Postures.of(solver).find(gamma))
