"""What follows from a design before any sample is drawn, and what to be warned of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from softreach import taper
from softreach.actuation import actuation, curvature_range, extension_range
from softreach.manipulator import Manipulator

__all__ = ["DesignReport", "describe", "design_warnings"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DesignReport:
    """The numbers that a design implies."""

    helical_angles: Array
    """α of each architecture [rad]."""
    revolutions: Array
    """Ω of each architecture [rad]."""
    tip_radius: float
    """R2(L) [m]."""
    radius_ratio: float
    """R1/R2 [-]."""
    taper_ratio: float
    """R2(0)/R2(L) [-]."""
    extension: tuple[float, float]
    """Smallest and largest ζ in the activation box [-]."""
    curvature: tuple[float, float]
    """Smallest and largest bending curvature times L, in the box and along the arm [-]."""
    warnings: tuple[str, ...]
    """Limits that the design touches, each with its number."""


def describe(arm: Manipulator) -> DesignReport:
    """Everything that `softreach design` prints."""
    _, bending = curvature_range(arm)
    return DesignReport(
        helical_angles=arm.helical_angles,
        revolutions=arm.revolutions,
        tip_radius=arm.tip_radius,
        radius_ratio=arm.radius_ratio,
        taper_ratio=arm.outer_radius / arm.tip_radius,
        extension=extension_range(arm),
        curvature=(_smallest_bending(arm) * arm.length, float(bending.max() * arm.length)),
        warnings=design_warnings(arm),
    )


def design_warnings(arm: Manipulator) -> tuple[str, ...]:
    """One line for each limit that the design touches: none of them makes a result impossible."""
    return (*_overlaps(arm), *_sharp_bending(arm), *_large_activations(arm))


def _smallest_bending(arm: Manipulator, stations: int = 11) -> float:
    """Least √(u1² + u2²) in the box: bounded least squares at each station [1/m]."""
    from scipy.optimize import lsq_linear

    low, high = arm.bounds.T
    if (low <= 0).all() and (high >= 0).all():
        return 0.0
    free = high > low
    table = actuation(arm, np.linspace(0.0, arm.length, stations)).curvature[:, :2]
    fixed = table[:, :, ~free] @ low[~free]
    return min(
        float(
            np.linalg.norm(lsq_linear(u, -rest, (low[free], high[free])).fun)
            if free.any()
            else np.linalg.norm(rest)
        )
        for u, rest in zip(table[:, :, free], fixed, strict=True)
    )


def _sharp_bending(arm: Manipulator) -> Iterator[str]:
    stations, bending = curvature_range(arm)
    slender = bending * arm.radius(stations)
    worst = int(np.argmax(slender))
    if slender[worst] >= 1:
        place = f"Z = {stations[worst] / arm.length:.2f} L"
        yield (
            f"bending reaches |κ| R2 = {slender[worst]:.2f} at {place}: the inner side would fold "
            "where it is 1 or more, and the theory ends there"
        )


def _large_activations(arm: Manipulator) -> Iterator[str]:
    largest = float(np.abs(arm.bounds).max())
    if largest > 1:
        yield (
            f"activations reach |γ| = {largest:.3g}: above 1 a fiber would shorten by more than "
            "its length, so γ is a load on the matrix there, not a strain of the fiber"
        )


def _overlaps(arm: Manipulator) -> Iterator[str]:
    """Pairs of bundles whose sectors meet between base and tip."""
    for first, second in combinations(range(arm.bundles), 2):
        depth, place = _overlap(arm, first, second)
        if depth > 1e-9:
            names = f"{arm.bundle_names[first]} and {arm.bundle_names[second]}"
            yield (
                f"sectors of {names} overlap by up to {np.degrees(depth):.3g}° "
                f"(from Z = {place / arm.length:.2f} L): both contract the same matter"
            )


def _overlap(arm: Manipulator, first: int, second: int) -> tuple[float, float]:
    """Largest overlap of two sectors [rad] and the first Z where they overlap [m].

    Their angular distance is linear in the rotation per tangent, hence in S: no sampling is needed.
    """
    extent = arm.bundle_extents[[first, second]].mean()
    angles = arm.fiber_angles([0.0, arm.length])[:, [first, second]]
    start, end = angles[:, 1] - angles[:, 0]
    if abs(end - start) < 1e-12:
        apart = abs(_wrapped(start))
        return extent - apart, 0.0
    turns = (
        2
        * np.pi
        * np.arange(np.floor(min(start, end) / (2 * np.pi)), max(start, end) / (2 * np.pi) + 2)
    )
    nearest = np.clip(turns, min(start, end), max(start, end))
    depth = float((extent - np.abs(nearest - turns)).max())
    return depth, _first_contact(arm, start, end, extent)


def _first_contact(arm: Manipulator, start: float, end: float, extent: float) -> float:
    """Z at which the distance first falls to the mean extent."""
    gap = _wrapped(start)
    if abs(gap) <= extent:
        return 0.0
    toward = np.sign(end - start)
    travel = (2 * np.pi - toward * gap) % (2 * np.pi) - extent
    s = (
        taper.slender_coordinate(arm.length, arm.outer_radius, arm.taper)
        * travel
        / abs(end - start)
    )
    return float(np.clip(taper.station_of(s, arm.outer_radius, arm.taper), 0.0, arm.length))


def _wrapped(angle: float) -> float:
    """The angle in [-π, π)."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)
