"""Definitions of filaments of ActiveFilaments.jl: read from JSON, and written as Julia source."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from os import PathLike
from typing import Any

from softreach.arm.along import Pieces
from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.exchange.activefilaments.filament import (
    Angle,
    Filament,
    FilamentRing,
    arm_of,
    filament_of,
    is_from_inside_out,
)
from softreach.support.arguments import POSITIVE, as_given, as_number, as_path
from softreach.support.errors import InvalidDesign, InvalidInput, Range
from softreach.support.files.formats import FileFormat, Formats
from softreach.support.files.text import MEGABYTE, read_text, write_text

FILAMENT_SCRIPT: Formats = {".jl": FileFormat()}
"""Format of `write_design`."""

_HEAD = """\
# The filament of ActiveFilaments.jl with the tips of a design of softreach.
# Lengths in m, angles in rad, E in Pa, density in kg/m^3.
using ActiveFilaments
"""
_BOUNDS = (-5 / 3, 0.0)  # where the file has none, widened to hold the activation


def read_design(path: str | PathLike[str]) -> Manipulator:
    """Read the definition of a filament that Julia wrote as JSON.

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
    try:
        value = json.loads(read_text("definition", source, MEGABYTE))
    except (ValueError, RecursionError) as error:
        raise InvalidInput("definition", source, f"JSON, {error}") from None
    try:
        return arm_of(_filament(_Value("definition", value)))
    except InvalidDesign as error:
        faults = "; ".join(str(fault) for fault in error.faults)
        raise InvalidInput(source, faults, "the filament of an arm that can exist") from None


@dataclass(frozen=True)
class _Value:
    place: str
    value: Any

    def of(self, key: str) -> _Value:
        if isinstance(self.value, dict) and key in self.value:
            return _Value(f"{self.place}.{key}", self.value[key])
        raise self.fault(f"an object with {key}")

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


def _filament(definition: _Value) -> Filament:
    length = definition.of("L").number(POSITIVE)
    parts = definition.of("rings")
    activation = definition.of("activation").each(len(parts.each()))
    bounds = _bounds(definition, activation)
    rings = tuple(
        _ring(ring, sectors, pairs, length)
        for ring, sectors, pairs in zip(parts.each(), activation, bounds, strict=True)
    )
    if not is_from_inside_out(rings):
        raise parts.fault("with the innermost first and the outermost last")
    tube = definition.of("innerTube")
    inner, outer = _radii(tube)
    if inner != 0 or not math.isclose(outer, rings[0].inner_radius, rel_tol=1e-12):
        raise tube.fault(f"from 0 to the innermost ring, {rings[0].inner_radius:g}")
    modulus, ratio = _mechanics(tube)
    return Filament(
        length=length,
        taper=definition.of("phi2").number(),
        density=definition.of("ρvol").number(),
        rings=rings,
        core_modulus=modulus,
        core_poisson_ratio=ratio,
    )


def _ring(
    ring: _Value, sectors: _Value, bounds: tuple[tuple[float, float], ...], length: float
) -> FilamentRing:
    modulus, ratio = _mechanics(ring)
    inner, outer = _radii(ring)
    if not 0 <= inner < outer:
        raise ring.of("geometry").fault("0 <= R1 < R2")
    return FilamentRing(
        young_modulus=modulus,
        poisson_ratio=ratio,
        inner_radius=inner,
        outer_radius=outer,
        angle=_angle(ring.of("fiberArchitecture").of("α2"), length),
        extent=sectors.of("σ").number(),
        offset=sectors.of("θ0").number(),
        bounds=bounds,
    )


def _mechanics(part: _Value) -> tuple[float, float]:
    properties = part.of("mechanicalProperties")
    return properties.of("E").number(), properties.of("ν").number()


def _radii(part: _Value) -> tuple[float, float]:
    """R1 and R2 at the base: a tapered filament there holds them at all of its Z."""
    radii = (part.of("geometry").of(name) for name in ("R1", "R2"))
    inner, outer = (r.each()[0] if isinstance(r.value, list) else r for r in radii)
    return inner.number(), outer.number()


def _angle(angle: _Value, length: float) -> Angle:
    if not isinstance(angle.value, dict):
        return angle.number()
    ranges = angle.of("piecewiseRanges")
    pairs = [pair.numbers(2) for pair in ranges.each()]
    ends = [pairs[0][0], *(end for _, end in pairs)]
    if [start for start, _ in pairs] != ends[:-1]:
        raise ranges.fault("pairs (Z1, Z2) that follow one another from 0 to L")
    values = angle.of("expressions").numbers(len(pairs))
    return Pieces(stations_over_length=tuple(end / length for end in ends), values=values)


