"""Frames and strains of rods at stations, and how their tips move with the activations."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Frames", "StrainRange", "Strains", "TipMotions", "position_slopes"]

Array = NDArray[np.float64]


class Frames(NamedTuple):
    """Rods in space, at stations."""

    position: Array
    """Centerline r [m], shape (n, station, 3)."""
    directors: Array
    """d1, d2, d3 as rows, shape (n, station, 3, 3)."""


class Strains(NamedTuple):
    """How rods are deformed, at stations."""

    curvature: Array
    """u in the directors, per unit of activated arclength [1/m], shape (n, station, 3)."""
    extension: Array
    """ζ [-], shape (n, station)."""


class TipMotions(NamedTuple):
    """Where tips are and point, and how both change with each activation."""

    tips: Array
    """r [m], shape (n, 3)."""
    slopes: Array
    """∂r/∂γ [m], shape (n, 3, bundles)."""
    directions: Array
    """Tangents d3 [-], shape (n, 3)."""
    rotations: Array
    """ω [rad], shape (n, 3, bundles): ∂d3/∂γ = ω × d3."""


class StrainRange(NamedTuple):
    """Ranges of the strains within the activation box, shape (station, 2) each."""

    bending: Array
    """√(u1² + u2²) [1/m], from 0 to an upper bound at most 1e-5 too large."""
    torsion: Array
    """u3 [1/m]."""
    extension: Array
    """ζ [-]."""


def position_slopes(tips: Array, twists: Array, slopes: Array) -> None:
    """Put ∂r/∂γ = v + ω × r (n, 3, bundles) into place, from tips and spatial twists (v, ω)."""
    v, w = twists[:, :3], twists[:, 3:]
    slopes[:] = v
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        slopes[:, i] += w[:, j] * tips[:, k, None] - w[:, k] * tips[:, j, None]
