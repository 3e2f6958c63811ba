"""What an arm weighs, and how that compares with what bends it."""

from __future__ import annotations

import math

import numpy as np

from softreach.arm.loads import Loads
from softreach.arm.manipulator import Manipulator
from softreach.support.errors import Fault, InvalidDesign

__all__ = [
    "GRAVITY",
    "VERIFIED_LOAD_NUMBER",
    "is_overloaded",
    "load_number",
    "load_number_faults",
    "mass",
]

GRAVITY = 9.81
"""g, by which load numbers are told where no loads act [m/s²]."""

VERIFIED_LOAD_NUMBER = 12.0
"""Largest Λ for which loaded arms were verified over the whole box of activations [-]."""

# Exact for the square of a cubic, which is the mass of a piece of any profile.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)


def mass(arm: Manipulator) -> float:
    """Mass of the whole arm before activation [kg].

    Raises:
        InvalidDesign: A layer without a density.
    """
    ends = np.array([0.0, *arm.profile.breakpoints, arm.length])
    half = 0.5 * np.diff(ends)[:, None]
    z = ends[:-1, None] + half * (1.0 + _NODES)
    per_length = arm.section.mass_per_length(arm.profile.radius(z))
    return float(np.sum(half * _WEIGHTS * per_length))


def load_number(arm: Manipulator) -> float:
    """Λ = (w + P/L) L³/(4 K1), with bending stiffness K1 at the base [-], theory (79).

    Without loads, w is the weight per length at the base under g = 9.81 m/s², and P is 0: Λ is
    ρ g L³/(E R2²) for a solid arm of one material, and an upright cylinder buckles under its own
    weight at 1.96. With loads, w is the weight under their gravity and the force per length beside
    it, P the sum of all other forces, payload included, and of all moments over L. Sizes are added
    whatever their directions, so that Λ bounds what bends the arm.

    Raises:
        InvalidDesign: A layer without Young's modulus, or without a density where it weighs.
    """
    base = arm.profile.radius(0.0)
    if faults := load_number_faults(arm):
        raise InvalidDesign(faults)
    per_length, force = (_own_weight(arm), 0.0) if arm.loads is None else _of_loads(arm, arm.loads)
    stiffness = arm.section.stiffness(base).bending
    return float((per_length + force / arm.length) * arm.length**3 / (4.0 * stiffness))


def is_overloaded(arm: Manipulator) -> bool:
    """Whether the load number is above what was verified, by more than rounding.

    Raises:
        InvalidDesign: A layer without Young's modulus, or without a density where it weighs.
    """
    return load_number(arm) > VERIFIED_LOAD_NUMBER * (1 + 1e-9)


def load_number_faults(arm: Manipulator) -> list[Fault]:
    """What keeps the load number from being known."""
    faults = arm.section.modulus_faults("where weight counts")
    weighs = arm.loads is None or any(arm.loads.gravity)
    return faults + (arm.section.density_faults("where weight counts") if weighs else [])


def _own_weight(arm: Manipulator, gravity: float = GRAVITY) -> float:
    """Weight per length at the base [N/m]."""
    return gravity * float(arm.section.mass_per_length(arm.profile.radius(0.0)))


def _of_loads(arm: Manipulator, loads: Loads) -> tuple[float, float]:
    """Force per length at the base [N/m], and other forces with moments over the length [N]."""
    gravity = math.hypot(*loads.gravity)
    payload = loads.payload * gravity
    per_length = math.hypot(*loads.force_per_length)
    per_length += _own_weight(arm, gravity) if gravity else 0.0
    force = payload + math.hypot(*loads.tip_force) + math.hypot(*loads.follower_force)
    moment = payload * math.hypot(*loads.payload_arm)
    moment += math.hypot(*loads.tip_moment) + math.hypot(*loads.follower_moment)
    for one in loads.point_loads:
        force += math.hypot(*one.force)
        moment += math.hypot(*one.moment)
    return per_length, force + moment / arm.length
