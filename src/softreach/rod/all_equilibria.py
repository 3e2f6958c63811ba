"""Every equilibrium of a loaded arm at given activations, stable or not.

The direction of gravity that the tip sees decides which one the base would have to see: a map of
the sphere to itself. Unloaded it is a rotation, so that its degree is 1, theory (80): every
direction at the base is covered once more forward than backward. A mesh of the sphere, finer where
the map stretches it, shows all triangles whose image covers the direction that the base does see.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.errors import InvalidInput
from softreach.geometry.sphere_mesh import icosphere, quartered
from softreach.rod.equilibrium import Solver
from softreach.rod.tip_map import TipStatus

__all__ = ["AllEquilibria", "all_equilibria"]

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_FIRST_LEVELS = 4
_MOST_LEVELS = 8
_LONGEST = 0.35  # side of an image that is flat enough [rad]
_SLACK = 0.15  # how far outside an image, in its size, the direction may lie and still be tried
_SAME = 1e-6  # [rad]


class AllEquilibria(NamedTuple):
    """The equilibria of one arm, the stable ones first."""

    tips: Array
    """r [m], shape (n, 3)."""
    status: NDArray[np.int8]
    """`TipStatus`, shape (n,)."""
    margin: Array
    """How far from the loss of stability [-], shape (n,)."""
    directions: Array
    """Gravity at the tip, as the base of the unloaded arm sees it, shape (n, 3)."""
    degree: int
    """Those of even index less those of odd index: 1 if none is missing."""


def all_equilibria(solver: Solver, gamma: Array) -> AllEquilibria:
    """Every equilibrium of the activations (1, bundles).

    Raises:
        InvalidInput: Loads along several directions, or that follow the tip.
    """
    if not solver.tables.one_direction:
        raise InvalidInput("loads", solver.tables.loads, "dead and along one direction")
    starts = _candidates(solver, gamma)
    found, sign = solver.polished(gamma, starts)
    kept = _distinct(found.frame, found.status != TipStatus.NO_EQUILIBRIUM)
    kept = kept[np.argsort(found.status[kept], kind="stable")]
    return AllEquilibria(
        found.tips[kept],
        found.status[kept],
        found.margin[kept],
        found.frame[kept],
        int(sign[kept].sum()),
    )


def _candidates(solver: Solver, gamma: Array) -> Array:
    """Centers of the triangles whose image covers, or nearly covers, what the base sees."""
    points, triangles = icosphere(_FIRST_LEVELS)
    images = solver.base_directions(gamma, points)
    seen, starts = solver.tables.axes[0], []
    for level in range(_FIRST_LEVELS, _MOST_LEVELS + 1):
        corners = images[triangles]
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        flat = (sides < _LONGEST) | (level == _MOST_LEVELS)
        near = _covers(corners[flat], seen)
        starts.append(points[triangles[flat][near]].mean(axis=1))
        if flat.all():
            break
        before = len(points)
        points, triangles = quartered(points, triangles[~flat])
        images = np.concatenate([images, solver.base_directions(gamma, points[before:])])
    directions = np.concatenate(starts)
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


def _covers(corners: Array, direction: Array) -> NDArray[np.bool_]:
    """Which triangles of unit vectors (n, 3, 3) hold a direction, with some slack."""
    a, b, c = np.moveaxis(corners, 1, 0)
    parts = np.stack(
        [np.cross(b, c) @ direction, np.cross(c, a) @ direction, np.cross(a, b) @ direction], axis=1
    )
    size = np.abs(parts).sum(axis=1)
    sign = np.sign(parts.sum(axis=1))
    ahead = corners.sum(axis=1) @ direction > 0
    return ahead & ((parts * sign[:, None]).min(axis=1) >= -_SLACK * size)


def _distinct(directions: Array, good: NDArray[np.bool_]) -> Indices:
    """The first of each group of equal directions."""
    kept: list[int] = []
    for k in np.flatnonzero(good):
        if all(np.linalg.norm(directions[k] - directions[j]) > _SAME for j in kept):
            kept.append(int(k))
    return np.array(kept, np.intp)
