"""Faults of single values: numbers within ranges, texts, values along the arm.

Absent values are not judged, so that one unreadable key does not hide a file's other faults; None
is a value, and rarely allowed.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from softreach.support.arguments import plain
from softreach.support.arrays import as_floats
from softreach.support.errors import Fault, InvalidInput, Range

__all__ = [
    "INSIDE_RANGE",
    "as_numbers",
    "range_faults",
    "series_faults",
    "sound_values",
    "text_faults",
    "values_along",
]

_OPTIONAL = {"helical_angle", "revolution", "young_modulus", "density"}

INSIDE_RANGE = Range(0.0, 1.0, open_low=True, open_high=True)
"""Between base and tip, over the length."""


def text_faults(values: Mapping[str, Any]) -> list[Fault]:
    """A name that is not text."""
    name = values.get("name", "")
    return [] if isinstance(name, str) else [Fault("name", name, "must be text")]


def range_faults(values: Mapping[str, Any], ranges: Mapping[str, Range]) -> list[Fault]:
    """A fault for each value outside its range; absent ones are skipped."""
    given = {name: plain(values[name]) for name in ranges if name in values}
    return [
        Fault(name, value, ranges[name])
        for name, value in given.items()
        if not ranges[name].admits(value) and not (value is None and name in _OPTIONAL)
    ]


def series_faults(values: Mapping[str, Any], field: str, per_station: bool = True) -> list[Fault]:
    """Everything wrong with values given along the arm.

    Args:
        values: `stations_over_length` and the values themselves.
        field: What the values are called.
        per_station: Whether there is one for each station; else one for each gap between them.
    """
    stations, along = as_numbers(values["stations_over_length"]), as_numbers(values[field])
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


def as_numbers(values: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Numbers as an array; empty for text, booleans and anything else that is not a number."""
    try:
        return as_floats("values", values)
    except InvalidInput:
        return np.empty(0)


def sound_values(values: Mapping[str, Any], faults: list[Fault]) -> dict[str, Any]:
    """The values without a fault so far."""
    blamed = {fault.path for fault in faults}
    return {name: plain(value) for name, value in values.items() if name not in blamed}


def values_along(given: Any) -> tuple[float, ...] | None:
    """The values of what changes along the arm; None for anything else."""
    values = getattr(given, "values", None)
    return values if isinstance(values, tuple) else None


def _ascends_from_0_to_1(stations: np.ndarray[Any, np.dtype[np.float64]]) -> bool:
    ends = stations[0] == 0.0 and stations[-1] == 1.0
    return bool(ends and np.isfinite(stations).all() and (np.diff(stations) > 0).all())
