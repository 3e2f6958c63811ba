"""Where in the activation box a rod is hardest to integrate: the corners that bend it most.

The error of the steps grows with a high power of the bending, so that its largest values lie where
many bundles bend the arm the same way: at few corners of the box, which random samples miss.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import tables
from softreach.rod.activation_box import ActivationBox

__all__ = ["pilot_activations", "worsened"]

Array = NDArray[np.float64]

_MOST_CORNERS = 1024
_INSIDE = 256
_HEADINGS = 16
_STATIONS = 9
_SEARCHED = 8  # corners from which larger errors are searched
_ROUNDS = 24


def pilot_activations(arm: Manipulator, box: ActivationBox) -> Array:
    """Corners, points on faces and points inside the activation box.

    All corners where they are no more than 1,024; else as many at random, and those that bend most.
    Only the last depend on more of an arm than its bounds.

    Returns:
        Activations, shape (n, bundles).
    """
    m, rng = box.bundles, np.random.default_rng(0)
    if 2**m <= _MOST_CORNERS:
        corners = np.indices((2,) * m).reshape(m, 2**m).T.astype(float)
    else:
        corners = rng.integers(0, 2, (_MOST_CORNERS, m)).astype(float)
        corners[:2] = [[0.0], [1.0]]
    inside, faces = rng.random((2, _INSIDE, m))
    if m:
        faces[np.arange(_INSIDE), rng.integers(0, m, _INSIDE)] = rng.integers(0, 2, _INSIDE)
    cube = np.concatenate([corners, faces, inside])
    if 2**m > _MOST_CORNERS:
        cube = np.concatenate([cube, _bending_corners(arm)])
    return np.ascontiguousarray(box.from_cube(cube))


def _bending_corners(arm: Manipulator) -> Array:
    """Corners of the unit cube that are extreme in bending, at each station and all along the arm.

    The bending (u1, u2) that a box of activations reaches at a station is a zonogon, whose farthest
    vertex toward a heading has every bundle at the bound that helps. Along the arm the heading
    turns as the fibers of each bundle do, or not at all.
    """
    z = _stations(arm)
    plane = tables(arm, z).curvature[:, :2]
    start = 2.0 * np.pi * np.arange(_HEADINGS) / _HEADINGS
    directions = np.unwrap(np.arctan2(plane[:, 1], plane[:, 0]), axis=0)
    turns = np.concatenate([np.zeros((len(z), 1)), directions - directions[0]], axis=1)
    turns = np.unique(turns.round(9), axis=1)
    heading = start[:, None, None] + turns.T  # (heading, turn, station)
    along = np.einsum("htsc,scb->htsb", np.stack([np.cos(heading), np.sin(heading)], -1), plane)
    helps = np.concatenate([along.reshape(-1, arm.bundles), along.sum(2).reshape(-1, arm.bundles)])
    return np.unique((helps > 0).astype(float), axis=0)


def _stations(arm: Manipulator) -> Array:
    """Even ones, and one within each smooth stretch of the arm."""
    ends = np.array([0.0, *arm.breakpoints, arm.length])
    even = np.linspace(0.0, arm.length, _STATIONS)
    return np.union1d(even, 0.5 * (ends[1:] + ends[:-1])) if arm.breakpoints else even


def worsened(
    error: Callable[[Array], Array], pilot: Array, found: Array, box: ActivationBox
) -> tuple[Array, Array]:
    """Activations of larger error, by moving one bundle to a bound at a time, from the worst.

    Args:
        error: Errors of activations (n, bundles), shape (n,).
        pilot: Where to begin, shape (n, bundles).
        found: Their errors, shape (n,).
        box: The bounds.

    Returns:
        Where the searches ended, shape (at most 8, bundles), and the errors there.
    """
    chosen = np.argsort(-found, kind="stable")[:_SEARCHED]
    gamma, worst = pilot[chosen].copy(), found[chosen].copy()
    free, rows = box.free, np.arange(len(chosen))
    for _ in range(_ROUNDS if len(free) else 0):
        moved = np.repeat(gamma[:, None], 2 * len(free), axis=1)
        moved[:, np.arange(len(free)), free] = box.low[free]
        moved[:, len(free) + np.arange(len(free)), free] = box.high[free]
        errors = error(moved.reshape(-1, box.bundles)).reshape(len(rows), -1)
        best = errors.argmax(axis=1)
        better = errors[rows, best] > 1.0001 * worst
        if not better.any():
            break
        gamma[better] = moved[rows, best][better]
        worst[better] = errors[rows, best][better]
    return gamma, worst
