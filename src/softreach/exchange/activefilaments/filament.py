"""An arm as ActiveFilaments.jl has it: rings of one family of sectors each around an inner tube."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from softreach.arm.actuators import FiberArchitecture
from softreach.arm.along import AlongArm, Pieces
from softreach.arm.manipulator import Manipulator
from softreach.arm.material import Material
from softreach.arm.profile import LinearTaper
from softreach.arm.section import Ring, Section
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput

Angle = float | Pieces

_SMALLEST_TAPER = 1e-4  # rad; below it their Θ(Z) is unstable, as their own source warns
_ANY_MODULUS = 1e6  # Pa, where Young's modulus cancels


@dataclass(frozen=True, kw_only=True)
class FilamentRing:
    """A ring and the sectors in it."""

    young_modulus: float
    """E [Pa]."""
    poisson_ratio: float
    """ν [-]."""
    inner_radius: float
    """R1 at the base [m]."""
    outer_radius: float
    """R2 at the base [m]."""
    angle: Angle = 0.0
    """α at the outer radius [rad]."""
    extent: float = math.pi
    """σ of every sector [rad]."""
    offset: float = 0.0
    """Polar angle of the center of the first sector [rad]."""
    bounds: tuple[tuple[float, float], ...] = ((0.0, 0.0),)
    """(lower, upper) γ of each sector in their scale [-]; one that stays 0 where none is."""
    bundles: tuple[int, ...] = ()
    """Index of the bundle of the arm for each sector; none for a ring without fibers."""
    scale: float = 1.0
    """Their γ over that of the arm [-]."""
    name: str = ""
    """Its name in the arm."""


@dataclass(frozen=True, kw_only=True)
class Filament:
    """An `AFilament`, and the structure of its activation."""

    length: float
    """L [m]."""
    taper: float
    """φ of the outermost surface [rad]."""
    density: float | None
    """ρ, one for all of it [kg/m³]; None where it plays no part."""
    rings: tuple[FilamentRing, ...]
    """The innermost first, the outermost last."""
    core_modulus: float
    """E inside of the first ring [Pa]."""
    core_poisson_ratio: float
    """ν inside of the first ring [-]."""

    @property
    def columns(self) -> int:
        """Number of its activations: sectors of all rings."""
        return sum(len(ring.bounds) for ring in self.rings)

    def to_columns(self, activation: Array) -> Array:
        """Their activations from those of the arm, shape (sample, bundle) to (sample, column)."""
        blocks = [
            activation[:, list(ring.bundles)] * ring.scale
            if ring.bundles
            else np.zeros((len(activation), len(ring.bounds)))
            for ring in self.rings
        ]
        return np.concatenate(blocks, axis=1)

    def from_columns(self, columns: Array) -> Array:
        """Activations of the arm from theirs, shape (sample, column) to (sample, bundle)."""
        activation = np.zeros((len(columns), sum(len(ring.bundles) for ring in self.rings)))
        first = 0
        for ring in self.rings:
            block = columns[:, first : first + len(ring.bounds)]
            first += len(ring.bounds)
            if ring.bundles:
                activation[:, list(ring.bundles)] = block / ring.scale
        return activation


def filament_of(arm: Manipulator) -> Filament:
    """The filament of ActiveFilaments.jl with the tips of an arm.

    There each ring has one family of equidistant sectors. Several families in one ring become
    several rings in the same place that share its Young's modulus evenly, so that stiffness is the
    same; their activations are multiplied by the number of families, so that forces are the same.

    Raises:
        InvalidInput: Something that a filament there does not have.
    """
    _check_expressible(arm)
    assert isinstance(arm.profile, LinearTaper)
    core = arm.section.core_material
    return Filament(
        length=arm.length,
        taper=arm.profile.taper,
        density=_density(arm),
        rings=_from_inside_out(list(_rings(arm))),
        core_modulus=_modulus(core),
        core_poisson_ratio=core.poisson_ratio,
    )


def arm_of(filament: Filament) -> Manipulator:
    """The arm that a filament of ActiveFilaments.jl is.

    Rings that overlap stay so: each adds its whole stiffness there as here. The mass per length is
    the filament's, whatever overlaps.

    Raises:
        InvalidDesign: Numbers that no arm can have.
    """
    outer = filament.rings[-1].outer_radius
    profile = LinearTaper(length=filament.length, outer_radius=outer, taper=filament.taper)
    spans = [(ring.inner_radius / outer, ring.outer_radius / outer) for ring in filament.rings]
    density = _shared_density(filament, spans)
    rings = tuple(
        Ring(
            inner_ratio=low,
            outer_ratio=high,
            material=Material(
                young_modulus=ring.young_modulus, poisson_ratio=ring.poisson_ratio, density=density
            ),
        )
        for ring, (low, high) in zip(filament.rings, spans, strict=True)
    )
    core = Material(
        young_modulus=filament.core_modulus,
        poisson_ratio=filament.core_poisson_ratio,
        density=density,
    )
    default = min(rings, key=lambda ring: ring.inner_ratio).material
    return Manipulator(
        profile=profile,
        section=Section(rings=rings, core=None if core == default else core),
        actuators=tuple(_fiber(k, ring) for k, ring in enumerate(filament.rings)),
    )


def _fiber(place: int, ring: FilamentRing) -> FiberArchitecture:
    return FiberArchitecture(
        name=ring.name or f"ring {place + 1}",
        ring=place,
        bundles=len(ring.bounds),
        helical_angle=ring.angle,
        extent=ring.extent,
        offset=ring.offset,
        activation_bounds=ring.bounds,
    )


def _shared_density(filament: Filament, spans: list[tuple[float, float]]) -> float | None:
    """The density that, counted in every layer, gives the mass of the filament."""
    if filament.density is None:
        return None
    layers = min(inner for inner, _ in spans) ** 2 + sum(b**2 - a**2 for a, b in spans)
    return filament.density / layers if abs(layers - 1.0) > 1e-9 else filament.density


def _from_inside_out(rings: list[FilamentRing]) -> tuple[FilamentRing, ...]:
    """As they are, if the first is innermost and the last outermost; else sorted to be so."""
    for order in rings, sorted(rings, key=lambda ring: (ring.outer_radius, ring.inner_radius)):
        if is_from_inside_out(order):
            return tuple(order)
    spans = [(ring.inner_radius, ring.outer_radius) for ring in rings]
    allowed = "in ActiveFilaments.jl such that the innermost one is not the outermost of several"
    raise InvalidInput("radii of the rings", spans, allowed)


def is_from_inside_out(rings: Sequence[FilamentRing]) -> bool:
    """True if the first ring is the innermost and the last the outermost, as AFilament takes it."""
    innermost = min(ring.inner_radius for ring in rings)
    outermost = max(ring.outer_radius for ring in rings)
    return rings[0].inner_radius == innermost and rings[-1].outer_radius == outermost


def _rings(arm: Manipulator) -> Iterator[FilamentRing]:
    base, section = float(arm.profile.radius(0.0)), arm.section
    names = [ring.name for ring in section.rings]
    firsts = np.cumsum([0, *(fiber.bundles for fiber in arm.fibers)]).tolist()
    places = [
        fiber.ring % len(names) if isinstance(fiber.ring, int) else names.index(fiber.ring)
        for fiber in arm.fibers
    ]
    shared = Counter(places)
    for k, ring in enumerate(section.rings):
        share = max(shared[k], 1)
        body = FilamentRing(
            young_modulus=_modulus(ring.material) / share,
            poisson_ratio=ring.material.poisson_ratio,
            inner_radius=ring.inner_ratio * base,
            outer_radius=ring.outer_ratio * base,
            scale=float(share),
            name=ring.name,
        )
        if not shared[k]:
            yield body
        for place, first, fiber in zip(places, firsts, arm.fibers, strict=False):
            if place == k:
                angle = fiber.helical_angle_on(arm.profile, arm.section)
                pairs = (fiber.bounds * body.scale).tolist()
                yield replace(
                    body,
                    angle=angle if isinstance(angle, Pieces) else float(angle),  # pyright: ignore[reportArgumentType]
                    extent=fiber.extent,
                    offset=fiber.offset,
                    bounds=tuple((low, high) for low, high in pairs),
                    bundles=tuple(range(first, first + fiber.bundles)),
                    name=fiber.name,
                )


def _modulus(material: Material) -> float:
    return _ANY_MODULUS if material.young_modulus is None else material.young_modulus


def _density(arm: Manipulator) -> float | None:
    """The one density that gives the arm's mass per length [kg/m³]."""
    if any(layer.material.density is None for layer in arm.section.layers):
        return None
    return float(arm.section.mass_per_length(1.0)) / math.pi


