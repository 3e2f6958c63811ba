"""Base of all actuators: names, bundles, bounds, where along the arm they act."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np

from softreach.arm.number import MOST, Number, as_numbers, fields_of, number
from softreach.arm.part import AlongArm
from softreach.arm.profile import Profile
from softreach.arm.section import Section
from softreach.arm.stations import Span
from softreach.support.arrays import Array, Mask, read_only
from softreach.support.errors import Fault, InvalidDesign, Range

Bounds = tuple[float, float] | tuple[tuple[float, float], ...]

MOST_TURN = 200 * math.pi
"""A hundred turns [rad]: steps along the arm grow with them, and with a thousand no tolerance is
met."""

MOST_BUNDLES = 100  # Of an arm in all: the time to bound its bending grows with their square


_BOUND = re.compile(r"(lower|upper)(?:\[(\d+)\])?")


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
    """Places of bundles in the sections, for pictures."""

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
    acts: Mask
    """Stations at which each bundle acts, shape (station, bundle)."""
    disk_ratio: Array | None = None
    """Radius of disks that hold lines over R2 [-], shape (station, bundle); None: as of lines."""

    @property
    def held_ratio(self) -> Array:
        """Radius within which each bundle and what holds it lie, over R2 [-], (station, bundle)."""
        return self.outer_ratio if self.disk_ratio is None else self.disk_ratio

    @property
    def middle_ratio(self) -> Array:
        """Radius of the middle line of each bundle over R2 [-], shape (station, bundle)."""
        return 0.5 * (self.inner_ratio + self.outer_ratio)


@cache
def _each_bundle(kind: type) -> Mapping[str, Number]:
    """Numbers of a kind of actuator that each bundle may have by itself."""
    return {field: number for field, number in fields_of(kind).items() if number.each}


@dataclass(frozen=True, kw_only=True)
class Actuator(Span, ABC):
    """Something that loads the sections of an arm in proportion to its activations.

    A new kind is a frozen dataclass that inherits these fields and implements `resultants` and
    `outline`: nothing else needs to know of it.

    Raises:
        InvalidDesign: A field is out of its range.
    """

    unit: ClassVar[str] = "1"
    """Unit of an activation: "1", "N" or "Pa"."""
    symbol: ClassVar[str] = "γ"
    """Symbol of an activation in formulas."""
    activation: ClassVar[str] = "activation"
    """Quantity that an activation is."""
    is_force: ClassVar[bool] = False
    """True if it loads matter and leaves its length at rest, per which curvature then counts.

    Tendons and chambers do; fibers and muscles change that length, and curvature with it: (7).
    """
    default_name: ClassVar[str] = "actuator"
    """Name that an arm gives to unnamed ones, followed by a number."""
    validity: ClassVar[str] = ""
    """Limit of the linear law of this kind, in a sentence."""

    name: str = ""
    """Name in summaries and pictures; unique within an arm, which names those without."""
    bundles: int = number(
        "n", "", "number of bundles", low=1, high=MOST_BUNDLES, integer=True, default=1
    )
    """n, number of independent activations [-]."""
    activation_bounds: Bounds
    """(lower, upper) activation of every bundle, or one pair per bundle [unit]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        pairs = np.atleast_2d(np.asarray(self.activation_bounds, float)).tolist()
        bounds = [(low, high) for low, high in pairs]
        bounds = bounds[0] if all(pair == bounds[0] for pair in bounds) else tuple(bounds)
        object.__setattr__(self, "activation_bounds", bounds)
        for field in _each_bundle(type(self)):  # one for all, where that says the same
            values = getattr(self, field)
            if isinstance(values, tuple) and self._spread(field, values[0]) == values:
                object.__setattr__(self, field, values[0])

    @property
    def numbers(self) -> dict[str, Number]:
        """Its numbers, those of bundles, and bounds: `lower` of all, `lower[1]` of one."""
        allowed = Range(unit="" if self.unit == "1" else self.unit)
        bundles = ["", *(f"[{k}]" for k in range(self.bundles))] if self.bundles > 1 else [""]
        ends = ("lower", "min", "lowest activation"), ("upper", "max", "highest activation")
        numbers = super().numbers
        for field, own in _each_bundle(type(self)).items() if self.bundles > 1 else ():
            numbers |= own.elements(self.of_bundles(field))
        return numbers | {
            f"{end}{k}": Number(symbol=f"{short} {self.symbol}{k}", meaning=about, allowed=allowed)
            for end, short, about in ends
            for k in bundles
        }

    def values_of(self, name: str, profile: Profile, section: Section) -> tuple[float, ...]:
        """A number of all bundles in each."""
        field, _, k = name.removesuffix("]").partition("[")
        if field in _each_bundle(type(self)) and (k or isinstance(getattr(self, field), tuple)):
            return (self.of_bundles(field)[int(k)],) if k else self.of_bundles(field)
        if not (bound := _BOUND.fullmatch(name)):
            return super().values_of(name, profile, section)
        each = self.bounds[:, int(bound[1] == "upper")].tolist()
        return tuple(each) if bound[2] is None else (each[int(bound[2])],)

    def replace(self, **changes: Any) -> Self:
        """With bounds: other bundles keep theirs, or have the first's if their number changes.

        Raises:
            InvalidDesign: A bound of a bundle that there is none of, or a field is not what it
                must be.
        """
        new = {name: changes.pop(name) for name in sorted(changes) if _BOUND.fullmatch(name)}
        bundles = changes.get("bundles", self.bundles)
        if new and isinstance(bundles, int) and bundles > 0:
            same = bundles == self.bundles
            bounds = self.bounds.copy() if same else self.bounds[:1].repeat(bundles, axis=0)
            for name, value in new.items():  # `lower` before `lower[1]`
                end, k = _BOUND.fullmatch(name).groups()  # pyright: ignore
                if k is not None and int(k) >= bundles:
                    allowed = f"has no bundle, as their number becomes {bundles}"
                    raise InvalidDesign([Fault(name, value, allowed)])
                bounds[slice(None) if k is None else int(k), int(end == "upper")] = value
            changes["activation_bounds"] = tuple(map(tuple, bounds.tolist()))
        for field in _each_bundle(type(self)):
            if any(name.startswith(f"{field}[") for name in changes):
                given = changes.get(field, getattr(self, field))
                changes[field] = given if isinstance(given, tuple) else self._spread(field, given)
        return super().replace(**changes)

    def of_bundles(self, field: str) -> tuple[float, ...]:
        """Values of a number for each bundle, whether it is one for all or one for each."""
        given = getattr(self, field)
        return given if isinstance(given, tuple) else self._spread(field, given)

    def _spread(self, field: str, value: float) -> tuple[float, ...]:
        """Values for each bundle by one for all."""
        return (value,) * self.bundles

    @abstractmethod
    def resultants(self, profile: Profile, section: Section, z: Array) -> Resultants:
        """Axial force and moment on sections at stations Z [m] where it acts, per activation."""

    @abstractmethod
    def outline(self, profile: Profile, section: Section, z: Array) -> Outline:
        """Places of the bundles at stations Z [m]."""

    @property
    def fiber_direction(self) -> str:
        """Direction of contraction within a bundle, for pictures.

        "along" it, "right-handed" or "left-handed" across it, or "radial".
        """
        return "along"

    def disk_stations(self, profile: Profile) -> tuple[float, ...]:
        """Z of the disks that hold it [m]; none where it follows the arm."""
        return ()

    @property
    def bounds(self) -> Array:
        """Lower and upper activation of each bundle [unit], shape (bundles, 2)."""
        return np.broadcast_to(np.asarray(self.activation_bounds, float), (self.bundles, 2))

    @property
    def bundle_names(self) -> tuple[str, ...]:
        """A name for each bundle."""
        if self.bundles == 1:
            return (self.name,)
        return tuple(f"{self.name} {k + 1}" for k in range(self.bundles))

    def breakpoints(self, profile: Profile) -> tuple[float, ...]:
        """Stations inside (0, L) where its load jumps or is not smooth [m]."""
        places = [*self.span(profile.length), *[profile.length * x for x in self.breaks]]
        return tuple([z for z in places if 0.0 < z < profile.length])

    def acts(self, profile: Profile, z: Array) -> Mask:
        """Stations Z [m] at which it acts: its end is not among them, but for the tip of the arm.

        Returns:
            Shape (station, bundle).
        """
        start, end = self.span(profile.length)
        inside = (z >= start) & ((z < end) | (end >= profile.length))
        return np.broadcast_to(inside[:, None], (len(z), self.bundles))

    def section_faults(self, profile: Profile, section: Section) -> list[Fault]:
        """Faults that keep it from driving an arm with this profile and section."""
        return []

    def _faults(self) -> list[Fault]:
        faults = super()._faults()
        bundles = None if any(fault.path == "bundles" for fault in faults) else self.bundles
        blamed = {fault.path.partition("[")[0] for fault in faults}
        for field in _each_bundle(type(self)).keys() - blamed if bundles else ():
            given, allowed = getattr(self, field), f"must be one number, or {bundles}, one a bundle"
            if as_numbers(given).shape not in ((), (bundles,)):
                faults.append(Fault(field, given, allowed))
        return faults + bounds_faults(self.activation_bounds, bundles)


