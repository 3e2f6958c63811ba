"""The curves in which a plane across an axis cuts a surface of triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softreach.geometry.surface import Surface

__all__ = ["plane_cut"]

Array = NDArray[np.float64]


def plane_cut(surface: Surface, axis: int, at: float) -> list[Array]:
    """Cut a surface by the plane where one coordinate has a value.

    A vertex in the plane counts as above it, so that every triangle that is cut gives one piece.

    Args:
        surface: Triangles.
        axis: Of the coordinate, 0 to 2.
        at: Its value, in the unit of the surface.

    Returns:
        Curves of shape (n, 3). Those of a closed surface are closed: they end where they begin.
    """
    vertices, faces = np.asarray(surface.vertices, float), np.asarray(surface.faces)
    height = vertices[:, axis] - at
    above = height >= 0.0
    pieces = _pieces(faces, above)
    edges, ends = np.unique(pieces.reshape(-1, 2), axis=0, return_inverse=True)
    low, high = (height[edges[:, side]] for side in range(2))
    share = (low / (low - high))[:, None]
    places = (1.0 - share) * vertices[edges[:, 0]] + share * vertices[edges[:, 1]]
    places[:, axis] = at
    return [places[curve] for curve in _chained(ends.reshape(-1, 2), len(edges))]


def _pieces(faces: NDArray[np.integer], above: NDArray[np.bool_]) -> NDArray[np.integer]:
    """Of each triangle that is cut, its two edges that are, as vertices, shape (n, 2, 2)."""
    count = above[faces].sum(axis=1)
    cut = faces[(count == 1) | (count == 2)]
    alone = above[cut] == (above[cut].sum(axis=1) == 1)[:, None]
    first = alone.argmax(axis=1)[:, None]
    apex, *others = (np.take_along_axis(cut, (first + k) % 3, axis=1)[:, 0] for k in range(3))
    edges = [np.sort(np.stack([apex, other], axis=1), axis=1) for other in others]
    return np.stack(edges, axis=1)


def _chained(pieces: NDArray[np.integer], count: int) -> list[list[int]]:
    """Curves through places that pieces connect; open ones first, from an end to the other."""
    touching: list[list[int]] = [[] for _ in range(count)]
    for number, (one, other) in enumerate(pieces.tolist()):
        touching[one].append(number)
        touching[other].append(number)
    used = np.zeros(len(pieces), bool)
    order = sorted(range(count), key=lambda place: len(touching[place]) % 2 == 0)
    found = (_walk(place, pieces, touching, used) for place in order)
    return [curve for curve in found if len(curve) > 1]


def _walk(
    place: int,
    pieces: NDArray[np.integer],
    touching: list[list[int]],
    used: NDArray[np.bool_],
) -> list[int]:
    """From a place along pieces that are not used yet, as far as they go."""
    curve = [place]
    while (ahead := next((k for k in touching[place] if not used[k]), None)) is not None:
        used[ahead] = True
        one, other = pieces[ahead].tolist()
        place = other if one == place else one
        curve.append(place)
    return curve
