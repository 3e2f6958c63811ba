"""What everything that drives an arm has in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from softreach.arm.profile import Profile
from softreach.arm.section import Section
from softreach.arm.variable import Variable

__all__ = ["Actuator", "Outline", "Resultants", "actuator_kinds"]

Array = NDArray[np.float64]


class Resultants(NamedTuple):
    """The load that one unit of each activation puts on the sections, over Young's modulus."""

    force: Array
    """Axial force N [m²], shape (station, bundle)."""
    moment: Array
    """Moment M about the directors [m³], shape (station, 3, bundle)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Outline:
    """Where bundles lie in the sections, for pictures: a sector of a ring at each station."""

    center: Array
    """Polar angle of the middle of each bundle [rad], shape (station, bundle)."""
    extent: Array
    """Angular extent of each bundle [rad], shape (bundle,)."""
    inner_ratio: Array
    """Inner radius of each bundle over R2 [-], shape (bundle,)."""
    outer_ratio: Array
    """Outer radius of each bundle over R2 [-], shape (bundle,)."""


class Actuator(ABC):
    """Something that loads the sections of an arm in proportion to its activations.

    A new kind is a frozen dataclass that implements this class: nothing else needs to know of it.
    """

    unit: ClassVar[str] = "1"
    """Unit of an activation."""
    variables: ClassVar[tuple[Variable, ...]] = ()
    """Fields that a designer varies, beside the bounds."""
    default_name: ClassVar[str] = "actuator"
    """Name that an arm gives to unnamed ones, followed by a number."""

    name: str
    """What summaries and pictures call it; unique within an arm, which names those without."""
    bundles: int
    """Number of independent activations."""

    @property
    @abstractmethod
    def bounds(self) -> Array:
        """Lower and upper activation of each bundle [unit], shape (bundles, 2)."""

    @abstractmethod
    def with_bounds(self, bounds: Array) -> Self:
        """A copy with other bounds, shape (bundles, 2)."""

    @abstractmethod
    def resultants(self, profile: Profile, section: Section, z: Array) -> Resultants:
        """Axial force and moment on the sections at stations Z [m], per unit of activation."""

    @abstractmethod
    def outline(self, profile: Profile, section: Section, z: Array) -> Outline:
        """Where the bundles lie at stations Z [m]."""

    @property
    def bundle_names(self) -> tuple[str, ...]:
        """A name for each bundle."""
        if self.bundles == 1:
            return (self.name,)
        return tuple(f"{self.name} {k + 1}" for k in range(self.bundles))

    def value_on(self, field: str, profile: Profile, section: Section) -> float:
        """Value of a variable when this actuator drives an arm with this profile and section."""
        del profile, section
        return getattr(self, field)

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new one."""
        return replace(self, **changes)  # pyright: ignore[reportArgumentType]


def actuator_kinds() -> dict[str, type[Actuator]]:
    """Every kind of actuator that has been imported, by the name of its class."""
    return {kind.__name__: kind for kind in Actuator.__subclasses__()}
