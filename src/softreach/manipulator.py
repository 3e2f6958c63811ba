"""The design of an arm: a tapered tube, its fibers, and how far each may be activated."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach import cross_section, taper
from softreach.errors import Fault, InvalidDesign, InvalidInput, Range
from softreach.fiber import FiberArchitecture, plain_number, range_faults

__all__ = ["Manipulator", "manipulator_faults"]

Array = NDArray[np.float64]
Bounds = tuple[float, float] | tuple[tuple[float, float], ...]

_RANGES = {
    "length": Range(0.0, unit="m", open_low=True),
    "outer_radius": Range(0.0, unit="m", open_low=True),
    "inner_radius": Range(0.0, unit="m"),
    "taper": Range(-math.pi / 2, math.pi / 2, "rad", open_low=True, open_high=True),
    "poisson_ratio": Range(0.0, 0.5),
}


@dataclass(frozen=True, kw_only=True)
class Manipulator:
    """A slender arm with fibers in a ring, clamped at Z = 0 where its tangent is +z (section 2).

    Values are frozen; `replace` makes a changed copy, which is checked again.

    Raises:
        InvalidDesign: The arm cannot exist; the error names every fault.
    """

    length: float
    """L, from base to tip before activation [m]."""
    outer_radius: float
    """R2(0), outer radius at the base [m]."""
    inner_radius: float
    """R1(0), inner radius of the ring of fibers at the base [m]; R1/R2 is the same all along."""
    taper: float = 0.0
    """φ, taper angle [rad]: R2(Z) = R2(0) - Z tan φ; negative widens toward the tip."""
    poisson_ratio: float = 0.5
    """ν, Poisson's ratio [-]."""
    fibers: tuple[FiberArchitecture, ...]
    """The fiber architectures; activations follow their order, bundle by bundle."""
    activation_bounds: Bounds = (-5 / 3, 0.0)
    """(lower, upper) of γ for every bundle, or one pair per bundle [-]; γ < 0 contracts."""

    def __post_init__(self) -> None:
        if faults := manipulator_faults(vars(self)):
            raise InvalidDesign(faults)
        for field in _RANGES:
            object.__setattr__(self, field, float(plain_number(getattr(self, field))))
        object.__setattr__(self, "fibers", tuple(self.fibers))
        object.__setattr__(self, "activation_bounds", _plain_bounds(self.activation_bounds))
        if faults := list(_extension_faults(self)):
            raise InvalidDesign(faults)

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new design."""
        return replace(self, **changes)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Manipulator:
        """Read a design from a TOML file (lengths in m, angles in degrees).

        Raises:
            InvalidDesign: The file's faults, all of them, in the file's own names and units.
        """
        from softreach.design_file import load_design

        return load_design(path)

    def save(self, path: str | PathLike[str]) -> None:
        """Write the design as a TOML file that `load` reads back to the same value."""
        from softreach.design_file import save_design

        save_design(self, path)

    @property
    def radius_ratio(self) -> float:
        """ρ = R1/R2 [-]."""
        return self.inner_radius / self.outer_radius

    def radius(self, z: ArrayLike) -> Array:
        """R2(Z) [m]."""
        return taper.outer_radius(z, self.outer_radius, self.taper)

    def fiber_angles(self, z: ArrayLike) -> Array:
        """θ_j + Θ(Z): where each bundle is centered at Z [rad], shape (stations, bundles)."""
        turn = taper.rotation_per_tangent(z, self.outer_radius, self.taper)
        winding = np.tan(self.helical_angles)[self.bundle_fiber]
        return self.bundle_angles + np.multiply.outer(turn, winding)

    @property
    def tip_radius(self) -> float:
        """R2(L) [m]."""
        return float(self.radius(self.length))

    @cached_property
    def helical_angles(self) -> Array:
        """α of each architecture [rad], shape (architectures,)."""
        turn = self._rotation_per_tangent
        return np.array([_helical_angle(fiber, turn) for fiber in self.fibers])

    @cached_property
    def revolutions(self) -> Array:
        """Ω = Θ(L) of each architecture [rad], shape (architectures,)."""
        return np.tan(self.helical_angles) * self._rotation_per_tangent

    @property
    def _rotation_per_tangent(self) -> float:
        return float(taper.rotation_per_tangent(self.length, self.outer_radius, self.taper))

    @cached_property
    def bundle_fiber(self) -> NDArray[np.intp]:
        """Index of the architecture that each bundle belongs to, shape (bundles,)."""
        return np.repeat(np.arange(len(self.fibers)), [fiber.bundles for fiber in self.fibers])

    @property
    def bundles(self) -> int:
        """m, number of independently activated bundles."""
        return sum(fiber.bundles for fiber in self.fibers)

    @cached_property
    def bundle_angles(self) -> Array:
        """θ_j = θ0 + 2πj/n at Z = 0 [rad], shape (bundles,)."""
        return np.concatenate(
            [f.offset + 2 * np.pi * np.arange(f.bundles) / f.bundles for f in self.fibers]
        )

    @cached_property
    def bundle_extents(self) -> Array:
        """σ of each bundle [rad], shape (bundles,)."""
        return np.array([fiber.extent for fiber in self.fibers])[self.bundle_fiber]

    @cached_property
    def bundle_names(self) -> tuple[str, ...]:
        """A readable name for each bundle."""
        return tuple(_bundle_names(self.fibers))

    @cached_property
    def bounds(self) -> Array:
        """Lower and upper activation of each bundle [-], shape (bundles, 2)."""
        return np.broadcast_to(np.asarray(self.activation_bounds, float), (self.bundles, 2))

    def check_activations(self, activations: ArrayLike) -> Array:
        """The activations as an (n, bundles) float array.

        Raises:
            InvalidInput: Another shape, or values that are not finite.
        """
        gamma = np.ascontiguousarray(activations, dtype=float)
        if gamma.ndim != 2 or gamma.shape[1] != self.bundles:
            allowed = f"of shape (n, {self.bundles}), one column per bundle"
            raise InvalidInput("activations.shape", gamma.shape, allowed)
        if not np.isfinite(gamma).all():
            row = int(np.flatnonzero(~np.isfinite(gamma).all(axis=1))[0])
            raise InvalidInput(f"activations[{row}]", gamma[row], "finite numbers")
        return gamma


def manipulator_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with the fields of a design; fields that are absent are not judged.

    This serves the constructor and the file reader alike, so that a file with one unreadable key
    still hears of all its other faults.
    """
    faults = range_faults(values, _RANGES)
    blamed = {fault.path for fault in faults}
    sound = {name: values[name] for name in values if name not in blamed}
    faults += _radius_faults(**{name: plain_number(sound.get(name)) for name in _RANGES})
    fiber_trouble = _fibers_faults(sound["fibers"]) if "fibers" in sound else []
    faults += fiber_trouble
    if "activation_bounds" in sound:
        fibers = None if fiber_trouble else sound.get("fibers")
        faults += _bounds_faults(sound["activation_bounds"], fibers)
    return faults


