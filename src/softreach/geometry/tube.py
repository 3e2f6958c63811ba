"""Closed surfaces along curves: tubes of varying radius, and ribbons with a thickness."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from softreach.geometry.surface import Surface
from softreach.support.arrays import Faces, Index
from softreach.support.errors import InvalidInput


def tube_surface(
    centerline: ArrayLike, normal: ArrayLike, binormal: ArrayLike, radii: ArrayLike, sides: int = 32
) -> Surface:
    """A tube of circular sections of some radii [m], capped at both ends, with outward faces.

    Centers [m] and unit vectors in the sections have shape (stations, 3); normal x binormal points
    along the centerline. Vertices come ring by ring, the centers of both caps last.
    """
    center = np.asarray(centerline, float)
    if center.ndim != 2 or center.shape[1] != 3 or len(center) < 2:
        raise InvalidInput("centerline.shape", center.shape, "(stations, 3) with stations >= 2")
    if sides < 3:
        raise InvalidInput("sides", sides, "at least 3")
    angles = 2 * np.pi * np.arange(sides) / sides
    spokes = np.multiply.outer(np.cos(angles), np.asarray(normal, float))
    spokes += np.multiply.outer(np.sin(angles), np.asarray(binormal, float))
    reach = np.broadcast_to(np.asarray(radii, float), len(center))[:, None]
    rings = (center + reach * spokes).swapaxes(0, 1).reshape(-1, 3)
    vertices = np.concatenate([rings, center[[0, -1]]])
    ring, last = np.arange(sides), (len(center) - 1) * sides
    after = np.roll(ring, -1)
    quad = np.column_stack([ring, after, after + sides, ring + sides])
    walls = (quad + sides * np.arange(len(center) - 1)[:, None, None]).reshape(-1, 4)
    first_cap = np.column_stack([np.full(sides, last + sides), after, ring])
    last_cap = np.column_stack([np.full(sides, last + sides + 1), ring + last, after + last])
    faces = np.concatenate([_halves(walls), first_cap, last_cap])
    return Surface(vertices=vertices, faces=faces)


def ribbon_surface(lower: ArrayLike, upper: ArrayLike) -> Surface:
    """The closed skin between two patches (stations, across, 3) [m]; the lower comes first.

    The upper one is on the side that (along x across) points to; faces are outward.
    """
    low, high = np.asarray(lower, float), np.asarray(upper, float)
    index = np.arange(low.shape[0] * low.shape[1]).reshape(low.shape[:2])
    rim = np.concatenate([index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]])
    after, grid = np.roll(rim, -1), _grid(index)
    wall = np.column_stack([rim, after, after + index.size, rim + index.size])
    quads = np.concatenate([grid[:, ::-1], grid + index.size, wall])
    vertices = np.concatenate([low.reshape(-1, 3), high.reshape(-1, 3)])
    return Surface(vertices=vertices, faces=_halves(quads))


def grid_faces(stations: int, across: int) -> Faces:
    """Triangles of an open grid of points (stations, across), turning from the first axis to it."""
    return _halves(_grid(np.arange(stations * across).reshape(stations, across)))


def joined(parts: Sequence[Any]) -> Surface:
    """Several surfaces, each with vertices and faces, as one; none is one without vertices."""
    if len(parts) == 1:
        return parts[0]
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = [part.faces + start for part, start in zip(parts, starts, strict=False)]
    return Surface(
        vertices=np.concatenate([np.empty((0, 3)), *(part.vertices for part in parts)]),
        faces=np.concatenate([np.empty((0, 3), np.int64), *faces]),
    )


def _grid(index: Index) -> Index:
    """The quads of a grid of vertices, turning from the first axis to the second."""
    corners = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return np.column_stack([corner.ravel() for corner in corners])


def _halves(quads: Index) -> Faces:
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
