"""Where a map of the unit sphere to itself takes a given value: all places, by subdivision.

Triangles are quartered until their images are nearly flat or keep clear of the value. How far an
image is from flat is measured where a side is halved. What is left is the start of Newton's method.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.geometry.sphere_mesh import icosphere, quartered

__all__ = ["Map", "Roots", "polished_roots", "sphere_roots", "tangents_at"]

Array = NDArray[np.float64]
Map = Callable[[Array], Array]
"""Images of unit vectors (n, 3), unit vectors of the same shape."""

_MOST_LEVELS = 16
_MOST_TRIANGLES = 200_000
_MOST_STARTS = 1000  # of triangles that are not flat
_FLAT = 2.5
"""Least altitude of a flat image, in sags of the one that it was cut from, of which it has 1/4."""
_TURNS = 30
_WIDEST = 0.3  # Newton step [rad]
_DIFFERENCE = 3e-6  # of numerical derivatives [rad]
_SETTLED = 1e-9  # Newton step [rad] of a root that was reached, if the map is well conditioned
_RESIDUAL = 1e-11
_SAME = 1e-6  # [rad]


class Roots(NamedTuple):
    """Where a map takes a value."""

    points: Array
    """Unit vectors, shape (n, 3)."""
    determinants: Array
    """Of the derivative, positive where the map keeps the sense of rotation; shape (n,)."""


def sphere_roots(
    image: Map, value: Array, *, levels: int, caution: float, starts: Array
) -> tuple[Roots, bool]:
    """All places where a smooth map takes a value.

    Args:
        image: The map.
        value: A unit vector, shape (3,).
        levels: How often the triangles of the first mesh are quartered.
        caution: How near an image must come to the value to be cut further, in its sags.
        starts: Where to look too, shape (n, 3).

    Returns:
        The places, and whether the triangles were few enough to be cut until they were flat, or
        smaller than a millionth.
    """
    frame = np.array([*tangents_at(value[None])[:, 0], value])

    def seen(points: Array) -> Array:
        return image(points) @ frame.T

    centers, settled = _candidates(seen, levels, caution)
    return polished_roots(image, value, np.concatenate([starts, centers])), settled


def _candidates(seen: Map, levels: int, caution: float) -> tuple[Array, bool]:
    """Centers of the triangles that may hold a root, and whether they were not too many."""
    points, triangles = icosphere(levels)
    images, centers = seen(points), [np.empty((0, 3))]
    for _ in range(_MOST_LEVELS):
        before, parents = len(points), triangles
        points, triangles = quartered(points, triangles)
        images = np.concatenate([images, seen(points[before:])])
        sag = np.tile(_sags(images, parents, triangles[3 * len(parents) :]), 4)
        corners = images[triangles]
        near = _distances(corners[..., :2]) <= caution * sag + 1e-12
        near &= corners[..., 2].max(axis=1) + sag > 0
        flat = _altitudes(corners[..., :2]) >= _FLAT * sag
        centers.append(points[triangles[near & flat]].mean(axis=1))
        triangles = triangles[near & ~flat]
        if not 0 < len(triangles) < _MOST_TRIANGLES:
            break
    few = triangles[:: 1 + len(triangles) // _MOST_STARTS]
    starts = _unit(np.concatenate([*centers, points[few].mean(axis=1)]))
    return starts, len(triangles) < _MOST_TRIANGLES


def _sags(images: Array, triangles: NDArray[np.intp], middles: NDArray[np.intp]) -> Array:
    """How far the images of the middles of sides are from the middles of their images."""
    corners = images[triangles]
    halfway = 0.5 * (corners + np.roll(corners, -1, axis=1))
    return np.linalg.norm(images[middles] - halfway, axis=2).max(axis=1)


def _distances(corners: Array) -> Array:
    """Of the origin from triangles in the plane, shape (n, 3, 2); 0 inside."""
    sides = np.roll(corners, -1, axis=1) - corners
    size = np.maximum((sides**2).sum(axis=2), 1e-300)
    along = np.clip(-(corners * sides).sum(axis=2) / size, 0.0, 1.0)
    apart = np.linalg.norm(corners + along[..., None] * sides, axis=2).min(axis=1)
    turns = corners[..., 0] * sides[..., 1] - corners[..., 1] * sides[..., 0]
    inside = (turns > 0).all(axis=1) | (turns < 0).all(axis=1)
    return np.where(inside, 0.0, apart)


def _altitudes(corners: Array) -> Array:
    """Smallest ones of triangles in the plane, shape (n, 3, 2)."""
    sides = np.roll(corners, -1, axis=1) - corners
    doubled = sides[:, 0, 0] * sides[:, 1, 1] - sides[:, 0, 1] * sides[:, 1, 0]
    return np.abs(doubled) / np.maximum(np.linalg.norm(sides, axis=2).max(axis=1), 1e-300)


def polished_roots(image: Map, value: Array, starts: Array) -> Roots:
    """The different roots to which Newton's method comes, in the order of the first starts."""
    across = tangents_at(value[None])[:, 0]
    points, last = _unit(starts), np.full(len(starts), np.inf)
    slopes, missing = np.empty((len(points), 2, 2)), np.full(len(points), np.inf)
    working = np.arange(len(points))
    for _ in range(_TURNS):
        ahead, slopes[working] = _linearized(image, points[working], across)
        missing[working] = np.linalg.norm(ahead - value, axis=1)
        step = _newton(slopes[working], -(ahead @ across.T))
        points[working] = _moved(points[working], step)
        last[working] = np.linalg.norm(step, axis=1)
        working = working[last[working] > 1e-14]
        if not len(working):
            break
    good = (last < _SETTLED) | (missing < _RESIDUAL)
    kept = _first_of_equals(points, good & (missing < 1e-6))
    return Roots(points[kept], np.linalg.det(slopes[kept]))


