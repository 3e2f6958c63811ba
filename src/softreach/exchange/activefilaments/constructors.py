"""From the constructors in a definition to a filament."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from softreach.arm.along import Pieces
from softreach.exchange.activefilaments.expressions import Call, Unreadable
from softreach.exchange.activefilaments.filament import (
    Angle,
    Filament,
    FilamentRing,
    is_from_inside_out,
)
from softreach.support.errors import InvalidDesign, InvalidInput

__all__ = ["filament_from"]

_BOUNDS = (-5 / 3, 0.0)  # where the file has none, widened to hold the activation
_DENSITY = 1000.0  # the default of AFilament [kg/m³]
_BOUNDS_NAMES = ("γBounds", "gammaBounds", "γ_bounds", "gamma_bounds")


class _Sectors(NamedTuple):
    """One ActivationPiecewiseGamma."""

    line: int
    gamma: tuple[float, ...]
    extent: float
    offset: float


class _Reader(NamedTuple):
    """Arguments of constructors, checked one by one."""

    source: str

    def fault(self, call: Call, value: object, allowed: str) -> InvalidInput:
        shown = value if isinstance(value, int | float | str) else type(value).__name__
        return InvalidInput(f"{self.source}, line {call.line}, {call.name}", shown, allowed)

    def arguments(self, call: Call, names: str, **defaults: Any) -> list[Any]:
        """Positional arguments, then options, in the order of their names."""
        order = names.split()
        if len(call.values) > len(order):
            raise self.fault(call, f"{len(call.values)} arguments", f"of {', '.join(order)}")
        given = dict(zip(order, call.values, strict=False)) | dict(call.options)
        if unknown := set(given) - set(order) - set(defaults):
            known = ", ".join([*order, *defaults])
            raise self.fault(call, sorted(unknown)[0], f"one of {known}")
        if missing := [name for name in order if name not in given]:
            raise self.fault(call, "nothing", f"given for {missing[0]}")
        return [({**defaults, **given})[name] for name in [*order, *defaults]]

    def number(self, call: Call, name: str, value: object) -> float:
        if not isinstance(value, float):
            raise self.fault(call, value, f"a number for {name}")
        return value

    def numbers(self, call: Call, name: str, value: object) -> tuple[float, ...]:
        if not isinstance(value, list | tuple) or not all(isinstance(x, float) for x in value):
            raise self.fault(call, value, f"a vector of numbers for {name}")
        return tuple(value)

    def call(self, call: Call, kind: str, value: object) -> Call:
        if not isinstance(value, Call) or value.name != kind:
            shown = value.name if isinstance(value, Call) else value
            raise self.fault(call, shown, f"given a {kind}")
        return value

    def calls(self, call: Call, kind: str, value: object) -> list[Call]:
        if not isinstance(value, list) or not value:
            raise self.fault(call, value, f"given a vector of {kind}")
        return [self.call(call, kind, one) for one in value]


def filament_from(source: str, call: Call, known: Mapping[str, Any]) -> Filament:
    """The filament of an AFilament, with the activation that is defined beside it.

    Args:
        source: What errors call the file.
        call: The AFilament.
        known: What the names in the file stand for.

    Raises:
        InvalidInput: Arguments that are missing, unknown or of another kind, with their line.
    """
    read = _Reader(source)
    names, defaults = "rings", {"L": 1.0, "phi2": 0.0, "ρvol": _DENSITY, "N": 32.0}
    vector, length, taper, density, _, tube = read.arguments(
        call, names, **defaults, innerTube=None
    )
    length = read.number(call, "L", length)
    rings = read.calls(call, "Ring", vector)
    activation = _activation(read, call, known, len(rings))
    bounds = _bounds(read, call, known, activation)
    parts = [
        _ring(read, ring, sectors, pairs, length)
        for ring, sectors, pairs in zip(rings, activation, bounds, strict=True)
    ]
    if not is_from_inside_out(parts):
        spans = ", ".join(f"{one.inner_radius:g} to {one.outer_radius:g}" for one in parts)
        raise read.fault(call, spans, "rings with the innermost first and the outermost last")
    modulus, ratio = _core(read, call, tube, parts[0])
    return Filament(
        length=length,
        taper=read.number(call, "phi2", taper),
        density=read.number(call, "ρvol", density),
        rings=tuple(_with_bundles(parts)),
        core_modulus=modulus,
        core_poisson_ratio=ratio,
    )


def _with_bundles(parts: Sequence[FilamentRing]) -> list[FilamentRing]:
    """Each ring with the numbers of its sectors among all."""
    ends = np.cumsum([len(part.bounds) for part in parts]).tolist()
    return [
        replace(part, bundles=tuple(range(end - len(part.bounds), end)))
        for part, end in zip(parts, ends, strict=True)
    ]


def _ring(
    read: _Reader,
    call: Call,
    sectors: _Sectors,
    bounds: tuple[tuple[float, float], ...],
    length: float,
) -> FilamentRing:
    mechanics, geometry, architecture = read.arguments(call, "mechanics geometry architecture")
    modulus, ratio = _mechanics(read, call, mechanics)
    inner, outer = _radii(read, call, geometry)
    fibers = read.call(call, "FiberArchitecture", architecture)
    (angle,) = read.arguments(fibers, "α2")
    return FilamentRing(
        young_modulus=modulus,
        poisson_ratio=ratio,
        inner_radius=inner,
        outer_radius=outer,
        angle=_angle(read, fibers, angle, length),
        extent=sectors.extent,
        offset=sectors.offset,
        bounds=bounds,
        bundles=(),
    )


def _mechanics(read: _Reader, call: Call, value: object) -> tuple[float, float]:
    mechanics = read.call(call, "MechanicalProperties", value)
    modulus, ratio = read.arguments(mechanics, "E ν")
    return read.number(mechanics, "E", modulus), read.number(mechanics, "ν", ratio)


def _radii(read: _Reader, call: Call, value: object) -> tuple[float, float]:
    """R1 and R2; the angle of taper follows from that of the filament."""
    geometry = read.call(call, "Geometry", value)
    inner, outer, _ = read.arguments(geometry, "R1 R2", phi2=0.0)
    return read.number(geometry, "R1", inner), read.number(geometry, "R2", outer)


def _angle(read: _Reader, call: Call, value: object, length: float) -> Angle:
    if isinstance(value, float):
        return value
    pieces = read.call(call, "PiecewiseStructure", value)
    values, ranges = read.arguments(pieces, "expressions piecewiseRanges")
    angles = read.numbers(pieces, "expressions", values)
    ends = [read.numbers(pieces, "piecewiseRanges", one) for one in _listed(read, pieces, ranges)]
    joined = [ends[0][0], *(end for _, end in ends)] if all(len(e) == 2 for e in ends) else []
    if not joined or [start for start, _ in ends] != joined[:-1] or length <= 0:
        raise read.fault(pieces, "ranges", "pairs (Z1, Z2) that follow one another from 0 to L")
    try:
        return Pieces(stations_over_length=tuple(end / length for end in joined), values=angles)
    except InvalidDesign as error:
        raise read.fault(pieces, "ranges", f"from 0 to L = {length:g}, {error}") from None


def _listed(read: _Reader, call: Call, value: object) -> list[Any]:
    if not isinstance(value, list) or not value:
        raise read.fault(call, value, "given a vector of ranges")
    return value


def _core(read: _Reader, call: Call, tube: object, innermost: FilamentRing) -> tuple[float, float]:
    """E and ν of the inside."""
    if tube is None:
        return innermost.young_modulus, innermost.poisson_ratio
    inside = read.call(call, "InnerTube", tube)
    mechanics, geometry = read.arguments(inside, "mechanics geometry")
    inner, outer = _radii(read, inside, geometry)
    if inner != 0 or not math.isclose(outer, innermost.inner_radius, rel_tol=1e-12):
        allowed = f"from 0 to the innermost ring, {innermost.inner_radius:g}"
        raise read.fault(inside, f"{inner:g} to {outer:g}", allowed)
    return _mechanics(read, inside, mechanics)


def _activation(read: _Reader, call: Call, known: Mapping[str, Any], rings: int) -> list[_Sectors]:
    """The structure of the activation: one entry for each ring."""
    name = "ActivationPiecewiseGamma"
    lists = [value for value in known.values() if _is_activation(value, name)]
    if not lists:
        for value in known.values():
            if isinstance(value, Unreadable) and name in value.names:
                raise value.error
        allowed = f"beside `activation = [{name}(...)]`, one for each ring"
        raise read.fault(call, "the filament", allowed)
    found = [[_sectors(read, one) for one in each] for each in lists]
    last = found[-1]
    if len(last) != rings:
        where = Call(name, last[0].line, ())
        raise read.fault(where, f"{len(last)} of them", f"{rings}, one for each ring")
    return last


def _is_activation(value: object, name: str) -> bool:
    each = value if isinstance(value, list) and value else [None]
    return all(isinstance(one, Call) and one.name == name for one in each)


def _sectors(read: _Reader, call: Call) -> _Sectors:
    count, gamma, extent, offset = read.arguments(call, "N γ σ θ0")
    values = read.numbers(call, "γ", gamma)
    if read.number(call, "N", count) != len(values) or not values:
        raise read.fault(call, f"{len(values)} activations", f"N = {count:g} of them, 1 or more")
    extent, offset = read.number(call, "σ", extent), read.number(call, "θ0", offset)
    return _Sectors(call.line, values, extent, offset)


def _bounds(
    read: _Reader, call: Call, known: Mapping[str, Any], activation: list[_Sectors]
) -> list[tuple[tuple[float, float], ...]]:
    """(lower, upper) of each sector of each ring."""
    given = next((known[name] for name in _BOUNDS_NAMES if name in known), None)
    if given is None:
        return [
            tuple((min(_BOUNDS[0], gamma), max(_BOUNDS[1], gamma)) for gamma in sectors.gamma)
            for sectors in activation
        ]
    if isinstance(given, Unreadable):
        raise given.error
    where = Call("γBounds", call.line, ())
    if not isinstance(given, list) or len(given) != len(activation):
        raise read.fault(where, given, f"{len(activation)} tuples (lows, highs), one for each ring")
    return [
        _pairs(read, where, one, len(sectors.gamma))
        for one, sectors in zip(given, activation, strict=True)
    ]


def _pairs(read: _Reader, call: Call, value: object, count: int) -> tuple[tuple[float, float], ...]:
    allowed = f"a tuple (lows, highs) of {count} numbers each"
    if not isinstance(value, tuple) or len(value) != 2:
        raise read.fault(call, value, allowed)
    lows, highs = (read.numbers(call, "bounds", side) for side in value)
    if not len(lows) == len(highs) == count:
        raise read.fault(call, f"{len(lows)} lows and {len(highs)} highs", allowed)
    return tuple(zip(lows, highs, strict=True))