def _radius_faults(
    length: float | None,
    outer_radius: float | None,
    inner_radius: float | None,
    taper: float | None,
    **_: object,
) -> Iterator[Fault]:
    if outer_radius is not None and inner_radius is not None and inner_radius >= outer_radius:
        yield Fault(
            "inner_radius", inner_radius, f"must be below outer_radius = {outer_radius:g} m"
        )
    if length is None or outer_radius is None or taper is None:
        return
    tip = outer_radius - length * math.tan(taper)
    if tip <= 0:
        limit = math.atan(outer_radius / length)
        allowed = f"leaves no tip (R2(L) = {tip:.4g} m)"
        yield Fault("taper", taper, f"{allowed}; must be below {limit:.6g} rad ({_degrees(limit)})")


def _fibers_faults(fibers: Any) -> list[Fault]:
    if not isinstance(fibers, Sequence) or isinstance(fibers, str) or not fibers:
        return [Fault("fibers", fibers, "must be a sequence of one FiberArchitecture or more")]
    strangers = [k for k, fiber in enumerate(fibers) if not isinstance(fiber, FiberArchitecture)]
    if strangers:
        k = strangers[0]
        return [Fault(f"fibers[{k}]", fibers[k], "must be a FiberArchitecture")]
    return []


def _bounds_faults(bounds: Any, fibers: Sequence[FiberArchitecture] | None) -> list[Fault]:
    try:
        pairs = np.asarray(bounds, dtype=float)
    except (TypeError, ValueError):
        pairs = np.empty(0)
    if pairs.shape[-1:] != (2,) or pairs.ndim > 2 or not pairs.size:
        allowed = "must be a pair (lower, upper), or one such pair for each bundle"
        return [Fault("activation_bounds", bounds, allowed)]
    if not np.isfinite(pairs).all():
        return [Fault("activation_bounds", bounds, "must hold finite numbers")]
    if (pairs[..., 0] > pairs[..., 1]).any():
        return [Fault("activation_bounds", bounds, "must have lower <= upper")]
    count = sum(fiber.bundles for fiber in fibers) if fibers else len(pairs)
    if pairs.ndim == 2 and len(pairs) != count:
        allowed = f"must be one pair, or {count} pairs: one for each bundle"
        return [Fault("activation_bounds", bounds, allowed)]
    return []


def _extension_faults(arm: Manipulator) -> Iterator[Fault]:
    """The theory ends where a fiber would shorten the arm to nothing: ζ <= 0."""
    integrals = cross_section.section_integrals(
        arm.radius_ratio, arm.taper, arm.helical_angles[arm.bundle_fiber], arm.poisson_ratio
    )
    z = cross_section.extension_per_activation(integrals.axial, arm.bundle_extents)
    smallest = 1.0 + np.minimum(z * arm.bounds[:, 0], z * arm.bounds[:, 1]).sum()
    if smallest <= 0:
        allowed = f"reaches extension ζ = {smallest:.4g}; must keep ζ > 0: narrow the bounds"
        yield Fault("activation_bounds", arm.activation_bounds, allowed)


def _helical_angle(fiber: FiberArchitecture, rotation_per_tangent: float) -> float:
    if fiber.helical_angle is not None:
        return fiber.helical_angle
    return math.atan((fiber.revolution or 0.0) / rotation_per_tangent)


def _bundle_names(fibers: Sequence[FiberArchitecture]) -> Iterator[str]:
    for k, fiber in enumerate(fibers):
        name = fiber.name or f"fiber {k + 1}"
        if fiber.bundles == 1:
            yield name
        else:
            yield from (f"{name} {j + 1}" for j in range(fiber.bundles))


def _plain_bounds(bounds: ArrayLike) -> Bounds:
    pairs = np.asarray(bounds, float).tolist()
    return tuple(pairs) if np.ndim(pairs) == 1 else tuple(tuple(pair) for pair in pairs)


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.4g}°"
