"""Extremes of bending κ over the bounds of an arm and along it: exact where there is a way.

κ is |u| η/ζ of theory (7) and (45). The (u1, u2) that fibers and muscles reach at a station, of
η = ζ, are a zonogon, the image of the box of inputs. Forces, of η = 1, reach a polygon, the box
seen from ζ = 0. The farthest vertex and the point nearest to the origin are the range. Under loads,
and where strains are not affine in the inputs, a search finds them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.driving import Driving, body_of
from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import tables
from softreach.rod.rods import as_tip_map, with_unstable
from softreach.rod.tip_map import TipMap
from softreach.sampling import sample_cube
from softreach.support.arrays import Array

_STATIONS = 101
_PER_TURN = 24  # stations for each turn of one bundle relative to another
_FEWEST = 9  # stations between two breakpoints
_BRACKETS = 16
_POINTS = 17  # into which a bracket is divided, again and again
_NARROWINGS = 10  # each narrows a bracket eightfold
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
    for _ in range(_NARROWINGS):
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


_MOST_CORNERS = 10  # inputs of which all corners are tried
_OF_BENDING = 256  # samples for which bending is looked at, which loads make dear
_AROUND = 64  # samples for each place tried around the worst
_ROUNDS, _SHRINK = 12, 0.6


class BendingRange(NamedTuple):
    """Range of the bending κ of the centerline as it is, in the bounds and along the arm."""

    least: float
    """κ [1/m]."""
    largest: float
    """κ [1/m]."""
    gentlest: float
    """κ R2, R2 before activation [-]."""
    sharpest: Extreme
    """κ R2 [-], and where it is."""
    exact: bool
    """False of what a search found, which may miss more."""


@lru_cache(maxsize=64)
def bending_over_bounds(arm: Manipulator) -> BendingRange:
    """Range of bending over all inputs within the bounds, under the loads of the arm.

    Exact where `has_exact_bending`, else by `worst_inputs`.

    Raises:
        InvalidDesign: Some activation within the bounds would shorten the arm to nothing.
    """
    stations = bending_stations(arm).ravel()
    radius = arm.profile.radius(stations)
    if has_exact_bending(arm):
        least, largest = smallest_bending(arm).value, largest_bending(arm).value
        gentlest = float((bending_at(arm, stations)[0] * radius).min()) if least else 0.0
        return BendingRange(least, largest, gentlest, sharpest_bending(arm), exact=True)
    tip_map = with_unstable(as_tip_map(arm, warn=False))

    def bending(gamma: Array) -> Array:
        curvature = tip_map.strains(gamma, stations).curvature
        return np.hypot(curvature[..., 0], curvature[..., 1])

    def ends(gamma: Array) -> Array:
        kappa = bending(gamma)
        return np.stack([-kappa.min(axis=1), kappa.max(axis=1), (kappa * radius).max(axis=1)], 1)

    gamma, value = worst_inputs(tip_map, ends, _OF_BENDING)
    least, largest, sharpest = np.where(np.isfinite(value), np.abs(value), 0.0).tolist()
    gentlest, _, relative = np.nan_to_num(bending(gamma) * radius)
    place = Extreme(sharpest, float(stations[relative.argmax()]))
    return BendingRange(least, largest, float(gentlest.min()), place, exact=False)


def worst_inputs(
    tip_map: TipMap, measure: Callable[[Array], Array], samples: int = 2048
) -> tuple[Array, Array]:
    """The inputs within the bounds at which each of some measures is largest, by search.

    Samples, a power of two, half as many on faces, corners, then the neighborhood of the worst: it
    proves nothing. Measures of inputs (n, inputs) are (n, k), NaN where there is no arm; inputs are
    returned as (k, inputs) with values (k,), -inf where no arm was found.
    """
    box = tip_map.box

    def of(gamma: Array) -> Array:
        return np.nan_to_num(measure(gamma), nan=-np.inf, posinf=np.inf, neginf=-np.inf)

    rng = np.random.default_rng(0)
    inside = box.from_cube(sample_cube("sobol", samples, box.bundles))
    faces = box.from_cube(rng.random((samples // 2, box.bundles)).round(0))
    mixed = np.where(rng.random(faces.shape) < 0.5, faces, inside[: len(faces)])
    every = np.concatenate([inside, some_corners(tip_map), mixed])
    values = of(every)
    around, columns = max(samples // _AROUND, 8), np.arange(values.shape[1])
    starts = 4 if samples > _OF_BENDING else 2
    worst = np.argsort(-values, axis=0, kind="stable")[:starts].T
    gamma, value = every[worst], values[worst, columns[:, None]]
    draws = rng.normal(size=(len(columns), _ROUNDS, around, *gamma.shape[1:]))
    shape = len(columns), around, gamma.shape[1]
    for k in range(_ROUNDS):
        moves = draws[:, k] * 0.25 * _SHRINK**k * box.widths
        tried = box.clip(gamma[:, None] + moves)
        outcomes = of(tried.reshape(math.prod(shape), box.bundles)).reshape(*shape, -1)
        outcomes = outcomes[columns, :, :, columns]  # each measure's own, (column, around, start)
        top = outcomes.argmax(axis=1)[:, None]
        ahead = np.take_along_axis(outcomes, top, axis=1)[:, 0]
        place = np.take_along_axis(tried, top[..., None], axis=1)[:, 0]
        gamma = np.where((ahead > value)[..., None], place, gamma)
        value = np.maximum(value, ahead)
    best = value.argmax(axis=1)
    return gamma[columns, best], value[columns, best]


def some_corners(tip_map: TipMap) -> Array:
    """Corners of the activation box, and each input at its bounds alone, shape (n, inputs)."""
    box = tip_map.box
    alone = np.tile(box.clip(np.zeros(box.bundles)), (2 * box.bundles, 1))
    each = np.arange(box.bundles)
    alone[each, each], alone[box.bundles + each, each] = box.low, box.high
    if box.bundles <= _MOST_CORNERS:
        return np.unique(np.concatenate([box.corners(), alone]), axis=0)
    pushed = np.random.default_rng(0).random((2**_MOST_CORNERS, box.bundles)).round()
    return np.concatenate([np.stack([box.low, box.high]), box.from_cube(pushed), alone])
