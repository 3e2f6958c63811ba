"""What an actuator must satisfy, checked on plain values by constructors and the file reader."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from softreach.arm.value_checks import (
    as_numbers,
    range_faults,
    sound_values,
    text_faults,
    values_along,
)
from softreach.support.arguments import plain
from softreach.support.errors import Fault, Range

__all__ = [
    "FIBER_RANGES",
    "MOST_BUNDLES",
    "MOST_TURN",
    "STRETCH_RANGES",
    "actuator_faults",
    "angle_faults",
    "bounds_faults",
    "chamber_faults",
    "constant_angle_faults",
    "fiber_faults",
    "one_length_faults",
    "sector_faults",
    "stretch_faults",
    "tendon_faults",
    "which_ring_faults",
    "winding_faults",
]

MOST_TURN = 200 * math.pi
"""A hundred turns [rad]: steps along the arm grow with them, and with a thousand no tolerance is
met."""

MOST_BUNDLES = 100
"""Of a whole arm: the time to bound its bending grows with their square."""

_LARGEST = 1e30  # activation, in any unit: its products stay far from where doubles end

FIBER_RANGES = {
    "helical_angle": Range(-math.pi / 2, math.pi / 2, "rad", open_low=True, open_high=True),
    "revolution": Range(-MOST_TURN, MOST_TURN, "rad"),
    "offset": Range(unit="rad"),
    "extent": Range(0.0, 2 * math.pi, "rad", open_low=True),
    "bundles": Range(low=1, high=MOST_BUNDLES, whole=True),
}

STRETCH_RANGES = {
    "start_over_length": Range(0.0, 1.0, open_high=True),
    "end_over_length": Range(0.0, 1.0, open_low=True),
}


def fiber_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with the fields of one architecture; absent ones are skipped."""
    faults = range_faults(values, FIBER_RANGES)
    if {"helical_angle", "revolution"} <= values.keys():
        faults += _one_winding(values["helical_angle"], values["revolution"])
    faults += text_faults(values)
    if "activation_bounds" in values:
        bundles = sound_values(values, faults).get("bundles")
        faults += bounds_faults(values["activation_bounds"], bundles)
    return faults


def actuator_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with the fields that all actuators have."""
    faults = range_faults(values, {"bundles": FIBER_RANGES["bundles"]}) + text_faults(values)
    bundles = sound_values(values, faults).get("bundles")
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
    along = values_along(angle)
    allowed = {"helical_angle": FIBER_RANGES["helical_angle"]}
    angles = (angle,) if along is None else along
    return [fault for one in angles for fault in range_faults({"helical_angle": one}, allowed)]


def constant_angle_faults(angle: Any) -> list[Fault]:
    """What is no helical angle that stays the same along the arm."""
    allowed = FIBER_RANGES["helical_angle"]
    return [] if allowed.admits(plain(angle)) else [Fault("helical_angle", angle, allowed)]


def winding_faults(angle: Any, revolution: Any) -> list[Fault]:
    """Everything wrong with how a fiber winds."""
    faults = angle_faults(angle)
    faults += range_faults({"revolution": revolution}, {"revolution": FIBER_RANGES["revolution"]})
    return faults + _one_winding(angle, revolution)


def tendon_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with the route of a tendon, or with tensions that push."""
    ranges = {name: FIBER_RANGES[name] for name in ("offset", "revolution")}
    faults = range_faults(values, ranges)
    if values["revolution"] is None:
        faults.append(Fault("revolution", None, FIBER_RANGES["revolution"]))
    faults += one_length_faults(values, "distance", Range(0.0, unit="m"), sampled=True)
    bounds = as_numbers(values["activation_bounds"])
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
    along = values_along(values[field]) if sampled else None
    if along is not None:
        return [fault for one in along for fault in range_faults({field: one}, {field: allowed})]
    return range_faults(
        {given[0]: values[given[0]]},
        {field: allowed, ratio: allowed._replace(unit="")},
    )


def stretch_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with where along the arm an actuator begins and ends."""
    faults = range_faults(values, STRETCH_RANGES)
    start, end = (plain(values[name]) for name in STRETCH_RANGES)
    if not faults and start >= end:
        faults = [Fault("end_over_length", end, f"must be above start_over_length = {start:g}")]
    return faults


def bounds_faults(bounds: Any, bundles: int | None) -> list[Fault]:
    """Whatever is wrong with a pair (lower, upper), or one such pair for each bundle."""
    pairs = as_numbers(bounds)
    if pairs.shape[-1:] != (2,) or pairs.ndim > 2 or not pairs.size:
        allowed = "must be a pair (lower, upper), or one such pair for each bundle"
        return [Fault("activation_bounds", bounds, allowed)]
    if not (np.abs(pairs) <= _LARGEST).all():  # NaN too
        allowed = f"must hold finite numbers from -{_LARGEST:g} to {_LARGEST:g}"
        return [Fault("activation_bounds", bounds, allowed)]
    if (pairs[..., 0] > pairs[..., 1]).any():
        return [Fault("activation_bounds", bounds, "must have lower <= upper")]
    if pairs.ndim == 2 and bundles is not None and len(pairs) != bundles:
        several = f", or {bundles} pairs: one for each bundle" if bundles > 1 else ""
        allowed = f"must be one pair{several}"
        return [Fault("activation_bounds", bounds, allowed)]
    return []


def _one_winding(angle: Any, revolution: Any) -> list[Fault]:
    if (angle is None) != (revolution is None):
        return []
    allowed = "give exactly one of helical_angle and revolution (0 for a longitudinal fiber)"
    both = None if angle is None else (angle, revolution)
    return [Fault("helical_angle, revolution", both, allowed)]
