"""From a design to the two tables that everything downstream sees: ζ = 1 + z·γ and u = Uγ.

The map is linear in the activations, theory (7). All physics lives in this room: a new actuator,
profile or material changes these tables, and nothing that reads them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator
from softreach.errors import Fault, InvalidDesign

__all__ = ["Tables", "check_extension", "extension_range", "tables"]

Array = NDArray[np.float64]

_STATIONS = 101


@dataclass(frozen=True, eq=False)
class Tables:
    """The response of an arm at given stations per unit of activation of each bundle."""

    stations: Array
    """Z [m], shape (station,)."""
    extension: Array
    """z = dζ/dγ [-], shape (station, bundle)."""
    curvature: Array
    """U = du/dγ [1/m], per activated arclength, in the directors, shape (station, 3, bundle)."""


def tables(arm: Manipulator, stations: ArrayLike) -> Tables:
    """z = N/K0 and U = K⁻¹M of every actuator: theory (6), which for fibers is (8) to (10).

    Args:
        arm: The design.
        stations: Z [m], shape (station,).
    """
    z = np.atleast_1d(np.asarray(stations, float))
    loads = [actuator.resultants(arm.profile, arm.section, z) for actuator in arm.actuators]
    stiffness = arm.section.stiffness(arm.profile.radius(z))
    resistance = np.stack([stiffness.bending, stiffness.bending, stiffness.torsion], axis=1)
    return Tables(
        z,
        np.concatenate([load.force for load in loads], axis=1) / stiffness.axial[:, None],
        np.concatenate([load.moment for load in loads], axis=2) / resistance[..., None],
    )


def check_extension(arm: Manipulator) -> None:
    """The theory ends where an activation would shorten the arm to nothing.

    Raises:
        InvalidDesign: ζ <= 0 somewhere in the activation box and along the arm.
    """
    smallest, _ = extension_range(arm)
    if smallest <= 0:
        allowed = f"reaches extension ζ = {smallest:.4g}; must keep ζ > 0: narrow the bounds"
        raise InvalidDesign([Fault("activation_bounds", arm.bounds.tolist(), allowed)])


def extension_range(arm: Manipulator) -> tuple[float, float]:
    """Smallest and largest ζ anywhere in the activation box and along the arm [-]."""
    ends = tables(arm, _stations(arm)).extension[..., None] * arm.bounds
    return 1.0 + float(ends.min(-1).sum(-1).min()), 1.0 + float(ends.max(-1).sum(-1).max())


def _stations(arm: Manipulator) -> Array:
    """Even stations, and those where the profile breaks."""
    even = np.linspace(0.0, arm.length, _STATIONS)
    return np.union1d(even, arm.profile.breakpoints) if arm.profile.breakpoints else even
