"""Drives: inputs of a user, such as motors and valves, that activate one bundle or several."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from softreach.arm.number import MOST, NamedFloats, Number, as_numbers, is_path_name, number
from softreach.arm.part import Part
from softreach.support.arguments import plain
from softreach.support.arrays import Array
from softreach.support.errors import Fault, Range

if TYPE_CHECKING:
    from softreach.arm.profile import Profile
    from softreach.arm.section import Section

_FINITE = Range(-MOST, MOST)


@dataclass(frozen=True, kw_only=True)
class Drive(Part):
    """An input u that activates bundles: γ = offset + gain dz(u) of each that it names.

    dz(u) = sign(u) max(0, |u| - dead_zone). What several drives give to one bundle is added, and a
    tendon driven by its tension never gets less than 0 N, as it cannot push. So gains +g and -g
    make an antagonistic pair of two tendons from one signed input, with the offset as its
    pretension.

    Raises:
        InvalidDesign: A field is not what it must be.
    """

    name: str
    """Name of the input; unlike those of actuators and bundles."""
    unit: str = "1"
    """Unit of u: "m", "N", "V", "turns", or any other."""
    bounds: tuple[float, float]
    """(lower, upper) of u [unit]."""
    gains: Mapping[str, float]
    """Activation per u of each bundle that it drives [unit of the bundle per unit of u], by the
    bundle's name."""
    offsets: Mapping[str, float] = NamedFloats()
    """Activation of these bundles at u = 0 [unit of the bundle]; 0 where none is given."""
    dead_zone: float = number("u0", "", "largest |u| without effect", low=0.0, default=0.0)
    """Largest |u| that has no effect [unit]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "bounds", tuple(as_numbers(self.bounds).tolist()))
        for field in ("gains", "offsets"):
            object.__setattr__(self, field, NamedFloats(getattr(self, field)))

    def effective(self, u: Array) -> tuple[Array, Array]:
        """dz(u) [unit], and its derivative [-], both of the shape of u."""
        beyond = np.abs(u) - self.dead_zone
        acts = (beyond > 0.0) | (self.dead_zone == 0.0)
        return np.where(acts, np.sign(u) * beyond, 0.0), acts.astype(float)

    @property
    def numbers(self) -> dict[str, Number]:
        """Its numbers, with its bounds, and gain and offset of each of its bundles."""
        declared = {
            "lower": ("min u", "lowest input"),
            "upper": ("max u", "highest input"),
            "gain": ("g", "size of the gains, each of which keeps its sign"),
            **{f"gains[{name}]": ("g", f"gain of {name}") for name in self.gains},
            **{f"offsets[{name}]": ("o", f"offset of {name}") for name in self.offsets},
        }
        return {
            name: Number(field=name, symbol=symbol, meaning=meaning, allowed=_FINITE)
            for name, (symbol, meaning) in declared.items()
        } | super().numbers

    def values_of(self, name: str, profile: Profile, section: Section) -> tuple[float, ...]:
        """NaN for a gain that its bundles do not share."""
        if name == "gain":
            sizes = {abs(gain) for gain in self.gains.values()}
            return (sizes.pop() if len(sizes) == 1 else math.nan,)
        if name in ("lower", "upper"):
            return (self.bounds[name == "upper"],)
        return super().values_of(name, profile, section)

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, or with numbers by the names in `numbers`."""
        if "gain" in changes:
            size, gains = changes.pop("gain"), changes.get("gains", self.gains)
            changes["gains"] = {name: math.copysign(size, gain) for name, gain in gains.items()}
        if changes.keys() & {"lower", "upper"}:
            low, high = changes.get("bounds", self.bounds)
            changes["bounds"] = (changes.pop("lower", low), changes.pop("upper", high))
        return super().replace(**changes)

    def _faults(self) -> list[Fault]:
        faults = super()._faults()
        if isinstance(self.name, str) and not self.name:
            faults.append(Fault("name", self.name, "must not be empty: inputs are called by it"))
        if not isinstance(self.unit, str) or not self.unit:
            faults.append(Fault("unit", self.unit, 'must be text, "1" for none'))
        return [*faults, *self._number_faults()]

    def _number_faults(self) -> Iterator[Fault]:
        pair = as_numbers(self.bounds)
        if pair.shape != (2,) or not (np.abs(pair) <= MOST).all() or pair[0] > pair[1]:
            allowed = f"must be a pair (lower, upper) of numbers up to {MOST:g}, lower <= upper"
            yield Fault("bounds", self.bounds, allowed)
        bundles = self.gains if isinstance(self.gains, Mapping) else self.offsets
        for field in ("gains", "offsets"):
            numbers = getattr(self, field)
            if not isinstance(numbers, Mapping) or (field == "gains" and not numbers):
                yield Fault(field, numbers, "must be a mapping from names of bundles to numbers")
                continue
            for name, value in numbers.items():
                if not _FINITE.admits(plain(value)):
                    yield Fault(f"{field}[{name}]", value, _FINITE)
                elif name not in bundles:
                    yield Fault(f"offsets[{name}]", value, "must be that of a bundle in gains")


def drive_faults(
    drives: Sequence[Drive], actuators: Sequence[str], bundles: Sequence[str]
) -> Iterator[Fault]:
    """Faults of the drives of an arm with these actuators and bundles."""
    taken = [*actuators, *bundles]
    for k, drive in enumerate(drives):
        name = drive.name
        if name in taken:
            yield Fault(f"drives[{k}].name", name, "must be unlike names of other parts")
        elif not is_path_name(name):
            allowed = "must be one line without dots and brackets, and without spaces around it"
            yield Fault(f"drives[{k}].name", name, allowed)
        taken.append(name)
        for bundle in drive.gains:
            if bundle not in bundles:
                allowed = f"must be a bundle of the arm: {', '.join(bundles) or 'it has none'}"
                yield Fault(f"drives[{k}].gains", bundle, allowed)
