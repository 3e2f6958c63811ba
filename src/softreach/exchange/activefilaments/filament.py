"""Filaments of ActiveFilaments.jl: arms written as Julia, and read from the JSON of Julia."""

import json
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from os import PathLike
from typing import Any, Self

import numpy as np

from softreach.arm.actuators import FiberArchitecture
from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.part import AlongArm, Pieces
from softreach.arm.profile import LinearTaper
from softreach.arm.section import Material, Ring, Section
from softreach.support.arguments import POSITIVE, as_given, as_number, as_path
from softreach.support.arrays import Array, Index
from softreach.support.errors import InvalidDesign, InvalidInput, Range
from softreach.support.files.text import MEGABYTE, read_text

Bounds = tuple[tuple[float, float], ...]

_THERE = "in ActiveFilaments.jl"
_SMALLEST_TAPER = 1e-4  # rad; below it their Θ(Z) is unstable, as their own source warns
_BOUNDS = (-5 / 3, 0.0)  # where the file has none, widened to hold the activation
_ANY_MODULUS = 1e6  # Pa, where Young's modulus cancels
_HEAD = """\
# The filament of ActiveFilaments.jl with the tips of a design of softreach.
# Lengths in m, angles in rad, E in Pa, density in kg/m^3.
using ActiveFilaments
"""


@dataclass(frozen=True, kw_only=True)
class FilamentRing:
    """A ring and the sectors in it."""

    young_modulus: float  # E [Pa]
    poisson_ratio: float  # ν [-]
    radii: tuple[float, float]  # R1 and R2 at the base [m]
    angle: float | Pieces = 0.0  # α at the outer radius [rad]
    extent: float = math.pi  # σ of every sector [rad]
    offset: float = 0.0  # polar angle of the center of the first sector [rad]
    bounds: Bounds = ((0.0, 0.0),)  # of γ of each sector in their scale; one stays 0 where none is
    bundles: tuple[int, ...] = ()  # of the arm, one for each sector; none without fibers
    scale: float = 1.0  # their γ over that of the arm [-]
    name: str = ""  # in the arm


@dataclass(frozen=True, kw_only=True)
class Filament:
    """An `AFilament`, and the structure of its activation."""

    length: float  # L [m]
    taper: float  # φ of the outermost surface [rad]
    density: float | None  # ρ, one for all of it [kg/m³]; None where it plays no part
    rings: Sequence[FilamentRing]  # the innermost first, the outermost last
    core_modulus: float  # E inside of the first ring [Pa]
    core_poisson_ratio: float  # ν inside of the first ring [-]

    @cached_property
    def columns(self) -> tuple[Index, Array]:
        """The bundle of the arm in each of its sectors, -1 where there is none; their scales."""
        pairs = [(k, ring.scale) for ring in self.rings for k in ring.bundles or (-1,)]
        bundles, scales = zip(*pairs, strict=True)
        return np.array(bundles), np.array(scales)

    def to_columns(self, activation: Array) -> Array:
        """Their activations from those of the arm, shape (sample, bundle) to (sample, column)."""
        bundles, scales = self.columns
        return np.where(bundles < 0, 0.0, activation[:, bundles] * scales)

    def from_columns(self, columns: Array) -> Array:
        """Activations of the arm from theirs, shape (sample, column) to (sample, bundle)."""
        bundles, scales = self.columns
        own = np.argsort(bundles)[np.count_nonzero(bundles < 0) :]
        return columns[:, own] / scales[own]


