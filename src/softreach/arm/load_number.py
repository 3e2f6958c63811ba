"""Mass of an arm, and Λ: how much its loads bend it."""

from __future__ import annotations

from softreach.arm.loads import GRAVITY, Loads
from softreach.arm.manipulator import Manipulator
from softreach.arm.scale import body_mass
from softreach.support.errors import Fault, InvalidDesign

__all__ = ["VERIFIED_LOAD_NUMBER", "is_overloaded", "load_number", "load_number_faults", "mass"]

VERIFIED_LOAD_NUMBER = 12.0
"""Largest Λ for which loaded arms were verified over the whole box of activations [-]."""


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
