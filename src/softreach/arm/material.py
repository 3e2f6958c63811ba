"""What an arm is made of."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Self

from softreach.arm.checks import MATERIAL_RANGES, material_faults
from softreach.arm.variable import Variable
from softreach.support.arguments import plain
from softreach.support.errors import InvalidDesign

__all__ = ["Material"]


@dataclass(frozen=True, kw_only=True)
class Material:
    """An isotropic elastic material.

    While one material fills an arm that only fibers and muscles drive, Young's modulus cancels from
    its shapes and may be left out. Density is needed for weight alone.

    Raises:
        InvalidDesign: A field is out of its range.
    """

    variables: ClassVar[tuple[Variable, ...]] = (
        Variable("young_modulus", "E", "Young's modulus", MATERIAL_RANGES["young_modulus"]),
        Variable("poisson_ratio", "ν", "Poisson's ratio", MATERIAL_RANGES["poisson_ratio"]),
        Variable("density", "ρ", "density", MATERIAL_RANGES["density"]),
    )

    young_modulus: float | None = None
    """E, Young's modulus [Pa]; None where it cancels."""
    poisson_ratio: float = 0.5
    """ν, Poisson's ratio [-]."""
    density: float | None = None
    """ρ, mass per volume [kg/m³]; None where weight plays no part."""
    name: str = ""
    """What files and pictures call it."""

    def __post_init__(self) -> None:
        if faults := material_faults(vars(self)):
            raise InvalidDesign(faults)
        for field in MATERIAL_RANGES:
            if (value := getattr(self, field)) is not None:
                object.__setattr__(self, field, float(plain(value)))

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new one."""
        return replace(self, **changes)

    def same_matter(self, other: Material) -> bool:
        """Whether all but the names are equal."""
        return all(
            getattr(self, field.name) == getattr(other, field.name)
            for field in fields(self)
            if field.name != "name"
        )
