"""All activations that put the tip at a target, with three free bundles.

1. The activation box is cut into cells of six tetrahedra each; tips and Jacobians are computed at
   their corners, once for an arm (`prepared`).
2. A tetrahedron is mapped by the quadratic through tips and Jacobians of its corners, whose image
   lies within planes; the true image lies within a remainder of it, estimated from the tips and
   Jacobians along the edges: `kernels.image.activation_mesh`. So every root lies in a tetrahedron
   whose planes, moved out by the remainder, contain the target.
3. An octree over space lists the inflated images that may cover a place (`image_tree`); for few
   targets the boxes round the images are looked through instead (`ImageLeaves`).
4. In each tetrahedron listed at the target, the quadratic through tips and Jacobians says whether
   and where it is reached: a start (`kernels.branches.candidates`). Tips alone improve it.
5. Damped Newton with the exact Jacobian leads from each start to a root
   (`kernels.branches.newton`).
6. A tetrahedron that folds within itself holds two roots and gave one start: the other root lies
   opposite, along the null direction of the Jacobian (`newton.second_preimages`), and is searched
   as well.
7. Roots between which the tip hardly leaves the target are one.
8. A root beyond a bound is one on the bound if the tip misses no more there than the error of the
   map leaves open.
9. Targets left without a root are searched by descent, for Newton fails where J is singular.

Under loads some activations have no equilibrium, and a tip that is NaN is a failed step. Cells that
they tear have no image; their other corners begin searches instead (`torn_cells`).
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from softreach.inverse.prepared import PreparedMap
from softreach.inverse.request import Request
from softreach.inverse.roots import (
    Roots,
    closed_form,
    conditions,
    descend,
    no_roots,
    placed,
    roots_at,
)
from softreach.kernels.branches import candidates, newton
from softreach.rod.tip_map import TipMap
from softreach.support import parallel
from softreach.support.arrays import Array, Index, joined, joined_by, rows
from softreach.workspace.search import CLOSELY, nearest_tips

_ROUNDING = 1e-13  # of a tip, in L, with room to spare
_LARGEST, _SMALLEST = 8192, 1024  # targets solved together on a thread
_LARGEST_LOADED = 32_768  # with loads, on all threads
_SHARES = 6  # of the targets for each thread, because some are harder than others
_MOST_ITERATIONS = 40
_CHORD_STEPS = 2  # with the inverse that a start knows, before Newton's method
_STEEP = 1000.0  # change of activation per change of place in L beyond which they are not taken
_LONGEST_CHORD = 0.003  # in ranges of the bounds
_MUCH_NEARER = 0.1  # part of the distance to the target that a step may leave
_OVERSHOOTS = 2.8, 5.0, 16.0  # the larger ones where the curvature is far from what the cell says
_OUTSIDE = 0.02  # how far outside the bounds that search may begin, in ranges
_ROOM = candidates.MOST_STARTS + 4096  # starts that are gathered before they are copied
_AT_ONCE = 32  # targets that share a tree which is not divided
_PLACES = 32  # along each axis, when targets are put in order
_PARTNER_RANGE = 1.5  # widths of a cell within which a fold's other root is looked for


def every_branch(prepared: PreparedMap, request: Request) -> Roots:
    """All roots inside the bounds of three free bundles, sorted by target."""
    count = len(request.targets)
    if not count:
        return no_roots(prepared.tip_map)
    prepared.prepare_branches(count)
    size = _LARGEST_LOADED  # work enough to be shared out among threads
    if not prepared.tip_map.supports_unstable:  # enough for kernels, and enough sets for threads
        share = -(-count // (_SHARES * parallel.thread_count()))
        size = min(_LARGEST, max(_SMALLEST, share))
    # Groups of neighbors, which share most candidates, alike in work, from everywhere.
    low, extent = request.targets.min(axis=0), np.ptp(request.targets, axis=0)
    places = ((request.targets - low) * (_PLACES / np.maximum(extent, 1e-300))).astype(np.int64)
    order = np.argsort(places.clip(max=_PLACES - 1) @ [_PLACES**2, _PLACES, 1], kind="stable")
    number = -(-count // size)
    groups = [order[block] for block in parallel.blocks(count, _SMALLEST)]
    sets = [np.concatenate(groups[k::number]) for k in range(number)]
    if prepared.tip_map.supports_unstable or len(sets) == 1:
        parts = [_branches_of(prepared, request, chosen) for chosen in sets]
    else:
        alone = parallel.undivided()(_branches_of)
        parts = list(parallel.in_order(partial(alone, prepared, request, some) for some in sets))
    return joined_by("target", parts)


def with_other_sheets(prepared: PreparedMap, request: Request, roots: Roots) -> Roots:
    """The roots, and after those of each target the ones in other postures than from rest."""
    parts = [no_roots(prepared.tip_map)]
    for number, sheet in enumerate(prepared.sheets, 1):
        target, start = sheet.starts.starts(request.targets)
        ends = descend(sheet.tip_map, request.targets[target], start, request.residual)
        part = roots_at(sheet.tip_map, request.targets, target, ends.gamma)
        part = part._replace(sheet=np.full(len(target), number))
        parts.append(rows(part, part.residual <= request.reach_tol))
    others = joined_by("target", parts)
    if not len(others.target):
        return roots
    # A sheet goes on into activations at which its posture is that from rest.
    at_rest = roots_at(prepared.tip_map, request.targets, others.target, others.gamma)
    same = at_rest.residual <= request.reach_tol
    roots = distinct(prepared, request, roots.joined(rows(at_rest, same)))
    return roots.joined(distinct(prepared, request, rows(others, ~same)))


def _branches_of(prepared: PreparedMap, request: Request, chosen: Index) -> Roots:
    """The roots of some of the targets, sorted by their places in `chosen`."""
    some = request.of(chosen)
    starts = starts_from_cells(prepared, some, np.arange(len(chosen)))
    if len(prepared.torn_cells.tip):  # more from corners of cells that have no image
        target, gamma = prepared.torn_cells.starts(some.targets)
        nowhere, unknown = np.full(len(target), -1), np.zeros((len(target), 3, 3))
        starts = joined_by("target", [starts, Starts(target, nowhere, gamma, unknown)])
    roots = _newton(prepared, some, starts)
    # Where the quadratics say that nothing leads there, look once more without believing them.
    missing = roots.missing(len(chosen), some.residual)
    again = starts_from_cells(prepared, some, missing, with_root=False)
    roots = fresh = distinct(prepared, some, roots.joined(_newton(prepared, some, again)))
    for _ in range(2):  # a partner may have a partner of its own where two folds meet
        before, fresh = len(roots.target), _newton(prepared, some, _partner_starts(prepared, fresh))
        roots = distinct(prepared, some, roots.joined(fresh))
        if len(roots.target) == before:
            break
    missing = roots.missing(len(chosen), some.residual)
    starts = starts_from_cells(prepared, some, missing)
    if len(starts.target):  # step 9
        goal = some.targets[starts.target]
        ends = nearest_tips(prepared.tip_map, starts.gamma, goal, some.residual, CLOSELY)
        late = roots_at(prepared.tip_map, some.targets, starts.target, ends.gamma)
        roots = roots.joined(distinct(prepared, some, rows(late, late.residual <= some.residual)))
    return roots._replace(target=chosen[roots.target])


def _newton(prepared: PreparedMap, request: Request, starts: Starts) -> Roots:
    """Steps 5 and 8: damped Newton from every start; the roots that are within the bounds."""
    tip_map, goal = prepared.tip_map, request.targets[starts.target]
    if not len(goal):
        return no_roots(tip_map)
    low, high, n = tip_map.box.low.copy(), tip_map.box.high.copy(), len(goal)
    start = _improved(tip_map, goal, starts)
    slope, residual, step = np.zeros((n, 3, 3)), np.full(n, 1e300), np.zeros((n, 3))
    damping, trial, state = np.ones(n), start.copy(), np.full(n, newton.RUNNING)
    search = newton.Search(goal, start.copy(), slope, residual, step, damping, trial, state)
    for _ in range(_MOST_ITERATIONS):
        if not len(active := np.flatnonzero(search.state == newton.RUNNING)):
            break
        tips, slopes = tip_map.tips_and_slopes(search.trial[active])
        newton.newton_step(search, active, tips, slopes, low, high, request.residual)
        if tip_map.supports_unstable:
            # A search whose step leads nowhere has ended, as where the tip moves without limit.
            lost = active[~np.isfinite(search.trial[active]).all(axis=1)]
            search.trial[lost], search.state[lost] = search.gamma[lost], newton.STAGNATED
    converged = np.flatnonzero(search.state == newton.CONVERGED)
    # The trial holds the step that convergence left untaken; it may overstep a bound a little.
    trial, goal = search.trial[converged], goal[converged]
    gamma = tip_map.box.clip(trial)
    tips, sheet = placed(tip_map, gamma), np.zeros(len(converged), np.int64)
    residual = np.linalg.norm(tips - goal, axis=1)
    target, cell = starts.target[converged], starts.cell[converged]
    roots = Roots(target, gamma, tips, search.slope[converged], residual, cell, sheet)
    within = roots.residual <= request.residual
    over = ~within & (gamma != trial).any(axis=1)
    on_bounds = _moved_to_bounds(tip_map, request, rows(roots, over), goal[over])
    return rows(roots, within).joined(on_bounds)


def _moved_to_bounds(tip_map: TipMap, request: Request, roots: Roots, goal: Array) -> Roots:
    """Step 8: those of roots beyond bounds that miss little enough on the bounds."""
    # Back to the bounds the tip moves by no more than the condition number times the reach_tol.
    near = roots.residual <= request.reach_tol * conditions(roots.slope)
    roots, goal = rows(roots, near), goal[near]
    if not len(goal):
        return roots
    ends = descend(tip_map, goal, roots.gamma, request.residual)
    tip, slope = tip_map.tips_and_slopes(ends.gamma)
    roots = roots._replace(gamma=ends.gamma, tip=tip, slope=slope, residual=ends.distance)
    return rows(roots, roots.residual <= request.reach_tol)


def _improved(tip_map: TipMap, goal: Array, starts: Starts) -> Array:
    """The starts after steps with the inverse known there that bring the tip much nearer."""
    gamma = starts.gamma.copy()
    if tip_map.supports_unstable:
        return gamma
    steepest = np.abs(starts.inverse).max(axis=(1, 2)) * tip_map.length
    row = np.flatnonzero((steepest > 0) & (steepest < _STEEP))
    miss = goal[row] - tip_map.tips(gamma[row])
    for steps_left in reversed(range(_CHORD_STEPS)):
        step = np.einsum("nij,nj->ni", starts.inverse[row], miss)
        short = (np.abs(step) <= _LONGEST_CHORD * tip_map.box.widths).all(axis=1)
        row, step, miss = row[short], step[short], miss[short]
        trial = gamma[row] + step
        if not steps_left:  # Newton's method looks at the last one
            gamma[row] = trial
            break
        next_miss = goal[row] - tip_map.tips(trial)
        nearer = (next_miss**2).sum(axis=1) <= _MUCH_NEARER**2 * (miss**2).sum(axis=1)
        row, miss = row[nearer], next_miss[nearer]
        gamma[row] = trial[nearer]
    return gamma


def _partner_starts(prepared: PreparedMap, roots: Roots) -> Starts:
    """Near the second preimage of every root that has a fold near, once for each overshoot."""
    roots = rows(roots, roots.cell >= 0)
    box, parts = prepared.tip_map.box, [Starts.empty(0)]
    margin = _OUTSIDE * box.widths  # a start moved to the bounds may be short of the other root
    for overshoot in _OVERSHOOTS:
        start, near = np.empty_like(roots.gamma), np.zeros(len(roots.target), bool)
        known = roots.cell, roots.gamma, roots.slope, closed_form(roots.slope)[0]
        bounds = box.low - margin, box.high + margin
        newton.second_preimages(
            prepared.mesh, *known, _PARTNER_RANGE, overshoot, *bounds, start, near
        )
        roots, unknown = rows(roots, near), np.zeros((int(near.sum()), 3, 3))
        parts.append(Starts(roots.target, roots.cell, start[near], unknown))
    return joined_by("target", parts)


def distinct(prepared: PreparedMap, request: Request, roots: Roots) -> Roots:
    """Step 7: every root once."""
    counts = np.bincount(roots.target, minlength=len(request.targets))
    several = np.flatnonzero(counts[roots.target] > 1)
    offsets = np.concatenate([[0], np.cumsum(counts[counts > 1])])
    compared = roots.gamma[several], roots.residual[several]
    smallest, _ = closed_form(roots.slope[several])
    single, rounding = np.ones(len(several), bool), _ROUNDING * prepared.tip_map.length
    newton.merge_equal(offsets, *compared, smallest, rounding, single)
    kept = np.ones(len(roots.target), bool)
    kept[several] = single
    return rows(roots, kept)


class Starts(NamedTuple):
    """Activations at which searches begin."""

    target: Index  # number of the target, (n,)
    cell: Index  # cell of the mesh, (n,)
    gamma: Array  # activation [-], (n, 3)
    inverse: Array  # inverse of the Jacobian there [1/m], roughly; 0 if not known, (n, 3, 3)

    @staticmethod
    def empty(room: int) -> Starts:
        """Space for so many."""
        target, cell = np.empty(room, np.int64), np.empty(room, np.int64)
        return Starts(target, cell, np.empty((room, 3)), np.empty((room, 3, 3)))


def starts_from_cells(
    prepared: PreparedMap, request: Request, chosen: Index, with_root: bool = True
) -> Starts:
    """Starts for targets `chosen`, sorted by target, of tetrahedra whose quadratics reach them."""
    parts = [Starts.empty(0)]
    if not len(prepared.mesh.corner) or not len(chosen):
        return parts[0]
    box, targets = prepared.tip_map.box, request.targets[chosen]
    low, high, out = box.low.copy(), box.high.copy(), Starts.empty(_ROOM)
    # Before many targets were asked for, a tree for each block of what may cover them.
    few = parallel.blocks(len(targets), _AT_ONCE)
    trees = ((block, prepared.leaves.around(targets[block])) for block in few)
    if "tree" in vars(prepared):
        trees = [(slice(len(targets)), prepared.tree)]
    for block, tree in trees:
        first, last, _ = block.indices(len(targets))
        while first < last:
            done, count = candidates.find_starts(
                prepared.mesh, tree, targets[first:last], low, high, with_root, *out
            )
            part = rows(out, np.arange(count))
            parts.append(part._replace(target=chosen[part.target + first]))
            first += done
    return joined(parts)
