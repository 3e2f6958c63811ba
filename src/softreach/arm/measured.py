"""Stiffnesses and mass per length that a laboratory measured on an arm."""

from __future__ import annotations

from dataclasses import dataclass

from softreach.arm.along import AlongArm
from softreach.arm.number import number
from softreach.arm.part import Part

__all__ = ["Measured"]


@dataclass(frozen=True, kw_only=True)
class Measured(Part):
    """Measured numbers of the sections of an arm, in place of what follows from its materials.

    Each is a number for all of the arm, or a function along it; None follows from the materials.

    Raises:
        InvalidDesign: A number out of its range.
    """

    axial_stiffness: float | AlongArm | None = number(
        "K0", "N", "axial stiffness", low=0.0, open_low=True, along=AlongArm, default=None
    )
    """K0 [N]."""
    bending_stiffness: float | AlongArm | None = number(
        "K1", "N m²", "bending stiffness", low=0.0, open_low=True, along=AlongArm, default=None
    )
    """K1 = K2 [N m²]."""
    torsion_stiffness: float | AlongArm | None = number(
        "K3", "N m²", "torsional stiffness", low=0.0, open_low=True, along=AlongArm, default=None
    )
    """K3 [N m²]."""
    mass_per_length: float | AlongArm | None = number(
        "μ", "kg/m", "mass per length", low=0.0, along=AlongArm, default=None
    )
    """μ, before activation [kg/m]."""

    @property
    def stiffnesses(self) -> tuple[float | AlongArm | None, ...]:
        """K0, K1 and K3, each None where it was not measured."""
        return self.axial_stiffness, self.bending_stiffness, self.torsion_stiffness

    @property
    def breaks(self) -> tuple[float, ...]:
        """Z/L inside (0, 1) where one of them is not smooth."""
        values = (*self.stiffnesses, self.mass_per_length)
        return tuple(x for value in values if isinstance(value, AlongArm) for x in value.breaks)