def design_script(arm: Manipulator) -> str:
    """Julia that defines the filament of ActiveFilaments.jl with an arm's tips.

    Raises:
        InvalidInput: The arm has what no filament there has: another profile than a linear taper,
            a bore, or other actuators than fibers along all of it.
    """
    filament = filament_of(a_manipulator("arm", arm))
    rings, activations, bounds = [], [], []
    for ring in filament.rings:
        mechanics = _mechanics(ring.young_modulus, ring.poisson_ratio)
        fibers = f"FiberArchitecture({_angle(ring.angle, filament.length)})"
        name = "".join(letter if letter.isprintable() else " " for letter in ring.name).strip()
        scale = f"γ is {ring.scale:g} times that of softreach" if ring.scale != 1 else ""
        comment = "; ".join(filter(None, (name, scale)))
        rings.append(f"    Ring({mechanics}, Geometry{ring.radii}, {fibers}),")
        rings[-1] += f"  # {comment}" if comment else ""
        lows, highs = (_vector(side) for side in zip(*ring.bounds, strict=True))
        sectors = f"{len(ring.bounds)}, {lows}, {ring.extent!r}, {ring.offset!r}"
        activations.append(f"    ActivationPiecewiseGamma({sectors}),")
        bounds.append(f"    ({lows}, {highs}),")
    inside = _mechanics(filament.core_modulus, filament.core_poisson_ratio)
    tube = f"InnerTube({inside}, Geometry(0.0, {filament.rings[0].radii[0]!r}))"
    values = {"L": filament.length, "phi2": filament.taper, "ρvol": filament.density}
    options = ", ".join(f"{name} = {x!r}" for name, x in values.items() if x is not None)
    lines = [_HEAD, "rings = [", *rings, "]", f"innerTube = {tube}"]
    lines += [f"filament = AFilament(rings; {options}, innerTube = innerTube)", ""]
    lines += ["activation = [", *activations, "]", "γBounds = [", *bounds, "]", ""]
    return "\n".join(lines)


def filament_of(arm: Manipulator) -> Filament:
    """The filament of ActiveFilaments.jl with the tips of an arm; refused if there is none.

    There each ring has one family of equidistant sectors. Several families in one ring become
    several rings in the same place that share its Young's modulus evenly, so that stiffness is the
    same; their activations are multiplied by the number of families, so that forces are the same.
    """
    for name, value, allowed in _faults(arm):
        raise InvalidInput(name, value, f"{allowed} {_THERE}")
    assert isinstance(arm.profile, LinearTaper)
    core, layers = arm.section.core_material, arm.section.layers
    is_dense = all(layer.material.density is not None for layer in layers)
    rings = list(_rings(arm))
    orders = rings, sorted(rings, key=lambda ring: ring.radii[::-1])
    right = [each for each in orders if is_from_inside_out([ring.radii for ring in each])]
    if not right:
        allowed = f"{_THERE} such that the innermost one is not the outermost of several"
        raise InvalidInput("radii of the rings", [ring.radii for ring in rings], allowed)
    dense = float(arm.section.mass_per_length(1.0)) / math.pi if is_dense else None
    inside = {"core_modulus": _modulus(core), "core_poisson_ratio": core.poisson_ratio}
    outside = {"length": arm.length, "taper": arm.profile.taper}
    return Filament(rings=right[0], density=dense, **outside, **inside)


def is_from_inside_out(radii: Sequence[tuple[float, float]]) -> bool:
    """True if the first ring is the innermost and the last the outermost, as AFilament takes it."""
    inner, outer = zip(*radii, strict=True)
    return inner[0] == min(inner) and outer[-1] == max(outer)


def _rings(arm: Manipulator) -> Iterator[FilamentRing]:
    base, section = float(arm.profile.radius(0.0)), arm.section
    firsts = np.cumsum([0, *(fiber.bundles for fiber in arm.fibers)]).tolist()
    places = [section.ring_index(fiber.ring) for fiber in arm.fibers]
    shared = Counter(places)
    for k, ring in enumerate(section.rings):
        share = max(shared[k], 1)
        known: Any = {
            "young_modulus": _modulus(ring.material) / share,
            "scale": float(share),
            "poisson_ratio": ring.material.poisson_ratio,
            "name": ring.name,
        }
        radii = ring.inner_ratio * base, ring.outer_ratio * base
        body = FilamentRing(radii=radii, **known)
        if not shared[k]:
            yield body
        for place, first, fiber in zip(places, firsts, arm.fibers, strict=False):
            if place != k:
                continue
            angle: Any = fiber.helical_angle_on(arm.profile, arm.section)
            angle = angle if isinstance(angle, Pieces) else float(angle)
            own: Any = {
                "angle": angle,
                "extent": fiber.extent,
                "offset": fiber.offset,
                "bounds": tuple(map(tuple, (fiber.bounds * body.scale).tolist())),
                "bundles": tuple(range(first, first + fiber.bundles)),
                "name": fiber.name,
            }
            yield replace(body, **own)


def _modulus(material: Material) -> float:
    return _ANY_MODULUS if material.young_modulus is None else material.young_modulus


