"""What a design must satisfy, checked on plain values.

The constructors and the file reader share these checks. Absent values are not judged, so that one
unreadable key does not hide a file's other faults; None is a value, and rarely allowed.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from softreach.errors import Fault, Range

__all__ = [
    "FIBER_RANGES",
    "INSIDE_RANGE",
    "MATERIAL_RANGES",
    "PROFILE_RANGES",
    "RING_RANGES",
    "STRETCH_RANGES",
    "bounds_faults",
    "fiber_faults",
    "material_faults",
    "name_faults",
    "plain_number",
    "profile_faults",
    "range_faults",
    "ring_faults",
    "section_faults",
    "series_faults",
    "stretch_faults",
    "text_faults",
    "tube_faults",
]

PROFILE_RANGES = {
    "length": Range(0.0, unit="m", open_low=True),
    "outer_radius": Range(0.0, unit="m", open_low=True),
    "taper": Range(-math.pi / 2, math.pi / 2, "rad", open_low=True, open_high=True),
}

MATERIAL_RANGES = {
    "young_modulus": Range(0.0, unit="Pa", open_low=True),
    "poisson_ratio": Range(0.0, 0.5),
    "density": Range(0.0, unit="kg/m³", open_low=True),
}

FIBER_RANGES = {
    "helical_angle": Range(-math.pi / 2, math.pi / 2, "rad", open_low=True, open_high=True),
    "revolution": Range(unit="rad"),
    "offset": Range(unit="rad"),
    "extent": Range(0.0, 2 * math.pi, "rad", open_low=True),
    "bundles": Range(low=1, high=1000, whole=True),
}

INSIDE_RANGE = Range(0.0, 1.0, open_low=True, open_high=True)
"""Between base and tip, over the length."""

STRETCH_RANGES = {
    "start_over_length": Range(0.0, 1.0, open_high=True),
    "end_over_length": Range(0.0, 1.0, open_low=True),
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

_OPTIONAL = {"helical_angle", "revolution", "young_modulus", "density"}


def profile_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with the fields of a linear taper."""
    faults = range_faults(values, PROFILE_RANGES)
    return faults + list(_taper_faults(_sound(values, faults)))


def material_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with the fields of a material."""
    return range_faults(values, MATERIAL_RANGES) + text_faults(values)


def text_faults(values: Mapping[str, Any]) -> list[Fault]:
    """A name that is not text."""
    name = values.get("name", "")
    return [] if isinstance(name, str) else [Fault("name", name, "must be text")]


def ring_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with the fields of a ring."""
    faults = range_faults(values, RING_RANGES) + text_faults(values)
    inner, outer = (plain_number(values[name]) for name in RING_RANGES)
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
    if not faults and (bore := plain_number(values["bore_ratio"])) > inner:
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
    sound = _sound(values, faults)
    faults += _inner_radius_faults(sound.get("outer_radius"), sound.get("inner_radius"))
    faults += _taper_faults(sound)
    if sound.get("activation_bounds") is not None:
        faults += bounds_faults(sound["activation_bounds"], bundles)
    return faults


def fiber_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with the fields of one architecture; absent ones are skipped."""
    faults = range_faults(values, FIBER_RANGES)
    if {"helical_angle", "revolution"} <= values.keys():
        faults += _one_winding(values["helical_angle"], values["revolution"])
    faults += text_faults(values)
    if "activation_bounds" in values:
        bundles = _sound(values, faults).get("bundles")
        faults += bounds_faults(values["activation_bounds"], bundles)
    return faults


def actuator_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with the fields that all actuators have."""
    faults = range_faults(values, {"bundles": FIBER_RANGES["bundles"]}) + text_faults(values)
    bundles = _sound(values, faults).get("bundles")
    return faults + bounds_faults(values["activation_bounds"], bundles) + stretch_faults(values)


def sector_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with where the bundles of a sector lie."""
    faults = range_faults(values, {name: FIBER_RANGES[name] for name in ("offset", "extent")})
    return faults + which_ring_faults(values["ring"])


def which_ring_faults(ring: Any) -> list[Fault]:
    """What names no ring."""
    if isinstance(ring, str) or (
        isinstance(ring, int) and not isinstance(ring, bool) and ring >= 0
    ):
        return []
    return [Fault("ring", ring, "must be the index, from 0, or the name of a ring")]


def angle_faults(angle: Any) -> list[Fault]:
    """What is no helical angle, constant or along the arm."""
    along = _values_along(angle)
    allowed = {"helical_angle": FIBER_RANGES["helical_angle"]}
    angles = (angle,) if along is None else along
    return [fault for one in angles for fault in range_faults({"helical_angle": one}, allowed)]


def constant_angle_faults(angle: Any) -> list[Fault]:
    """What is no helical angle that stays the same along the arm."""
    allowed = FIBER_RANGES["helical_angle"]
    return [] if allowed.admits(plain_number(angle)) else [Fault("helical_angle", angle, allowed)]


def tendon_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with the route of a tendon, or with tensions that push."""
    ranges = {name: FIBER_RANGES[name] for name in ("offset", "revolution")}
    faults = range_faults(values, ranges)
    if values["revolution"] is None:
        faults.append(Fault("revolution", None, FIBER_RANGES["revolution"]))
    faults += one_length_faults(values, "distance", Range(0.0, unit="m"), sampled=True)
    bounds = _numbers(values["activation_bounds"])
    if bounds.size and bounds.min() < 0:
        allowed = "must be at least 0 N: a tendon pulls and cannot push"
        faults.append(Fault("activation_bounds", values["activation_bounds"], allowed))
    return faults


