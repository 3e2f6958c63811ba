"""Bundles that fill sectors of a ring and contract it: fibers and muscles."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from softreach.arm.actuators.actuator import Bounds, Outline, PolarActuator, Resultants
from softreach.arm.actuators.ring_integrals import RingIntegrals, ring_integrals
from softreach.arm.number import number
from softreach.arm.profile import Profile
from softreach.arm.section import Ring, Section
from softreach.support.arrays import Array
from softreach.support.errors import Fault, InvalidDesign, InvalidInput

__all__ = ["SectorActuator", "cone_integrals", "ring_name_faults"]


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
    def integrals(self, profile: Profile, section: Section, z: Array) -> RingIntegrals:
        """I0, I1, I3 at stations Z [m], each of shape (station,): theory (3)."""

    @abstractmethod
    def rotation(self, profile: Profile, section: Section, z: Array) -> Array:
        """Θ(Z) [rad]: how far the sectors have turned at stations Z [m] from where they begin."""

    def resultants(self, profile: Profile, section: Section, z: Array) -> Resultants:
        """N = E R2² I0 σ and M = E R2³ (I1 a sin θ, -I1 a cos θ, I3 σ), a = 2 sin(σ/2): theory (4).

        R2 and E are the outer radius and Young's modulus of the ring.
        """
        ring = section.ring(self.ring)
        radius, scale = profile.radius(z) * ring.outer_ratio, np.pi * ring.modulus
        axial, bending, torsion = self.integrals(profile, section, z)
        theta = self.angles(profile, section, z)
        share, mean = self.extent / np.pi, 2.0 * np.sin(self.extent / 2.0) / np.pi
        bend = (scale * radius**3 * bending * mean)[:, None]
        twist = (scale * radius**3 * torsion * share)[:, None]
        moment = [bend * np.sin(theta), -bend * np.cos(theta), np.broadcast_to(twist, theta.shape)]
        force = (scale * radius**2 * axial * share)[:, None]
        return Resultants(np.broadcast_to(force, theta.shape), np.stack(moment, axis=1))

    def outline(self, profile: Profile, section: Section, z: Array) -> Outline:
        ring, each = section.ring(self.ring), np.ones(self.bundles)
        center = self.angles(profile, section, z)
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
        del profile
        try:
            index = section.ring_index(self.ring)
        except InvalidDesign as error:
            return list(error.faults)
        known = section.rings[index].material.young_modulus is not None
        if known or not section.has_measured_stiffness:
            return []
        allowed = f"must be given in Pa for {self.name!r}, which acts on measured stiffnesses"
        return [Fault(f"rings[{index}].material.young_modulus", None, allowed)]

    def angles(self, profile: Profile, section: Section, z: Array) -> Array:
        """θ0 + 2πj/n + Θ(Z) [rad], shape (station, bundle): theory (11)."""
        return self.start_angles + self.rotation(profile, section, z)[:, None]

    def split(self, count: int, *, keep_extent: bool = True) -> tuple[Self, ...]:
        """Several actuators of one bundle in place of this one, evenly about its center.

        Args:
            count: Number of actuators.
            keep_extent: True gives each the extent σ of the original, one extent apart; False its
                share σ / count, so that together they fill the sector of the original.

        Returns:
            The parts, named "NAME 1", "NAME 2", ...; they have the winding and the bounds of the
            original.

        Raises:
            InvalidInput: Several bundles, which are independent already, or a count below 1.
        """
        if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
            raise InvalidInput("count", count, "a whole number >= 1")
        if self.bundles != 1:
            hint = "its bundles are independent already"
            raise InvalidInput(f"{self.name}.bundles", self.bundles, "1 to be split", hint)
        if count == 1:
            return (self,)
        extent = self.extent if keep_extent else self.extent / int(count)
        names = [f"{self.name} {k + 1}" if self.name else "" for k in range(count)]
        places = [self.offset + (k - (int(count) - 1) / 2) * extent for k in range(count)]
        same = zip(names, places, strict=True)
        return tuple(self.replace(name=name, offset=x, extent=extent) for name, x in same)

    def _faults(self) -> list[Fault]:
        return super()._faults() + ring_name_faults(self.ring)


def ring_name_faults(ring: Any) -> list[Fault]:
    """A fault for what is neither index nor name of a ring."""
    index = isinstance(ring, int) and not isinstance(ring, bool) and ring >= 0
    if index or isinstance(ring, str):
        return []
    return [Fault("ring", ring, "must be the index, from 0, or the name of a ring")]


def cone_integrals(ring: Ring, slope: Array, angle: Array) -> RingIntegrals:
    """I0, I1, I3 of one ring at stations, each pair of slope and angle integrated once.

    Args:
        ring: The ring.
        slope: tan φ of the arm's surface, shape (station,); that of the ring is in proportion.
        angle: α at the outer radius of the ring [rad], shape (station,).
    """
    pairs = slope + 1j * angle
    if not (len(pairs) and (pairs == pairs[0]).all()):
        pairs, station = np.unique(pairs, return_inverse=True)
        return RingIntegrals(*(integral[station] for integral in _integrals(ring, pairs)))
    single = _integrals(ring, pairs[:1])
    return RingIntegrals(*(np.broadcast_to(integral, pairs.shape) for integral in single))


def _integrals(ring: Ring, pairs: NDArray[np.complex128]) -> RingIntegrals:
    """The integrals for pairs of slope (real) and angle (imaginary)."""
    slope = np.arctan(pairs.real * ring.outer_ratio)
    return ring_integrals(ring.radius_ratio, slope, pairs.imag, ring.material.poisson_ratio)