def _faults(arm: Manipulator) -> Iterator[tuple[str, object, str]]:
    if not arm.base.is_identity:
        yield "base", str(arm.base), "upright at the origin, as arm.replace(base=Base()) is,"
    if not isinstance(arm.profile, LinearTaper):
        yield "profile", type(arm.profile).__name__, "a LinearTaper"
        return
    if arm.rigid_pieces:
        yield "rigid_pieces", len(arm.rigid_pieces), "0"
    taper = arm.profile.taper
    if 0 < abs(taper) < _SMALLEST_TAPER:
        yield "taper", f"{taper:g} rad", f"0 or at least {_SMALLEST_TAPER:g}"
    if arm.section.measured is not None:
        yield "section.measured", arm.section.measured, "None"
    if arm.section.bore_ratio > 0:
        yield "bore_ratio", arm.section.bore_ratio, "0"
    for actuator in arm.actuators:
        if not isinstance(actuator, FiberArchitecture):
            yield actuator.name, type(actuator).__name__, "a FiberArchitecture"
            return
        stretch, angle = actuator.span_over_length(arm.length), actuator.helical_angle
        if isinstance(actuator.offset, tuple):
            yield f"offset of {actuator.name}", actuator.offset, "one, as bundles are evenly spaced"
        if stretch != (0.0, 1.0):
            yield f"stretch of {actuator.name}", stretch, "all of the arm"
        if isinstance(angle, AlongArm) and (taper != 0 or not isinstance(angle, Pieces)):
            name, kind = f"helical_angle of {actuator.name}", type(angle).__name__
            yield name, kind, "constant, or Pieces on an arm without taper,"


def _mechanics(modulus: float, poisson_ratio: float) -> str:
    return f"MechanicalProperties({modulus!r}, {poisson_ratio!r})"


def _angle(angle: float | Pieces, length: float) -> str:
    if not isinstance(angle, Pieces):
        return repr(angle)
    ends = [length * x for x in angle.stations_over_length]
    ranges = ", ".join(f"({start!r}, {end!r})" for start, end in pairwise(ends))
    return f"PiecewiseStructure({_vector(angle.values)}, [{ranges}])"


def _vector(numbers: Iterable[float]) -> str:
    return f"[{', '.join(map(repr, numbers))}]"


def read_design(path: str | PathLike[str]) -> Manipulator:
    """Read the definition of a filament that Julia wrote as JSON.

    Rings that overlap stay so: each adds its whole stiffness there as here. The mass per length is
    the filament's, whatever overlaps.

    Args:
        path: The file: `L`, `phi2`, `ρvol`, `rings` and `innerTube` of one AFilament, `activation`
            with one ActivationPiecewiseGamma a ring and, if it has bounds, `γBounds` with one
            (lows, highs) a ring; else the bounds are [-5/3, 0], widened to hold the activation.
            Lengths are in m, angles in rad, E in Pa, densities in kg/m³.

    Raises:
        InvalidInput: No such definition, with the place of what is wrong, or one that no arm can
            have.
    """
    source = as_path("path", path)
    text = read_text("definition", source, MEGABYTE)
    try:
        value = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InvalidInput("definition", source, f"JSON, {error}") from None
    try:
        return _arm(_Value("definition", value))
    except InvalidDesign as error:
        faults = "; ".join(str(fault) for fault in error.faults)
        raise InvalidInput(source, faults, "the filament of an arm that can exist") from None


@dataclass(frozen=True)
class _Value:
    place: str
    value: Any

    def of(self, *keys: str) -> Self:
        found = self
        for key in keys:
            if not isinstance(found.value, dict) or key not in found.value:
                raise found.fault(f"an object with {key}")
            found = type(self)(f"{found.place}.{key}", found.value[key])
        return found

    def each(self, count: float | None = None) -> list[Self]:
        if isinstance(self.value, list) and self.value and count in (None, len(self.value)):
            return [type(self)(f"{self.place}[{k}]", value) for k, value in enumerate(self.value)]
        raise self.fault("a list" if count is None else f"a list of {count:g}")

    def number(self, allowed: Range = Range()) -> float:  # noqa: B008
        return as_number(self.place, self.value, allowed)

    def numbers(self, count: float | None = None) -> tuple[float, ...]:
        return tuple(value.number() for value in self.each(count))

    def fault(self, allowed: str) -> InvalidInput:
        shown = as_given(self.value)
        return InvalidInput(self.place, shown if len(str(shown)) < 80 else "...", allowed)


