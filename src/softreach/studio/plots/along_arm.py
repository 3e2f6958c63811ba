"""Curvature and strain along an arm in one activation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.studio.state import solvable_rod

__all__ = ["AlongArm", "along_arm"]

Array = NDArray[np.float64]

_STATIONS = 121


class AlongArm(NamedTuple):
    """Values at stations along the arm."""

    station: Array
    """Z [L]."""
    bending: Array
    """√(u₁² + u₂²) times L [-]."""
    torsion: Array
    """u₃ times L [-]."""
    extension: Array
    """ζ [-]."""

    @property
    def known(self) -> bool:
        """Whether the arm has an equilibrium in this activation."""
        return bool(np.isfinite(self.extension).all())


def along_arm(arm: Manipulator, activation: Sequence[float]) -> AlongArm:
    """What an activation does to an arm, station by station.

    Raises:
        InvalidInput: Loads that cannot be computed.
    """
    z = np.linspace(0.0, 1.0, _STATIONS)
    curvature, extension = solvable_rod(arm).strains_at(z * arm.length)([list(activation)])
    u1, u2, u3 = curvature[0].T * arm.length
    return AlongArm(z, np.hypot(u1, u2), u3, extension[0])
