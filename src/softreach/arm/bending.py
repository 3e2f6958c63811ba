"""Extremes of bending κ over the bounds of an arm, exact: at stations and along the arm.

κ is |u| η/ζ of theory (7) and (45). The (u1, u2) that fibers and muscles reach at a station, of
η = ζ, are a zonogon, the image of the box of inputs. Forces, of η = 1, reach a polygon, the box
seen from ζ = 0. The farthest vertex and the point nearest to the origin are the range.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.driving import Driving, body_of
from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import tables
from softreach.support.arrays import Array

_STATIONS = 101
_PER_TURN = 24  # stations for each turn of one bundle relative to another
_FEWEST = 9  # stations between two breakpoints
_BRACKETS = 16
_POINTS = 17  # into which a bracket is divided, again and again
_ROUNDS = 10  # each narrows a bracket eightfold
_MOST_INPUTS = 8  # of which all corners are looked at


class Extreme(NamedTuple):
    """An extreme value along an arm and where it is."""

    value: float  # Of bending [1/m], or of bending times radius [-]
    station: float  # The first Z where it is reached [m]


def has_exact_bending(arm: Manipulator) -> bool:
    """True without loads, if strains are affine in the inputs, of fibers alone or few forces."""
    driving = Driving(arm)
    if arm.loads is not None or not driving.is_affine:
        return False
    forces = [actuator.is_force for actuator in driving.law.arm.bundle_actuators[: arm.bundles]]
    moving = int(np.ptp(arm.input_bounds, axis=1).astype(bool).sum())
    return not any(forces) or (all(forces) and moving <= _MOST_INPUTS)


def bending_at(arm: Manipulator, stations: ArrayLike) -> tuple[Array, Array]:
    """Least and largest κ = √(u1² + u2²) η/ζ [1/m] within the bounds, (station,): theory (45)."""
    center, halves, (start, end) = _reached(arm, stations)
    # Zonogons hold the origin where no line along an edge separates them, nor one across the
    # center, which is what remains where all edges are parallel or of no length.
    normals = np.stack([halves[..., 1], -halves[..., 0]], axis=-1)
    normals = np.concatenate([normals, center[:, None]], axis=1)
    away = np.abs(np.einsum("snc,sc->sn", normals, center))
    reach = np.abs(np.einsum("snc,sbc->snb", normals, halves)).sum(axis=-1)
    edges = end - start
    square, along = (edges**2).sum(axis=-1), -(start * edges).sum(axis=-1)
    part = np.divide(along, square, out=np.zeros_like(square), where=square > 0)
    nearest = np.linalg.norm(start + np.clip(part, 0.0, 1.0)[..., None] * edges, axis=-1)
    least = np.where((away <= reach).all(axis=1), 0.0, nearest.min(axis=1))
    return least, _farthest((start, end))


def _farthest(edges: tuple[Array, Array]) -> Array:
    return np.max([np.linalg.norm(ends, axis=-1).max(axis=1) for ends in edges], axis=0)


def largest_bending(arm: Manipulator) -> Extreme:
    """The largest bending [1/m] within the bounds and along the arm, to 1e-9 of it."""
    return _largest(arm, lambda z: _farthest(_reached(arm, z)[2]))


def sharpest_bending(arm: Manipulator) -> Extreme:
    """The largest bending times R2(Z) [-]: the inner side folds where it is 1 or more."""
    return _largest(arm, lambda z: _farthest(_reached(arm, z)[2]) * arm.profile.radius(z))


def smallest_bending(arm: Manipulator) -> Extreme:
    """The least bending [1/m] in the box and along the arm; 0 below 1e-9 of the largest there."""
    low, high = arm.input_bounds.T
    if not Driving(arm).offsets.any() and (low <= 0).all() and (high >= 0).all():
        return Extreme(0.0, 0.0)
    station = _largest(arm, lambda z: -bending_at(arm, z)[0]).station
    (least,), (largest,) = bending_at(arm, station)
    return Extreme(float(least) if least > 1e-9 * largest else 0.0, station)


def _reached(arm: Manipulator, stations: ArrayLike) -> tuple[Array, Array, tuple[Array, Array]]:
    """Zonogons of (u1, u2): centers (station, 2) and half the edges (station, 1 + input, 2) [1/m].

    And both ends of segments whose hull is the (κ1, κ2) reached, shape (station, edge, 2) [1/m].
    """
    driving = Driving(arm)
    table = tables(driving.law.arm, stations)
    inputs = np.column_stack([driving.offsets, driving.gains])  # of 1, and of each input
    low, high = np.vstack([[[1.0, 1.0]], arm.input_bounds]).T
    mean, half = 0.5 * (low + high), 0.5 * (high - low)
    plane, rates = table.curvature[:, :2] @ inputs, table.extension @ inputs
    center, halves = plane @ mean, np.swapaxes(plane * half, 1, 2)
    if not table.has_forces:
        vertices = _vertices(center, halves)
        return center, halves, (vertices, np.roll(vertices, -1, axis=1))
    moving = np.flatnonzero(half)
    signs = 2.0 * np.indices((2,) * len(moving)).reshape(len(moving), 2 ** len(moving)) - 1.0
    seen = center[:, None] + np.einsum("smc,mv->svc", halves[:, moving], signs)
    seen /= (1.0 + (rates @ mean)[:, None] + (rates * half)[:, moving] @ signs)[..., None]
    first, steps = np.arange(signs.shape[1]), 1 << np.arange(len(moving))
    pairs = np.concatenate([np.stack([first, first ^ step]) for step in (0, *steps)], axis=1)
    return center, halves, (seen[:, pairs[0]], seen[:, pairs[1]])


def _vertices(center: Array, halves: Array) -> Array:
    """Vertices in order around zonogons, (station, 2 * bundle, 2): edges sorted by direction."""
    x, y = halves[..., 0], halves[..., 1]
    upward = np.where(((y < 0) | ((y == 0) & (x < 0)))[..., None], -halves, halves)
    order = np.argsort(np.arctan2(upward[..., 1], upward[..., 0]), axis=1)
    edges = 2.0 * np.take_along_axis(upward, order[..., None], axis=1)
    side = np.cumsum(edges, axis=1) - 0.5 * edges.sum(axis=1, keepdims=True)
    return center[:, None] + np.concatenate([side, -side], axis=1)


def _largest(arm: Manipulator, measure: Callable[[Array], Array]) -> Extreme:
    """The largest value of a function of Z that is smooth or kinks downward between breakpoints."""
    grid = bending_stations(arm)
    values, last = measure(grid.ravel()), grid.shape[1] - 1
    # Brackets lie around the highest local maxima; none crosses a breakpoint.
    each = values.reshape(grid.shape)
    padded = np.pad(each, ((0, 0), (1, 1)), constant_values=-np.inf)
    piece, place = np.nonzero((each >= padded[:, :-2]) & (each >= padded[:, 2:]))
    highest = np.argsort(-each[piece, place], kind="stable")[:_BRACKETS]
    piece, place = piece[highest], place[highest]
    low, high = grid[piece, np.maximum(place - 1, 0)], grid[piece, np.minimum(place + 1, last)]
    stations = [grid.ravel()]
    for _ in range(_ROUNDS):
        inside = np.linspace(low, high, _POINTS, axis=1)
        finer = measure(inside.ravel())
        stations.append(inside.ravel())
        values = np.concatenate([values, finer])
        best, row = finer.reshape(inside.shape).argmax(axis=1), np.arange(len(inside))
        low = inside[row, np.maximum(best - 1, 0)]
        high = inside[row, np.minimum(best + 1, _POINTS - 1)]
    top = values.max()
    reached = np.concatenate(stations)[values >= top - 1e-12 * abs(top)]
    return Extreme(float(top), float(reached.min()))


def bending_stations(arm: Manipulator) -> Array:
    """Stations [m] that see each turn of bundles, (piece, station), just inside breakpoints."""
    arm = body_of(arm)
    ends = np.array([0.0, *arm.breakpoints, arm.length])
    start, end = ends[:-1].copy(), ends[1:].copy()
    start[1:], end[:-1] = np.nextafter(start[1:], np.inf), np.nextafter(end[:-1], -np.inf)
    center = arm.outline(np.linspace(0.0, arm.length, _STATIONS)).center
    relative = np.abs(np.diff(center - center[:, :1], axis=0)).sum(axis=0)
    along = _STATIONS + _PER_TURN * (float(relative.max(initial=0.0)) / (2 * np.pi))
    count = math.ceil(along * float((end - start).max()) / arm.length)
    return np.linspace(start, end, max(_FEWEST, count), axis=1)
