"""Solving for activations: an arm is prepared once, then any number of targets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator
from softreach.inverse.branches import distinct, every_branch, with_other_sheets
from softreach.inverse.direction import compromises, direction_errors, marker_errors
from softreach.inverse.least_change import least_changes
from softreach.inverse.prepared import PreparedMap, prepared_map
from softreach.inverse.proofs import gap_bounds
from softreach.inverse.request import RESIDUALS, Request, as_activations, as_frames, as_markers
from softreach.inverse.roots import (
    Roots,
    conditions,
    first_of_each,
    nearly_singular_roots,
    no_roots,
    roots_at,
)
from softreach.inverse.solutions import Solutions, Status
from softreach.rod.clearance import ClearanceMap
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.rods import all_inputs, as_tip_map
from softreach.rod.tip_map import Frame, TipMap
from softreach.support import parallel
from softreach.support.arguments import as_flag, as_integer, as_number
from softreach.support.arrays import Array, Index, Mask, as_directions, as_points, joined, rows
from softreach.support.errors import InvalidInput, Range
from softreach.workspace.search import CLOSELY, nearest_tips

_WEIGHTS = Range(0.0, 1e6, open_low=True)
_LOOKED_AT = 16  # activations of a family, of which some may be free
_NEARLY = 1e-2  # gap in L at which a target may have a root where ∂r/∂γ is nearly singular
_BLOCK = 32_768  # targets at once: bounds the memory of a call
_BRANCH_BLOCK = 131_072  # where all roots are searched, which is done in smaller sets


def solve_inverse(
    arm: Manipulator | TipMap | PreparedMap,
    targets: ArrayLike,
    *,
    residual_over_length: float = 1e-10,
    within: float = 0.0,
    near: ArrayLike | None = None,
    direction: ArrayLike | None = None,
    orientation: ArrayLike | None = None,
    cone: float = 0.0,
    direction_weight: float = 0.1,
    markers: Mapping[str, ArrayLike] | None = None,
    marker_within: float | Mapping[str, float] = 0.0,
    family: int = 1,
    seed: int = 0,
    from_rest: bool = False,
    free: bool = False,
    tol: float = 1e-6,
    frame: Frame = "world",
    point: str | None = None,
) -> Solutions:
    """The activations that put the tip at each target, or as near to it as the arm can reach.

    Bundles with equal bounds are held there; the others are free. With three free bundles: every
    activation within the bounds, by Newton's method from every cell of the activation box whose
    image covers the target. With more: the one of least |γ - near|, and `family - 1` others on
    request. With fewer, or out of reach: the nearest reachable point found, and whether a bound
    proves the target to be out of reach. The arm is prepared at the
    first call and remembered.

    Of an arm under loads every activation given holds the arm in a posture; `leans` says where it
    leans there to one of two sides. Three free bundles may hold several at one activation, which
    the arm comes to by several ways: all are searched, those to which the activations lead straight
    from rest come first, and `Solution.posture` is the tip map that goes on from each. Nothing is
    proved, so that a target that no search reaches is `NOT_FOUND`.

    Args:
        arm: The design, its tip map, or what `prepared_map` made of it.
        targets: Tip positions to reach [m], shape (t, 3), or (3,) for one.
        residual_over_length: |tip - target| to which a solution is searched, in L. Where the arm
            comes no nearer than to within `tol`, its nearest activations are the solutions: whether
            it reaches such a target is more than its tips can say.
        within: |tip - target| at which a target counts as reached [m], if no activation does
            better; the residual says how near the tip comes. It holds for poses with a direction
            too, of which one within that distance is then searched for.
        near: With more than three free bundles: the activation to stay near to [unit of each],
            shape (bundles,) or (t, bundles); by default rest. Where units differ, the change of
            each activation counts in its own range.
        direction: Wanted tip tangents d3, shape (3,) or (t, 3), of any length. A target then
            counts as reached only where the direction is met as well: by one of all solutions of
            three free bundles, or by a search for both with more.
        orientation: Wanted frames of the tip in place of directions: rotation matrices with the
            directors d1, d2, d3 as columns, shape (3, 3) or (t, 3, 3). Angles are then those of the
            rotation from the wanted frame to the tip's.
        cone: Angle from `direction`, or `orientation`, that is allowed [rad]; a millionth more is
            rounding.
        direction_weight: w [-] where no activation meets both: `nearest` has least
            |tip - target|²/L² + w² θ² with the angle θ beyond the cone.
        markers: Wanted positions of markers of the arm by name [m], shape (3,) or (t, 3) each. A
            target then counts as reached only where each marker is at its own as well; else
            `nearest` has the least sum of all squared distances. Of an arm under loads only
            postures from rest are searched.
        marker_within: As `within`, for all markers or for each by name [m].
        family: With more than three free bundles: how many activations to give for each target,
            the others being those nearest to random activations and apart by a thousandth of a
            range; fewer where no more of them are found.
        seed: Seed of these.
        from_rest: Of an arm under loads: only postures to which activations lead straight from
            rest, or from where the arm is in whose tip map is given.
        free: Only activations from rest at which the arm touches neither its `surroundings` nor
            itself, those nearest to `near` first; a target with others alone is `IN_CONTACT`.
        tol: Largest error of the tips themselves, in L; residuals refer to `tip_positions` with
            this tolerance. No target nearer to a tip than that is called out of reach. A tip map
            keeps its own.
        frame: That of targets and directions: "world", or "base", whose z is along the straight
            arm.
        point: Name of the marker that counts as the tip, such as that of a tool; by default that
            of the design. Of a tip map its own counts.

    Returns:
        One `Solution` for each target; failures are its status, never an exception.

    Raises:
        InvalidInput: Arguments of another shape, not finite, or out of range; both a direction and
            an orientation.

    Examples:
        >>> arm = sr.designs.minimal_trunk()
        >>> solutions = sr.solve_inverse(arm, [[0.2, 0.1, 0.6]])
        >>> sr.tip_positions(arm, solutions.activations).round(6)
        array([[0.2, 0.1, 0.6]])
    """
    prepared = prepared_map(arm, tol, frame=frame, point=point)
    points, box = as_points("targets", targets), prepared.whole.box
    preferred = np.zeros(box.bundles) if near is None else near
    measures, length = prepared.whole.measures, prepared.whole.length
    if direction is not None and orientation is not None:
        raise InvalidInput("direction", direction, "left out, as d3 of the orientation is one")
    unit = None if direction is None else as_directions("direction", direction, len(points))
    frames = None if orientation is None else as_frames(orientation, len(points))
    residual = as_number("residual_over_length", residual_over_length, RESIDUALS) * length
    most, free = as_integer("family", family, 1, 10_000), as_flag("free", free)
    within = as_number("within", within, Range(0.0, unit="m"))
    request = Request(
        targets=points,
        residual=residual,
        reach_tol=max(residual, prepared.whole.tol * length, within),
        near=as_activations("near", preferred, box, len(points)) / measures[box.free],
        direction=unit if frames is None else frames[:, :, 2],
        orientation=frames,
        cone=as_number("cone", cone, Range(0.0, np.pi, unit="rad")),
        direction_weight=as_number("direction_weight", direction_weight, _WEIGHTS),
        **as_markers(prepared.whole, markers or {}, marker_within, len(points)),
        within=within,
        family=max(most, _LOOKED_AT if free else 1),
        seed=as_integer("seed", seed, 0, 2**63),
        from_rest=as_flag("from_rest", from_rest) or free or bool(markers),
    )
    solve, size = _by_distance, _BLOCK
    if prepared.dimension > 3:
        solve = _by_least_change
    elif prepared.dimension == 3:
        solve, size = _by_branches, _BRANCH_BLOCK if request.is_of_place else _BLOCK
    blocks = parallel.blocks(len(points), size) or [slice(0)]
    solutions = Solutions.joined([solve(prepared, request.of(block)) for block in blocks])
    nearest = solutions.nearest_activations * measures
    every = solutions.activations * measures
    solutions = replace(solutions, activations=every, nearest_activations=nearest)
    return _free_of(solutions, prepared, preferred, most) if free else solutions


def _free_of(solutions: Solutions, known: PreparedMap, near: ArrayLike, most: int) -> Solutions:
    """The solutions that touch nothing, the nearest first; of families so many at most."""
    whole = as_tip_map(known.whole.arm, known.whole.tol)  # in postures from rest
    target = np.repeat(np.arange(len(solutions)), solutions.counts)
    preferred = np.broadcast_to(np.asarray(near, float), (len(solutions), whole.box.bundles))
    away = np.linalg.norm((solutions.activations - preferred[target]) / whole.box.scales, axis=1)
    rows = np.lexsort((away, target))
    rows = rows[ClearanceMap(whole).of(solutions.activations[rows]).value > 0.0]
    if known.dimension > 3:
        rows = rows[np.arange(len(rows)) - np.searchsorted(target[rows], target[rows]) < most]
    return solutions.only(rows, np.bincount(target[rows], minlength=len(solutions)))


def _by_branches(prepared: PreparedMap, request: Request) -> Solutions:
    roots = every_branch(prepared, request)
    if not request.from_rest:
        roots = with_other_sheets(prepared, request, roots)
    if not request.is_of_place:
        return _by_distance(prepared, request, roots)
    missing = roots.missing(len(request.targets))
    blocks = parallel.blocks(len(missing), _BLOCK) or [slice(0)]
    none = no_roots(prepared.tip_map)
    closest = joined([_closest(prepared, request, missing[block], none) for block in blocks])
    bounds = _gap_bounds(prepared, request, closest)
    # A target not proved to be out of reach may have roots that are nearly singular.
    left = (closest.residual > request.residual) & (bounds == 0.0)
    if not prepared.proves:
        left &= closest.residual <= _NEARLY * prepared.whole.length
    if left.any():
        late = nearly_singular_roots(prepared, request, missing[left])
        late = distinct(prepared, request, late)
        roots, still = roots.joined(late), np.isin(missing, late.target, invert=True)
        closest, bounds = rows(closest, still), bounds[still]
    return _solutions(prepared, request, roots, closest, bounds)


def _by_distance(prepared: PreparedMap, request: Request, every: Roots | None = None) -> Solutions:
    """The nearest place or pose, but where one of all roots points the way that is wanted."""
    every = no_roots(prepared.tip_map) if every is None else every
    roots = rows(every, _meeting(prepared, request, every))
    missing = roots.missing(len(request.targets))
    known = rows(every, np.isin(every.target, missing))
    closest = _closest(prepared, request, missing, known)
    return _solutions(prepared, request, roots, closest)


def _by_least_change(prepared: PreparedMap, request: Request) -> Solutions:
    tip_map, (target, gamma, best) = prepared.tip_map, least_changes(prepared, request)
    roots = roots_at(tip_map, request.targets, target, gamma)
    missing = roots.missing(len(request.targets))
    left, start = request.targets[missing], best.gamma[missing]
    if request.is_of_place:
        start = nearest_tips(tip_map, start, left, request.residual, CLOSELY).gamma
    else:
        start = compromises(tip_map, request.of(missing), start).gamma
    closest = roots_at(tip_map, request.targets, missing, start)
    return _solutions(prepared, request, roots, closest)


def _closest(prepared: PreparedMap, request: Request, chosen: Index, known: Roots) -> Roots:
    """The nearest tip, or the best compromise with a direction, from seeds and known roots."""
    tip_map, targets = prepared.tip_map, request.targets[chosen]
    if not len(chosen):
        return no_roots(tip_map)
    target, start = prepared.seeds.starts(prepared.seeds.nearest(targets))
    target = np.concatenate([target, np.searchsorted(chosen, known.target)])
    start = np.concatenate([start, known.gamma])
    if request.is_of_place:
        gamma, _, left = nearest_tips(tip_map, start, targets[target], request.residual, CLOSELY)
    else:
        gamma, left, _ = compromises(tip_map, request.of(chosen[target]), start)
    best = first_of_each(target, left, len(chosen))
    return roots_at(tip_map, request.targets, chosen, gamma[best])


def _gap_bounds(prepared: PreparedMap, request: Request, closest: Roots) -> Array:
    """Lower bounds of the distance of targets to all tips; 0 where they prove nothing."""
    gap = closest.residual
    bounds, out = np.zeros(len(gap)), np.flatnonzero(gap > request.reach_tol)
    # Where the position yields to a direction, the gap says nothing of what can be reached.
    if len(out) and request.is_of_place and (prepared.proves or not prepared.dimension):
        gaps = request.targets[closest.target[out]], gap[out], request.reach_tol
        bounds[out] = gap_bounds(prepared.tip_map, prepared.coarse_cells, *gaps)
    # Within the error of the tips, what is true of them need not be true of the arm.
    return np.where(bounds > request.reach_tol, bounds, 0.0)


def _solutions(
    prepared: PreparedMap,
    request: Request,
    roots: Roots,
    closest: Roots,
    bounds: Array | None = None,
) -> Solutions:
    """Join roots, sorted by target, and the nearest points to targets without; some are roots."""
    tip_map, whole, count = prepared.tip_map, prepared.whole, len(request.targets)
    if bounds is None:
        bounds = _gap_bounds(prepared, request, closest)
    hit = closest.residual <= request.reach_tol
    hit &= _meeting(prepared, request, closest)
    roots = roots.joined(rows(closest, hit))
    # Roots on a bound that miss by what the error of the tips leaves open come last.
    beside = roots.residual > request.residual
    roots = rows(roots, np.lexsort((beside, roots.target))) if beside.any() else roots
    best = roots.joined(rows(closest, ~hit))
    best = rows(best, np.unique(best.target, return_index=True)[1])
    statuses, proved_gaps = np.full(count, Status.REACHED, np.int8), np.zeros(count)
    out_of_reach = np.where(bounds[~hit] > 0.0, Status.UNREACHABLE, Status.NOT_FOUND)
    statuses[closest.target[~hit]], proved_gaps[closest.target] = out_of_reach, bounds
    activations, known = whole.box.with_fixed(roots.gamma), as_tip_map(whole)
    leans = np.zeros(len(activations), bool)
    if isinstance(known.rod, LoadedRod):
        leans = known.rod.leans(known.inputs.activations(activations))
    maps = [prepared, *prepared.sheets] if roots.sheet.any() else [prepared]
    return Solutions(
        arm=whole.arm,
        tip_maps=tuple(all_inputs(each.whole) for each in maps),
        frame=whole.frame,
        bundles=whole.box.names,
        targets=request.targets,
        offsets=np.searchsorted(roots.target, np.arange(count + 1)),
        activations=activations,
        residuals=roots.residual,
        direction_errors=_direction_errors(prepared, request, roots),
        marker_names=tuple(request.markers),
        marker_errors=marker_errors(tip_map, request, roots.target, roots.gamma),
        conditions=conditions(roots.slope),
        margins=tip_map.box.margin(roots.gamma),
        leans=leans,
        sheets=roots.sheet,
        statuses=statuses,
        nearest=np.where((best.residual > request.residual)[:, None], best.tip, request.targets),
        nearest_activations=whole.box.with_fixed(best.gamma),
        gaps=best.residual,
        direction_gaps=_direction_errors(prepared, request, best),
        marker_gaps=marker_errors(tip_map, request, best.target, best.gamma),
        gap_bounds=proved_gaps,
    )


def _meeting(prepared: PreparedMap, request: Request, roots: Roots) -> Mask:
    """Mask of the roots that meet the goals beside the position of the tip."""
    off = _direction_errors(prepared, request, roots)  # NaN where no direction is wanted
    least = max(request.residual, prepared.whole.tol * prepared.whole.length)
    enough = [max(request.marker_within.get(name, 0.0), least) for name in request.markers]
    errors = marker_errors(prepared.tip_map, request, roots.target, roots.gamma)
    return ~(off > request.direction_tol) & (errors <= enough).all(axis=1)


def _direction_errors(prepared: PreparedMap, request: Request, roots: Roots) -> Array:
    """Angles between the tips' directions and those wanted [rad], each on its own sheet."""
    errors = np.full(len(roots.target), np.nan)
    for sheet, each in enumerate([prepared, *(prepared.sheets if roots.sheet.any() else ())]):
        on = np.flatnonzero(roots.sheet == sheet)
        known = request, roots.target[on], roots.gamma[on]
        errors[on] = direction_errors(each.tip_map, *known)
    return errors
