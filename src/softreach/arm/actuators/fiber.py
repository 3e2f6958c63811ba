"""Fibers and muscles: bundles that fill sectors of a ring of the section and contract it.

What one fiber puts on the section that it pulls on are radial integrals. The paper prints closed
forms of them (Appendix A) that are singular at φ = 0, α = 0 and α = ±φ, need complex numbers, and
hold a misprint in δ3. The integrals have none of that: δ0 = 4 R2² I0, δ1 = δ2 = 6 R2³ I1,
δ3 = 6 R2³ I3, theory (12).

Muscles are those of a muscular hydrostat, such as an elephant's trunk: Kaczmarski, Leanza, Zhao,
Kuhl, Moulton and Goriely, J. Mech. Phys. Solids (2025) 106102.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.actuators.actuator import MOST_TURN, Bounds, Outline, PolarActuator, Resultants
from softreach.arm.number import number
from softreach.arm.part import AlongArm, Pieces, values_along
from softreach.arm.profile import Profile
from softreach.arm.section import Ring, Section
from softreach.support.arrays import Array
from softreach.support.errors import Fault, InvalidDesign

_RING_NODES, _RING_WEIGHTS = np.polynomial.legendre.leggauss(48)

# The integrands have poles at x = ±i/tan α. Beyond this |tan α| (86.4°) they are so near to a ring
# that begins below this ratio that 48 nodes in x no longer reach machine precision.
_STEEP, _FULL = 16.0, 0.05


class RingIntegrals(NamedTuple):
    """Integrals over the ring x = R/R2 from ρ to 1 [-], theory (3)."""

    axial: Array
    """I0 = ∫ x k dx [-]."""
    bending: Array
    """I1 = ∫ x² k dx [-]."""
    torsion: Array
    """I3 = ∫ x² t dx [-]."""


@dataclass(frozen=True, kw_only=True)
class SectorActuator(PolarActuator):
    """Equidistant bundles of one extent in one ring; γ < 0 contracts."""

    extent: float = number("σ", "rad", "angular extent of a bundle", above=0.0, high=2 * math.pi)
    """σ, angular extent of every bundle [rad]; 0 < σ ≤ 2π."""
    ring: int | str = 0
    """Ring of the section that it is in: index or name."""
    activation_bounds: Bounds = (-5 / 3, 0.0)
    """(lower, upper) of γ for every bundle, or one pair per bundle [-]; γ < 0 contracts."""

    @abstractmethod
    def integrals(self, profile: Profile, ring: Ring, z: Array) -> RingIntegrals:
        """I0, I1, I3 of its ring at stations Z [m], each of shape (station,): theory (3)."""

    def rotation(self, profile: Profile, ring: Ring, z: Array) -> Array:
        """Θ(Z) [rad]: how far the sectors have turned at stations Z [m] from where they begin."""
        return np.zeros(len(z))

    def resultants(self, profile: Profile, section: Section, z: Array) -> Resultants:
        """N = E R2² I0 σ and M = E R2³ (I1 a sin θ, -I1 a cos θ, I3 σ), a = 2 sin(σ/2): theory (4).

        R2 and E are the outer radius and Young's modulus of the ring.
        """
        ring = section.ring(self.ring)
        radius, scale = profile.radius(z) * ring.outer_ratio, np.pi * ring.material.relative_modulus
        axial, bending, torsion = self.integrals(profile, ring, z)
        theta = self.angles(profile, ring, z)
        share, mean = self.extent / np.pi, 2.0 * np.sin(self.extent / 2.0) / np.pi
        bend = (scale * radius**3 * bending * mean)[:, None]
        twist = (scale * radius**3 * torsion * share)[:, None]
        moment = [bend * np.sin(theta), -bend * np.cos(theta), np.broadcast_to(twist, theta.shape)]
        force = (scale * radius**2 * axial * share)[:, None]
        return Resultants(np.broadcast_to(force, theta.shape), np.stack(moment, axis=1))

    def outline(self, profile: Profile, section: Section, z: Array) -> Outline:
        ring, each = section.ring(self.ring), np.ones(self.bundles)
        center = self.angles(profile, ring, z)
        return Outline(
            center=center,
            extent=self.extent * each,
            inner_ratio=np.full(center.shape, ring.inner_ratio),
            outer_ratio=np.full(center.shape, ring.outer_ratio),
            shape=("sector",) * self.bundles,
            acts=self.acts(profile, z),
        )

    def section_faults(self, profile: Profile, section: Section) -> list[Fault]:
        """A ring that the section does not have, or whose modulus is unknown and needed."""
        try:
            index = section.ring_index(self.ring)
        except InvalidDesign as error:
            return list(error.faults)
        known = section.rings[index].material.young_modulus is not None
        if known or not section.has_measured_stiffness:
            return []
        allowed = f"must be given in Pa for {self.name!r}, which acts on measured stiffnesses"
        return [Fault(f"rings[{index}].material.young_modulus", None, allowed)]

    def angles(self, profile: Profile, ring: Ring, z: Array) -> Array:
        """θ0 + 2πj/n + Θ(Z) [rad], shape (station, bundle): theory (11)."""
        return self.start_angles + self.rotation(profile, ring, z)[:, None]

    def _faults(self) -> list[Fault]:
        ring, faults = self.ring, super()._faults()
        index = isinstance(ring, int) and not isinstance(ring, bool) and ring >= 0
        allowed = "must be the index, from 0, or the name of a ring"
        return faults if index or isinstance(ring, str) else [*faults, Fault("ring", ring, allowed)]


def ring_integrals(
    radius_ratio: ArrayLike, taper: ArrayLike, helical_angle: ArrayLike, poisson_ratio: ArrayLike
) -> RingIntegrals:
    """I0, I1, I3 [-] of fiber contraction over the ring: theory (3), with k and t of (1) and (2).

    All arguments broadcast: ρ = R1/R2, taper φ, helical angle α at the outer radius [rad], and ν.
    """
    each = np.broadcast_arrays(radius_ratio, taper, helical_angle, poisson_ratio)
    ratio, phi, alpha, nu = np.array(each, float)[..., None]
    x, weight = _nodes(ratio, np.abs(np.tan(alpha)))
    cone = 1.0 + (x * np.tan(phi)) ** 2
    helix = 1.0 + (x * np.tan(alpha)) ** 2
    k = (1.0 + nu) / (cone * helix) - nu
    t = x * np.tan(alpha) / (helix * np.sqrt(cone))
    return RingIntegrals(*np.sum(weight * np.stack([x * k, x**2 * k, x**2 * t]), axis=-1))


def _nodes(ratio: Array, tangent: Array) -> tuple[Array, Array]:
    """Points x of the ring and their weights, which resolve |tan α| up to 10⁹ and any ring."""
    half = 0.5 * (1.0 - ratio)
    x, weight = ratio + half * (1.0 + _RING_NODES), half * _RING_WEIGHTS
    steep = (tangent > _STEEP) & (ratio < _FULL)
    if not steep.any():
        return x, weight
    # In u with x tan α = sinh u the poles stay π/2 away, however steep the fiber.
    slope = np.where(steep, tangent, 1.0)
    low, high = np.arcsinh(ratio * slope), np.arcsinh(slope)
    half = 0.5 * (high - low)
    u = low + half * (1.0 + _RING_NODES)
    steep_weight = half * _RING_WEIGHTS * np.cosh(u) / slope
    return np.where(steep, np.sinh(u) / slope, x), np.where(steep, steep_weight, weight)


def cone_integrals(ring: Ring, slope: Array, angle: Array) -> RingIntegrals:
    """I0, I1, I3 of one ring, each pair of slope and angle integrated once, shape (station,).

    The slope is tan φ of the arm's surface, the angle α at the outer radius of the ring [rad].
    """
    pairs, station = np.unique(slope + 1j * angle, return_inverse=True)
    of_ring = np.arctan(pairs.real * ring.outer_ratio)
    each = ring_integrals(ring.radius_ratio, of_ring, pairs.imag, ring.material.poisson_ratio)
    return RingIntegrals(*np.stack(each)[:, station])


# Enough for machine precision between two samples of an angle.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


@dataclass(frozen=True, kw_only=True)
class FiberArchitecture(SectorActuator):
    """A helical or longitudinal fiber architecture with equidistant bundles (section 2).

    Give either the helical angle or the revolution; 0 is longitudinal, positive is right-handed.

    Raises:
        InvalidDesign: A field is out of its range, or both or neither of `helical_angle` and
            `revolution` are given.
    """

    default_name: ClassVar[str] = "fiber"
    validity: ClassVar[str] = (
        "The law is exact to first order in the radius over the length on which the shape changes. "
        "Below γ = -1, γ is a load on the matrix, not a strain of the fiber."
    )

    revolution: float | None = number(
        "Ω", "rad", "revolution from base to tip", low=-MOST_TURN, high=MOST_TURN, default=None
    )
    """Ω, total rotation of a fiber about the axis from where it begins to where it ends [rad]."""
    helical_angle: float | AlongArm | None = number(
        "α",
        "rad",
        "helical angle at the outer radius",
        above=-math.pi / 2,
        below=math.pi / 2,
        along=AlongArm,
        instead_of="revolution",
        hint=" (0 for a longitudinal fiber)",
        default=None,
    )
    """α, from the axis, at the outer radius of the ring [rad]; |α| < π/2; may change along Z."""

    def helical_angle_on(self, profile: Profile, section: Section) -> float | AlongArm:
        """α at the outer radius of the ring [rad], which the revolution fixes."""
        return self._angle(profile, section.ring(self.ring))

    def _angle(self, profile: Profile, ring: Ring) -> float | AlongArm:
        if self.revolution == 0.0:
            return 0.0
        given = self.helical_angle
        return _even_angle(self, profile, ring.outer_ratio) if given is None else given

    def revolution_on(self, profile: Profile, section: Section) -> float:
        """Ω = Θ(L) [rad], which the helical angle fixes: theory (14)."""
        end = np.asarray(self.span(profile.length)[1:])
        return float(self.rotation(profile, section.ring(self.ring), end)[0])

    def _following(self, field: str, other: Any, profile: Profile, section: Section) -> Any:
        if field == "revolution":
            return self.revolution_on(profile, section)
        if field == "helical_angle":
            return self.helical_angle_on(profile, section)
        return super()._following(field, other, profile, section)

    def integrals(self, profile: Profile, ring: Ring, z: Array) -> RingIntegrals:
        """I0, I1, I3 for the local taper and helical angle: theory (3)."""
        local = values_along(self._angle(profile, ring), z / profile.length)
        return cone_integrals(ring, profile.slope(z), local)

    def rotation(self, profile: Profile, ring: Ring, z: Array) -> Array:
        """Θ(Z) = ∫ tan α dZ/(R cos φ) from where it begins [rad]: theory (50)."""
        if self.helical_angle == 0.0 or self.revolution == 0.0:
            return np.zeros(np.shape(z))
        angle, ratio = self._angle(profile, ring), ring.outer_ratio
        start = self.station_at("start", profile.length)
        if isinstance(angle, AlongArm):
            turned = _rotation_from_base(profile, ratio, angle, np.append(z, start))
            return turned[:-1] - turned[-1]
        return _along_cone(profile, ratio, start, z) * np.tan(angle)


@lru_cache(maxsize=64)
def _even_angle(fiber: FiberArchitecture, profile: Profile, ratio: float) -> float:
    """α of a revolution on the cone of a ring [rad]; each table of an arm asks for it."""
    along = _along_cone(profile, ratio, *fiber.span(profile.length))
    return math.atan((fiber.revolution or 0.0) / float(along))


def _along_cone(profile: Profile, ratio: float, start: ArrayLike, end: ArrayLike) -> Array:
    whole = profile.surface_coordinate(end, ratio)
    return whole - profile.surface_coordinate(start, ratio) if np.any(start) else whole


def _rotation_from_base(profile: Profile, ratio: float, angle: AlongArm, z: Array) -> Array:
    """Θ from the base, summed over the pieces on which profile and angle are smooth."""
    breaks = [profile.length * x for x in angle.breaks]
    knots = np.union1d([0.0, *breaks, profile.length], profile.breakpoints)
    knots = knots[np.append(np.diff(knots) > 1e-14 * profile.length, True)]

    def turn(start: Array, end: Array) -> Array:
        if isinstance(angle, Pieces):
            middle = angle((start + 1e-13 * profile.length) / profile.length)
            return _along_cone(profile, ratio, start, end) * np.tan(middle)
        half = 0.5 * (end - start)[..., None]
        z = start[..., None] + half * (1.0 + _NODES)
        secant = np.hypot(1.0, ratio * profile.slope(z)) / (ratio * profile.radius(z))
        return np.sum(half * _WEIGHTS * np.tan(angle(z / profile.length)) * secant, axis=-1)

    before = np.concatenate([[0.0], np.cumsum(turn(knots[:-1], knots[1:]))])
    piece = np.clip(np.searchsorted(knots, z, "right") - 1, 0, len(knots) - 2)
    return before[piece] + turn(knots[piece], z)


@dataclass(frozen=True, kw_only=True)
class ObliqueMuscle(SectorActuator):
    """Fibers that run at an angle across a sector which does not wind.

    They leave the sector at one side while others enter at the other, so that the muscle stays in
    its place and twists the arm: theory (4) with Θ(Z) = 0 and the α of its fibers.

    Raises:
        InvalidDesign: A field is out of its range.
    """

    default_name: ClassVar[str] = "oblique muscle"
    validity: ClassVar[str] = (
        "The limits of fibers hold here too. A fiber that leaves the sector before the tip is "
        "taken to be anchored in the matrix there."
    )

    helical_angle: float = number(
        "α", "rad", "angle of its fibers", above=-math.pi / 2, below=math.pi / 2
    )
    """α of its fibers from the axis, at the outer radius of the ring [rad]; 0 is longitudinal."""

    @property
    def fiber_direction(self) -> str:
        if self.helical_angle == 0:
            return "along"
        return "right-handed" if self.helical_angle > 0 else "left-handed"

    def integrals(self, profile: Profile, ring: Ring, z: Array) -> RingIntegrals:
        """I0, I1, I3 with the local taper and the angle of the fibers: theory (3)."""
        return cone_integrals(ring, profile.slope(z), np.full(len(z), self.helical_angle))


@dataclass(frozen=True, kw_only=True)
class RadialMuscle(SectorActuator):
    """Fibers along the radius of a sector: contracting them (γ < 0) makes the arm longer.

    A radial strain γ stretches an elastic section by -ν γ along the axis wherever it acts, so that
    k = -ν in theory (3), by theory (51): N = -ν E σ (R2² - R1²)/2 γ, and a moment unless the
    sectors go all around.

    Raises:
        InvalidDesign: A field is out of its range.
    """

    default_name: ClassVar[str] = "radial muscle"
    validity: ClassVar[str] = (
        "The limits of fibers hold here too. The change of radius is left out."
    )

    @property
    def fiber_direction(self) -> str:
        return "radial"

    def integrals(self, profile: Profile, ring: Ring, z: Array) -> RingIntegrals:
        """I0 = -ν (1 - ρ²)/2, I1 = -ν (1 - ρ³)/3, I3 = 0 [-]."""
        nu, rho, each = ring.material.poisson_ratio, ring.radius_ratio, np.ones(len(z))
        return RingIntegrals(
            -nu * (1.0 - rho**2) / 2.0 * each, -nu * (1.0 - rho**3) / 3.0 * each, 0.0 * each
        )
