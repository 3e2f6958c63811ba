"""The linear law of tendons, and how far it is from the follower load.

N = -τ t3 and M = -p × τ t with the tangent t of the rod at rest, ζ = 1 + N/K0, ω = K⁻¹ M. The
tendon of the bent rod has b = p' + ω × p + ζ e3 instead of p' + e3: the bend, of the curvature κ,
shortens it by κρt, the thrust by 1 - ζ, the twist turns it by ω3 ρt. For the slope β = atan(ρt θ')
of the tendon they together turn its tangent by

    δβ = sin β cos β (κρt + (1 - ζ) - κρt K1/K3) = κρt sin β cos β ((R/2ρt)² - ν),

the last for a solid rod of the radius R, to first order. The linear law is wrong by the part
δβ tan β of bending and extension and by δβ / tan β of twist, thus of order κρt, second order in the
tension. A parallel tendon does not turn: for it the linear law is that of the follower load.
"""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from tests.oracles.tendon_rod import Rod, Shape, Tendon, follower_shape

Array = NDArray[np.float64]


class Deviation(NamedTuple):
    """How far the linear law is from the follower load."""

    bend: float
    """Largest κρt along the rod, κ per length of the bent rod [-]."""
    tip: float
    """Distance of the tips over L [-]."""
    relative: float
    """Distance of the tips over what the tip moves [-]."""


def linear_strains(rod: Rod, tendons: Sequence[Tendon], z: float) -> Array:
    """(ω, ζ) by the linear law."""
    *bending, axial = (k(z) for k in rod.stiffness)
    force, moment = 0.0, np.zeros(3)
    for tendon in tendons:
        if z <= tendon.anchor:
            p, dp, _ = tendon.at(z)
            t = dp + [0.0, 0.0, 1.0]
            t /= np.linalg.norm(t)
            force -= tendon.tension * t[2]
            moment -= np.cross(p, tendon.tension * t)
    return np.append(moment / bending, 1 + force / axial)


def linear_shape(rod: Rod, tendons: Sequence[Tendon], stations: ArrayLike) -> Shape:
    """The rod with the strains of the linear law."""
    ends = sorted({0.0, rod.length, *(tendon.anchor for tendon in tendons)})
    return shape_of(lambda z: linear_strains(rod, tendons, z), ends, stations)


def shape_of(
    strains: Callable[[float], Array], ends: Sequence[float], stations: ArrayLike
) -> Shape:
    """The rod with given strains (ω, ζ), smooth between the ends of pieces."""

    def rates(z: float, y: Array) -> Array:
        e, directors = strains(z), y[3:].reshape(3, 3)
        turned = np.cross(e[:3] @ directors, directors)
        return np.concatenate([e[3] * directors[2], turned.ravel()])

    z = np.asarray(stations, float)
    states = np.empty((12, len(z)))
    state = np.concatenate([np.zeros(3), np.eye(3).ravel()])
    for low, high in pairwise(ends):
        # a station at the break takes its strains from below: stop short of it by rounding
        walk = solve_ivp(
            rates,
            (np.nextafter(low, high) if low else low, high),
            state,
            method="DOP853",
            dense_output=True,
            rtol=1e-11,
            atol=1e-13,
        )
        inside, state = (z >= low) & (z <= high), walk.y[:, -1]
        if inside.any():
            states[:, inside] = walk.sol(z[inside])
    along = np.array([strains(station) for station in z])
    return Shape(states[:3].T, states[3:].T.reshape(-1, 3, 3), along[:, 3], along[:, :3])


def linear_law_deviation(rod: Rod, tendons: Sequence[Tendon], *, stations: int = 33) -> Deviation:
    """How far the linear law is from the follower load for tendons on a rod."""
    z = np.linspace(0.0, rod.length, stations)
    exact = follower_shape(rod, tendons, z)
    linear = linear_shape(rod, tendons, z)
    kappa = np.linalg.norm(exact.curvature[:, :2], axis=1) / exact.extension
    radius = np.max([np.broadcast_to(tendon.radius(z), z.shape) for tendon in tendons], axis=0)
    miss = np.linalg.norm(exact.place[-1] - linear.place[-1])
    moved = np.linalg.norm(exact.place[-1] - [0.0, 0.0, rod.length])
    return Deviation(float((kappa * radius).max()), float(miss / rod.length), float(miss / moved))
