"""Definitions of filaments, as users of ActiveFilaments.jl write them, as designs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np

from softreach.arm.along import Pieces
from softreach.arm.manipulator import Manipulator
from softreach.exchange.activefilaments.constructors import Constructed, Unreadable, is_of_kind
from softreach.exchange.activefilaments.filament import (
    Angle,
    Filament,
    FilamentRing,
    arm_of,
    is_from_inside_out,
)
from softreach.support.arguments import as_path
from softreach.support.errors import InvalidDesign, InvalidInput
from softreach.support.files.text import read_text

__all__ = ["read_design"]

_LARGEST = 100_000  # bytes
_BOUNDS = (-5 / 3, 0.0)  # where the file has none, widened to hold the activation
_BOUNDS_NAMES = ("γBounds", "gammaBounds", "γ_bounds", "gamma_bounds")
_ACTIVATION = "ActivationPiecewiseGamma"

Pairs = tuple[tuple[float, float], ...]
"""(lower, upper) of each sector of a ring."""


def read_design(path: str | PathLike[str]) -> Manipulator:
    """Read the definition of a filament from Julia source for ActiveFilaments.jl.

    The file must define one AFilament and its activation, one ActivationPiecewiseGamma a ring. The
    bounds of the activations are `γBounds` or `gammaBounds` if the file has them; else [-5/3, 0],
    widened to hold the activation.

    Args:
        path: The file. It is read and never run: numbers, simple arithmetic, elementary functions
            and the constructors of the package are understood.

    Raises:
        InvalidInput: A definition that is not such, with the number of its line, or that no arm can
            have.
    """
    from softreach.exchange.activefilaments.julia import Julia

    source = as_path("path", path)
    known = Julia(source).read(read_text("definition", source, _LARGEST))
    filament = _filament(_the_filament(source, known), known)
    try:
        return arm_of(filament)
    except InvalidDesign as error:
        faults = "; ".join(str(fault) for fault in error.faults)
        raise InvalidInput(source, faults, "the filament of an arm that can exist") from None


def _the_filament(source: str, known: Mapping[str, Any]) -> Constructed:
    """The one filament that is defined, or why there is none."""
    filaments = [value for value in known.values() if is_of_kind(value, "AFilament")]
    if len(filaments) == 1:
        return filaments[0]
    if filaments:
        lines = " and ".join(filament.where.rpartition(" ")[2] for filament in filaments)
        raise InvalidInput(source, f"filaments in lines {lines}", "the definition of one filament")
    _raise_unreadable(known, "AFilament")
    allowed = "a definition with `filament = AFilament(rings; ...)`"
    raise InvalidInput(source, "no filament", allowed)


def _raise_unreadable(known: Mapping[str, Any], name: str) -> None:
    """Raise why a name could not be read that was made from a constructor."""
    for value in known.values():
        if isinstance(value, Unreadable) and name in value.names:
            raise value.error


def _filament(filament: Constructed, known: Mapping[str, Any]) -> Filament:
    """The filament, with the activation that is defined beside it."""
    _check_each(filament, filament.rings, "Ring")
    activation = _activation(filament, known)
    bounds = _bounds(filament, known, activation)
    rings = [
        _ring(ring, sectors, pairs, filament.L)
        for ring, sectors, pairs in zip(filament.rings, activation, bounds, strict=True)
    ]
    if not is_from_inside_out(rings):
        spans = ", ".join(f"{ring.inner_radius:g} to {ring.outer_radius:g}" for ring in rings)
        raise filament.fault(spans, "rings with the innermost first and the outermost last")
    modulus, ratio = _core(filament.innerTube, rings[0])
    ends = np.cumsum([len(ring.bounds) for ring in rings]).tolist()
    return Filament(
        length=filament.L,
        taper=filament.phi2,
        density=filament.ρvol,
        rings=tuple(
            replace(ring, bundles=tuple(range(end - len(ring.bounds), end)))
            for ring, end in zip(rings, ends, strict=True)
        ),
        core_modulus=modulus,
        core_poisson_ratio=ratio,
    )


def _check_each(of: Constructed, values: Sequence[Any], kind: str) -> None:
    for value in values:
        if not is_of_kind(value, kind):
            raise of.fault(value, f"given a vector of {kind}")


def _ring(ring: Constructed, sectors: Constructed, bounds: Pairs, length: float) -> FilamentRing:
    inner, outer = ring.geometry.R1, ring.geometry.R2
    if not 0 <= inner < outer:
        raise ring.geometry.fault(f"R1 = {inner:g}, R2 = {outer:g}", "0 <= R1 < R2")
    return FilamentRing(
        young_modulus=ring.mechanics.E,
        poisson_ratio=ring.mechanics.ν,
        inner_radius=inner,
        outer_radius=outer,
        angle=_angle(ring.architecture, length),
        extent=sectors.σ,
        offset=sectors.θ0,
        bounds=bounds,
    )


def _angle(architecture: Constructed, length: float) -> Angle:
    pieces = architecture.α2
    if isinstance(pieces, float):
        return pieces
    if not is_of_kind(pieces, "PiecewiseStructure"):
        raise architecture.fault(pieces, "given a number or a PiecewiseStructure")
    ranges = pieces.piecewiseRanges
    pairs = all(is_of_kind(ends, "a vector of numbers") and len(ends) == 2 for ends in ranges)
    joined = [ranges[0][0], *(end for _, end in ranges)] if pairs else []
    if not joined or [start for start, _ in ranges] != joined[:-1] or length <= 0:
        raise pieces.fault("ranges", "pairs (Z1, Z2) that follow one another from 0 to L")
    stations = tuple(end / length for end in joined)
    try:
        return Pieces(stations_over_length=stations, values=tuple(pieces.expressions))
    except InvalidDesign as error:
        raise pieces.fault("ranges", f"from 0 to L = {length:g}, {error}") from None


def _core(tube: Constructed | None, innermost: FilamentRing) -> tuple[float, float]:
    """E and ν of the inside."""
    if tube is None:
        return innermost.young_modulus, innermost.poisson_ratio
    inner, outer = tube.geometry.R1, tube.geometry.R2
    if inner != 0 or not math.isclose(outer, innermost.inner_radius, rel_tol=1e-12):
        allowed = f"from 0 to the innermost ring, {innermost.inner_radius:g}"
        raise tube.fault(f"{inner:g} to {outer:g}", allowed)
    return tube.mechanics.E, tube.mechanics.ν


def _activation(filament: Constructed, known: Mapping[str, Any]) -> list[Constructed]:
    """The structure of the activation, the last one that is defined: one entry for each ring."""
    activation = next(filter(_is_activation, list(known.values())[::-1]), None)
    if activation is None:
        _raise_unreadable(known, _ACTIVATION)
        allowed = f"beside `activation = [{_ACTIVATION}(...)]`, one for each ring"
        raise filament.fault("the filament", allowed)
    for sectors in activation:
        if len(sectors.γ) != sectors.N or not sectors.γ:
            allowed = f"N = {sectors.N:g} of them, 1 or more"
            raise sectors.fault(f"{len(sectors.γ)} activations", allowed)
    if len(activation) != len(filament.rings):
        allowed = f"{len(filament.rings)}, one for each ring"
        raise activation[0].fault(f"{len(activation)} of them", allowed)
    return activation


def _is_activation(value: object) -> bool:
    return (
        isinstance(value, list) and bool(value) and all(is_of_kind(v, _ACTIVATION) for v in value)
    )


def _bounds(
    filament: Constructed, known: Mapping[str, Any], activation: Sequence[Constructed]
) -> list[Pairs]:
    bounds = next((known[name] for name in _BOUNDS_NAMES if name in known), None)
    if bounds is None:
        low, high = _BOUNDS
        return [tuple((min(low, γ), max(high, γ)) for γ in sectors.γ) for sectors in activation]
    if isinstance(bounds, Unreadable):
        raise bounds.error
    where = Constructed(name="γBounds", where=filament.where)
    if not isinstance(bounds, list) or len(bounds) != len(activation):
        allowed = f"{len(activation)} tuples (lows, highs), one for each ring"
        raise where.fault(bounds, allowed)
    return [
        _pairs(where, value, len(sectors.γ))
        for value, sectors in zip(bounds, activation, strict=True)
    ]


def _pairs(where: Constructed, value: Any, count: int) -> Pairs:
    allowed = f"a tuple (lows, highs) of {count} numbers each"
    if not isinstance(value, tuple) or len(value) != 2:
        raise where.fault(value, allowed)
    lows, highs = value
    if not all(is_of_kind(side, "a vector of numbers") and len(side) == count for side in value):
        raise where.fault(f"{value}", allowed)
    return tuple(zip(lows, highs, strict=True))
