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
    pairs, station = np.unique(np.stack([slope, angle], axis=1), axis=0, return_inverse=True)
    integrals = ring_integrals(
        ring.radius_ratio,
        np.arctan(pairs[:, 0] * ring.outer_ratio),
        pairs[:, 1],
        ring.material.poisson_ratio,
    )
    return RingIntegrals(*(integral[station] for integral in integrals))
