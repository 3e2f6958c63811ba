"""The cross-section: what it is made of, and how stiff that makes it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.checks import MATERIAL_RANGES, plain_number, range_faults, ring_faults
from softreach.errors import Fault, InvalidDesign

__all__ = ["Material", "Ring", "Section", "Stiffness"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Material:
    """An isotropic elastic material.

    One material fills the arm, so that Young's modulus cancels and is not asked for.

    Raises:
        InvalidDesign: A field is out of its range.
    """

    poisson_ratio: float = 0.5
    """ν, Poisson's ratio [-]."""

    def __post_init__(self) -> None:
        if faults := range_faults(vars(self), MATERIAL_RANGES):
            raise InvalidDesign(faults)
        object.__setattr__(self, "poisson_ratio", float(plain_number(self.poisson_ratio)))


@dataclass(frozen=True, kw_only=True)
class Ring:
    """The layer between two radii that actuators live in; its radii keep their ratio to R2(Z).

    Raises:
        InvalidDesign: No ring is left between the ratios.
    """

    inner_ratio: float
    """R1/R2, inner radius of the ring over the outer radius of the arm [-]."""
    outer_ratio: float = 1.0
    """Outer radius of the ring over the outer radius of the arm [-]."""
    material: Material = Material()
    """What the ring is made of."""

    def __post_init__(self) -> None:
        faults = ring_faults(vars(self))
        if not isinstance(self.material, Material):
            faults.append(Fault("material", self.material, "must be a Material"))
        if faults:
            raise InvalidDesign(faults)
        for field in ("inner_ratio", "outer_ratio"):
            object.__setattr__(self, field, float(plain_number(getattr(self, field))))

    @property
    def radius_ratio(self) -> float:
        """ρ, inner over outer radius of the ring itself [-]."""
        return self.inner_ratio / self.outer_ratio


class Stiffness(NamedTuple):
    """What a section resists with, over Young's modulus, one value for each station."""

    axial: Array
    """K0/E [m²]."""
    bending: Array
    """K1/E = K2/E [m⁴]."""
    torsion: Array
    """K3/E [m⁴]."""


@dataclass(frozen=True, kw_only=True)
class Section:
    """A core and the ring around it, of one material.

    Raises:
        InvalidDesign: Not exactly one ring, or one that does not reach the surface of the arm.
    """

    rings: tuple[Ring, ...]
    """The ring of actuators; the core inside it is of the same material."""

    def __post_init__(self) -> None:
        rings = tuple(self.rings) if isinstance(self.rings, tuple | list) else ()
        if len(rings) != 1 or not isinstance(rings[0], Ring):
            raise InvalidDesign([Fault("section.rings", self.rings, "must hold one Ring")])
        object.__setattr__(self, "rings", rings)
        if self.rings[0].outer_ratio != 1.0:
            fault = Fault("section.rings[0].outer_ratio", self.rings[0].outer_ratio, "must be 1")
            raise InvalidDesign([fault])

    def with_inner(self, ratio: float) -> Section:
        """A copy whose ring begins at another share R1/R2 of the outer radius [-]."""
        return Section(rings=(replace(self.rings[0], inner_ratio=ratio),))

    def stiffness(self, radius: ArrayLike) -> Stiffness:
        """K0 = π R2², K1 = (π/4) R2⁴, K3 = K1/(1 + ν), all over E, at R2 [m]: theory (5)."""
        outer = np.asarray(radius, float)
        bending = np.pi / 4 * outer**4
        poisson = self.rings[0].material.poisson_ratio
        return Stiffness(np.pi * outer**2, bending, bending / (1 + poisson))
