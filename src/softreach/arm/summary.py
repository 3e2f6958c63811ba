"""What follows from a design before any sample is drawn, and its warnings."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from softreach.arm.actuators import FiberArchitecture, Outline, SectorActuator
from softreach.arm.along import AlongArm
from softreach.arm.bending import largest_bending, sharpest_bending, smallest_bending
from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import both_sides, check_extension, extension_range

__all__ = ["DesignSummary", "describe", "design_warnings"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DesignSummary:
    """The numbers that a design implies."""

    helical_angles: Array
    """α of each architecture where it begins [rad]."""
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
        helical_angles=np.array([_angle_at_start(fiber, arm) for fiber in arm.fibers]),
        revolutions=np.array([fiber.revolution_on(*body) for fiber in arm.fibers]),
        base_radius=float(arm.profile.radius(0.0)),
        tip_radius=tip_radius,
        radius_ratio=arm.section.inner_ratio,
        taper_ratio=float(arm.profile.radius(0.0)) / tip_radius,
        extension=extension_range(arm),
        curvature=(
            smallest_bending(arm).value * arm.length,
            largest_bending(arm).value * arm.length,
        ),
        warnings=design_warnings(arm),
    )


def _angle_at_start(fiber: FiberArchitecture, arm: Manipulator) -> float:
    angle = fiber.helical_angle_on(arm.profile, arm.section)
    return float(angle(fiber.start_over_length)) if isinstance(angle, AlongArm) else angle


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
    """Pairs of bundles in one ring whose sectors meet between base and tip.

    Different rings may overlap on purpose, each with its own stiffness: they do not share matter.
    """
    z = both_sides(arm, arm.profile.station(np.linspace(0.0, arm.profile.slender_length, 201)))
    outline, rings = arm.outline(z), _ring_of_each_bundle(arm)
    for first, second in combinations(range(arm.bundles), 2):
        if rings[first] is None or rings[first] != rings[second]:
            continue
        depth, place = _overlap(outline, z, first, second)
        if depth > 1e-9:
            names = f"{arm.bundle_names[first]} and {arm.bundle_names[second]}"
            yield (
                f"sectors of {names} overlap by up to {np.degrees(depth):.3g}° "
                f"(from Z = {place / arm.length:.2f} L): both contract the same matter"
            )


def _ring_of_each_bundle(arm: Manipulator) -> list[int | None]:
    """Index of the ring that a bundle fills a sector of; None for other kinds."""
    return [
        arm.section.ring_index(one.ring) if isinstance(one, SectorActuator) else None
        for one in arm.actuators
        for _ in range(one.bundles)
    ]


def _overlap(outline: Outline, z: Array, first: int, second: int) -> tuple[float, float]:
    """Largest overlap of two sectors [rad] and the first Z where they overlap [m].

    Between stations their angular distance is taken to be linear.
    """
    pair = [first, second]
    shares = outline.acts[:, first] & outline.acts[:, second]
    if not shares.any():
        return 0.0, 0.0
    extent = outline.extent[pair].mean()
    apart = outline.center[:, second] - outline.center[:, first]
    depth = extent - np.abs(_wrapped(apart))
    # Where the distance passes a whole turn between two stations, the overlap there is complete.
    turns = np.round(apart / (2 * np.pi))
    passes = (np.diff(np.sign(apart - 2 * np.pi * turns)) != 0) & (np.diff(turns) == 0)
    deepest = np.where(np.append(passes, False), extent, depth)
    deepest[~shares] = -np.inf
    return float(deepest.max()), _first_contact(z, depth, shares)


def _first_contact(z: Array, depth: Array, shares: NDArray[np.bool_]) -> float:
    """Z at which the overlap begins [m]."""
    here = shares & (depth > 0)
    if not here.any():
        return float(z[shares][0])
    first = int(np.argmax(here))
    if first == 0 or not shares[first - 1]:
        return float(z[first])
    return float(np.interp(0.0, depth[first - 1 : first + 1], z[first - 1 : first + 1]))


def _wrapped(angle: Array) -> Array:
    """The angles in [-π, π)."""
    return (angle + np.pi) % (2 * np.pi) - np.pi
