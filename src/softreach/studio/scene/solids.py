"""Triangles of the solids around an arm, as a picture needs them."""

from __future__ import annotations

from typing import Any

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.geometry.regions import Box, Cylinder, HalfSpace, Region, Sphere, Tube
from softreach.geometry.surface import Surface, ribbon_surface, tube_surface
from softreach.support.arrays import Array

_SIDES, _RINGS = 48, 25
_WIDE = 1.2  # half an edge of the square that is drawn of a plane [L]


def solid_surfaces(arm: Manipulator) -> list[Surface]:
    """A surface [m] around each of the surroundings; of a plane a square beside the arm."""
    middle = np.array(arm.base.position)
    around = middle + _WIDE * arm.length * np.array([[-1.0], [1.0]])
    return [region_surface(each.region, around) for each in arm.surroundings]


def region_surface(region: Region, around: Array) -> Surface:
    """The surface of a region; `around` are corners (2, 3) of what else is drawn, all in m."""
    if isinstance(region, Box):
        (x, y, z), corners = region.bounds.T, np.empty((2, 2, 2, 3))
        corners[..., 0], corners[..., 1], corners[..., 2] = np.meshgrid(x, y, z, indexing="ij")
        return ribbon_surface(corners[:, :, 0], corners[:, :, 1])
    if isinstance(region, Sphere):
        angles = np.linspace(0.0, np.pi, _RINGS)
        heights = region.center[2] - region.radius * np.cos(angles)
        line = np.broadcast_to(region.center, (_RINGS, 3)).copy()
        line[:, 2] = heights
        return _revolved(line, np.array([0.0, 0.0, 1.0]), region.radius * np.sin(angles))
    if isinstance(region, Tube):
        line = np.array([region.start, region.end, region.end, region.start, region.start])
        outer, inner = region.radius, region.inner_radius
        wall = _revolved(line, region.axis, np.array([outer, outer, inner, inner, outer]))
        return Surface(vertices=wall.vertices, faces=wall.faces[: -2 * _SIDES])  # without caps
    if isinstance(region, Cylinder):
        ends = np.array([region.start, region.end])
        return _revolved(ends, region.axis, np.full(2, region.radius))
    if isinstance(region, HalfSpace):
        (square,) = region.wireframe(around)
        return Surface(vertices=square[:4], faces=np.array([[0, 1, 2], [0, 2, 3]]))
    mesh: Any = getattr(region, "mesh", region)  # of a file, or itself
    return Surface(vertices=mesh.vertices, faces=mesh.faces)


def _revolved(line: Array, axis: Array, radii: Array) -> Surface:
    first, second = np.linalg.svd(axis[None])[2][1:]
    second *= np.sign(np.cross(first, second) @ axis)
    first, second = (np.tile(each, (len(line), 1)) for each in (first, second))
    return tube_surface(line, first, second, radii, _SIDES)
