"""Extremes of bending over the bounds of any arm: exact where there is a way, by search else."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from softreach.arm import bending as exact
from softreach.arm.manipulator import Manipulator
from softreach.rod.rods import as_tip_map, with_unstable
from softreach.rod.tip_map import TipMap
from softreach.sampling import sample_cube
from softreach.support.arrays import Array

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
    sharpest: exact.Extreme
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
    stations = exact.bending_stations(arm).ravel()
    radius = arm.profile.radius(stations)
    if exact.has_exact_bending(arm):
        least, largest = exact.smallest_bending(arm).value, exact.largest_bending(arm).value
        gentlest = float((exact.bending_at(arm, stations)[0] * radius).min()) if least else 0.0
        return BendingRange(least, largest, gentlest, exact.sharpest_bending(arm), exact=True)
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
    place = exact.Extreme(sharpest, float(stations[relative.argmax()]))
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
