"""The ring integrals on cones: along an arm whose radius and helical angles change."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softreach.arm.actuators.ring_integrals import RingIntegrals, ring_integrals
from softreach.arm.section import Ring

__all__ = ["cone_integrals"]

Array = NDArray[np.float64]


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
    one = _integrals(ring, pairs[:1])
    return RingIntegrals(*(np.broadcast_to(integral, pairs.shape) for integral in one))


def _integrals(ring: Ring, pairs: NDArray[np.complex128]) -> RingIntegrals:
    """The integrals for pairs of slope (real) and angle (imaginary)."""
    slope = np.arctan(pairs.real * ring.outer_ratio)
    return ring_integrals(ring.radius_ratio, slope, pairs.imag, ring.material.poisson_ratio)
