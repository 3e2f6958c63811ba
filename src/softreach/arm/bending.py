"""Extremes of bending in the activation box, exact: at stations and along the arm.

At one station the reachable (u1, u2) are a zonogon, the image of the activation box. Its farthest
vertex and its nearest point to the origin are the range of bending there.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import tables

__all__ = ["Extreme", "bending_at", "largest_bending", "sharpest_bending", "smallest_bending"]

Array = NDArray[np.float64]

_STATIONS = 101
_PER_TURN = 24  # stations for each turn of one bundle relative to another
_FEWEST = 9  # stations between two breakpoints
_BRACKETS = 16
_POINTS = 17  # into which a bracket is divided, again and again
_ROUNDS = 10  # each narrows a bracket eightfold


class Extreme(NamedTuple):
    """An extreme value along an arm and where it is."""

    value: float
    """Of bending [1/m], or of bending times radius [-]."""
    station: float
    """The first Z where it is reached [m]."""


def bending_at(arm: Manipulator, stations: ArrayLike) -> tuple[Array, Array]:
    """Least and largest bending √(u1² + u2²), theory (45) with u of (7), of the activation box.

    Args:
        arm: The design.
        stations: Z [m], shape (station,).

    Returns:
        Least and largest bending [1/m], each of shape (station,).
    """
    arm = arm.inner
    center, halves = _zonogons(arm, stations)
    if not arm.bundles:
        return np.zeros(len(center)), np.zeros(len(center))
    vertices = _vertices(center, halves)
    edge = _distance_to_edges(vertices)
    return np.where(_holds_origin(center, halves), 0.0, edge), _farthest(vertices)


def _largest_at(arm: Manipulator, stations: Array) -> Array:
    """As `bending_at`, the largest alone [1/m]: with many bundles by far the cheaper half."""
    center, halves = _zonogons(arm, stations)
    return _farthest(_vertices(center, halves)) if arm.bundles else np.zeros(len(center))


def _farthest(vertices: Array) -> Array:
    return np.linalg.norm(vertices, axis=-1).max(axis=1)


def largest_bending(arm: Manipulator) -> Extreme:
    """The largest bending [1/m] in the box and along the arm, to 1e-9 of it."""
    arm = arm.inner
    return _largest(arm, lambda z: _largest_at(arm, z))


def sharpest_bending(arm: Manipulator) -> Extreme:
    """The largest bending times R2(Z) [-]: the inner side folds where it is 1 or more."""
    arm = arm.inner
    return _largest(arm, lambda z: _largest_at(arm, z) * arm.profile.radius(z))


def smallest_bending(arm: Manipulator) -> Extreme:
    """The least bending [1/m] in the box and along the arm; 0 below 1e-9 of the largest there."""
    arm = arm.inner
    low, high = arm.bounds.T
    if (low <= 0).all() and (high >= 0).all():
        return Extreme(0.0, 0.0)
    station = _largest(arm, lambda z: -bending_at(arm, z)[0]).station
    (least,), (largest,) = bending_at(arm, station)
    return Extreme(float(least) if least > 1e-9 * largest else 0.0, station)


def _zonogons(arm: Manipulator, stations: ArrayLike) -> tuple[Array, Array]:
    """Centers, shape (station, 2), and half the edges, shape (station, bundle, 2) [1/m]."""
    plane = tables(arm, stations).curvature[:, :2]
    low, high = arm.bounds.T
    center = plane @ (0.5 * (low + high))
    return center, np.swapaxes(plane * (0.5 * (high - low)), 1, 2)


def _vertices(center: Array, halves: Array) -> Array:
    """All vertices in order around the zonogon, shape (station, 2 * bundle, 2).

    Edges that all point upward, sorted by direction, lead from one vertex to the opposite one.
    """
    x, y = halves[..., 0], halves[..., 1]
    upward = np.where(((y < 0) | ((y == 0) & (x < 0)))[..., None], -halves, halves)
    order = np.argsort(np.arctan2(upward[..., 1], upward[..., 0]), axis=1)
    edges = 2.0 * np.take_along_axis(upward, order[..., None], axis=1)
    side = np.cumsum(edges, axis=1) - 0.5 * edges.sum(axis=1, keepdims=True)
    return center[:, None] + np.concatenate([side, -side], axis=1)


def _holds_origin(center: Array, halves: Array) -> NDArray[np.bool_]:
    """Zonogons that hold the origin: no line along an edge or across the center separates them.

    The last is what remains to be asked where all edges are parallel or of no length.
    """
    normals = np.stack([halves[..., 1], -halves[..., 0]], axis=-1)
    normals = np.concatenate([normals, center[:, None]], axis=1)
    away = np.abs(np.einsum("snc,sc->sn", normals, center))
    reach = np.abs(np.einsum("snc,sbc->snb", normals, halves)).sum(axis=-1)
    return (away <= reach).all(axis=1)


def _distance_to_edges(vertices: Array) -> Array:
    """Distance of the origin to the nearest edge, shape (station,)."""
    edges = np.roll(vertices, -1, axis=1) - vertices
    square = (edges**2).sum(axis=-1)
    along = -(vertices * edges).sum(axis=-1)
    part = np.divide(along, square, out=np.zeros_like(square), where=square > 0)
    nearest = vertices + np.clip(part, 0.0, 1.0)[..., None] * edges
    return np.linalg.norm(nearest, axis=-1).min(axis=1)


def _largest(arm: Manipulator, measure: Callable[[Array], Array]) -> Extreme:
    """The largest value of a function of Z that is smooth or kinks downward between breakpoints."""
    grid = _grid(arm)
    values = measure(grid.ravel())
    low, high = _brackets(grid, values.reshape(grid.shape))
    stations = [grid.ravel()]
    for _ in range(_ROUNDS):
        inside = np.linspace(low, high, _POINTS, axis=1)
        finer = measure(inside.ravel())
        stations.append(inside.ravel())
        values = np.concatenate([values, finer])
        best = finer.reshape(inside.shape).argmax(axis=1)
        row = np.arange(len(inside))
        low, high = (
            inside[row, np.maximum(best - 1, 0)],
            inside[row, np.minimum(best + 1, _POINTS - 1)],
        )
    top = values.max()
    reached = np.concatenate(stations)[values >= top - 1e-12 * abs(top)]
    return Extreme(float(top), float(reached.min()))


def _brackets(grid: Array, values: Array) -> tuple[Array, Array]:
    """Ends of intervals around the highest local maxima [m]; none crosses a breakpoint."""
    padded = np.pad(values, ((0, 0), (1, 1)), constant_values=-np.inf)
    piece, place = np.nonzero((values >= padded[:, :-2]) & (values >= padded[:, 2:]))
    highest = np.argsort(-values[piece, place], kind="stable")[:_BRACKETS]
    piece, place = piece[highest], place[highest]
    last = grid.shape[1] - 1
    return grid[piece, np.maximum(place - 1, 0)], grid[piece, np.minimum(place + 1, last)]


def _grid(arm: Manipulator) -> Array:
    """Stations fine enough to see each turn of the bundles, shape (piece, station).

    A piece lies between two breakpoints, where the curvature may jump: it ends just inside them.
    """
    ends = np.array([0.0, *arm.breakpoints, arm.length])
    start, end = ends[:-1].copy(), ends[1:].copy()
    start[1:], end[:-1] = np.nextafter(start[1:], np.inf), np.nextafter(end[:-1], -np.inf)
    along = _STATIONS + _PER_TURN * _turns(arm)
    count = math.ceil(along * float((end - start).max()) / arm.length)
    return np.linspace(start, end, max(_FEWEST, count), axis=1)


def _turns(arm: Manipulator) -> float:
    """Turns about the axis that some bundle makes relative to another."""
    center = arm.outline(np.linspace(0.0, arm.length, _STATIONS)).center
    relative = np.abs(np.diff(center - center[:, :1], axis=0)).sum(axis=0)
    return float(relative.max(initial=0.0)) / (2 * np.pi)