def _linearized(image: Map, points: Array, across: Array) -> tuple[Array, Array]:
    """Images, and the derivatives between the tangent planes, shape (n, 2, 2)."""
    turned = _DIFFERENCE * tangents_at(points)
    places = np.concatenate([points[None], points + turned, points - turned])
    images = image(_unit(places.reshape(-1, 3))).reshape(places.shape)
    slopes = (images[1:3] - images[3:]) @ across.T / (2 * _DIFFERENCE)
    return images[0], np.moveaxis(slopes, 0, 2)


def _newton(slopes: Array, missing: Array) -> Array:
    """Newton's steps, no longer than what is trusted, shape (n, 2)."""
    (a, b), (c, d) = np.moveaxis(slopes, 0, 2)
    determinant = a * d - b * c
    determinant = np.copysign(np.maximum(np.abs(determinant), 1e-300), determinant)
    x, y = missing.T
    step = np.stack([d * x - b * y, a * y - c * x], axis=1) / determinant[:, None]
    size = np.linalg.norm(step, axis=1, keepdims=True)
    return step * np.minimum(1.0, _WIDEST / np.maximum(size, 1e-300))


def _moved(points: Array, step: Array) -> Array:
    first, second = tangents_at(points)
    return _unit(points + step[:, :1] * first + step[:, 1:] * second)


def tangents_at(points: Array) -> Array:
    """Two orthonormal tangents t1, t2 with t1 × t2 pointing outward, shape (2, n, 3)."""
    x, y, z = points.T
    s = np.copysign(1.0, z)
    a = -1.0 / (s + z)
    b = x * y * a
    return np.array(
        [np.stack([1 + s * x * x * a, s * b, -s * x], 1), np.stack([b, s + y * y * a, -y], 1)]
    )


def _unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _first_of_equals(points: Array, good: NDArray[np.bool_]) -> NDArray[np.intp]:
    """The first of each group of equal points."""
    kept: list[int] = []
    for k in np.flatnonzero(good):
        if all(np.linalg.norm(points[k] - points[j]) > _SAME for j in kept):
            kept.append(int(k))
    return np.array(kept, np.intp)