def _check_expressible(arm: Manipulator) -> None:
    there = "in ActiveFilaments.jl"
    if not arm.base.is_identity:
        hint = "give arm.replace(base=Base()), whose places are those in the frame of the base"
        raise InvalidInput("base", str(arm.base), f"upright at the origin {there}", hint)
    if not isinstance(arm.profile, LinearTaper):
        raise InvalidInput("profile", type(arm.profile).__name__, f"a LinearTaper {there}")
    if arm.rigid_pieces:
        raise InvalidInput("rigid_pieces", len(arm.rigid_pieces), f"0 {there}")
    taper = arm.profile.taper
    if 0 < abs(taper) < _SMALLEST_TAPER:
        raise InvalidInput("taper", f"{taper:g} rad", f"0 or at least {_SMALLEST_TAPER:g} {there}")
    if arm.section.measured is not None:
        raise InvalidInput("section.measured", arm.section.measured, f"None {there}")
    if arm.section.bore_ratio > 0:
        raise InvalidInput("bore_ratio", arm.section.bore_ratio, f"0 {there}")
    for actuator in arm.actuators:
        if not isinstance(actuator, FiberArchitecture):
            kind = type(actuator).__name__
            raise InvalidInput(actuator.name, kind, f"a FiberArchitecture {there}")
        stretch = actuator.span_over_length(arm.length)
        if stretch != (0.0, 1.0):
            raise InvalidInput(f"stretch of {actuator.name}", stretch, f"all of the arm {there}")
        angle = actuator.helical_angle
        if isinstance(angle, AlongArm) and (taper != 0 or not isinstance(angle, Pieces)):
            allowed = f"constant, or Pieces on an arm without taper, {there}"
            name = f"helical_angle of {actuator.name}"
            raise InvalidInput(name, type(angle).__name__, allowed)
