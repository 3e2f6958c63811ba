"""Scale of an arm: its mass and load number, and warnings of a length in another unit."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from softreach.arm.loads import GRAVITY, Loads
from softreach.arm.profile import Profile
from softreach.arm.section import Section
from softreach.support.errors import Fault, InvalidDesign

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator

__all__ = [
    "VERIFIED_LOAD_NUMBER",
    "body_mass",
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


def body_mass(profile: Profile, section: Section) -> float:
    """Mass of the body of an arm [kg].

    Raises:
        InvalidDesign: A layer without a density.
    """
    ends = {0.0, *profile.breakpoints, profile.length}
    ends.update(profile.length * x for x in section.breaks)
    ends = np.array(sorted(ends))
    half = 0.5 * np.diff(ends)[:, None]
    z = ends[:-1, None] + half * (1.0 + _NODES)
    per_length = section.mass_per_length_at(profile, z)
    return float(np.sum(half * _WEIGHTS * per_length))


def scale_warnings(profile: Profile, section: Section) -> tuple[str, ...]:
    """One line for a length that looks like one in mm, and one for an arm that is not slender."""
    return (*_long(profile, section), *_stout(profile))


def _long(profile: Profile, section: Section) -> Iterator[str]:
    length = profile.length
    if length >= _LONG:
        known = not section.density_faults("")
        heavy = f" and weighs {body_mass(profile, section):.3g} kg" if known else ""
        yield (
            f"the arm is {length:g} m long{heavy}; if that is meant in mm: lengths are in m, "
            f"{length:g} mm are {length / 1e3:g}"
        )


def _stout(profile: Profile) -> Iterator[str]:
    radius = float(profile.radius(0.0))
    slenderness = profile.length / radius
    if slenderness < _SLENDER:
        meant = f"lengths are in m, {radius:g} mm are {radius / 1e3:g}"
        cause = f"if that is meant in mm: {meant}" if radius >= _WIDE else "is it a diameter?"
        yield (
            f"the arm is {slenderness:.3g} times as long as its outer radius at the base, "
            f"{radius:g} m, and the theory is one of slender arms, {_SLENDER:g} times or more; "
            f"{cause}"
        )


def mass(arm: Manipulator) -> float:
    """Mass of the arm [kg].

    Raises:
        InvalidDesign: A layer without a density.
    """
    return body_mass(arm.profile, arm.section)


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
    if faults := load_number_faults(arm):
        raise InvalidDesign(faults)
    own = Loads(gravity=(0.0, 0.0, -GRAVITY))
    per_length, force = (arm.loads or own).sizes(arm.section, arm.profile)
    stiffness = arm.section.stiffness_at(arm.profile, 0.0).bending
    return float((per_length + force / arm.length) * arm.length**3 / (4.0 * stiffness))


def is_overloaded(arm: Manipulator) -> bool:
    """The load number is above what was verified, by more than rounding.

    Raises:
        InvalidDesign: A layer without Young's modulus, or without a density where it weighs.
    """
    return load_number(arm) > VERIFIED_LOAD_NUMBER * (1 + 1e-9)


def load_number_faults(arm: Manipulator) -> list[Fault]:
    """Faults that keep the load number from being known."""
    faults = arm.section.modulus_faults("where weight counts")
    weighs = arm.loads is None or any(arm.loads.gravity)
    return faults + (arm.section.density_faults("where weight counts") if weighs else [])
