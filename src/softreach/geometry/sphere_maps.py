"""Places that maps of the unit sphere to itself take to a value, one by one or by whole circles."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.kernels.points.triangles import FLAT, OPEN, judge_images
from softreach.support.arrays import Array, Index

Map = Callable[[Array], Array]  # images of unit vectors (n, 3), unit vectors of the same shape
_MOST_LEVELS = 16
_MOST_TRIANGLES = 200_000
_MOST_STARTS = 1000  # of triangles that are not flat
_IMAGES_OF_ROOT = 60  # that Newton's method asks for, of most starts
_FLAT = 2.5  # least altitude of a flat image, in sags of the one that it was cut from: it has 1/4
_TURNS = 30
_WIDEST = 0.3  # Newton step [rad]
_DIFFERENCE = 3e-6  # of numerical derivatives [rad]
_SETTLED = 1e-9  # Newton step [rad] of a root that was reached, if the map is well conditioned
_RESIDUAL = 1e-11
_SAME = 1e-6  # [rad]
_POLAR, _AROUND = 24, 5
_SAMPLES = 8192
_BISECTIONS = 60
_OFF_AXIS = 1e-6


@lru_cache(maxsize=8)
def icosphere(levels: int) -> tuple[Array, Index]:
    """Points (n, 3) of an icosahedron whose triangles (20 · 4^levels, 3) are quartered; frozen."""
    if levels:
        return quartered(*icosphere(levels - 1))
    golden = 0.5 * (1.0 + np.sqrt(5.0))
    pairs = np.array([[-1, golden], [1, golden], [-1, -golden], [1, -golden]])
    points = np.zeros((12, 3))
    for axis in range(3):
        points[4 * axis : 4 * axis + 4, axis] = pairs[:, 0]
        points[4 * axis : 4 * axis + 4, (axis + 1) % 3] = pairs[:, 1]
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    near = points @ points.T > 0.4
    triples = combinations(range(12), 3)
    triangles = np.array([t for t in triples if near[t, np.roll(t, 1)].all()])
    inward = np.linalg.det(points[triangles]) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    return points, triangles


def quartered(points: Array, triangles: Index) -> tuple[Array, Index]:
    """Triangles cut in four at the middles of sides, on the sphere; and points, old ones first."""
    after = triangles[:, [1, 2, 0]]
    sides = np.minimum(triangles, after) * len(points) + np.maximum(triangles, after)
    keys, which = np.unique(sides, return_inverse=True)
    middles = points[keys // len(points)] + points[keys % len(points)]
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    a, b, c = triangles.T
    ab, bc, ca = (len(points) + which.reshape(-1, 3)).T
    cut = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    return np.concatenate([points, middles]), np.concatenate([np.stack(t, axis=1) for t in cut])


class Roots(NamedTuple):
    """Points that a map takes to a value."""

    points: Array  # unit vectors, (n, 3)
    determinants: Array  # of the derivative, above 0 where the sense of rotation is kept, (n,)


def sphere_roots(
    image: Map, value: Array, *, levels: int, caution: float, starts: Array, most: int = 10_000_000
) -> tuple[Roots, bool]:
    """All places where a smooth map takes a value (3,), and whether triangles were cut to flatness.

    Those of the icosphere of some levels are cut further where their images come within `caution`
    of their sags of the value, with `most` images or so. Other starts (n, 3) are looked at, too.
    """
    frame = np.array([*tangents_at(value[None])[:, 0], value])
    centers, settled = _candidates(lambda x: image(x) @ frame.T, levels, caution, most // 2)
    every = 1 + len(centers) * _IMAGES_OF_ROOT * 2 // most
    roots = polished_roots(image, value, np.concatenate([starts, centers[::every]]))
    return roots, settled and every == 1


def _candidates(seen: Map, levels: int, caution: float, most: int) -> tuple[Array, bool]:
    """Centers of the triangles that may hold a root, and whether they were not too many."""
    points, triangles = icosphere(levels)
    images, centers, few_enough = seen(points), [np.empty((0, 3))], False
    for level in range(levels, levels + _MOST_LEVELS):
        before, parents = len(points), triangles
        finer = icosphere(level + 1) if level == levels else quartered(points, triangles)
        points, triangles = finer
        images = np.concatenate([images, seen(points[before:])])
        verdicts = np.empty(len(triangles), np.int8)
        judge_images(images, parents, triangles, caution, _FLAT, verdicts)
        centers.append(points[triangles[verdicts == FLAT]].mean(axis=1))
        triangles = triangles[verdicts == OPEN]
        few_enough = len(triangles) < _MOST_TRIANGLES and len(points) + 3 * len(triangles) < most
        if not few_enough or not len(triangles):
            break
    few = triangles[:: 1 + len(triangles) // _MOST_STARTS]
    starts = _unit(np.concatenate([*centers, points[few].mean(axis=1)]))
    return starts, few_enough


def polished_roots(image: Map, value: Array, starts: Array) -> Roots:
    """The different roots to which Newton's method comes, in the order of the first starts."""
    across = tangents_at(value[None])[:, 0]
    points, last = _unit(starts), np.full(len(starts), np.inf)
    slopes, missing = np.empty((len(points), 2, 2)), np.full(len(points), np.inf)
    working = np.arange(len(points))
    for _ in range(_TURNS):
        # Images, and derivatives between the tangent planes by differences.
        at, tangents = points[working], tangents_at(points[working])
        turned = _DIFFERENCE * tangents
        places = np.concatenate([at[None], at + turned, at - turned])
        images = image(_unit(places.reshape(-1, 3))).reshape(places.shape)
        change, ahead = (images[1:3] - images[3:]) @ across.T / (2 * _DIFFERENCE), images[0]
        slopes[working] = np.moveaxis(change, 0, 2)
        missing[working] = np.linalg.norm(ahead - value, axis=1)
        step = _newton(slopes[working], -(ahead @ across.T))
        points[working] = _unit(at + step[:, :1] * tangents[0] + step[:, 1:] * tangents[1])
        before, last[working] = last[working], np.linalg.norm(step, axis=1)
        # Where the map is nearly singular, rounding alone keeps steps from becoming any smaller.
        at_noise = (last[working] >= before) & (missing[working] < _RESIDUAL)
        working = working[(last[working] > 1e-14) & ~at_noise]
        if not len(working):
            break
    good = ((last < _SETTLED) | (missing < _RESIDUAL)) & (missing < 1e-6)
    left, kept = np.flatnonzero(good), list[int]()
    while len(left):
        kept.append(int(left[0]))
        left = left[np.linalg.norm(points[left] - points[left[0]], axis=1) > _SAME]
    return Roots(points[kept], np.linalg.det(slopes[kept]))


