"""Scale of an arm: its mass, Λ, how much its loads bend it, and lengths in another unit."""

from __future__ import annotations

import numpy as np

from softreach.arm.body import Body
from softreach.arm.loads import GRAVITY, Loads
from softreach.support.errors import Fault, InvalidDesign

__all__ = [
    "VERIFIED_LOAD_NUMBER",
    "is_overloaded",
    "load_number",
    "load_number_faults",
    "mass",
    "scale_warnings",
]

VERIFIED_LOAD_NUMBER = 12.0
"""Largest Λ for which loaded arms were verified over the whole box of activations [-]."""


_LONG = 10.0
"""Length from which mm may be meant [m]."""
_SLENDER = 5.0
"""Least L/R2(0) of a slender arm [-]."""
_WIDE = 1.0
"""Outer radius from which mm may be meant [m]."""

# Exact for the square of a cubic, which is the mass of a piece of any profile.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)


def mass(arm: Body) -> float:
    """Mass of the arm [kg].

    Raises:
        InvalidDesign: A layer without a density.
    """
    inside = (arm.length * x for x in arm.section.breaks)
    ends = np.array(sorted({0.0, *arm.profile.breakpoints, *inside, arm.length}))
    half = 0.5 * np.diff(ends)[:, None]
    z = ends[:-1, None] + half * (1.0 + _NODES)
    per_length = arm.section.mass_per_length_at(arm.profile, z)
    return float(np.sum(half * _WEIGHTS * per_length))


def load_number(arm: Body) -> float:
    """Λ = (w + P/L) L³/(4 K1), with bending stiffness K1 at the base [-], theory (79).

    Without loads, w is the weight per length at the base under g = 9.81 m/s², and P is 0: Λ is
    ρ g L³/(E R2²) for a solid arm of one material, and an upright cylinder buckles under its own
    weight at 1.96. With loads, w is the weight under their gravity and the force per length beside
    it, P the sum of all other forces, payload included, and of all moments over L. Sizes are added
    whatever their directions, so that Λ bounds what bends the arm.

    Raises:
        InvalidDesign: A layer without Young's modulus, or without a density where it weighs.
    """
    if faults := load_number_faults(arm):
        raise InvalidDesign(faults)
    own = Loads(gravity=(0.0, 0.0, -GRAVITY))
    per_length, force = (arm.loads or own).sizes(arm.section, arm.profile)
    stiffness = arm.section.stiffness_at(arm.profile, 0.0).bending
    return float((per_length + force / arm.length) * arm.length**3 / (4.0 * stiffness))


def is_overloaded(arm: Body) -> bool:
    """The load number is above what was verified, by more than rounding.

    Raises:
        InvalidDesign: A layer without Young's modulus, or without a density where it weighs.
    """
    return load_number(arm) > VERIFIED_LOAD_NUMBER * (1 + 1e-9)


def load_number_faults(arm: Body) -> list[Fault]:
    """Faults that keep the load number from being known."""
    faults = arm.section.modulus_faults("where weight counts")
    weighs = arm.loads is None or any(arm.loads.gravity)
    return faults + (arm.section.density_faults("where weight counts") if weighs else [])


def scale_warnings(arm: Body) -> tuple[str, ...]:
    """One line for a length that looks like one in mm, and one for an arm that is not slender."""
    length, radius = arm.length, float(arm.profile.radius(0.0))
    warnings: list[str] = []
    if length >= _LONG:
        known = not arm.section.density_faults("")
        heavy = f" and weighs {mass(arm):.3g} kg" if known else ""
        warnings.append(
            f"the arm is {length:g} m long{heavy}; if that is meant in mm: lengths are in m, "
            f"{length:g} mm are {length / 1e3:g}"
        )
    if (slenderness := length / radius) < _SLENDER:
        meant = f"lengths are in m, {radius:g} mm are {radius / 1e3:g}"
        cause = f"if that is meant in mm: {meant}" if radius >= _WIDE else "is it a diameter?"
        warnings.append(
            f"the arm is {slenderness:.3g} times as long as its outer radius at the base, "
            f"{radius:g} m, and the theory is one of slender arms, {_SLENDER:g} times or more; "
            f"{cause}"
        )
    return tuple(warnings)
