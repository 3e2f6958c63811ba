"""The linear taper: outer radius, fiber rotation, and the arclength in which bending is even.

All lengths share one unit; q = Z tan φ / R2(0) is the fraction of the radius lost at Z.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["outer_radius", "rotation_per_tangent", "slender_coordinate", "station_of"]

Array = NDArray[np.float64]


def outer_radius(z: ArrayLike, base_radius: float, taper: float) -> Array:
    """R2(Z) = R2(0) - Z tan φ [m]."""
    return base_radius - np.asarray(z, float) * np.tan(taper)


def slender_coordinate(z: ArrayLike, base_radius: float, taper: float) -> Array:
    """S(Z) = ∫ dZ / R2 from 0 to Z [-]: length counted in local radii.

    In S the bending of each fiber has constant magnitude and rotates at a constant rate, so that
    uniform steps in S share the bending evenly.
    """
    z = np.asarray(z, float)
    return z / base_radius * _relative_log(z * np.tan(taper) / base_radius)


def station_of(s: ArrayLike, base_radius: float, taper: float) -> Array:
    """Z(S) [m], the inverse of `slender_coordinate`: R2(0) (1 - exp(-S tan φ)) / tan φ."""
    s = np.asarray(s, float)
    return base_radius * s * _relative_expm1(-s * np.tan(taper))


def rotation_per_tangent(z: ArrayLike, base_radius: float, taper: float) -> Array:
    """Θ(Z) / tan α [-], the rotation of a fiber of tan α = 1 (Appendix B).

    Equals -log(R2(Z)/R2(0)) / sin φ, written so that φ = 0 needs no case of its own.
    """
    return slender_coordinate(z, base_radius, taper) / np.cos(taper)


def _relative_log(q: Array) -> Array:
    """log(1 - q) / (-q), which is 1 at q = 0."""
    return np.divide(np.log1p(-q), -q, out=np.ones_like(q), where=q != 0)


def _relative_expm1(x: Array) -> Array:
    """(exp(x) - 1) / x, which is 1 at x = 0."""
    return np.divide(np.expm1(x), x, out=np.ones_like(x), where=x != 0)