@dataclass(frozen=True, kw_only=True)
class PolarActuator(Actuator):
    """An actuator whose bundles stand evenly around the axis."""

    offset: float | tuple[float, ...] = number(
        "θ0", "rad", "polar angle of the first bundle", each=True, default=0.0
    )
    """θ0, polar angle of the first bundle where it begins [rad]; the others stand evenly, counted
    toward larger angles. Or the angle of each bundle, in any order."""

    @property
    def start_angles(self) -> Array:
        """θ0 + 2πj/n, polar angle of each bundle where it begins [rad], (bundle,), read-only."""
        return read_only(np.array(self.of_bundles("offset")))

    def _spread(self, field: str, value: float) -> tuple[float, ...]:
        turn = 2.0 * np.pi * np.arange(self.bundles) / self.bundles
        return tuple((value + turn * (field == "offset")).tolist())

    def length_along(self, field: str, profile: Profile, z: Array) -> tuple[Array, Array]:
        """A length [m] and its slope [-] at Z, under FIELD, or over R2(Z) under FIELD_ratio."""
        length, ratio = getattr(self, field), getattr(self, f"{field}_ratio")
        if ratio is not None:
            return ratio * profile.radius(z), -ratio * profile.slope(z)
        if isinstance(length, AlongArm):
            x = z / profile.length
            return length(x), length.derivative(x) / profile.length
        if isinstance(length, tuple):
            (first, last), (start, end) = length, self.span(profile.length)
            slope = (last - first) / (end - start)
            return first + slope * (np.clip(z, start, end) - start), np.full(z.shape, slope)
        return np.full(z.shape, length), np.zeros(z.shape)


def bounds_faults(bounds: Any, bundles: int | None) -> list[Fault]:
    """Everything wrong with a pair (lower, upper), or one for each bundle, if we know how many."""
    pairs, allowed = as_numbers(bounds), ""
    if pairs.shape[-1:] != (2,) or pairs.ndim > 2 or not pairs.size:
        allowed = "must be a pair (lower, upper), or one such pair for each bundle"
    elif not (np.abs(pairs) <= MOST).all():
        allowed = f"must hold finite numbers up to {MOST:g}"
    elif (pairs[..., 0] > pairs[..., 1]).any():
        allowed = "must have lower <= upper"
    elif pairs.ndim == 2 and bundles is not None and len(pairs) != bundles:
        several = f", or {bundles} pairs: one for each bundle" if bundles > 1 else ""
        allowed = f"must be one pair{several}"
    return [Fault("activation_bounds", bounds, allowed)] if allowed else []
