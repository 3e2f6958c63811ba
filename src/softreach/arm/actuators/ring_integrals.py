"""What one fiber does to the cross-section that it pulls on: the theory's radial integrals.

The paper prints closed forms (Appendix A) that are singular at φ = 0, α = 0 and α = ±φ, need
complex numbers, and hold a misprint in δ3. They are the integrals below, which have none of that:
δ0 = 4 R2² I0, δ1 = δ2 = 6 R2³ I1, δ3 = 6 R2³ I3, theory (12).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["RingIntegrals", "ring_integrals"]

# Enough for machine precision while x tan(α) stays below 100 or so (|α| < 89°), any ring.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(48)


class RingIntegrals(NamedTuple):
    """Integrals over the ring x = R/R2 in [ρ, 1] [-], theory (3)."""

    axial: NDArray[np.float64]
    """I0 = ∫ x k dx."""
    bending: NDArray[np.float64]
    """I1 = ∫ x² k dx."""
    torsion: NDArray[np.float64]
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
    half = 0.5 * (1.0 - ratio)
    x = ratio + half * (1.0 + _NODES)
    cone = 1.0 + (x * np.tan(phi)) ** 2
    helix = 1.0 + (x * np.tan(alpha)) ** 2
    k = (1.0 + nu) / (cone * helix) - nu
    t = x * np.tan(alpha) / (helix * np.sqrt(cone))
    return RingIntegrals(
        *(np.sum(half * _WEIGHTS * f, axis=-1) for f in (x * k, x**2 * k, x**2 * t))
    )
