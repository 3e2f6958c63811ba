"""What a design must satisfy, checked on plain values.

The constructors and the file reader share these checks. Absent values are not judged, so that a
file with one unreadable key still hears of its other faults.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from softreach.errors import Fault, Range

__all__ = ["ARM_RANGES", "FIBER_RANGES", "arm_faults", "fiber_faults", "plain_number"]

ARM_RANGES = {
    "length": Range(0.0, unit="m", open_low=True),
    "outer_radius": Range(0.0, unit="m", open_low=True),
    "inner_radius": Range(0.0, unit="m"),
    "taper": Range(-math.pi / 2, math.pi / 2, "rad", open_low=True, open_high=True),
    "poisson_ratio": Range(0.0, 0.5),
}

FIBER_RANGES = {
    "helical_angle": Range(-math.pi / 2, math.pi / 2, "rad", open_low=True, open_high=True),
    "revolution": Range(unit="rad"),
    "offset": Range(unit="rad"),
    "extent": Range(0.0, 2 * math.pi, "rad", open_low=True),
    "bundles": Range(low=1, whole=True),
}


def arm_faults(values: Mapping[str, Any], bundles: int | None = None) -> list[Fault]:
    """Everything wrong with the fields of a manipulator but its fibers.

    Args:
        values: Fields by name, SI units; absent ones are skipped.
        bundles: How many bundles the arm has, if that is known.
    """
    faults = _range_faults(values, ARM_RANGES)
    blamed = {fault.path for fault in faults}
    sound = {name: values[name] for name in values if name not in blamed}
    faults += _radius_faults(**{name: plain_number(sound.get(name)) for name in ARM_RANGES})
    if "activation_bounds" in sound:
        faults += _bounds_faults(sound["activation_bounds"], bundles)
    return faults


def fiber_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with the fields of one architecture."""
    faults = _range_faults(values, FIBER_RANGES)
    if {"helical_angle", "revolution"} <= values.keys():
        faults += _winding_faults(values["helical_angle"], values["revolution"])
    return faults


def plain_number(value: Any) -> Any:
    """A Python number for a NumPy scalar; anything else as it is."""
    return value.item() if hasattr(value, "item") and getattr(value, "ndim", 0) == 0 else value


def _range_faults(values: Mapping[str, Any], ranges: Mapping[str, Range]) -> list[Fault]:
    """A fault for each value outside its range; None is skipped."""
    faults = []
    for name, allowed in ranges.items():
        value = plain_number(values.get(name))
        if value is not None and not allowed.admits(value):
            faults.append(Fault(name, value, allowed))
    return faults


def _winding_faults(angle: float | None, revolution: float | None) -> list[Fault]:
    if (angle is None) != (revolution is None):
        return []
    allowed = "give exactly one of helical_angle and revolution (0 for a longitudinal fiber)"
    return [Fault("helical_angle, revolution", (angle, revolution), allowed)]


def _radius_faults(
    length: float | None,
    outer_radius: float | None,
    inner_radius: float | None,
    taper: float | None,
    **_: object,
) -> Iterator[Fault]:
    if outer_radius is not None and inner_radius is not None and inner_radius >= outer_radius:
        yield Fault(
            "inner_radius", inner_radius, f"must be below outer_radius = {outer_radius:g} m"
        )
    if length is None or outer_radius is None or taper is None:
        return
    tip = outer_radius - length * math.tan(taper)
    if tip <= 0:
        limit = math.atan(outer_radius / length)
        allowed = f"leaves no tip (R2(L) = {tip:.4g} m)"
        yield Fault("taper", taper, f"{allowed}; must be below {limit:.6g} rad ({_degrees(limit)})")


def _bounds_faults(bounds: Any, bundles: int | None) -> list[Fault]:
    try:
        pairs = np.asarray(bounds, dtype=float)
    except (TypeError, ValueError):
        pairs = np.empty(0)
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


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.4g}°"
