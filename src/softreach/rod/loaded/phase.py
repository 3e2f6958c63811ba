"""Phase by which loads let tangents swing or grow along an arm; it bounds the length of steps.

The tangents of theory (68) obey Jacobi's equation: where a force w pushes, they swing like
cos ∫ √(w/K) ds, so that conjugate points are about π of this phase apart; where it pulls, they grow
like cosh of the same.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.loads import Loads
from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import both_sides, ends_over, tables

__all__ = ["SHOT_AT_ONCE", "LoadPhase", "load_phase", "phase_stations"]

Array = NDArray[np.float64]

SHOT_AT_ONCE = 20.0
"""Phase up to which one segment is shot [rad]; e^20 roundings are 1e-7 rad."""
_MOST_PHASE = math.pi / 2.0
_MOST_STEPS = 1 << 16
_STATIONS = 65


class LoadPhase(NamedTuple):
    """Bounds of the phase of the tangents, theory (85)."""

    entire: float
    """Over the entire arm [rad]."""
    steepest: float
    """Over the entire arm, were it everywhere as steep in S as where it is steepest [rad]."""
    squeeze: float
    """The largest force over K0, times the largest η/ζ̂ [-]: from 1 on it could squeeze the arm to
    nothing."""

    stations: Array
    """Z from base to tip [m], shape (station,)."""
    along: Array
    """Phase from the base to there [rad], shape (station,)."""

    def parted(self, count: int) -> Array:
        """Z between so many parts of equal phase [m], from tip to base, shape (count - 1,)."""
        wanted = self.along[-1] * (1.0 - np.arange(1, count) / count)
        return np.interp(wanted, self.along, self.stations)

    @property
    def fewest_steps(self) -> int:
        """Uniform ones in S, of which none makes more than a quarter of a swing.

        Half of what is between conjugate points in a straight arm leaves room for the moment of a
        bent one, which makes the phase at most about √2 as large.
        """
        return max(2, math.ceil(min(self.steepest / _MOST_PHASE, _MOST_STEPS)))


def load_phase(
    arm: Manipulator, loads: Loads, compliance: tuple[Array, Array, Array], mass: Array
) -> LoadPhase:
    """The phase that loads give the tangents at most.

    Its rate is √(w (1 + w/K0)/K + (M/2K)²) ζ̂, with K the smaller of K1 and K3, w and M the sizes of
    all forces and moments beyond, added whatever their directions, and ζ̂ the largest within bounds,
    or η where that is larger.

    Args:
        arm: The design.
        loads: Loads on it.
        compliance: 1/K0 [1/N], 1/K1 and 1/K3 [1/(N m²)] at `phase_stations`.
        mass: Per length there [kg/m].
    """
    z = phase_stations(arm)
    axial, bending, torsion = compliance
    with np.errstate(over="ignore"):
        force, softest = _force(loads, z, mass), np.maximum(bending, torsion)
        swing = force * (1.0 + force * axial) * softest + (0.5 * _moment(loads) * softest) ** 2
        table = tables(arm, z)
        longest, grown = (
            1.0 + ends_over(part, arm.bounds).T
            for part in (table.extension, table.rest_length_factor)
        )
        relative = grown[1] / longest[0] if table.has_forces else 1.0
        squeeze = float((force * axial * relative).max())
        rate = np.maximum(longest[1], grown[1]) * np.sqrt(swing)
    steepest = rate * arm.profile.radius(z) * arm.profile.slender_length  # dZ = R2 dS
    along = np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(z)))
    return LoadPhase(float(along[-1]), float(steepest.max()), squeeze, z, along)


def phase_stations(arm: Manipulator) -> Array:
    """Z [m], even in S, and both sides of every breakpoint."""
    profile = arm.profile
    return both_sides(arm, profile.station(np.linspace(0.0, profile.slender_length, _STATIONS)))


def _force(loads: Loads, z: Array, mass: Array) -> Array:
    """The sizes of all forces beyond each station, added [N]."""
    gravity, at_tip = math.hypot(*loads.gravity), math.hypot(*loads.tip_force)
    per_length = math.hypot(*loads.force_per_length) + mass * gravity
    each = 0.5 * (per_length[1:] + per_length[:-1]) * np.diff(z)
    along = np.append(np.cumsum(each[::-1])[::-1], 0.0)
    points = sum((math.hypot(*load.force) * (load.station >= z) for load in loads.point_loads), 0.0)
    at_tip += math.hypot(*loads.follower_force) + loads.payload * gravity
    return at_tip + along + points


def _moment(loads: Loads) -> float:
    """The sizes of all moments, added, that of the payload on its lever among them [N m]."""
    weight = loads.payload * math.hypot(*loads.gravity)
    moments = [loads.tip_moment, loads.follower_moment]
    moments += [load.moment for load in loads.point_loads]
    return weight * math.hypot(*loads.payload_arm) + sum(math.hypot(*moment) for moment in moments)
