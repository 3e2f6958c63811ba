"""Poses chosen for places: those that keep best to the rules, then those of least effort."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.inverse.prepared import prepared_map
from softreach.inverse.solutions import Solutions, Status
from softreach.inverse.solve import solve_inverse
from softreach.requirements.poses import PoseRules
from softreach.rod.bending import some_corners
from softreach.rod.rods import as_tip_map
from softreach.sampling import sample_cube
from softreach.support import parallel
from softreach.support.arrays import Array, Index
from softreach.support.errors import InvalidInput, no_warnings
from softreach.support.progress import Progress
from softreach.workspace.search import nearest_tips

TOL = 1e-6  # over L: a place that is reached to the error of the tips is reached
_BLOCK = 32_768  # places at once: bounds the memory
_FAMILY = 32  # activations tried for a place of an arm with more than three free bundles
_MOST_TRIED = 4_096  # places for which they are
_SAME = 1e-4  # of the ranges, by which poses are told apart
_SEEDS, _NEIGHBORS = 256, 5
"""Samples that quick descents start from, and how many of them for each place."""
_CELLS = 16  # along each axis of three bundles: as many solutions as with 32, in half the time

Chooser = Callable[[PoseRules, Array, Array], "Posed"]
"""Poses under rules for places, each with the distance to which it must be reached."""


class Posed(NamedTuple):
    """The pose chosen for each place, under one payload."""

    gaps: Array
    poses: Array
    effort: Array
    nearest: Array
    excess: Array
    """Of each rule, shape (place, rule)."""
    value: Array
    """Of each rule, shape (place, rule)."""
    error: Array
    """Of the values of regions between stations [m], shape (place, rule)."""


def solved(
    rules: PoseRules, places: Array, within: Array, step: Progress, choose: Chooser
) -> Posed:
    """The poses at places, in blocks."""
    count, inputs, k = len(places), rules.arm.inputs, len(rules)
    shapes = ((), (inputs,), (), (3,), (k,), (k,), (k,))
    room = Posed(*(np.zeros((count, *shape)) for shape in shapes))
    for block in parallel.blocks(count, _BLOCK):
        for whole, part in zip(room, choose(rules, places[block], within[block]), strict=True):
            whole[block] = part
        step(len(places[block]))
    return room


def chosen(rules: PoseRules, places: Array, within: Array) -> Posed:
    """Poses at places from all solutions of the inverse."""
    arm = rules.arm
    try:
        with no_warnings():
            solutions = solve_inverse(prepared_map(arm, TOL, cells=_CELLS), places, from_rest=True)
    except InvalidInput as error:
        if error.name != "loads":
            raise
        return _without_equilibrium(rules, places)
    best = _best(rules, solutions)
    broken = (best.excess.sum(axis=1) > 0.0) & (solutions.statuses == Status.REACHED)
    if (as_tip_map(arm).box.dimension > 3) and 0 < broken.sum() <= _MOST_TRIED:
        rows = np.flatnonzero(broken)
        with no_warnings():
            family = solve_inverse(
                prepared_map(arm, TOL, cells=_CELLS), places[rows], family=_FAMILY
            )
        for all_places, some in zip(best, _best(rules, family), strict=True):
            all_places[rows] = some
    # A place that is reached to the error of the tips is reached.
    reached = solutions.statuses == Status.REACHED
    gaps = np.where(reached, np.minimum(best.gaps, TOL * arm.length), best.gaps)
    return best._replace(gaps=gaps)


def descended(rules: PoseRules, places: Array, within: Array) -> Posed:
    """Poses at the ends of descents from the samples whose tips are nearest to each place."""
    from scipy.spatial import KDTree

    rod, count = rules.rod, len(places)
    gamma = rod.box.from_cube(sample_cube("sobol", _SEEDS, rod.box.bundles))
    gamma = np.concatenate([gamma, some_corners(rod)])
    tips = rod.tips(gamma)
    known = np.isfinite(tips).all(axis=1)
    if not known.any():
        return _without_equilibrium(rules, places)
    gamma, tips = gamma[known], tips[known]
    near = KDTree(tips).query(places, k=min(_NEIGHBORS, len(tips)))[1].reshape(count, -1)
    owner = np.repeat(np.arange(count), near.shape[1])
    enough = TOL * rod.length
    ends = nearest_tips(rod, gamma[near.ravel()], places[owner], enough)
    least = np.full(count, np.inf)
    np.minimum.at(least, owner, ends.distance)
    # Local minima that are farther away than another are no poses at the place.
    wanted = np.maximum(np.maximum(within, enough)[owner], least[owner] * (1.0 + 1e-9))
    kept = np.flatnonzero(ends.distance <= wanted)
    # Most descents to a place end in one pose.
    same = np.column_stack([owner[kept], np.rint(rod.box.to_cube(ends.gamma[kept]) / _SAME)])
    kept = kept[np.unique(same, axis=0, return_index=True)[1]]
    return _ranked(
        rules, places, owner[kept], ends.gamma[kept], ends.distance[kept], ends.tips[kept]
    )


def _best(rules: PoseRules, solutions: Solutions) -> Posed:
    """Of each target the solution that breaks the rules least, then that of least effort."""
    missing = np.flatnonzero(solutions.counts == 0)
    owner = np.concatenate([np.repeat(np.arange(len(solutions)), solutions.counts), missing])
    gamma = np.concatenate([solutions.activations, solutions.nearest_activations[missing]])
    gaps = np.concatenate([solutions.residuals, solutions.gaps[missing]])
    nearest = np.concatenate(
        [np.repeat(solutions.targets, solutions.counts, axis=0), solutions.nearest[missing]]
    )
    return _ranked(rules, solutions.targets, owner, gamma, gaps, nearest)


def _ranked(
    rules: PoseRules, places: Array, owner: Index, gamma: Array, gaps: Array, nearest: Array
) -> Posed:
    """Of each place the pose that breaks the rules least, then that of least effort.

    Args:
        rules: Regions and limits of poses.
        places: Shape (place, 3).
        owner: Place of each pose; each place has one at least.
        gamma: Inputs of the poses.
        gaps: Distances from their tips to the places [m].
        nearest: Their tips.
    """
    lost = ~np.isfinite(gamma).all(axis=1)
    gamma[lost] = rules.rod.box.low
    judged = rules.judged(gamma)
    effort = np.linalg.norm(gamma / effort_scales(rules.arm), axis=1)
    broken = judged.excess.sum(axis=1)
    order = np.lexsort((effort, broken, owner))
    best = order[np.searchsorted(owner[order], np.arange(len(places)))]
    away = np.linalg.norm(places - rules.arm.base.position, axis=1)
    gaps = np.where(np.isfinite(gaps[best]), gaps[best], away + rules.arm.length)
    rest = (judged.excess[best], judged.value[best], judged.error[best])
    return Posed(gaps, gamma[best], effort[best], np.nan_to_num(nearest[best]), *rest)


def effort_scales(arm: Manipulator) -> Array:
    """Largest bound of each input, which its effort counts in, shape (inputs,)."""
    largest = np.abs(arm.input_bounds).max(axis=1, initial=0.0)
    return np.where(largest > 0.0, largest, 1.0)


def _without_equilibrium(rules: PoseRules, places: Array) -> Posed:
    """Poses of an arm that no activation holds under its loads: its tip is near no place."""
    arm, count = rules.arm, len(places)
    away = np.linalg.norm(places - arm.base.position, axis=1) + arm.length
    gamma = np.tile(rules.rod.box.low, (count, 1))
    rule = np.zeros((count, len(rules)))
    base = np.tile(arm.base.position, (count, 1))
    return Posed(away, gamma, np.zeros(count), base, rule, rule, rule)
