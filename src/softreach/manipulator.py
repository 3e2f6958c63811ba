"""The design of an arm: a tapered tube, its fibers, and how far each may be activated."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from os import PathLike, fspath
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach import cross_section, design_file, taper
from softreach.atomic import replacing
from softreach.checks import ARM_RANGES, arm_faults, plain_number
from softreach.errors import Fault, InvalidDesign, InvalidInput
from softreach.fiber import FiberArchitecture
from softreach.split import split_fiber

__all__ = ["Manipulator"]

Array = NDArray[np.float64]
Bounds = tuple[float, float] | tuple[tuple[float, float], ...]


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
        if faults := _faults(self):
            raise InvalidDesign(faults)
        for field in ARM_RANGES:
            object.__setattr__(self, field, float(plain_number(getattr(self, field))))
        object.__setattr__(self, "fibers", tuple(self.fibers))
        object.__setattr__(self, "activation_bounds", _plain_bounds(self.activation_bounds))
        if faults := list(_extension_faults(self)):
            raise InvalidDesign(faults)

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new design."""
        return replace(self, **changes)

    def split(self, fiber: str | int, count: int, *, keep_extent: bool = True) -> Self:
        """Replace an architecture of one bundle by `count` independent ones beside each other.

        They are spread evenly about the center of the original, one extent apart, and wind as it
        does. Splitting the longitudinal fiber of `designs.minimal_trunk` in two gives
        `designs.redundant_trunk`. Overlap is not checked: fibers of different architectures
        may cross anyway.

        Args:
            fiber: Name or index of the architecture.
            count: How many shall take its place; 1 leaves the design as it is.
            keep_extent: True gives each the extent σ of the original, False its share σ / count, so
                that together they fill the sector of the original.

        Returns:
            The new design; the parts are named "NAME 1", "NAME 2", ..., and each has the activation
            bounds of the original.

        Raises:
            InvalidInput: No such architecture, one of several bundles, or a count below 1.
            InvalidDesign: The parts do not fit on the arm, such as a reachable extension of zero.
        """
        fibers, repeats = split_fiber(self.fibers, fiber, count, keep_extent)
        bounds = self.activation_bounds
        if np.ndim(bounds) == 2:
            bounds = _plain_bounds(np.repeat(self.bounds, repeats, axis=0))
        return self.replace(fibers=fibers, activation_bounds=bounds)

    @classmethod
    def from_toml(cls, text: str, source: str = "design") -> Self:
        """A design from the text of a file; `source` is what errors call it.

        Raises:
            InvalidDesign: The text's faults, all of them, in the file's own names and units.
        """
        values = design_file.parse(text, source)
        try:
            fibers = tuple(FiberArchitecture(**fiber) for fiber in values.pop("fibers"))
            return cls(fibers=fibers, **values)
        except InvalidDesign as error:
            raise design_file.in_file_terms(error, source) from None

    def to_toml(self) -> str:
        """The design as the text of a file, from which `from_toml` makes an equal one."""
        return design_file.render(asdict(self))

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Self:
        """Read a design file (TOML, lengths in m, angles in degrees).

        Raises:
            InvalidDesign: The file's faults, all of them, in the file's own names and units.
            OSError: The file cannot be read.
        """
        return cls.from_toml(Path(path).read_text(encoding="utf-8"), source=fspath(path))

    def save(self, path: str | PathLike[str]) -> None:
        """Write a design file; an older one is replaced whole."""
        with replacing(path) as partial:
            partial.write_text(self.to_toml(), encoding="utf-8")

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
        if gamma.size and not np.isfinite([gamma.min(), gamma.max()]).all():
            row = int(np.flatnonzero(~np.isfinite(gamma).all(axis=1))[0])
            raise InvalidInput(f"activations[{row}]", gamma[row], "finite numbers")
        return gamma


def _faults(arm: Manipulator) -> list[Fault]:
    """Everything wrong with the fields of an arm."""
    trouble = _fibers_faults(arm.fibers)
    bundles = None if trouble else sum(fiber.bundles for fiber in arm.fibers)
    return trouble + arm_faults(vars(arm), bundles)


def _fibers_faults(fibers: Any) -> list[Fault]:
    if not isinstance(fibers, Sequence) or isinstance(fibers, str) or not fibers:
        return [Fault("fibers", fibers, "must be a sequence of one FiberArchitecture or more")]
    strangers = [k for k, fiber in enumerate(fibers) if not isinstance(fiber, FiberArchitecture)]
    if strangers:
        k = strangers[0]
        return [Fault(f"fibers[{k}]", fibers[k], "must be a FiberArchitecture")]
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
