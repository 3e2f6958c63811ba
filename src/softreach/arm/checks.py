"""What the body of an arm must satisfy, checked on plain values.

The constructors and the file reader share these checks, those of actuators and those of values.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from softreach.arm.actuator_checks import bounds_faults
from softreach.arm.value_checks import range_faults, sound_values, text_faults
from softreach.support.arguments import plain
from softreach.support.errors import Fault, Range

__all__ = [
    "MATERIAL_RANGES",
    "PROFILE_RANGES",
    "RING_RANGES",
    "material_faults",
    "name_faults",
    "profile_faults",
    "ring_faults",
    "section_faults",
    "tube_faults",
]

# Fourth powers of radii and cubes of lengths stay far from where doubles end, and so does all that
# is computed from them.
PROFILE_RANGES = {
    "length": Range(1e-9, 1e9, "m"),
    "outer_radius": Range(1e-12, 1e9, "m"),
    "taper": Range(-math.pi / 2, math.pi / 2, "rad", open_low=True, open_high=True),
}

MATERIAL_RANGES = {
    "young_modulus": Range(1e-30, 1e30, "Pa"),
    "poisson_ratio": Range(0.0, 0.5),
    "density": Range(1e-30, 1e30, "kg/m³"),
}

RING_RANGES = {
    "inner_ratio": Range(0.0, 1.0, open_high=True),
    "outer_ratio": Range(0.0, 1.0, open_low=True),
}

_TUBE_RANGES = {
    "length": PROFILE_RANGES["length"],
    "outer_radius": PROFILE_RANGES["outer_radius"],
    "inner_radius": Range(0.0, unit="m"),
    "inner_ratio": RING_RANGES["inner_ratio"],
    "taper": PROFILE_RANGES["taper"],
    **MATERIAL_RANGES,
}

_PARTS = ("actuators", "core", "loads", "profile", "rings", "section")


def profile_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with the fields of a linear taper."""
    faults = range_faults(values, PROFILE_RANGES)
    return faults + list(_taper_faults(sound_values(values, faults)))


def material_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with the fields of a material."""
    return range_faults(values, MATERIAL_RANGES) + text_faults(values)


def ring_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with the fields of a ring."""
    faults = range_faults(values, RING_RANGES) + text_faults(values)
    inner, outer = (plain(values[name]) for name in RING_RANGES)
    if not faults and inner >= outer:
        faults = [Fault("inner_ratio", inner, f"must be below outer_ratio = {outer:g}")]
    return faults


def section_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with how rings and bore fit together."""
    rings = values["rings"]
    faults = range_faults(values, {"bore_ratio": RING_RANGES["inner_ratio"]})
    faults += name_faults([ring.name for ring in rings], "rings")
    inner, outer = min(one.inner_ratio for one in rings), [one.outer_ratio for one in rings]
    if max(outer) != 1.0:
        allowed = "must be 1 for the outermost ring, which reaches the surface of the arm"
        faults.append(Fault(f"rings[{int(np.argmax(outer))}].outer_ratio", max(outer), allowed))
    if not faults and (bore := plain(values["bore_ratio"])) > inner:
        allowed = f"must be at most the smallest inner_ratio of the rings, {inner:g}"
        faults.append(Fault("bore_ratio", bore, allowed))
    return faults


def tube_faults(values: Mapping[str, Any], bundles: int | None = None) -> list[Fault]:
    """Everything wrong with the flat description of a tapered tube, except its fibers.

    Args:
        values: Fields by name, SI units; absent ones are skipped.
        bundles: How many bundles the arm has, if that is known.
    """
    faults = range_faults(values, _TUBE_RANGES)
    sound = sound_values(values, faults)
    faults += _inner_radius_faults(sound.get("outer_radius"), sound.get("inner_radius"))
    faults += _taper_faults(sound)
    if sound.get("activation_bounds") is not None:
        faults += bounds_faults(sound["activation_bounds"], bundles)
    return faults


def name_faults(names: list[Any], path: str) -> Iterator[Fault]:
    """Names given twice, or that paths of parameters would mix up; an empty one does not count."""
    for k, name in enumerate(names):
        if isinstance(name, str) and (wrong := _mixed_up(name, path)):
            yield Fault(f"{path}[{k}].name", name, wrong)
        if name and name in names[:k]:
            first = names.index(name)
            yield Fault(f"{path}[{k}].name", name, f"must differ from {path}[{first}].name")


def _mixed_up(name: str, path: str) -> str:
    """What is wrong with the name of an actuator or a ring in the path of a parameter."""
    if not name.isprintable() or name != name.strip() or set(name) & set(".[]"):
        return "must be one line without dots and brackets, and without spaces around it"
    if path == "actuators" and name in _PARTS:
        return f"must not be one of {', '.join(_PARTS)}, by which paths name parts of the arm"
    return "must not be a number, by which paths count rings" if _counts(name, path) else ""


def _counts(name: str, path: str) -> bool:
    return path == "rings" and name.isdecimal()


def _inner_radius_faults(outer: float | None, inner: float | None) -> Iterator[Fault]:
    if outer is not None and inner is not None and inner >= outer:
        yield Fault("inner_radius", inner, f"must be below outer_radius = {outer:g} m")


def _taper_faults(sound: Mapping[str, Any]) -> Iterator[Fault]:
    length, radius, taper = (sound.get(name) for name in PROFILE_RANGES)
    if length is None or radius is None or taper is None:
        return
    tip = radius - length * math.tan(taper)
    if tip <= 0:
        limit = math.atan(radius / length)
        why = f"leaves no tip (R2(L) = {tip:.4g} m)"
        yield Fault("taper", taper, Range(high=limit, unit="rad", open_high=True, why=why))
