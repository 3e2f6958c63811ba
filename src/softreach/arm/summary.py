"""What follows from a design before any sample is drawn, and its warnings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from softreach.arm.bending import largest_bending, sharpest_bending, smallest_bending
from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import check_extension, extension_range

__all__ = ["DesignSummary", "describe", "design_warnings"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DesignSummary:
    """The numbers that a design implies."""

    helical_angles: Array
    """α of each architecture [rad]."""
    revolutions: Array
    """Ω of each architecture [rad]."""
    base_radius: float
    """R2(0) [m]."""
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


def describe(arm: Manipulator) -> DesignSummary:
    """Everything that `softreach design` prints.

    Raises:
        InvalidDesign: Some activation within the bounds would shorten the arm to nothing.
    """
    check_extension(arm)
    tip_radius = float(arm.profile.radius(arm.length))
    body = arm.profile, arm.section
    return DesignSummary(
        helical_angles=np.array([fiber.helical_angle_on(*body) for fiber in arm.fibers]),
        revolutions=np.array([fiber.revolution_on(*body) for fiber in arm.fibers]),
        base_radius=float(arm.profile.radius(0.0)),
        tip_radius=tip_radius,
        radius_ratio=arm.section.rings[0].inner_ratio,
        taper_ratio=float(arm.profile.radius(0.0)) / tip_radius,
        extension=extension_range(arm),
        curvature=(
            smallest_bending(arm).value * arm.length,
            largest_bending(arm).value * arm.length,
        ),
        warnings=design_warnings(arm),
    )


def design_warnings(arm: Manipulator) -> tuple[str, ...]:
    """One line for each limit that the design touches: none of them makes a result impossible."""
    return (*_overlaps(arm), *_sharp_bending(arm), *_large_activations(arm))


def _sharp_bending(arm: Manipulator) -> Iterator[str]:
    sharpest = sharpest_bending(arm)
    if sharpest.value >= 1:
        place = f"Z = {sharpest.station / arm.length:.2f} L"
        yield (
            f"bending reaches |κ| R2 = {sharpest.value:.2f} at {place}: the inner side would fold "
            "where it is 1 or more, and the theory ends there"
        )


def _large_activations(arm: Manipulator) -> Iterator[str]:
    largest = max((float(np.abs(fiber.bounds).max()) for fiber in arm.fibers), default=0.0)
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

    Their angular distance is linear in S: no sampling is needed.
    """
    outline = arm.outline([0.0, arm.length])
    extent = outline.extent[[first, second]].mean()
    start, end = outline.center[:, second] - outline.center[:, first]
    if abs(end - start) < 1e-12:
        apart = abs(_wrapped(start))
        return extent - apart, 0.0
    full = 2 * np.pi
    turns = full * np.arange(np.floor(min(start, end) / full), max(start, end) / full + 2)
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
    s = arm.profile.slender_length * travel / abs(end - start)
    return float(np.clip(arm.profile.station(s), 0.0, arm.length))


def _wrapped(angle: float) -> float:
    """The angle in [-π, π)."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)