def _newton(slopes: Array, missing: Array) -> Array:
    """Newton's steps, no longer than what is trusted, shape (n, 2)."""
    (a, b), (c, d) = np.moveaxis(slopes, 0, 2)
    determinant = a * d - b * c
    determinant = np.copysign(np.maximum(np.abs(determinant), 1e-300), determinant)
    x, y = missing.T
    step = np.stack([d * x - b * y, a * y - c * x], axis=1) / determinant[:, None]
    size = np.linalg.norm(step, axis=1, keepdims=True)
    return step * np.minimum(1.0, _WIDEST / np.maximum(size, 1e-300))


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


class Rings(NamedTuple):
    """Circles of latitude that go to the pole."""

    points: Array  # one of each, all on one meridian, (n, 3)
    signs: NDArray[np.int8]  # 1 where image and place both move away from the pole, else -1, (n,)
    pole_sign: int  # the same of the pole itself, which goes to itself

    @property
    def complete(self) -> bool:
        """True if the image of the meridian, which ends opposite, passes the pole that often."""
        return self.pole_sign + 2 * int(self.signs.sum()) == 1


def is_axisymmetric(image: Map, axis: Array, tolerance: float) -> bool:
    """True if turning about an axis, and mirroring through it, changes less than so much [rad]."""
    polar = np.pi * (np.arange(_POLAR) + 0.5) / _POLAR
    around = 2 * np.pi * np.arange(_AROUND) / _AROUND + 0.1
    first, second = tangents_at(axis[None])[:, 0]
    outward = np.cos(around)[:, None] * first + np.sin(around)[:, None] * second
    points = np.cos(polar)[:, None] * axis + np.sin(polar)[:, None] * outward[:, None]
    images = image(points.reshape(-1, 3)).reshape(points.shape)
    sideways = (images * np.cross(axis, outward)[:, None]).sum(axis=2)
    ahead = np.stack([images @ axis, (images * outward[:, None]).sum(axis=2)])
    return bool(max(np.abs(sideways).max(), np.ptp(ahead, axis=1).max()) <= tolerance)


def pole_rings(image: Map, axis: Array, near: Array) -> Rings:
    """Circles of latitude that an axisymmetric map takes to its pole, on the meridian of `near`."""
    aside = near - (near @ axis) * axis
    size = float(np.linalg.norm(aside))
    outward = aside / size if size > _OFF_AXIS else tangents_at(axis[None])[0, 0]

    def meridian(angle: Array) -> Array:
        return np.cos(angle)[:, None] * axis + np.sin(angle)[:, None] * outward

    def seen(angle: Array) -> tuple[Array, Array]:
        images = image(meridian(angle))
        return images @ outward, images @ axis

    angles = np.pi * (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    away, ahead = seen(angles)
    crossing = np.flatnonzero((away[1:] * away[:-1] <= 0) & (ahead[1:] + ahead[:-1] > 0))
    low, high, sign = angles[crossing], angles[crossing + 1], np.sign(away[crossing + 1])
    for _ in range(_BISECTIONS if len(low) else 0):
        middle = 0.5 * (low + high)
        above = seen(middle)[0] * sign > 0
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    points = meridian(0.5 * (low + high))
    return Rings(points, sign.astype(np.int8), int(np.sign(away[0])))
