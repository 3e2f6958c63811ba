"""How fibers wind: from helical angles along the arm to their rotation about its axis."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.along import AlongArm, Pieces
from softreach.arm.profile import Profile

__all__ = ["helical_rotation"]

Array = NDArray[np.float64]

# Enough for machine precision between two samples of an angle.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


def helical_rotation(
    profile: Profile, ratio: float, angle: float | AlongArm, start: float, z: ArrayLike
) -> Array:
    """Θ(Z) = ∫ tan α(Z)/(R cos φ) dZ from `start` to Z [rad]: theory (50).

    Args:
        profile: R2(Z).
        ratio: R/R2 of the cone on which α is measured [-].
        angle: α, constant or along the arm [rad].
        start: Where the fiber begins [m].
        z: Stations Z [m], any shape.
    """
    z = np.asarray(z, float)
    if isinstance(angle, AlongArm):
        turned = _rotation_from_base(profile, ratio, angle, np.append(z, start))
        return turned[:-1].reshape(z.shape) - turned[-1]
    turned = profile.surface_coordinate(z, ratio)
    if start > 0.0:
        turned = turned - profile.surface_coordinate(start, ratio)
    return turned * np.tan(angle)


def _rotation_from_base(profile: Profile, ratio: float, angle: AlongArm, z: Array) -> Array:
    """Θ from the base, summed over the pieces on which profile and angle are smooth."""
    breaks = [profile.length * x for x in angle.breaks]
    knots = np.union1d([0.0, *breaks, profile.length], profile.breakpoints)
    knots = knots[np.append(np.diff(knots) > 1e-14 * profile.length, True)]
    gap = _constant_gap if isinstance(angle, Pieces) else _smooth_gap
    whole = gap(profile, ratio, angle, knots[:-1], knots[1:])
    before = np.concatenate([[0.0], np.cumsum(whole)])
    piece = np.clip(np.searchsorted(knots, z, "right") - 1, 0, len(knots) - 2)
    return before[piece] + gap(profile, ratio, angle, knots[piece], z)


def _constant_gap(
    profile: Profile, ratio: float, angle: AlongArm, start: Array, end: Array
) -> Array:
    """Over stretches that share one angle each, which begin at `start`."""
    along = profile.surface_coordinate(end, ratio) - profile.surface_coordinate(start, ratio)
    return along * np.tan(angle((start + 1e-13 * profile.length) / profile.length))


def _smooth_gap(profile: Profile, ratio: float, angle: AlongArm, start: Array, end: Array) -> Array:
    """By Gauss quadrature."""
    half = 0.5 * (end - start)[..., None]
    z = start[..., None] + half * (1.0 + _NODES)
    secant = np.hypot(1.0, ratio * profile.slope(z)) / (ratio * profile.radius(z))
    return np.sum(half * _WEIGHTS * np.tan(angle(z / profile.length)) * secant, axis=-1)
