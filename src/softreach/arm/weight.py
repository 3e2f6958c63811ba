"""What an arm weighs, and how that compares with what bends it."""

from __future__ import annotations

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.errors import InvalidDesign

__all__ = ["GRAVITY", "load_number", "mass"]

GRAVITY = 9.81
"""g, by which load numbers are told [m/s²]."""

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
    """Λ = w L³/(4 K1) with weight per length and bending stiffness at the base [-], theory (79).

    It is ρ g L³/(E R2²) for a solid arm of one material. An upright cylinder buckles under its own
    weight at 1.96.

    Raises:
        InvalidDesign: A layer without a density or Young's modulus.
    """
    base = arm.profile.radius(0.0)
    if faults := arm.section.modulus_faults("where weight counts"):
        raise InvalidDesign(faults)
    weight = GRAVITY * arm.section.mass_per_length(base)
    return float(weight * arm.length**3 / (4.0 * arm.section.stiffness(base).bending))
