"""Radial integrals of the theory: the load of one fiber on the cross-section that it pulls on.

The paper prints closed forms (Appendix A) that are singular at φ = 0, α = 0 and α = ±φ, need
complex numbers, and hold a misprint in δ3. They are the integrals below, which have none of that:
δ0 = 4 R2² I0, δ1 = δ2 = 6 R2³ I1, δ3 = 6 R2³ I3, theory (12).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.support.arrays import Array

__all__ = ["RingIntegrals", "ring_integrals"]

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


def ring_integrals(
    radius_ratio: ArrayLike, taper: ArrayLike, helical_angle: ArrayLike, poisson_ratio: ArrayLike
) -> RingIntegrals:
    """Integrate fiber contraction over the ring: theory (3), with k and t of (1) and (2).

    Args:
        radius_ratio: ρ = R1/R2 [-]; all four arguments broadcast.
        taper: Taper angle φ [rad].
        helical_angle: Helical angle α at the outer radius, from the axis [rad].
        poisson_ratio: Poisson's ratio ν [-].

    Returns:
        I0, I1, I3 [-], each of the broadcast shape of the arguments.
    """
    ratio, phi, alpha, nu = (
        np.asarray(a, float)[..., None]
        for a in np.broadcast_arrays(radius_ratio, taper, helical_angle, poisson_ratio)
    )
    x, weight = _nodes(ratio, np.abs(np.tan(alpha)))
    cone = 1.0 + (x * np.tan(phi)) ** 2
    helix = 1.0 + (x * np.tan(alpha)) ** 2
    k = (1.0 + nu) / (cone * helix) - nu
    t = x * np.tan(alpha) / (helix * np.sqrt(cone))
    return RingIntegrals(*(np.sum(weight * f, axis=-1) for f in (x * k, x**2 * k, x**2 * t)))


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
