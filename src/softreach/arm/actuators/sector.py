"""Bundles that fill sectors of a ring and contract it: fibers and muscles.

What one fiber puts on the section that it pulls on are radial integrals. The paper prints closed
forms of them (Appendix A) that are singular at φ = 0, α = 0 and α = ±φ, need complex numbers, and
hold a misprint in δ3. The integrals have none of that: δ0 = 4 R2² I0, δ1 = δ2 = 6 R2³ I1,
δ3 = 6 R2³ I3, theory (12).
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.actuators.actuator import Bounds, Outline, PolarActuator, Resultants
from softreach.arm.number import number
from softreach.arm.profile import Profile
from softreach.arm.section import Ring, Section
from softreach.support.arrays import Array
from softreach.support.errors import Fault, InvalidDesign

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(48)

# The integrands have poles at x = ±i/tan α. Beyond this |tan α| (86.4°) they are so near to a ring
# that begins below this ratio that 48 nodes in x no longer reach machine precision.
_STEEP, _FULL = 16.0, 0.05


class RingIntegrals(NamedTuple):
    """Integrals over the ring x = R/R2 from ρ to 1 [-], theory (3)."""

    axial: Array
    """I0 = ∫ x k dx."""
    bending: Array
    """I1 = ∫ x² k dx."""
    torsion: Array
    """I3 = ∫ x² t dx."""


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
    x, weight = ratio + half * (1.0 + _NODES), half * _WEIGHTS
    steep = (tangent > _STEEP) & (ratio < _FULL)
    if not steep.any():
        return x, weight
    # In u with x tan α = sinh u the poles stay π/2 away, however steep the fiber.
    slope = np.where(steep, tangent, 1.0)
    low, high = np.arcsinh(ratio * slope), np.arcsinh(slope)
    half = 0.5 * (high - low)
    u = low + half * (1.0 + _NODES)
    steep_weight = half * _WEIGHTS * np.cosh(u) / slope
    return np.where(steep, np.sinh(u) / slope, x), np.where(steep, steep_weight, weight)


def cone_integrals(ring: Ring, slope: Array, angle: Array) -> RingIntegrals:
    """I0, I1, I3 of one ring, each pair of slope and angle integrated once, shape (station,).

    The slope is tan φ of the arm's surface, the angle α at the outer radius of the ring [rad].
    """
    pairs, station = np.unique(slope + 1j * angle, return_inverse=True)
    of_ring = np.arctan(pairs.real * ring.outer_ratio)
    each = ring_integrals(ring.radius_ratio, of_ring, pairs.imag, ring.material.poisson_ratio)
    return RingIntegrals(*np.stack(each)[:, station])
