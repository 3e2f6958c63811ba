"""What everything that drives an arm has in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.actuator_checks import actuator_faults
from softreach.arm.profile import Profile
from softreach.arm.section import Section
from softreach.arm.variable import Variable
from softreach.support.arguments import plain
from softreach.support.errors import Fault, InvalidDesign, Range

__all__ = ["STRETCH", "Actuator", "Bounds", "Outline", "Resultants", "actuator_kinds"]

Array = NDArray[np.float64]
Bounds = tuple[float, float] | tuple[tuple[float, float], ...]

STRETCH = (
    Variable("start_over_length", "Z0/L", "where it begins to act", Range(0, 1, open_high=True)),
    Variable("end_over_length", "Z1/L", "where it ends to act", Range(0, 1, open_low=True)),
)


class Resultants(NamedTuple):
    """The load that one unit of each activation puts on the sections.

    Both are divided by Young's modulus where the section leaves that out.
    """

    force: Array
    """Axial force N [N], shape (station, bundle)."""
    moment: Array
    """Moment M about the directors [N m], shape (station, 3, bundle)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Outline:
    """Where bundles lie in the sections, for pictures."""

    center: Array
    """Polar angle of the middle of each bundle [rad], shape (station, bundle)."""
    extent: Array
    """Angular extent of each bundle [rad], shape (bundle,); 0 for a line."""
    inner_ratio: Array
    """Inner radius of each bundle over R2 [-], shape (station, bundle)."""
    outer_ratio: Array
    """Outer radius of each bundle over R2 [-], shape (station, bundle)."""
    shape: tuple[str, ...]
    """"sector" of a ring, "line" along the arm, or round "lumen", for each bundle."""
    acts: NDArray[np.bool_]
    """Where along the arm each bundle acts, shape (station, bundle)."""

    @classmethod
    def empty(cls, stations: int) -> Outline:
        """The outline of a passive rod at so many stations."""
        nowhere = np.empty((stations, 0))
        return cls(
            center=nowhere,
            extent=np.empty(0),
            inner_ratio=nowhere,
            outer_ratio=nowhere,
            shape=(),
            acts=np.empty((stations, 0), bool),
        )


@dataclass(frozen=True, kw_only=True)
class Actuator(ABC):
    """Something that loads the sections of an arm in proportion to its activations.

    A new kind is a frozen dataclass that inherits these fields and implements `resultants` and
    `outline`: nothing else needs to know of it.

    Raises:
        InvalidDesign: A field is out of its range.
    """

    unit: ClassVar[str] = "1"
    """Unit of an activation: "1", "N" or "Pa"."""
    symbol: ClassVar[str] = "γ"
    """What formulas call an activation."""
    variables: ClassVar[tuple[Variable, ...]] = STRETCH
    """Fields that a designer varies, beside the bounds."""
    series: ClassVar[tuple[Variable, ...]] = ()
    """Further fields, that only functions along the arm can be given for."""
    default_name: ClassVar[str] = "actuator"
    """Name that an arm gives to unnamed ones, followed by a number."""
    validity: ClassVar[str] = ""
    """Where the linear law of this kind ends, in a sentence."""

    name: str = ""
    """What summaries and pictures call it; unique within an arm, which names those without."""
    bundles: int = 1
    """n, number of independent activations [-]."""
    activation_bounds: Bounds
    """(lower, upper) activation of every bundle, or one pair per bundle [unit]."""
    start_over_length: float = 0.0
    """Z0/L, where along the arm it begins to act [-]."""
    end_over_length: float = 1.0
    """Z1/L, where it ends to act [-]."""

    def __post_init__(self) -> None:
        if faults := self._faults():
            raise InvalidDesign(faults)
        for variable in self.variables:
            number = plain(getattr(self, variable.field))
            object.__setattr__(self, variable.field, number)
        object.__setattr__(self, "activation_bounds", _plain_bounds(self.activation_bounds))

    @abstractmethod
    def resultants(self, profile: Profile, section: Section, z: Array) -> Resultants:
        """Axial force and moment on sections at stations Z [m] where it acts, per activation."""

    @abstractmethod
    def outline(self, profile: Profile, section: Section, z: Array) -> Outline:
        """Where the bundles lie at stations Z [m]."""

    @property
    def course(self) -> str:
        """How what contracts runs within a bundle, for pictures.

        "along" it, "right-handed" or "left-handed" across it, or "radial".
        """
        return "along"

    @property
    def bounds(self) -> Array:
        """Lower and upper activation of each bundle [unit], shape (bundles, 2)."""
        return np.broadcast_to(np.asarray(self.activation_bounds, float), (self.bundles, 2))

    def with_bounds(self, bounds: ArrayLike) -> Self:
        """A copy with other bounds [unit], shape (bundles, 2)."""
        return self.replace(activation_bounds=bounds)

    @property
    def bundle_names(self) -> tuple[str, ...]:
        """A name for each bundle."""
        if self.bundles == 1:
            return (self.name,)
        return tuple(f"{self.name} {k + 1}" for k in range(self.bundles))

    def breakpoints(self, profile: Profile) -> tuple[float, ...]:
        """Stations inside (0, L) where its load jumps or is not smooth [m]."""
        ends = (self.start_over_length, self.end_over_length)
        return tuple(profile.length * x for x in ends if 0.0 < x < 1.0)

    def acts(self, profile: Profile, z: Array) -> NDArray[np.bool_]:
        """Whether it acts at stations Z [m]; at the end of its stretch it does not, but at a tip.

        Returns:
            Shape (station, bundle).
        """
        start, end = (profile.length * x for x in (self.start_over_length, self.end_over_length))
        inside = (z >= start) & ((z < end) | (self.end_over_length == 1.0))
        return np.broadcast_to(inside[:, None], (len(z), self.bundles))

    def section_faults(self, profile: Profile, section: Section) -> list[Fault]:
        """What keeps it from driving an arm with this profile and section."""
        del profile, section
        return []

    def value_on(self, field: str, profile: Profile, section: Section) -> Any:
        """Value of a variable when this actuator drives an arm with this profile and section."""
        del profile, section
        return getattr(self, field)

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new one."""
        return replace(self, **changes)

    def _faults(self) -> list[Fault]:
        """Everything wrong with its fields; kinds add their own."""
        return actuator_faults(vars(self))

    def _starts(self) -> Array:
        """Angles from the first bundle to each, evenly around [rad], shape (bundle,)."""
        return 2.0 * np.pi * np.arange(self.bundles) / self.bundles


def actuator_kinds() -> dict[str, type[Actuator]]:
    """Every kind of actuator that has been imported and can be made, by the name of its class."""
    return {kind.__name__: kind for kind in _kinds(Actuator) if not kind.__abstractmethods__}


def _kinds(of: type[Actuator]) -> list[type[Actuator]]:
    direct = of.__subclasses__()
    return direct + [kind for one in direct for kind in _kinds(one)]


def _plain_bounds(bounds: ArrayLike) -> Bounds:
    """One pair where all bundles share it, else one for each."""
    pairs = [(low, high) for low, high in np.atleast_2d(np.asarray(bounds, float)).tolist()]
    return pairs[0] if all(pair == pairs[0] for pair in pairs) else tuple(pairs)
