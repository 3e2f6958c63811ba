"""The design of an arm: its profile, its section, and what drives it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from os import PathLike, fspath
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm import file
from softreach.arm.actuator_checks import bounds_faults
from softreach.arm.actuators import Actuator, FiberArchitecture, Outline, SectorActuator
from softreach.arm.checks import tube_faults
from softreach.arm.loads import Loads
from softreach.arm.material import Material
from softreach.arm.part_checks import fit_faults, kind_faults, named, part_faults, shared_names
from softreach.arm.profile import LinearTaper, Profile
from softreach.arm.section import Ring, Section
from softreach.support.arguments import as_given, checked, flag, instance, path, text, whole
from softreach.support.arrays import as_stations
from softreach.support.errors import InvalidDesign, InvalidInput
from softreach.support.files.atomic import writing

__all__ = ["Manipulator", "a_manipulator"]

Array = NDArray[np.float64]

_NAMES = 6  # of bundles that `repr` lists


@dataclass(frozen=True, kw_only=True, repr=False)
class Manipulator:
    """A slender arm with actuators, clamped at Z = 0 where its tangent is +z (section 2).

    Values are frozen; `replace` makes a changed copy, which is checked again. What a design does is
    computed elsewhere: by `arm.tables` and everything after it.

    Raises:
        InvalidDesign: The arm cannot exist; the error names every fault.
    """

    profile: Profile
    """R2(Z), the outer radius along the arm, and its length."""
    section: Section
    """The core and the ring of actuators, in proportion to R2(Z)."""
    actuators: tuple[Actuator, ...]
    """What drives the arm; activations follow their order, bundle by bundle. Empty for a passive
    rod."""
    loads: Loads | None = None
    """What acts on the arm beside them; None for nothing, not even its weight."""

    def __post_init__(self) -> None:
        if faults := list(part_faults(self)):
            raise InvalidDesign(faults)
        object.__setattr__(self, "actuators", tuple(named(self.actuators)))
        if faults := list(shared_names(self)) or list(fit_faults(self)):
            raise InvalidDesign(faults)

    @classmethod
    def tapered(
        cls,
        *,
        length: float,
        outer_radius: float,
        inner_radius: float,
        taper: float = 0.0,
        poisson_ratio: float = 0.5,
        young_modulus: float | None = None,
        density: float | None = None,
        actuators: Sequence[Actuator],
        activation_bounds: ArrayLike | None = None,
    ) -> Self:
        """A tapered tube of one material with fibers in its outer ring: the arm of the paper.

        Args:
            length: L [m].
            outer_radius: R2(0), at the base [m].
            inner_radius: R1(0), where the ring of fibers begins, at the base [m]; R1/R2 is the same
                all along.
            taper: φ, taper angle [rad].
            poisson_ratio: ν [-].
            young_modulus: E [Pa]; None where it cancels: nothing weighs and only fibers or muscles
                act.
            density: ρ [kg/m³]; None where nothing weighs.
            actuators: What drives the arm.
            activation_bounds: (lower, upper) of γ for every bundle, or one pair per bundle [-];
                None for their own.

        Raises:
            InvalidDesign: The arm cannot exist; the error names every fault.
        """
        values = {name: value for name, value in locals().items() if name != "cls"}
        faults = list(kind_faults(actuators))
        bundles = None if faults else sum(actuator.bundles for actuator in actuators)
        if faults := tube_faults(values, bundles) + faults:
            raise InvalidDesign(faults)
        material = Material(
            young_modulus=young_modulus, poisson_ratio=poisson_ratio, density=density
        )
        ring = Ring(inner_ratio=inner_radius / outer_radius, material=material)
        arm = cls(
            profile=LinearTaper(length=length, outer_radius=outer_radius, taper=taper),
            section=Section(rings=(ring,)),
            actuators=tuple(actuators),
        )
        return arm if activation_bounds is None else arm.with_bounds(activation_bounds)

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new design."""
        return replace(self, **changes)

    def with_bounds(self, activation_bounds: ArrayLike) -> Self:
        """A copy with other activation bounds.

        Args:
            activation_bounds: (lower, upper) for every bundle, or one such pair per bundle.

        Raises:
            InvalidDesign: Not pairs, the wrong number of them, or lower above upper bounds.
        """
        if faults := bounds_faults(activation_bounds, self.bundles):
            raise InvalidDesign(faults)
        pairs = np.broadcast_to(np.asarray(activation_bounds, float), (self.bundles, 2))
        ends = np.cumsum([actuator.bundles for actuator in self.actuators], dtype=int)
        parts = zip(self.actuators, np.split(pairs, ends)[:-1], strict=True)
        return self.replace(actuators=tuple(one.with_bounds(part) for one, part in parts))

    @checked(count=whole(1, 1000), keep_extent=flag)
    def split(self, fiber: str | int, count: int, *, keep_extent: bool = True) -> Self:
        """Replace an architecture of one bundle by `count` independent ones beside each other.

        They are spread evenly about the center of the original, one extent apart, and wind as it
        does. Splitting the longitudinal fiber of `designs.minimal_trunk` in two gives
        `designs.redundant_trunk`. Overlap is not checked: fibers of different architectures
        may cross anyway.

        Args:
            fiber: Name or index of the architecture.
            count: How many take its place; 1 leaves the design as it is.
            keep_extent: True gives each the extent σ of the original, False its share σ / count, so
                that together they fill the sector of the original.

        Returns:
            The new design; the parts are named "NAME 1", "NAME 2", ..., and each has the activation
            bounds of the original.

        Raises:
            InvalidInput: No such architecture, one of several bundles, or a count below 1.
        """
        index = self._fiber_index(fiber)
        whole = self.actuators[index]
        assert isinstance(whole, SectorActuator)
        parts = whole.split(count, keep_extent=keep_extent)
        return self.replace(
            actuators=(*self.actuators[:index], *parts, *self.actuators[index + 1 :])
        )

    @classmethod
    @checked(text=text, source=text)
    def from_toml(cls, text: str, source: str = "design") -> Self:
        """A design from the text of a file; `source` is what errors call it.

        Raises:
            InvalidDesign: The text's faults, all of them, in the file's own names and units.
        """
        parts = file.parse(text, source)
        try:
            arm = cls(
                profile=parts.profile,
                section=parts.section,
                actuators=parts.actuators,
                loads=parts.loads,
            )
            return arm if parts.bounds is None else arm.with_bounds(parts.bounds)
        except InvalidDesign as error:
            raise file.in_file_terms(error, source) from None

    def to_toml(self) -> str:
        """The design as the text of a file, from which `from_toml` makes an equal one.

        Raises:
            InvalidDesign: A profile or an actuator of one's own that no table can describe.
        """
        return file.render(self.profile, self.section, self.actuators, self.loads)

    @classmethod
    @checked(path=path)
    def load(cls, path: str | PathLike[str]) -> Self:
        """Read a design file (TOML, lengths in m, angles in degrees).

        Raises:
            InvalidDesign: The file's faults, all of them, in the file's own names and units.
            InvalidInput: No file that can be read, or no text in UTF-8.
        """
        return cls.from_toml(file.text_of(path), source=fspath(path))

    @checked(path=path, overwrite=flag)
    def save(self, path: str | PathLike[str], *, overwrite: bool = False) -> None:
        """Write a design file; an older one is replaced whole.

        Args:
            path: The file.
            overwrite: Whether it may replace any file, and not only a design file.

        Raises:
            InvalidInput: Something else is there.
            NotWritten: It cannot be written.
            InvalidDesign: The design has no text; see `to_toml`.
        """
        text = self.to_toml()
        with writing(path, file.DESIGN_FILE[".toml"], overwrite=overwrite) as stream:
            stream.write(text.encode())

    @property
    def length(self) -> float:
        """L, from base to tip before activation [m]."""
        return self.profile.length

    @property
    def fibers(self) -> tuple[FiberArchitecture, ...]:
        """Those actuators that are fiber architectures."""
        return tuple(one for one in self.actuators if isinstance(one, FiberArchitecture))

    @property
    def bundles(self) -> int:
        """m, number of independent activations."""
        return sum(actuator.bundles for actuator in self.actuators)

    @cached_property
    def bundle_names(self) -> tuple[str, ...]:
        """A readable name for each bundle."""
        return tuple(name for actuator in self.actuators for name in actuator.bundle_names)

    @property
    def bundle_units(self) -> tuple[str, ...]:
        """The unit of the activation of each bundle."""
        return tuple(one.unit for one in self.actuators for _ in range(one.bundles))

    @cached_property
    def bounds(self) -> Array:
        """Lower and upper activation of each bundle [unit], shape (bundles, 2), read-only."""
        bounds = np.concatenate([np.empty((0, 2)), *(one.bounds for one in self.actuators)])
        bounds.setflags(write=False)
        return bounds

    @cached_property
    def breakpoints(self) -> tuple[float, ...]:
        """Stations inside (0, L) where profile or actuators are not smooth, ascending [m]."""
        places = {0.0, self.length, *self.profile.breakpoints}
        places.update(z for one in self.actuators for z in one.breakpoints(self.profile))
        ascending = np.array(sorted(places))
        # Two that differ by rounding alone are one.
        apart = np.diff(ascending, prepend=-np.inf) > 1e-12 * self.length
        inside = ascending[apart & (ascending < (1 - 1e-12) * self.length)][1:]
        return tuple(inside.tolist())

    @property
    def bundle_courses(self) -> tuple[str, ...]:
        """How what contracts runs within each bundle; see `Actuator.course`."""
        return tuple(one.course for one in self.actuators for _ in range(one.bundles))

    def outline(self, z: ArrayLike) -> Outline:
        """Where all bundles lie in the sections at stations Z [m], shape (station,)."""
        stations = as_stations("z", z)
        each = [one.outline(self.profile, self.section, stations) for one in self.actuators]
        each = each or [Outline.empty(len(stations))]
        return Outline(
            center=np.concatenate([one.center for one in each], axis=1),
            extent=np.concatenate([one.extent for one in each]),
            inner_ratio=np.concatenate([one.inner_ratio for one in each], axis=1),
            outer_ratio=np.concatenate([one.outer_ratio for one in each], axis=1),
            shape=tuple(shape for one in each for shape in one.shape),
            acts=np.concatenate([one.acts for one in each], axis=1),
        )

    def __repr__(self) -> str:
        base, tip = self.profile.radius([0.0, self.length])
        names = ", ".join(self.bundle_names[:_NAMES]) or "none, a passive rod"
        more = f", ... ({self.bundles} in all)" if self.bundles > _NAMES else ""
        return (
            f"{type(self).__name__}: L = {self.length:g} m, R2 = {base:.4g} to {tip:.4g} m\n"
            f"  bundles: {names}{more}"
        )

    def _repr_html_(self) -> str:
        """A small picture and the size of the arm, for notebooks."""
        from softreach.arm.portrait import arm_card

        return arm_card(self)

    def _fiber_index(self, fiber: str | int) -> int:
        """Index of a fiber architecture or muscle among the actuators, from its name or index."""
        names = {
            k: actuator.name
            for k, actuator in enumerate(self.actuators)
            if isinstance(actuator, SectorActuator)
        }
        whole = isinstance(fiber, int | np.integer) and not isinstance(fiber, bool)
        known = whole or isinstance(fiber, str)
        found = [k for k, name in names.items() if known and (k if whole else name) == fiber]
        if found:
            return found[0]
        listed = ", ".join(f"{k} ({name})" for k, name in names.items())
        allowed = f"the name or index of one architecture: {listed}"
        raise InvalidInput("fiber", as_given(fiber), allowed)


a_manipulator = instance(Manipulator, "a Manipulator")
"""An argument that is a design."""
