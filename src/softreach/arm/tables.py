"""From a design to the two tables that everything downstream sees: ζ = 1 + z·γ and u = Uγ.

The map is linear in the activations, theory (7). Curvature u is per length of η = 1 + Σ zγ over
fibers and muscles alone: these change the length of matter at rest, which forces leave as it is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.actuators import Actuator, Resultants
from softreach.arm.actuators.actuator import MOST_TURN
from softreach.arm.body import Body, RestStrains
from softreach.arm.number import fields_of
from softreach.arm.section import turned
from softreach.support.arrays import Array
from softreach.support.errors import Fault, InvalidDesign
from softreach.support.lazy import lazy

_STATIONS = 101
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
_PIECES = 32
_JUMP = 1e-3


@dataclass(frozen=True, eq=False)
class Tables:
    """The response of an arm at given stations per unit of activation of each bundle."""

    stations: Array  # Z [m], shape (station,)
    extension: Array  # z = dζ/dγ [-], shape (station, bundle)
    curvature: Array  # U = du/dγ [1/m], per length of η, in the directors, (station, 3, bundle)
    rest_length_factor: Array
    """dη/dγ [-]: z of bundles that change the length of matter at rest, 0 of those that are forces;
    shape (station, bundle). Of fibers and muscles alone it is `extension` itself."""

    @property
    def has_forces(self) -> bool:
        """True if some bundles are forces, so that η is not ζ."""
        return self.rest_length_factor is not self.extension


def tables(arm: Body, stations: ArrayLike) -> Tables:
    """z = N/K0 and U = K⁻¹M at Z [m] (station,): theory (6), which for fibers is (8) to (10).

    U of a rest shape is its curvature; what an arm is at rest, its `inner` arm has.

    Raises:
        InvalidDesign: An actuator loads the sections by another number of bundles than it has.
    """
    z = np.atleast_1d(np.asarray(stations, float))
    loads = [Resultants(np.empty((len(z), 0)), np.empty((len(z), 3, 0)))]
    loads += [_resultants(actuator, arm, z) for actuator in arm.actuators]
    stiffness = arm.stiffness_at(z)
    resistance, angle = arm.section.resistance(stiffness), arm.section.bending_angle
    extension = np.concatenate([load.force for load in loads], axis=1) / stiffness.axial[:, None]
    moment = turned(np.concatenate([load.moment for load in loads], axis=2), -angle)
    curvature = turned(moment / resistance[..., None], angle)
    for k, actuator in enumerate(arm.bundle_actuators):
        if isinstance(actuator, RestStrains):
            curvature[..., k] = actuator.shape.curvature(z / arm.length)
    is_force = [actuator.is_force for actuator in arm.bundle_actuators]
    resting = np.where(is_force, 0.0, extension) if any(is_force) else extension
    return Tables(z, extension, curvature, resting)


def _resultants(actuator: Actuator, arm: Body, z: Array) -> Resultants:
    """Load of an actuator on the sections: nothing where it does not act."""
    load, acts = actuator.resultants(arm.profile, arm.section, z), actuator.acts(arm.profile, z)
    shapes = np.shape(load.force), np.shape(load.moment)
    count, n = len(z), actuator.bundles
    if shapes != ((count, n), (count, 3, n)):
        kind = type(actuator).__name__
        allowed = f"must be that of {kind}.resultants, whose arrays have the shapes {shapes}"
        raise InvalidDesign([Fault(f"{actuator.name}.bundles", n, allowed)])
    if acts.all():
        return load
    return Resultants(np.where(acts, load.force, 0.0), np.where(acts[:, None], load.moment, 0.0))


def compliance(arm: Body, stations: ArrayLike) -> tuple[Array, Array]:
    """1/K0 [1/N] at stations Z [m], and 1/K1, 1/K2 and 1/K3 [1/(N m²)], one more axis of 3.

    All are 0 in rigid pieces. The axes of K1 and K2 are those of `Section.bending_angle`.

    Raises:
        InvalidDesign: A material without Young's modulus.
    """
    if faults := arm.section.load_faults():
        raise InvalidDesign(faults)
    stiffness = arm.stiffness_at(stations)
    return 1.0 / stiffness.axial, 1.0 / arm.section.resistance(stiffness)


@lru_cache(maxsize=64)
def check_extension(arm: Body) -> float:
    """The theory ends where an activation would shorten the inner arm to nothing.

    Returns:
        The smallest ζ in the activation box and along the arm, or η if that is smaller [-].

    Raises:
        InvalidDesign: ζ <= 0 somewhere in the activation box and along the arm, dimensions too
            large or too small for numbers of double precision, or more than a hundred turns.
    """
    faults, most = list[Fault](), MOST_TURN / math.tau
    with np.errstate(all="ignore"):
        for actuator in arm.actuators:  # those that wind so often that no steps follow them
            if "revolution" in fields_of(type(actuator)):
                turn = abs(actuator.value_on("revolution", arm.profile, arm.section))
                if not (turns := float(turn / math.tau)) <= most:
                    allowed = f"must be at most {most:g}: give a smaller angle"
                    faults.append(Fault(f"turns of {actuator.name}", turns, allowed))
        if faults:
            raise InvalidDesign(faults)
        table = tables(arm, strain_stations(arm))
    if not (np.isfinite(table.extension).all() and np.isfinite(table.curvature).all()):
        sizes = f"L = {arm.length:.3g} m, R2(0) = {float(arm.profile.radius(0.0)):.3g} m"
        allowed = f"overflows with {sizes}: give all lengths in m, moduli and pressures in Pa"
        raise InvalidDesign([Fault("design", None, allowed)])
    ends, matter = list[float](), (table.rest_length_factor, " of matter itself, without forces")
    for rates, of in ((table.extension, ""), matter)[: 1 + table.has_forces]:
        smallest, _ = range_of_extension(arm, rates)
        ends.append(smallest)
        if smallest <= 0:
            kept = "must keep ζ > 0: narrow the bounds"
            allowed = f"shortens the arm to nothing, with extension ζ = {smallest:.4g}{of}; {kept}"
            raise InvalidDesign([Fault("activation_bounds", arm.bounds.tolist(), allowed)])
    return min(ends)


def range_of_extension(arm: Body, extension: Array) -> tuple[float, float]:
    """Smallest and largest 1 + Σ zγ anywhere in the activation box and along the arm [-]."""
    least, most = ends_over(extension, arm.bounds).T
    return 1.0 + float(least.min()), 1.0 + float(most.max())


def ends_over(rates: Array, bounds: Array) -> Array:
    """Ends of Σ rates γ, with rates (station, bundle), over a box (bundle, 2), (station, 2)."""
    ends = rates[..., None] * bounds
    return np.stack([ends.min(-1).sum(-1), ends.max(-1).sum(-1)], axis=1)


def both_sides(arm: Body, stations: Array) -> Array:
    """The stations [m], and both sides of every breakpoint of the arm, ascending."""
    if not arm.breakpoints:
        return stations
    breaks = np.array(arm.breakpoints)
    return np.union1d(stations, np.append(breaks, np.nextafter(breaks, 0.0)))


@lru_cache(maxsize=64)
def jumps(arm: Body) -> tuple[float, ...]:
    """Breakpoints [m] at which strains or stiffnesses, not their slopes alone, jump."""
    breaks = np.array(arm.breakpoints)
    sides = np.concatenate([breaks, np.nextafter(breaks, 0.0)])
    table, stiffness = tables(arm, sides), arm.stiffness_at(sides)
    jumping = np.zeros(len(breaks), bool)
    for values in (table.extension, table.rest_length_factor, table.curvature, *stiffness):
        after, before = np.reshape(values, (2, len(breaks), -1))
        largest = np.abs(values).max(initial=0.0)
        jumping |= (np.abs(after - before) > _JUMP * largest).any(axis=1)
    return tuple(breaks[jumping].tolist())


def strain_stations(arm: Body) -> Array:
    """Stations Z [m] at which it is seen how far strains go."""
    return both_sides(arm, np.linspace(0.0, arm.length, _STATIONS))


def quadrature(arm: Body, pieces: int = _PIECES) -> tuple[Array, Array, Array]:
    """Gauss nodes between places where something begins or acts, weights, half their gaps [m]."""
    points = [] if arm.loads is None else [load.station for load in arm.loads.point_loads]
    knots = np.union1d(np.linspace(0.0, arm.length, pieces + 1), [*arm.breakpoints, *points])
    half = np.diff(knots)[:, None] / 2.0
    z = knots[:-1, None] + half * (1.0 + _NODES)
    return z.ravel(), (half * _WEIGHTS).ravel(), np.repeat(half.ravel(), len(_NODES))


@dataclass(frozen=True, eq=False)
class Works:
    """∫ N (ζ - 1) + M·ω dZ: what unit loads of some bundles do work on, without other loads.

    It is linear in the activations but where bundles change the length of matter.
    """

    arm: Body
    columns: NDArray[np.intp]  # Bundles whose unit loads do the work

    @lazy
    def growing(self) -> NDArray[np.intp]:
        """Bundles that change the length of matter."""
        return np.flatnonzero([not each.is_force for each in self.arm.bundle_actuators])

    def loads_at(self, z: Array, weights: Array) -> tuple[Array, Array]:
        """N and M of the unit loads at nodes, times weights, (node, work) and (node, 3, work)."""
        table = tables(self.arm, z)
        stiffness = self.arm.section.stiffness_at(self.arm.profile, z)
        section, resistance = self.arm.section, self.arm.section.resistance(stiffness)
        force = table.extension[:, self.columns] * (weights * stiffness.axial)[:, None]
        bent = turned(table.curvature[..., self.columns], -section.bending_angle)
        moment = bent * (weights[:, None] * resistance)[..., None]
        return force, turned(moment, section.bending_angle)

    @lazy
    def _rates(self) -> tuple[Array, Array]:
        """∫ N z + M·U dZ, (work, bundle), and ∫ M·U dη/dγ dZ of each bundle that grows."""
        z, weights, _ = quadrature(self.arm)
        force, moment = self.loads_at(z, weights)
        table = tables(self.arm, z)
        bent = np.einsum("sct,scb->stb", moment, table.curvature)
        axial = np.einsum("st,sb->tb", force, table.extension)
        eta = table.rest_length_factor[:, self.growing]
        return axial + bent.sum(axis=0), np.einsum("stb,sg->tbg", bent, eta)

    def of(self, inner: Array) -> Array:
        """Work of each unit load at activations of the inner arm, shape (n, work)."""
        return self._sum(self.by_bundle(inner), inner)

    def slopes(self, inner: Array) -> Array:
        """Its derivatives by the activations, shape (n or 1, work, bundle)."""
        slopes = self.by_bundle(inner)
        for k, column in enumerate(self.growing):
            slopes[..., column] += self._sum(self._rates[1][None, ..., k], inner)
        return slopes

    def by_bundle(self, inner: Array) -> Array:
        """∫ N z + η M·U dZ, shape (n or 1, work, bundle)."""
        linear, growing = self._rates
        work = linear[None].copy()
        for k, column in enumerate(self.growing):
            work = work + inner[:, column, None, None] * growing[..., k]
        return work

    def _sum(self, rates: Array, inner: Array) -> Array:
        """Σ rates γ over the bundles in their order, whatever BLAS and its threads would do."""
        total = np.zeros((len(inner), len(self.columns)))
        for j in range(inner.shape[1]):
            total += rates[..., j] * inner[:, j, None]
        return total
