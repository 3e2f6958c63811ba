"""Definitions of filaments as Julia source that ActiveFilaments.jl runs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from os import PathLike

from softreach.arm.along import Pieces
from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.exchange.activefilaments.filament import Angle, Filament, FilamentRing, filament_of
from softreach.support.files.formats import FileFormat, Formats
from softreach.support.files.text import write_text

__all__ = ["FILAMENT_SCRIPT", "design_script", "write_design"]

_HEAD = """\
# The filament of ActiveFilaments.jl with the tips of a design of softreach.
# Lengths in m, angles in rad, E in Pa, density in kg/m^3.
using ActiveFilaments
"""


FILAMENT_SCRIPT: Formats = {".jl": FileFormat()}
"""Format of `write_design`."""


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
        mechanics = _mechanics(ring.young_modulus, ring.poisson_ratio)
        geometry = f"Geometry({ring.inner_radius!r}, {ring.outer_radius!r})"
        fibers = f"FiberArchitecture({_angle(ring.angle, filament.length)})"
        yield f"    Ring({mechanics}, {geometry}, {fibers}),{_comment(ring)}"
    yield "]"
    inside = _mechanics(filament.core_modulus, filament.core_poisson_ratio)
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
    told = "; ".join(part for part in (name.strip(), scale) if part)
    return f"  # {told}" if told else ""


def _mechanics(modulus: float, poisson_ratio: float) -> str:
    return f"MechanicalProperties({modulus!r}, {poisson_ratio!r})"


def _angle(angle: Angle, length: float) -> str:
    if not isinstance(angle, Pieces):
        return repr(angle)
    ends = [length * x for x in angle.stations_over_length]
    ranges = ", ".join(f"({start!r}, {end!r})" for start, end in pairwise(ends))
    return f"PiecewiseStructure({_vector(angle.values)}, [{ranges}])"


def _vector(numbers: Iterable[float]) -> str:
    return f"[{', '.join(map(repr, numbers))}]"