def chamber_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with where a chamber lies and how wide it is."""
    positive = Range(0.0, open_low=True)
    faults = range_faults(values, {"offset": FIBER_RANGES["offset"], "area_factor": positive})
    faults += one_length_faults(values, "distance", Range(0.0, unit="m"))
    return faults + one_length_faults(values, "radius", positive._replace(unit="m"))


def one_length_faults(
    values: Mapping[str, Any], field: str, allowed: Range, *, sampled: bool = False
) -> list[Fault]:
    """Faults of a length that is given in m, or as a ratio to R2(Z)."""
    ratio = f"{field}_ratio"
    given = [name for name in (field, ratio) if values[name] is not None]
    if len(given) != 1:
        both = tuple(values[name] for name in (field, ratio)) if given else None
        return [Fault(f"{field}, {ratio}", both, f"give exactly one of {field} and {ratio}")]
    along = _values_along(values[field]) if sampled else None
    if along is not None:
        return [fault for one in along for fault in range_faults({field: one}, {field: allowed})]
    return range_faults(
        {given[0]: values[given[0]]},
        {field: allowed, ratio: allowed._replace(unit="")},
    )


def winding_faults(angle: Any, revolution: Any) -> list[Fault]:
    """Everything wrong with how a fiber winds."""
    faults = angle_faults(angle)
    faults += range_faults({"revolution": revolution}, {"revolution": FIBER_RANGES["revolution"]})
    return faults + _one_winding(angle, revolution)


def series_faults(values: Mapping[str, Any], field: str, per_station: bool = True) -> list[Fault]:
    """Everything wrong with values given along the arm.

    Args:
        values: `stations_over_length` and the values themselves.
        field: What the values are called.
        per_station: Whether there is one for each station; else one for each gap between them.
    """
    stations, along = _numbers(values["stations_over_length"]), _numbers(values[field])
    if stations.ndim != 1 or len(stations) < 2 or not _ascends_from_0_to_1(stations):
        allowed = "must be two or more numbers that rise from 0 (base) to 1 (tip)"
        return [Fault("stations_over_length", values["stations_over_length"], allowed)]
    count = len(stations) if per_station else len(stations) - 1
    if along.shape != (count,) or not np.isfinite(along).all():
        where = "station" if per_station else "gap between stations"
        return [
            Fault(field, values[field], f"must be {count} finite numbers, one for each {where}")
        ]
    return []


def _ascends_from_0_to_1(stations: np.ndarray[Any, np.dtype[np.float64]]) -> bool:
    ends = stations[0] == 0.0 and stations[-1] == 1.0
    return bool(ends and np.isfinite(stations).all() and (np.diff(stations) > 0).all())


def stretch_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with where along the arm an actuator begins and ends."""
    faults = range_faults(values, STRETCH_RANGES)
    start, end = (plain_number(values[name]) for name in STRETCH_RANGES)
    if not faults and start >= end:
        faults = [Fault("end_over_length", end, f"must be above start_over_length = {start:g}")]
    return faults


def bounds_faults(bounds: Any, bundles: int | None) -> list[Fault]:
    """Whatever is wrong with a pair (lower, upper), or one such pair for each bundle."""
    pairs = _numbers(bounds)
    if pairs.shape[-1:] != (2,) or pairs.ndim > 2 or not pairs.size:
        allowed = "must be a pair (lower, upper), or one such pair for each bundle"
        return [Fault("activation_bounds", bounds, allowed)]
    if not np.isfinite(pairs).all():
        return [Fault("activation_bounds", bounds, "must hold finite numbers")]
    if (pairs[..., 0] > pairs[..., 1]).any():
        return [Fault("activation_bounds", bounds, "must have lower <= upper")]
    if pairs.ndim == 2 and bundles is not None and len(pairs) != bundles:
        several = f", or {bundles} pairs: one for each bundle" if bundles > 1 else ""
        allowed = f"must be one pair{several}"
        return [Fault("activation_bounds", bounds, allowed)]
    return []


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


def plain_number(value: Any) -> Any:
    """A Python number for a NumPy scalar; anything else as it is."""
    return value.item() if hasattr(value, "item") and getattr(value, "ndim", 0) == 0 else value


def range_faults(values: Mapping[str, Any], ranges: Mapping[str, Range]) -> list[Fault]:
    """A fault for each value outside its range; absent ones are skipped."""
    given = {name: plain_number(values[name]) for name in ranges if name in values}
    return [
        Fault(name, value, ranges[name])
        for name, value in given.items()
        if not ranges[name].admits(value) and not (value is None and name in _OPTIONAL)
    ]


def _values_along(given: Any) -> tuple[float, ...] | None:
    """The values of what changes along the arm; None for anything else."""
    values = getattr(given, "values", None)
    return values if isinstance(values, tuple) else None


def _numbers(values: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Numbers as an array; empty for text, booleans and anything else that is not a number."""
    try:
        array = np.asarray(values)
    except (TypeError, ValueError):
        return np.empty(0)
    return array.astype(float) if array.dtype.kind in "iuf" else np.empty(0)


def _sound(values: Mapping[str, Any], faults: list[Fault]) -> dict[str, Any]:
    """The values without a fault so far."""
    blamed = {fault.path for fault in faults}
    return {name: plain_number(value) for name, value in values.items() if name not in blamed}


def _one_winding(angle: Any, revolution: Any) -> list[Fault]:
    if (angle is None) != (revolution is None):
        return []
    allowed = "give exactly one of helical_angle and revolution (0 for a longitudinal fiber)"
    both = None if angle is None else (angle, revolution)
    return [Fault("helical_angle, revolution", both, allowed)]


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