def _bounds(definition: _Value, activation: list[_Value]) -> list[tuple[tuple[float, float], ...]]:
    gammas = [sectors.of("γ").numbers(sectors.of("N").number()) for sectors in activation]
    if "γBounds" not in definition.value:
        low, high = _BOUNDS
        return [tuple((min(low, γ), max(high, γ)) for γ in ring) for ring in gammas]
    rings = definition.of("γBounds").each(len(gammas))
    sides = [
        [side.numbers(len(γ)) for side in ring.each(2)]
        for ring, γ in zip(rings, gammas, strict=True)
    ]
    return [tuple(zip(lows, highs, strict=True)) for lows, highs in sides]


def write_design(arm: Manipulator, path: str | PathLike[str], *, overwrite: bool = False) -> None:
    """Write a Julia script that defines the filament of ActiveFilaments.jl with an arm's tips.

    Args:
        arm: The design.
        path: The file; it is replaced only when the new one is complete.
        overwrite: Whether it may replace a file.

    Raises:
        InvalidInput: The arm has what no filament there has: another profile than a linear taper,
            a bore, or other actuators than fibers along all of it; or something else is there.
        NotWritten: It cannot be written.
    """
    write_text(path, design_script(arm), overwrite=overwrite)


def design_script(arm: Manipulator) -> str:
    """The text that `write_design` writes.

    Raises:
        InvalidInput: As `write_design`.
    """
    filament = filament_of(a_manipulator("arm", arm))
    return "\n".join([_HEAD, *_body(filament)]) + "\n"


def _body(filament: Filament) -> Iterator[str]:
    yield "rings = ["
    for ring in filament.rings:
        mechanics = _mechanics_text(ring.young_modulus, ring.poisson_ratio)
        geometry = f"Geometry({ring.inner_radius!r}, {ring.outer_radius!r})"
        fibers = f"FiberArchitecture({_angle_text(ring.angle, filament.length)})"
        yield f"    Ring({mechanics}, {geometry}, {fibers}),{_comment(ring)}"
    yield "]"
    inside = _mechanics_text(filament.core_modulus, filament.core_poisson_ratio)
    inner = filament.rings[0].inner_radius
    yield f"innerTube = InnerTube({inside}, Geometry(0.0, {inner!r}))"
    values = {"L": filament.length, "phi2": filament.taper, "ρvol": filament.density}
    options = [f"{name} = {value!r}" for name, value in values.items() if value is not None]
    yield f"filament = AFilament(rings; {', '.join(options)}, innerTube = innerTube)"
    yield from ("", *_activation(filament.rings))


def _activation(rings: Sequence[FilamentRing]) -> Iterator[str]:
    yield "activation = ["
    for ring in rings:
        lows = _vector(low for low, _ in ring.bounds)
        yield (
            f"    ActivationPiecewiseGamma({len(ring.bounds)}, {lows}, {ring.extent!r}, "
            f"{ring.offset!r}),"
        )
    yield "]"
    yield "γBounds = ["
    for ring in rings:
        lows, highs = (_vector(pair[side] for pair in ring.bounds) for side in (0, 1))
        yield f"    ({lows}, {highs}),"
    yield "]"


def _comment(ring: FilamentRing) -> str:
    name = "".join(character if character.isprintable() else " " for character in ring.name)
    scale = f"γ is {ring.scale:g} times that of softreach" if ring.scale != 1 else ""
    comment = "; ".join(part for part in (name.strip(), scale) if part)
    return f"  # {comment}" if comment else ""


def _mechanics_text(modulus: float, poisson_ratio: float) -> str:
    return f"MechanicalProperties({modulus!r}, {poisson_ratio!r})"


def _angle_text(angle: Angle, length: float) -> str:
    if not isinstance(angle, Pieces):
        return repr(angle)
    ends = [length * x for x in angle.stations_over_length]
    ranges = ", ".join(f"({start!r}, {end!r})" for start, end in pairwise(ends))
    return f"PiecewiseStructure({_vector(angle.values)}, [{ranges}])"


def _vector(numbers: Iterable[float]) -> str:
    return f"[{', '.join(map(repr, numbers))}]"
