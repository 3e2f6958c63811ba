"""Definitions of filaments of ActiveFilaments.jl, which Julia wrote as JSON, read as arms."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from typing import Any

from softreach.arm.actuators import FiberArchitecture
from softreach.arm.along import Pieces
from softreach.arm.manipulator import Manipulator
from softreach.arm.material import Material
from softreach.arm.profile import LinearTaper
from softreach.arm.section import Ring, Section
from softreach.exchange.activefilaments.filament import Bounds, is_from_inside_out
from softreach.support.arguments import POSITIVE, as_given, as_number, as_path
from softreach.support.errors import InvalidDesign, InvalidInput, Range
from softreach.support.files.text import MEGABYTE, read_text

_BOUNDS = (-5 / 3, 0.0)  # where the file has none, widened to hold the activation


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

    def of(self, *keys: str) -> _Value:
        found = self
        for key in keys:
            if not isinstance(found.value, dict) or key not in found.value:
                raise found.fault(f"an object with {key}")
            found = _Value(f"{found.place}.{key}", found.value[key])
        return found

    def each(self, count: float | None = None) -> list[_Value]:
        if isinstance(self.value, list) and self.value and count in (None, len(self.value)):
            return [_Value(f"{self.place}[{k}]", value) for k, value in enumerate(self.value)]
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
    layered = (
        Ring(inner_ratio=inner, outer_ratio=outer, material=material)
        for (inner, outer), material in zip(spans, materials, strict=True)
    )
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
        yield FiberArchitecture(
            name=f"ring {k + 1}",
            ring=k,
            bundles=len(own),
            helical_angle=_angle(ring.of("fiberArchitecture", "α2"), length),
            extent=sectors.of("σ").number(),
            offset=sectors.of("θ0").number(),
            activation_bounds=own,
        )


def _angle(angle: _Value, length: float) -> float | Pieces:
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
