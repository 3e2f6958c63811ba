"""The design of an arm: its profile, its section, and what drives it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm import design_file
from softreach.arm.actuators import (
    Actuator,
    FiberArchitecture,
    LengthTendon,
    Outline,
    SectorActuator,
)
from softreach.arm.actuators.actuator import bounds_faults
from softreach.arm.base import UPRIGHT, Base
from softreach.arm.drives import Drive, drive_faults
from softreach.arm.fitting import (
    fit_faults,
    inner_radius_faults,
    kind_faults,
    named_actuators,
    named_stations,
    part_faults,
    part_or_faults,
    placed_parts,
    shared_names,
)
from softreach.arm.loads import Loads
from softreach.arm.marker import Marker
from softreach.arm.material import Material
from softreach.arm.profile import LinearTaper, Profile
from softreach.arm.rest_shape import STRAIGHT, RestShape
from softreach.arm.rigid import RigidPiece
from softreach.arm.scale import scale_warnings
from softreach.arm.section import Ring, Section, Stiffness
from softreach.arm.stations import Stations
from softreach.support.arguments import (
    as_flag,
    as_given,
    as_instance,
    as_integer,
    as_path,
    as_text,
    plain,
)
from softreach.support.arrays import as_stations, read_only
from softreach.support.errors import InvalidDesign, InvalidInput, warn
from softreach.support.files.text import write_text
from softreach.support.lazy import lazy
from softreach.support.units import LengthUnit, as_unit, handy_unit

__all__ = ["Manipulator", "a_manipulator"]

Array = NDArray[np.float64]

_NAMES = 6  # of bundles that `repr` lists


@dataclass(frozen=True, kw_only=True, repr=False)
class Manipulator:
    """A slender arm with actuators, clamped at Z = 0 where its tangent is the base's z (section 2).

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
    """In the order of the activations, bundle by bundle; empty for a passive rod."""
    loads: Loads | None = None
    """Loads beside them; None for nothing, not even its weight."""
    base: Base = UPRIGHT
    """Pose of its clamped end in the world; upright at the origin."""
    rest: RestShape = STRAIGHT
    """Curvature and twist of the arm that nothing drives; straight."""
    drives: tuple[Drive, ...] = ()
    """Inputs that activate bundles; bundles that none of them names are inputs themselves."""
    stations: Mapping[str, float] = Stations()
    """Z [m] of stations by name, at which actuators, rigid pieces and markers may be."""
    rigid_pieces: tuple[RigidPiece, ...] = ()
    """Rigid pieces, which neither bend nor twist nor change their length."""
    markers: tuple[Marker, ...] = ()
    """Points that go with its sections; they change nothing about the arm."""
    display_unit: str | None = field(default=None, compare=False)
    """Unit that it is shown in, "m", "cm", "mm" or "L"; None for one that is handy.
    Designs that differ in it alone are equal, and `to_toml` leaves it out."""

    def __post_init__(self) -> None:
        if faults := list(part_faults(self)):
            raise InvalidDesign(faults)
        object.__setattr__(self, "stations", named_stations(self.stations))
        actuators = tuple(named_actuators(self.actuators))
        owners = [actuator.name for actuator in actuators]
        object.__setattr__(self, "actuators", placed_parts(actuators, self.stations, owners))
        owners = [f"rigid_pieces[{k}]" for k in range(len(self.rigid_pieces))]
        object.__setattr__(
            self, "rigid_pieces", placed_parts(self.rigid_pieces, self.stations, owners)
        )
        owners = [f"markers.{marker.name}" for marker in self.markers]
        object.__setattr__(self, "markers", placed_parts(self.markers, self.stations, owners))
        names = [actuator.name for actuator in self.actuators], self.bundle_names
        faults = list(shared_names(self)) or list(fit_faults(self))
        if faults := faults or list(drive_faults(self.drives, *names)):
            raise InvalidDesign(faults)
        object.__setattr__(self, "drives", tuple(self.drives))

    @classmethod
    def tapered(
        cls,
        *,
        length: float,
        outer_radius: float,
        inner_radius: float,
        taper: float = 0.0,
        tip_radius: float | None = None,
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
            tip_radius: R2(L), at the tip [m], instead of the taper.
            poisson_ratio: ν [-].
            young_modulus: E [Pa]; None where it cancels: nothing weighs and only fibers or muscles
                act.
            density: ρ [kg/m³]; None where nothing weighs.
            actuators: Actuators that drive the arm.
            activation_bounds: (lower, upper) of γ for every bundle, or one pair per bundle [-];
                None for their own.

        Raises:
            InvalidDesign: The arm cannot exist; the error names every fault.
        """
        faults = list(kind_faults(actuators))
        bundles = None if faults else sum(actuator.bundles for actuator in actuators)
        faults += inner_radius_faults(plain(inner_radius), plain(outer_radius))
        cone = {"length": length, "outer_radius": outer_radius, "taper": taper}
        profile = part_or_faults(faults, LinearTaper, **cone, tip_radius=tip_radius)
        matter = {
            "young_modulus": young_modulus,
            "poisson_ratio": poisson_ratio,
            "density": density,
        }
        material = part_or_faults(faults, Material, **matter)
        if activation_bounds is not None:
            faults += bounds_faults(activation_bounds, bundles)
        if faults or profile is None or material is None:
            raise InvalidDesign(faults)
        ring = Ring(inner_ratio=inner_radius / outer_radius, material=material)
        section = Section(rings=(ring,))
        arm = cls(profile=profile, section=section, actuators=tuple(actuators))
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
        shares = zip(self.actuators, np.split(pairs, ends)[:-1], strict=True)
        actuators = tuple(actuator.with_bounds(share) for actuator, share in shares)
        return self.replace(actuators=actuators)

    def split(self, fiber: str | int, count: int, *, keep_extent: bool = True) -> Self:
        """Replace an architecture of one bundle by `count` independent ones beside each other.

        They are spread evenly about the center of the original, one extent apart, and wind as it
        does. Splitting the longitudinal fiber of `designs.minimal_trunk` in two gives
        `designs.redundant_trunk`. Overlap is not checked: fibers of different architectures
        may cross anyway.

        Args:
            fiber: Name or index of the architecture.
            count: Number of those that take its place; 1 leaves the design as it is.
            keep_extent: True gives each the extent σ of the original, False its share σ / count, so
                that together they fill the sector of the original.

        Returns:
            The new design; the parts are named "NAME 1", "NAME 2", ..., and each has the activation
            bounds of the original.

        Raises:
            InvalidInput: No such architecture, one of several bundles, or a count below 1.
        """
        count = as_integer("count", count, 1, 1000)
        keep_extent = as_flag("keep_extent", keep_extent)
        index = self._fiber_index(fiber)
        original = self.actuators[index]
        assert isinstance(original, SectorActuator)
        parts = original.split(count, keep_extent=keep_extent)
        return self.replace(
            actuators=(*self.actuators[:index], *parts, *self.actuators[index + 1 :])
        )

    @classmethod
    def from_toml(cls, text: str, source: str = "design") -> Self:
        """A design from the text of a file; `source` is what errors call it.

        Raises:
            InvalidDesign: The text's faults, all of them, in the file's own names and units.
        """
        parts = design_file.parse(as_text("text", text), as_text("source", source))
        try:
            return cls(**parts._asdict())
        except InvalidDesign as error:
            raise design_file.in_file_terms(error, source) from None

    def to_toml(self) -> str:
        """The design as the text of a file, from which `from_toml` makes an equal one.

        It identifies the design in clouds and atlases, and holds no `display_unit`.

        Raises:
            InvalidDesign: A profile or an actuator of one's own that no table can describe.
        """
        return self._toml

    @lazy
    def _toml(self) -> str:
        return design_file.render(
            self.profile,
            self.section,
            self.actuators,
            self.loads,
            self.base,
            self.rest,
            self.stations,
            self.rigid_pieces,
            self.drives,
            self.markers,
        )

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Self:
        """Read a design file (TOML, lengths in m, angles in degrees).

        Raises:
            InvalidDesign: The file's faults, all of them, in the file's own names and units.
            InvalidInput: No file that can be read, or no text in UTF-8.

        Warns:
            SoftreachWarning: A length or a radius that may be in another unit.
        """
        source = as_path("path", path)
        arm = cls.from_toml(design_file.text_of(source), source=source)
        for text in scale_warnings(arm.profile, arm.section):
            warn(f"{source}: {text}")
        return arm

    def save(self, path: str | PathLike[str], *, overwrite: bool = False) -> None:
        """Write a design file.

        Args:
            path: The file.
            overwrite: Whether it may replace a file.

        Raises:
            InvalidInput: Something else is there.
            NotWritten: It cannot be written.
            InvalidDesign: The design has no text; see `to_toml`.
        """
        write_text(path, self.file_text, overwrite=overwrite)

    @property
    def file_text(self) -> str:
        """Text of its file: that of `to_toml`, and the unit that it is shown in."""
        return self.to_toml() + design_file.display_text(self.display_unit)

    @property
    def length(self) -> float:
        """L, from base to tip before activation [m]."""
        return self.profile.length

    @property
    def length_unit(self) -> LengthUnit:
        """Unit of lengths that it is shown in: `display_unit`, or one that is handy."""
        return as_unit(self.display_unit or handy_unit(self.length), self.length)

    @property
    def fibers(self) -> tuple[FiberArchitecture, ...]:
        """Those actuators that are fiber architectures."""
        return tuple(each for each in self.actuators if isinstance(each, FiberArchitecture))

    @property
    def bundles(self) -> int:
        """m, number of independent activations."""
        return sum(actuator.bundles for actuator in self.actuators)

    @lazy
    def bundle_names(self) -> tuple[str, ...]:
        """A readable name for each bundle."""
        return tuple(name for actuator in self.actuators for name in actuator.bundle_names)

    @lazy
    def bundle_actuators(self) -> tuple[Actuator, ...]:
        """The actuator of each bundle."""
        return tuple(actuator for actuator in self.actuators for _ in range(actuator.bundles))

    @lazy
    def bundle_units(self) -> tuple[str, ...]:
        """The unit of the activation of each bundle."""
        return tuple(actuator.unit for actuator in self.bundle_actuators)

    @lazy
    def bounds(self) -> Array:
        """Lower and upper activation of each bundle [unit], shape (bundles, 2), read-only."""
        bounds = (actuator.bounds for actuator in self.actuators)
        return read_only(np.concatenate([np.empty((0, 2)), *bounds]))

    @lazy
    def undriven(self) -> tuple[int, ...]:
        """Bundles that no drive names."""
        driven = {name for drive in self.drives for name in drive.gains}
        return tuple(k for k, name in enumerate(self.bundle_names) if name not in driven)

    @property
    def inputs(self) -> int:
        """Number of inputs: drives, then bundles that no drive names.

        They are what is called the activations of the arm in all results.
        """
        return len(self.drives) + len(self.undriven)

    @lazy
    def input_names(self) -> tuple[str, ...]:
        """A name for each input."""
        names = self.bundle_names
        return (*(drive.name for drive in self.drives), *(names[k] for k in self.undriven))

    @lazy
    def input_units(self) -> tuple[str, ...]:
        """The unit of each input."""
        units = self.bundle_units
        return (*(drive.unit for drive in self.drives), *(units[k] for k in self.undriven))

    @lazy
    def input_bounds(self) -> Array:
        """Lower and upper bound of each input [unit], shape (inputs, 2), read-only."""
        if not self.drives:
            return self.bounds
        of_drives = np.array([drive.bounds for drive in self.drives])
        return read_only(np.concatenate([of_drives, self.bounds[list(self.undriven)]]))

    @lazy
    def breakpoints(self) -> tuple[float, ...]:
        """Stations inside (0, L) where profile, section or actuators are not smooth [m]."""
        places = {0.0, self.length, *self.profile.breakpoints}
        places.update(self.length * x for x in self.section.breaks)
        places.update(z for actuator in self.actuators for z in actuator.breakpoints(self.profile))
        places.update(z for piece in self.rigid_pieces for z in piece.span(self.length))
        ascending = np.array(sorted(places))
        # Two that differ by rounding alone are one.
        apart = np.diff(ascending, prepend=-np.inf) > 1e-12 * self.length
        inside = ascending[apart & (ascending < (1 - 1e-12) * self.length)][1:]
        return tuple(inside.tolist())

    def stiffness_at(self, z: ArrayLike) -> Stiffness:
        """K0, K1 and K3 at stations Z [m]: those of its section, infinite in rigid pieces."""
        stations = np.asarray(z, float)
        stiffness = self.section.stiffness_at(self.profile, stations)
        if not self.rigid_pieces:
            return stiffness
        spans = [piece.span(self.length) for piece in self.rigid_pieces]
        inside = [
            (stations >= start) & ((stations < end) | (end >= self.length)) for start, end in spans
        ]
        rigid = np.any(inside, axis=0)
        return Stiffness(*(np.where(rigid, np.inf, value) for value in stiffness))

    @lazy
    def inner(self) -> Manipulator:
        """The arm as tables and kernels see it; itself where activations load its sections.

        A rest shape is a bundle held at 1, and tendons that are driven by length have tensions.
        `arm.driving` maps activations of the arm to those of this one.

        Raises:
            InvalidDesign: Displacements within the bounds shorten the arm to nothing.
        """
        by_length = any(isinstance(actuator, LengthTendon) for actuator in self.actuators)
        if self.rest.is_straight and not self.drives and not by_length:
            return self
        from softreach.arm.driving import inner_arm

        return inner_arm(self)

    @property
    def bundle_courses(self) -> tuple[str, ...]:
        """Direction of contraction within each bundle; see `Actuator.course`."""
        return tuple(actuator.course for actuator in self.bundle_actuators)

    def outline(self, z: ArrayLike) -> Outline:
        """Places of all bundles in the sections at stations Z [m], shape (station,)."""
        stations = as_stations("z", z)
        each = [part.outline(self.profile, self.section, stations) for part in self.actuators]
        each = each or [Outline.empty(len(stations))]
        return Outline(
            center=np.concatenate([part.center for part in each], axis=1),
            extent=np.concatenate([part.extent for part in each]),
            inner_ratio=np.concatenate([part.inner_ratio for part in each], axis=1),
            outer_ratio=np.concatenate([part.outer_ratio for part in each], axis=1),
            shape=tuple(shape for part in each for shape in part.shape),
            acts=np.concatenate([part.acts for part in each], axis=1),
        )

    def __repr__(self) -> str:
        base, tip = self.profile.radius([0.0, self.length])
        names = ", ".join(self.bundle_names[:_NAMES]) or "none, a passive rod"
        more = f", ... ({self.bundles} in all)" if self.bundles > _NAMES else ""
        pose = "" if self.base.is_identity else f"\n  base: {self.base}"
        return (
            f"{type(self).__name__}: L = {self.length:g} m, R2 = {base:.4g} to {tip:.4g} m\n"
            f"  bundles: {names}{more}{pose}"
        )

    def _repr_html_(self) -> str:
        from softreach.arm.skin import arm_card

        return arm_card(self)

    def _fiber_index(self, fiber: str | int) -> int:
        names = {
            k: actuator.name
            for k, actuator in enumerate(self.actuators)
            if isinstance(actuator, SectorActuator)
        }
        key = plain(fiber)
        if isinstance(key, int) and not isinstance(key, bool) and key in names:
            return key
        for index, name in names.items():
            if isinstance(key, str) and name == key:
                return index
        listed = ", ".join(f"{k} ({name})" for k, name in names.items())
        allowed = f"the name or index of one architecture: {listed}"
        raise InvalidInput("fiber", as_given(fiber), allowed)


def a_manipulator(name: str, value: object) -> Manipulator:
    """An argument that is a design."""
    return as_instance(name, value, Manipulator, "a Manipulator")