def _arm(definition: _Value) -> Manipulator:
    length, rings = definition.of("L").number(POSITIVE), definition.of("rings").each()
    radii, tube = [_radii(ring) for ring in rings], definition.of("innerTube")
    for ring, (inner, outer) in zip(rings, radii, strict=True):
        if not 0 <= inner < outer:
            raise ring.of("geometry").fault("0 <= R1 < R2")
    if not is_from_inside_out(radii):
        raise definition.of("rings").fault("with the innermost first and the outermost last")
    inner, outer = _radii(tube)
    if inner != 0 or not math.isclose(outer, radii[0][0], rel_tol=1e-12):
        raise tube.fault(f"from 0 to the innermost ring, {radii[0][0]:g}")
    base = radii[-1][1]
    spans = [(inner / base, outer / base) for inner, outer in radii]
    # the density that, counted in every layer, gives the mass of the filament
    density = definition.of("ρvol").number()
    layers = min(inner for inner, _ in spans) ** 2 + sum(b**2 - a**2 for a, b in spans)
    density = density / layers if abs(layers - 1.0) > 1e-9 else density
    *materials, core = (_material(part, density) for part in (*rings, tube))
    default = materials[min(range(len(spans)), key=lambda k: spans[k][0])]
    each = zip(spans, materials, strict=True)
    layered = (Ring(inner_ratio=a, outer_ratio=b, material=x) for (a, b), x in each)
    taper = definition.of("phi2").number()
    return Manipulator(
        profile=LinearTaper(length=length, outer_radius=base, taper=taper),
        section=Section(rings=tuple(layered), core=None if core == default else core),
        actuators=tuple(_fibers(definition, rings, length)),
    )


def _material(part: _Value, density: float) -> Material:
    modulus, ratio = (part.of("mechanicalProperties", name).number() for name in ("E", "ν"))
    return Material(young_modulus=modulus, poisson_ratio=ratio, density=density)


def _radii(part: _Value) -> tuple[float, float]:
    """R1 and R2 at the base: a tapered filament there holds them at all of its Z."""
    radii = (part.of("geometry", name) for name in ("R1", "R2"))
    inner, outer = (r.each()[0] if isinstance(r.value, list) else r for r in radii)
    return inner.number(), outer.number()


def _fibers(definition: _Value, rings: list[_Value], length: float) -> Iterator[FiberArchitecture]:
    activation = definition.of("activation").each(len(rings))
    bounds = _bounds(definition, activation)
    for k, (ring, sectors, own) in enumerate(zip(rings, activation, bounds, strict=True)):
        angle = _read_angle(ring.of("fiberArchitecture", "α2"), length)
        extent, offset = sectors.of("σ").number(), sectors.of("θ0").number()
        known: Any = {
            "helical_angle": angle,
            "extent": extent,
            "offset": offset,
            "name": f"ring {k + 1}",
            "ring": k,
        }
        yield FiberArchitecture(bundles=len(own), activation_bounds=own, **known)


def _read_angle(angle: _Value, length: float) -> float | Pieces:
    if not isinstance(angle.value, dict):
        return angle.number()
    ranges = angle.of("piecewiseRanges")
    pairs = [pair.numbers(2) for pair in ranges.each()]
    ends = [pairs[0][0], *(end for _, end in pairs)]
    if [start for start, _ in pairs] != ends[:-1]:
        raise ranges.fault("pairs (Z1, Z2) that follow one another from 0 to L")
    values = angle.of("expressions").numbers(len(pairs))
    return Pieces(stations_over_length=tuple(end / length for end in ends), values=values)


def _bounds(definition: _Value, activation: list[_Value]) -> list[Bounds]:
    gammas = [sectors.of("γ").numbers(sectors.of("N").number()) for sectors in activation]
    if "γBounds" not in definition.value:
        low, high = _BOUNDS
        return [tuple((min(low, γ), max(high, γ)) for γ in ring) for ring in gammas]
    rings = zip(definition.of("γBounds").each(len(gammas)), gammas, strict=True)
    sides = ([side.numbers(len(γ)) for side in ring.each(2)] for ring, γ in rings)
    return [tuple(zip(lows, highs, strict=True)) for lows, highs in sides]
