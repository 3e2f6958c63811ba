"""Surroundings of an arm: solids that it must not touch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softreach.arm.number import number
from softreach.arm.stations import Span
from softreach.geometry.regions import Region
from softreach.support.arrays import Array
from softreach.support.errors import Fault


@dataclass(frozen=True, kw_only=True)
class Obstacle(Span):
    """A solid beside the arm, and the part of the arm that must keep clear of it.

    What is left of the arm may be inside: a base that is clamped in a hole begins behind it.

    Raises:
        InvalidDesign: No region, or a number or a place out of range.
    """

    region: Region
    """The solid, in the world."""
    inside: bool = False
    """True if the region is free and all around it is solid, as for an arm in a tank."""
    clearance: float = number("c", "m", "distance to keep from it", low=0.0, default=0.0)
    """Distance to keep from it [m]."""
    name: str = ""
    """Name in results; by its kind and number where there is none."""

    def _faults(self) -> list[Fault]:
        faults = super()._faults()
        if not isinstance(self.region, Region):
            allowed = "must be a region: HalfSpace, Box, Sphere, Cylinder, Tube, Mesh or MeshFile"
            faults.append(Fault("region", self.region, allowed))
        if not isinstance(self.inside, bool):
            faults.append(Fault("inside", self.inside, "must be True or False"))
        return faults

    def gap(self, points: Array) -> tuple[Array, Array]:
        """Distance of points (n, 3) from the solid [m], with its gradient, (n,) and (n, 3)."""
        distance, gradient = self.region.nearest(np.ascontiguousarray(points))
        return (-distance, -gradient) if self.inside else (distance, gradient)


def obstacle_names(obstacles: tuple[Obstacle, ...]) -> list[str]:
    """A name for each."""
    kinds = (type(each.region).__name__.lower() for each in obstacles)
    pairs = enumerate(zip(obstacles, kinds, strict=True), 1)
    return [each.name or f"{kind} {number}" for number, (each, kind) in pairs]
