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
    "MATERIAL_RANGES",
    "PROFILE_RANGES",
    "RING_RANGES",
    "bounds_faults",
    "fiber_faults",
    "name_faults",
    "plain_number",
    "profile_faults",
    "range_faults",
    "ring_faults",
    "tube_faults",
]

PROFILE_RANGES = {
    "length": Range(0.0, unit="m", open_low=True),
    "outer_radius": Range(0.0, unit="m", open_low=True),
    "taper": Range(-math.pi / 2, math.pi / 2, "rad", open_low=True, open_high=True),
}

MATERIAL_RANGES = {"poisson_ratio": Range(0.0, 0.5)}

FIBER_RANGES = {
    "helical_angle": Range(-math.pi / 2, math.pi / 2, "rad", open_low=True, open_high=True),
    "revolution": Range(unit="rad"),
    "offset": Range(unit="rad"),
    "extent": Range(0.0, 2 * math.pi, "rad", open_low=True),
    "bundles": Range(low=1, whole=True),
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

_OPTIONAL = {"helical_angle", "revolution"}


def profile_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with the fields of a linear taper."""
    faults = range_faults(values, PROFILE_RANGES)
    return faults + list(_taper_faults(_sound(values, faults)))


def ring_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with the fields of a ring."""
    faults = range_faults(values, RING_RANGES)
    inner, outer = (plain_number(values[name]) for name in RING_RANGES)
    if not faults and inner >= outer:
        faults = [Fault("inner_ratio", inner, f"must be below outer_ratio = {outer:g}")]
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
    """Everything wrong with the fields of one architecture."""
    faults = range_faults(values, FIBER_RANGES)
    if {"helical_angle", "revolution"} <= values.keys():
        faults += _winding_faults(values["helical_angle"], values["revolution"])
    if not isinstance(values.get("name", ""), str):
        faults.append(Fault("name", values["name"], "must be text"))
    if "activation_bounds" in values:
        bundles = _sound(values, faults).get("bundles")
        faults += bounds_faults(values["activation_bounds"], bundles)
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
        allowed = f"must be one pair, or {bundles} pairs: one for each bundle"
        return [Fault("activation_bounds", bounds, allowed)]
    return []


def name_faults(names: list[Any], path: str) -> Iterator[Fault]:
    """Names given twice; an empty name does not count."""
    for k, name in enumerate(names):
        if name and name in names[:k]:
            first = names.index(name)
            yield Fault(f"{path}[{k}].name", name, f"must differ from {path}[{first}].name")


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


def _winding_faults(angle: float | None, revolution: float | None) -> list[Fault]:
    if (angle is None) != (revolution is None):
        return []
    allowed = "give exactly one of helical_angle and revolution (0 for a longitudinal fiber)"
    return [Fault("helical_angle, revolution", (angle, revolution), allowed)]


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
        allowed = f"leaves no tip (R2(L) = {tip:.4g} m)"
        yield Fault("taper", taper, f"{allowed}; must be below {limit:.6g} rad ({_degrees(limit)})")


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.4g}°"
