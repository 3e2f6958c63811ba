"""From a design to the two tables that everything downstream sees: ζ = 1 + z·γ and u = Uγ.

The map is linear in the activations (section 2). All physics lives here: a new kind of actuator
changes these tables, and nothing that reads them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.cross_section import extension_per_activation, section_integrals
from softreach.manipulator import Manipulator

__all__ = ["Actuation", "actuation", "curvature_range", "extension_range"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Actuation:
    """The response of an arm at given stations per unit of activation of each bundle."""

    stations: Array
    """Z [m], shape (station,)."""
    extension: Array
    """z = dζ/dγ [-], shape (station, fiber)."""
    curvature: Array
    """U = du/dγ [1/m], per activated arclength, in the directors, shape (station, 3, fiber)."""


def actuation(arm: Manipulator, stations: ArrayLike) -> Actuation:
    """Evaluate the actuation map of `arm` (section 2, the equations of ζ and u).

    Args:
        arm: The design.
        stations: Z [m], shape (station,).
    """
    z = np.atleast_1d(np.asarray(stations, float))
    fiber, extent = arm.bundle_fiber, arm.bundle_extents
    integrals = section_integrals(
        arm.radius_ratio, arm.taper, arm.helical_angles, arm.poisson_ratio
    )
    axial, bending, torsion = (values[fiber] for values in integrals)
    radius = arm.radius(z)[:, None]
    theta = arm.fiber_angles(z)

    # A fiber of extent σ pulls with the mean of cos and sin over it: 2 sin(σ/2)/π (a1, b1).
    bend = 4.0 * bending / radius * (2.0 * np.sin(extent / 2.0) / np.pi)
    twist = 4.0 * (1.0 + arm.poisson_ratio) * torsion / radius * (extent / np.pi)
    curvature = np.stack([bend * np.sin(theta), -bend * np.cos(theta), twist], axis=1)

    extension = np.broadcast_to(extension_per_activation(axial, extent), theta.shape)
    return Actuation(z, np.ascontiguousarray(extension), curvature)


def extension_range(arm: Manipulator, stations: int = 101) -> tuple[float, float]:
    """Smallest and largest ζ anywhere in the activation box and along the arm [-]."""
    z = actuation(arm, np.linspace(0.0, arm.length, stations)).extension
    ends = z[..., None] * arm.bounds
    return 1.0 + float(ends.min(-1).sum(-1).min()), 1.0 + float(ends.max(-1).sum(-1).max())


def curvature_range(arm: Manipulator, stations: int = 101) -> tuple[Array, Array]:
    """The largest bending √(u1² + u2²) that the activation box reaches, along the arm.

    Bending is convex in γ, so its maximum lies at a corner of the box; with many bundles the
    corners are searched along directions instead, which is exact for the polygon they form.

    Returns:
        Stations Z [m] and the largest bending there [1/m], each of shape (station,).
    """
    table = actuation(arm, np.linspace(0.0, arm.length, stations))
    plane = table.curvature[:, :2]
    # The reachable (u1, u2) are a zonogon; its farthest vertex maximises some direction's support.
    heading = np.linspace(0.0, 2.0 * np.pi, 1440, endpoint=False)
    along = np.einsum("hc,scf->shf", np.stack([np.cos(heading), np.sin(heading)], 1), plane)
    best = np.where(along > 0, arm.bounds[:, 1], arm.bounds[:, 0])
    reached = np.einsum("scf,shf->shc", plane, best)
    return table.stations, np.linalg.norm(reached, axis=-1).max(axis=1)
