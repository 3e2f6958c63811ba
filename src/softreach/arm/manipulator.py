"""The design of an arm: its profile, its section, and what drives it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm import design_file, design_reader
from softreach.arm.actuators import Actuator, LengthTendon, Tendon
from softreach.arm.actuators.actuator import bounds_faults
from softreach.arm.base import UPRIGHT, Base
from softreach.arm.body import Body, actuator_faults, behind, mass
from softreach.arm.drives import Drive, drive_faults
from softreach.arm.obstacles import Obstacle
from softreach.arm.part import gathered, kind_faults
from softreach.arm.profile import LinearTaper
from softreach.arm.section import Material, Ring, Section, name_faults
from softreach.arm.stations import Marker
from softreach.support.arguments import as_given, as_path, as_text, plain
from softreach.support.arrays import Array, read_only
from softreach.support.errors import Fault, InvalidDesign, InvalidInput, Range, warn
from softreach.support.files.text import write_text
from softreach.support.lazy import lazy
from softreach.support.units import UNITS, LengthUnit, as_unit, handy_unit

_NAMES = 6  # of bundles that `repr` lists
_LONG, _WIDE = 10.0, 1.0  # m, length and outer radius from which mm may be meant
_SLENDER = 5.0  # least L/R2(0) of a slender arm


@dataclass(frozen=True, kw_only=True, repr=False)
class Manipulator(Body):
    """A slender arm with actuators, clamped at Z = 0 where its tangent is the base's z (section 2).

    Values are frozen; `replace` makes a changed copy, which is checked again. What a design does is
    computed elsewhere: by `arm.tables` and everything after it.

    Raises:
        InvalidDesign: The arm cannot exist; the error names every fault.
    """

    base: Base = UPRIGHT
    """Pose of its clamped end in the world; upright at the origin."""
    drives: tuple[Drive, ...] = ()
    """Inputs that activate bundles; bundles that none of them names are inputs themselves."""
    markers: tuple[Marker, ...] = ()
    """Points that go with its sections; they change nothing about the arm."""
    point: str | None = None
    """Name of the marker that is asked for wherever tips are, such as that of a tool; None for the
    tip. Clouds, reachable sets, inverse solutions, paths, checks and searches are then of it."""
    surroundings: tuple[Obstacle, ...] = ()
    """Solids that it must not touch; they change nothing about the arm."""
    display_unit: str | None = field(default=None, compare=False)
    """Unit that it is shown in, "m", "cm", "mm", "in" or "L"; None for one that is handy.
    Designs that differ in it alone are equal, and `to_toml` leaves it out."""

    def _faults(self) -> list[Fault]:
        kinds = {
            "base": (Base, 'a Base, such as Base(points="down")'),
            "markers": ([Marker], "Markers"),
            "drives": ([Drive], "a sequence of Drive"),
            "surroundings": ([Obstacle], "Obstacles"),
        }
        faults, unit = super()._faults() + kind_faults(self, kinds), self.display_unit
        if unit is None or (isinstance(unit, str) and unit in UNITS):
            return faults
        return [*faults, Fault("display_unit", unit, f"must be one of {', '.join(UNITS)}")]

    def _settle(self) -> list[Fault]:
        object.__setattr__(self, "drives", tuple(self.drives))
        markers = [(f"markers.{marker.name}", marker) for marker in self.markers]
        solids = [(f"surroundings[{k}]", each) for k, each in enumerate(self.surroundings)]
        faults = super()._settle() + self._place("markers", markers)
        return faults + self._place("surroundings", solids)

    def _fit_faults(self) -> list[Fault]:
        faults = [*name_faults([each.name for each in self.markers], "markers")]
        faults += super()._fit_faults()
        if faults:
            return faults
        for marker in self.markers:
            faults += behind(f"markers.{marker.name}", marker.place_faults(self.length))
        for k, each in enumerate(self.surroundings):
            faults += behind(f"surroundings[{k}]", each.place_faults(self.length))
        if self.point is not None and self.pointed is None:
            faults.append(Fault("point", self.point, self._points))
        names = [actuator.name for actuator in self.actuators], self.bundle_names
        return faults or [*drive_faults(self.drives, *names)]

    @lazy
    def pointed(self) -> Marker | None:
        """The marker that `point` names; None for the tip."""
        return next((each for each in self.markers if each.name == self.point), None)

    @property
    def _points(self) -> str:
        names = ", ".join(each.name for each in self.markers)
        return (
            f"must be a marker of the arm: {names}"
            if names
            else "must be left out: the arm has no markers"
        )

    def at_point(self, point: str | None) -> Self:
        """The arm with a marker in place of its tip; itself for None.

        Args:
            point: Name of the marker.

        Raises:
            InvalidInput: It has no such marker.
        """
        if point is None or point == self.point:
            return self
        if not any(each.name == point for each in self.markers):
            raise InvalidInput("point", as_given(point), self._points.removeprefix("must be "))
        return self.replace(point=point)

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
        faults = actuator_faults(actuators)
        bundles = None if faults else sum(actuator.bundles for actuator in actuators)
        inner, outer, allowed = plain(inner_radius), plain(outer_radius), Range(0.0, unit="m")
        if not allowed.admits(inner):
            faults.append(Fault("inner_radius", inner, allowed))
        elif allowed.admits(outer) and inner >= outer:
            faults.append(Fault("inner_radius", inner, f"must be below outer_radius = {outer:g} m"))
        parts: dict[str, Any] = {}
        with gathered(faults):
            parts["profile"] = LinearTaper(
                length=length, taper=taper, outer_radius=outer_radius, tip_radius=tip_radius
            )
        with gathered(faults):
            parts["material"] = Material(
                young_modulus=young_modulus, poisson_ratio=poisson_ratio, density=density
            )
        if activation_bounds is not None:
            faults += bounds_faults(activation_bounds, bundles)
        if faults:
            raise InvalidDesign(faults)
        section = Section(rings=(Ring(inner_ratio=inner / outer, material=parts["material"]),))
        arm = cls(profile=parts["profile"], section=section, actuators=tuple(actuators))
        return arm if activation_bounds is None else arm.with_bounds(activation_bounds)

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
        actuators = (actuator.replace(activation_bounds=share) for actuator, share in shares)
        return self.replace(actuators=tuple(actuators))

    @classmethod
    def from_toml(cls, text: str, source: str = "design") -> Self:
        """A design from the text of a file; `source` is what errors call it.

        Raises:
            InvalidDesign: The text's faults, all of them, in the file's own names and units.
        """
        return design_reader.read(as_text("text", text), as_text("source", source), cls)

    def to_toml(self) -> str:
        """The design as the text of a file, from which `from_toml` makes an equal one.

        It identifies the design in clouds and atlases, and holds no `display_unit`.

        Raises:
            InvalidDesign: A profile or an actuator of one's own that no table can describe.
        """
        return self._toml

    @lazy
    def _toml(self) -> str:
        return design_file.render(vars(self))

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
        arm = cls.from_toml(design_reader.text_of(source), source=source)
        for text in scale_warnings(arm):
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

    @lazy
    def length_unit(self) -> LengthUnit:
        """Unit of lengths that it is shown in: `display_unit`, or one that is handy."""
        return as_unit(self.display_unit or handy_unit(self.length), self.length)

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
        return len(self.input_names)

    @lazy
    def input_names(self) -> tuple[str, ...]:
        """A name for each input."""
        alone = (self.bundle_names[k] for k in self.undriven)
        return (*(drive.name for drive in self.drives), *alone)

    @lazy
    def input_units(self) -> tuple[str, ...]:
        """The unit of each input."""
        alone = (self.bundle_units[k] for k in self.undriven)
        return (*(drive.unit for drive in self.drives), *alone)

    @lazy
    def input_bounds(self) -> Array:
        """Lower and upper bound of each input [unit], shape (inputs, 2), read-only."""
        if not self.drives:
            return self.bounds
        of_drives = np.array([drive.bounds for drive in self.drives])
        return read_only(np.concatenate([of_drives, self.bounds[list(self.undriven)]]))

    @property
    def is_direct(self) -> bool:
        """True if its inputs load its sections as they are: see `arm.driving`."""
        tendons = [part for part in self.actuators if isinstance(part, Tendon)]
        by_tension = not any(isinstance(t, LengthTendon) or t.has_guides for t in tendons)
        return self.rest.is_straight and not self.drives and by_tension

    def __repr__(self) -> str:
        base, tip = self.profile.radius([0.0, self.length])
        names = ", ".join(self.bundle_names[:_NAMES]) or "none, a passive rod"
        more = f", ... ({self.bundles} in all)" if self.bundles > _NAMES else ""
        pose = "" if self.base.is_identity else f"\n  base: {self.base}"
        return (
            f"{type(self).__name__}: L = {self.length:g} m, R2 = {base:.4g} to {tip:.4g} m\n"
            f"  bundles: {names}{more}{pose}"
        )


def a_manipulator(name: str, value: object) -> Manipulator:
    """An argument that is a design."""
    if isinstance(value, Manipulator):
        return value
    raise no_arm(name, value, "a Manipulator")


def no_arm(name: str, value: object, allowed: str) -> InvalidInput:
    """The refusal of an argument that is no arm; of a path it says how to open a file."""
    is_path = isinstance(value, str | PathLike)
    hint = "softreach.Manipulator.load opens a design file" if is_path else ""
    return InvalidInput(name, as_given(value), allowed, hint)


def scale_warnings(arm: Manipulator) -> tuple[str, ...]:
    """One line for a length that looks like one in mm, and one for an arm that is not slender."""
    length, radius = arm.length, float(arm.profile.radius(0.0))
    warnings: list[str] = []
    if length >= _LONG:
        known = not arm.section.density_faults("")
        heavy = f" and weighs {mass(arm):.3g} kg" if known else ""
        warnings.append(
            f"the arm is {length:g} m long{heavy}; if that is meant in mm: lengths are in m, "
            f"{length:g} mm are {length / 1e3:g}"
        )
    if (slenderness := length / radius) < _SLENDER:
        meant = f"lengths are in m, {radius:g} mm are {radius / 1e3:g}"
        cause = f"if that is meant in mm: {meant}" if radius >= _WIDE else "is it a diameter?"
        warnings.append(
            f"the arm is {slenderness:.3g} times as long as its outer radius at the base, "
            f"{radius:g} m, and the theory is one of slender arms, {_SLENDER:g} times or more; "
            f"{cause}"
        )
    return tuple(warnings)
