"""Roots of tip(γ) = target, how well the tip can be moved there, and searches for hard targets."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from softreach.inverse.prepared import PreparedMap
from softreach.inverse.request import Request
from softreach.kernels.branches import newton
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array, Index, joined_by, rows
from softreach.workspace.search import CLOSELY, Nearest, nearest_tips

_NEARLY_SINGULAR = ((500, 20, 0.1), (2000, 100, 0.08))
_UNREACHED = ((1, 1, 0.0, 0), (24, 4, 0.15, 0), (128, 24, 0.1, 8), (1000, 150, 0.05, 100))
"""Efforts: seeds near the target, most starts from them, their least distance in ranges, and
searches from anywhere."""

_SEED = 1
_BEYOND = 1e-3  # of the residual, to which a descent goes on
_MOST_STEPS = 60
_BLOCK = 500  # targets at once
_MOST_ITERATIONS = 60
_LONGEST_STEP = 0.3  # in ranges
_OUTSIDE = 0.05  # how far a search may leave the bounds, in ranges
_LEAST_DAMPING = 1e-3
_CONVERGED = 1e-9  # step, in ranges
_FIRST_RETURNS, _RETURNS = 4, 2  # steps down to the floor of the valley


class Roots(NamedTuple):
    """Activations of the free bundles, each a root for one of the targets or the nearest tip."""

    target: Index  # number of the target, (n,)
    gamma: Array  # activations [-], (n, m)
    tip: Array  # tips there [m], (n, 3)
    slope: Array  # ∂r/∂γ there [m], (n, 3, m)
    residual: Array  # |tip - target| [m], (n,)
    cell: Index  # cell of the mesh where the search began; -1 if in none, (n,)
    sheet: Index  # number of its sheet in `PreparedMap.sheets`, (n,)

    def joined(self, other: Roots) -> Roots:
        """Both, sorted by target as each of them is."""
        return joined_by("target", [self, other]) if len(other.target) else self

    def missing(self, targets: int, residual: float = np.inf) -> Index:
        """Numbers of the targets, of so many, that have no root within a residual [m]."""
        known = self.target[self.residual <= residual]
        return np.flatnonzero(np.bincount(known, minlength=targets) == 0)


def no_roots(tip_map: TipMap) -> Roots:
    """An empty set of roots."""
    none, m = np.empty(0, np.int64), tip_map.box.bundles
    places = np.empty((0, m)), np.empty((0, 3)), np.empty((0, 3, m))
    return Roots(none, *places, np.empty(0), none, none)


def roots_at(tip_map: TipMap, targets: Array, target: Index, gamma: Array) -> Roots:
    """Activations (n, m) as roots for some of the targets (t, 3) [m], whatever their residual."""
    tips, slopes = tip_map.tips_and_slopes(gamma)
    if not tip_map.supports_unstable:
        tips = tip_map.tips(gamma)  # to the last bit those that users get
    residual = np.linalg.norm(tips - targets[target], axis=1)
    cell, sheet = np.full(len(target), -1), np.zeros(len(target), np.int64)
    return Roots(target, gamma, tips, slopes, residual, cell, sheet)


def placed(tip_map: TipMap, gamma: Array) -> Array:
    """Tips to rounding [m], shape (n, 3): `TipMap.tips` of loaded arms are only as exact as tol."""
    return tip_map.tips_and_slopes(gamma)[0] if tip_map.supports_unstable else tip_map.tips(gamma)


def descend(
    tip_map: TipMap, targets: Array, start: Array, residual: float, most: int = _MOST_STEPS
) -> Nearest:
    """Local minima of distance to targets (n, 3) from starts (n, m), well within a residual [m]."""
    return nearest_tips(tip_map, start, targets, _BEYOND * residual, CLOSELY._replace(most=most))


def first_of_each(owner: Index, value: Array, count: int) -> Index:
    """The row of least value of each of `count` owners, all of whom have some, shape (count,)."""
    order = np.lexsort((value, owner))
    return order[np.searchsorted(owner[order], np.arange(count))]


def closed_form(slope: Array) -> tuple[Array, Array]:
    """Smallest singular values [m] and condition numbers of 3x3 Jacobians, shape (n,)."""
    smallest, condition = np.empty((2, len(slope)))
    newton.conditions(slope, smallest, condition)
    return smallest, condition


def conditions(slope: Array) -> Array:
    """Condition numbers of Jacobians (n, 3, m), infinite where singular; NaN for m = 0."""
    m = slope.shape[2]
    if m == 0:
        return np.full(len(slope), np.nan)
    if m == 3:
        return closed_form(slope)[1]
    sigma = np.linalg.svd(slope, compute_uv=False)
    with np.errstate(divide="ignore"):
        return sigma[:, 0] / sigma[:, -1]


def nearly_singular_roots(prepared: PreparedMap, request: Request, chosen: Index) -> Roots:
    """Roots for some of the targets, those that no other search found, sorted by target."""
    roots = no_roots(prepared.tip_map)
    for neighbors, most, apart in _NEARLY_SINGULAR:
        left = np.setdiff1d(chosen, roots.target)
        for first in range(0, len(left), _BLOCK):
            part = left[first : first + _BLOCK]
            near = prepared.seeds.nearest(request.targets[part], neighbors)
            owner, start = prepared.seeds.starts(near, most, apart)
            goal, owner = request.targets[part[owner]], part[owner]
            gamma = affine_invariant_newton(prepared.tip_map, goal, start, request.residual)
            ends = roots_at(prepared.tip_map, request.targets, owner, gamma)
            roots = roots.joined(rows(ends, ends.residual <= request.residual))
    return roots


def affine_invariant_newton(
    tip_map: TipMap, targets: Array, start: Array, residual: float
) -> Array:
    """Ends of searches by affine-invariant Newton, inside the bounds; a root or not, (n, 3).

    Near a full circle two singular values of J vanish together, and on the way to a root the
    residual has to rise. So steps are judged by the natural test, |J⁻¹ F(trial)| < |J⁻¹ F(γ)|,
    which is invariant under any linear change of the residual. The roots lie in a curved valley,
    along which the tip moves millions of times as far as across: each step ends with a few of
    Newton's method along that direction alone.
    """
    box, scales = tip_map.box, tip_map.box.scales
    bounds = box.low - _OUTSIDE * scales, box.high + _OUTSIDE * scales
    floor = partial(_valley_floor, tip_map, bounds)
    gamma, miss, slope = floor(targets, start, _FIRST_RETURNS)
    damping, active = np.ones(len(start)), np.flatnonzero(np.isfinite(miss[:, 0]))
    for _ in range(_MOST_ITERATIONS):
        if not len(active):
            break
        jacobians = slope[active] * scales  # next to singular ones instead of these
        sizes = np.linalg.norm(jacobians, axis=(1, 2))
        flat = np.abs(np.linalg.det(jacobians)) <= 1e-30 * sizes**3
        shift = np.where(flat, 1e-12 * sizes, 0.0)[:, None, None] * np.eye(3)
        inverse = np.linalg.inv(jacobians + shift)
        step = np.einsum("nij,nj->ni", inverse, miss[active])
        size = np.linalg.norm(step, axis=1)
        factor = np.minimum(damping[active], _LONGEST_STEP / np.maximum(size, 1e-300))
        trial = np.clip(gamma[active] + factor[:, None] * step * scales, *bounds)
        trial, away, new_slope = floor(targets[active], trial, _RETURNS)
        left = np.linalg.norm(np.einsum("nij,nj->ni", inverse, away), axis=1)
        accepted = left <= (1.0 - 0.25 * factor) * size
        taken = active[accepted]
        gamma[taken], slope[taken] = trial[accepted], new_slope[accepted]
        miss[taken] = away[accepted]
        damping[active] = np.where(accepted, np.minimum(1.0, 3.0 * factor), 0.3 * factor)
        near = np.linalg.norm(miss[active], axis=1) <= residual
        end = (size <= _CONVERGED) | (near & ~accepted) | (damping[active] < _LEAST_DAMPING)
        active = active[~end]
    return box.clip(gamma)


def _valley_floor(
    tip_map: TipMap, bounds: tuple[Array, Array], targets: Array, gamma: Array, steps: int
) -> tuple[Array, Array, Array]:
    """Activations after steps along the way in which tips move most, what they miss, and ∂r/∂γ."""
    scales = tip_map.box.scales
    tip, slope = tip_map.tips_and_slopes(gamma)
    for _ in range(steps):
        lost = np.isnan(tip[:, 0])
        known = np.where(lost[:, None, None], np.eye(3), slope * scales)
        left, sizes, right = np.linalg.svd(known)
        step = np.einsum("ni,ni->n", left[:, :, 0], targets - tip) / sizes[:, 0]
        ahead = np.clip(gamma + scales * step[:, None] * right[:, 0], *bounds)
        gamma = np.where(lost[:, None], gamma, ahead)
        tip, slope = tip_map.tips_and_slopes(gamma)
    return gamma, targets - tip, slope


class Reached(NamedTuple):
    """The best place found for each target."""

    gamma: Array  # activations [-], (t, m)
    residual: Array  # |tip - target| [m], (t,)


def reach(prepared: PreparedMap, request: Request, start: Array) -> Reached:
    """The activation found whose tip is nearest to each target, with growing effort.

    Most targets are reached from `start` (t, m) or the nearest seed. The rest lie where the map is
    singular or on the boundary, the image of faces with few free bundles: these are searched from
    many seeds, on such faces too, that lie apart.
    """
    box, targets = prepared.tip_map.box, request.targets
    first = descend(prepared.tip_map, targets, box.clip(start), request.residual)
    gamma, residual = first.gamma, first.distance
    rng = np.random.default_rng(_SEED)
    for neighbors, most, apart, random in _UNREACHED:
        # One set for all targets, so that no answer depends on the other targets.
        anywhere = rng.uniform(box.low, box.high, (random, len(box.low)))
        left = np.flatnonzero(residual > request.residual)
        if not len(left):
            break
        for some in np.array_split(left, 1 + len(left) * neighbors // 100_000):
            goal = targets[some]
            starts = [(np.repeat(np.arange(len(some)), random), np.tile(anywhere, (len(some), 1)))]
            # The nearest seed is enough for nearly all.
            for seeds in (
                [prepared.seeds, prepared.face_seeds] if neighbors > 1 else [prepared.seeds]
            ):
                starts.append(seeds.starts(seeds.nearest(goal, neighbors), most, apart))
            owner, start = map(np.concatenate, zip(*starts, strict=True))
            ends = descend(prepared.tip_map, goal[owner], start, request.residual)
            best = first_of_each(owner, ends.distance, len(some))
            better = ends.distance[best] < residual[some]
            gamma[some[better]] = ends.gamma[best[better]]
            residual[some[better]] = ends.distance[best[better]]
    return Reached(gamma, residual)
