"""Poses of an arm: judged by regions and limits, and those chosen for places to reach."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import numpy as np

from softreach.arm.actuators import Tendon
from softreach.arm.driving import Driving
from softreach.arm.lines import line_lengths
from softreach.arm.manipulator import Manipulator
from softreach.geometry.regions import HalfSpace
from softreach.inverse.direction import compromises, direction_errors
from softreach.inverse.prepared import PreparedMap, prepared_map
from softreach.inverse.request import Request
from softreach.inverse.roots import placed
from softreach.inverse.solutions import Solutions, Status
from softreach.inverse.solve import solve_inverse
from softreach.requirements.parts import LIMIT_UNITS, TOL, Goals, Keep
from softreach.rod.bending import bending_over_bounds, bending_stations, some_corners, worst_inputs
from softreach.rod.kinematics import configuration
from softreach.rod.rods import as_tip_map
from softreach.rod.tip_map import Frames, InvalidLoads, TipMap
from softreach.sampling import sample_cube
from softreach.support import parallel
from softreach.support.arrays import Array, Index, Mask, joined, rows
from softreach.support.errors import no_warnings
from softreach.support.progress import Progress
from softreach.workspace.search import Nearest, nearest_tips

_PLACES = 32_768  # places at once: bounds the memory
_FAMILY = 32  # activations tried for a place of an arm with more than three free bundles
_MOST_TRIED = 4_096  # places for which they are
_SAME = 1e-4  # of the ranges, by which poses are told apart
_WEIGHT = 0.1  # of an angle [rad] against a distance in L, where not both can be met
_PLACE_FIRST = 1e-5  # weight with which the tip is at the place but for some 1e-10 L
_SEEDS, _NEIGHBORS = 256, 5  # samples that quick descents start from; of them for each place
_CELLS = 16  # along each axis of three bundles: as many solutions as with 32, in half the time
_LEVELS = (48, 768, 4096)
"""Parts of the arm between which it is seen where a body is, finer where that does not decide."""
_BLOCK = 256  # poses at once
_SAFETY = 1.2  # of speeds and turns between stations, which are known at these


class Judged(NamedTuple):
    """Poses by the rules, one column for each."""

    value: Array
    """Distances by which regions are missed [m], negative where kept to; values of limits."""
    excess: Array  # Excess over L, or over the limit; 0 where nothing is missed, shape (n, rule)
    error: Array  # Largest possible addition between the stations looked at, shape (n, rule)


@dataclass(frozen=True, eq=False)
class PoseRules:
    """Regions and limits that poses of an arm must keep to."""

    arm: Manipulator
    keeps: tuple[Keep, ...]
    limits: dict[str, float]
    tolerance: float  # Error that is allowed in how far a region is missed [m]
    known_rod: TipMap | None = None  # Tip map of the arm, if it is another than the usual one

    @property
    def rooms(self) -> tuple[Array, Array]:
        """Largest value that each rule allows, and its scale: L, or the limit; (rule,) each."""
        none, limits = [0.0] * len(self.keeps), [*self.limits.values()]
        scales = [self.arm.length] * len(self.keeps) + [limit or 1.0 for limit in limits]
        return np.array(none + limits), np.array(scales)

    def __len__(self) -> int:
        return len(self.keeps) + len(self.limits)

    def some(self, columns: Index) -> Self:
        """Some of the rules, by their columns."""
        keeps = tuple(self.keeps[k] for k in columns if k < len(self.keeps))
        limits = list(self.limits.items())
        own = dict(limits[k - len(self.keeps)] for k in columns if k >= len(self.keeps))
        return replace(self, keeps=keeps, limits=own)

    @property
    def rod(self) -> TipMap:
        """The tip map of the arm, whose activations are its inputs."""
        return as_tip_map(self.arm) if self.known_rod is None else self.known_rod

    def judged(self, gamma: Array) -> Judged:
        """Poses of inputs (n, inputs) by every rule; a pose without an arm breaks none."""
        (value, error), k = np.zeros((2, len(gamma), len(self))), len(self.keeps)
        for block in parallel.blocks(len(gamma), _BLOCK):
            value[block, :k], error[block, :k] = self._kept(gamma[block])
            for column, name in enumerate(self.limits, k):
                value[block, column] = self._limited(name, gamma[block])
        value = np.nan_to_num(value, nan=-np.inf, posinf=np.inf, neginf=-np.inf)
        most, scale = self.rooms
        excess = np.maximum((value - most) / scale, 0.0)
        # What rounding alone makes of a bound that is met to the last bit is no excess.
        error = np.where(error > 1e-9 * self.arm.length, error, 0.0)
        return Judged(value, np.where(excess > 1e-9, excess, 0.0), error)

    def _kept(self, gamma: Array, levels: Sequence[int] = _LEVELS) -> tuple[Array, Array]:
        """Distances by which regions are missed [m], and what may come on top, (n, keep) each."""
        value, error = np.zeros((2, len(gamma), len(self.keeps)))
        left: dict[int, Index] = {}
        for column, keep in enumerate(self.keeps):
            if keep.of == "tip":
                tips = self.rod.tips(gamma)
                missed = keep.missed(np.nan_to_num(tips))
                value[:, column] = np.where(np.isnan(tips).any(axis=1), np.nan, missed)
            else:
                left[column] = np.arange(len(gamma))
        for parts in levels:
            poses = np.unique(np.concatenate([np.empty(0, int), *left.values()]))
            if not len(poses):
                break
            body = Body.of(self.rod, gamma[poses], parts)
            for column, own in left.items():
                seen, bound = body.missed(self.keeps[column], np.searchsorted(poses, own))
                value[own, column], error[own, column] = seen, bound - seen
                left[column] = own[(bound > 0.0) & (bound - seen > self.tolerance)]
        return value, error

    def _limited(self, name: str, gamma: Array) -> Array:
        if name == "bending":
            z = bending_stations(self.arm).ravel()
            u = self.rod.strains(gamma, z).curvature
            return (np.hypot(u[..., 0], u[..., 1]) * self.rod.radius(z)).max(axis=1)
        if not self.arm.bundles:
            return np.zeros(len(gamma))
        if name == "shortening":
            straight = line_lengths(self.arm.replace(loads=None), np.zeros((1, self.arm.inputs)))
            if self.arm.loads is None:
                lengths = line_lengths(self.arm, gamma)
            else:
                lengths = configuration(self.rod, gamma, 2)["line_length"].values
            return (1.0 - lengths / straight).max(axis=1)
        units = np.array(self.arm.bundle_units)
        every = Driving(self.arm).bundles(gamma)[:, : self.arm.bundles]
        sizes = every[:, units == LIMIT_UNITS[name]]
        if name == "force" and "m" in units:
            tension = configuration(self.rod, gamma, 2)["bundle_activation"].values
            sizes = np.concatenate([sizes, tension[:, units == "m"]], axis=1)
        return np.abs(sizes).max(axis=1, initial=0.0)

    def worst_pose(self) -> tuple[Array, Judged]:
        """The pose within the bounds that misses the one region by most, by search."""

        def missed(gamma: Array) -> Array:
            blocks = parallel.blocks(len(gamma), _BLOCK)
            return np.concatenate([self._kept(gamma[block], _LEVELS[:1])[0] for block in blocks])

        worst, _ = worst_inputs(self.rod, missed)
        return worst[0], self.judged(worst)

    def of_bounds(self, name: str) -> tuple[float, bool]:
        """Value of a limit of poses over all of the bounds, and whether it is exact."""
        if name == "bending":
            bending = bending_over_bounds(self.arm)
            return bending.sharpest.value, bending.exact
        _, worst = worst_inputs(self.rod, lambda gamma: self._limited(name, gamma)[:, None])
        return float(worst[0]), False


class Body(NamedTuple):
    """Sections of an arm in poses, at stations."""

    center: Array  # Shape (n, station, 3) [m]
    tangent: Array  # Shape (n, station, 3)
    radius: Array  # Of the widest before activation: body, tendons, their disks; (n, station) [m]
    between: Array
    """Farthest that a point of the body is from those of the two sections that it lies between,
    both ways together [m], shape (n, station - 1)."""
    bulge: Array
    """Farthest that the body bulges between two sections from the straight line between their
    points [m], shape (n, station - 1)."""
    lost: Mask  # Poses without an arm, shape (n,)
    disk_center: Array  # Of thin disks wider than the tendons that they hold, (n, disk, 3) [m]
    disk_tangent: Array  # Shape (n, disk, 3)
    disk_radius: Array  # Shape (n, disk) [m]

    @classmethod
    def of(cls, rod: TipMap, gamma: Array, parts: int) -> Self:
        """The sections between so many parts, and disks."""
        z = np.linspace(0.0, rod.length, parts + 1)
        frames, strains = rod.frames(gamma, z), rod.strains(gamma, z)
        radius = np.fmax(rod.arm.widest(z), _farthest_chords(rod, gamma, z, frames.position))
        disks = rows(rod.arm.disks, rod.arm.disks.radius > rod.arm.disks.tendons)
        stand = Frames(*(every[:, :0] for every in frames))
        if len(disks.station):
            stand = rod.frames(gamma, disks.station)
        turn = np.linalg.norm(strains.curvature, axis=2) * np.maximum(strains.extension, 1.0)
        speed = strains.extension + turn * radius + np.abs(np.gradient(radius, z, axis=1))
        step = rod.length / parts
        fastest = np.maximum(speed[:, 1:], speed[:, :-1])
        turning = fastest * np.maximum(turn[:, 1:], turn[:, :-1])
        change = np.abs(np.diff(speed, axis=1)) / step + turning
        return cls(
            center=np.where(np.isnan(frames.position), 0.0, frames.position),
            tangent=np.nan_to_num(frames.directors[:, :, 2]),
            radius=np.broadcast_to(radius, frames.position.shape[:2]),
            between=_SAFETY * fastest * step,
            bulge=_SAFETY * change * step**2 / 8.0,
            lost=np.isnan(frames.position.sum(axis=(1, 2))),
            disk_center=np.nan_to_num(stand.position),
            disk_tangent=np.nan_to_num(stand.directors[:, :, 2]),
            disk_radius=np.broadcast_to(disks.radius, stand.position.shape[:2]),
        )

    def missed(self, keep: Keep, poses: Index) -> tuple[Array, Array]:
        """Distances by which poses miss a region at stations [m], and at most between, (n,)."""
        center, tangent, radius, farthest, bulge, lost, *disks = rows(self, poses)
        missed = _missed(keep, center, tangent, radius)
        thin = _missed(keep, *disks).max(axis=1, initial=-np.inf)
        seen = np.maximum(missed.max(axis=1), thin)
        if (keep.inside and keep.region.convex) or isinstance(keep.region, HalfSpace):
            # Along a straight line the distance from such a region is largest at an end.
            # The bulge is that of a parabola, which a slope from end to end takes from its top.
            slope, bulge = np.abs(np.diff(missed, axis=1)), np.maximum(bulge, 1e-300)
            top = np.maximum(4.0 * bulge - slope, 0.0) ** 2 / (16.0 * bulge)
            between = np.maximum(missed[:, 1:], missed[:, :-1]) + top
        else:
            between = 0.5 * (missed[:, 1:] + missed[:, :-1] + farthest)
        bound = np.maximum(between.max(axis=1), seen)
        seen[lost] = bound[lost] = np.nan
        return seen, bound


def _farthest_chords(rod: TipMap, gamma: Array, z: Array, centers: Array) -> Array:
    """Distance of straight pieces between guides from the centers of sections [m], (n, station).

    On the inner side of a bend they are farther from the axis than their guides.
    """
    farthest = np.zeros(centers.shape[:2])
    for part in rod.arm.actuators:
        if not isinstance(part, Tendon) or not part.has_guides:
            continue
        held = part.held_at(rod.length)
        frames, points = rod.frames(gamma, held), part.points_at(rod.arm.profile, held)
        guides = frames.position[:, :, None] + np.einsum("gdb,ngdx->ngbx", points, frames.directors)
        shares = np.array([np.interp(z, held, one, 0.0, 0.0) for one in np.eye(len(held))])
        lines = np.einsum("gs,ngbx->nsbx", shares, guides)
        away = np.linalg.norm(lines - centers[:, :, None], axis=3).max(axis=2)
        farthest = np.fmax(farthest, np.where(shares.any(axis=0), away, 0.0))
    return farthest


def _missed(keep: Keep, center: Array, tangent: Array, radius: Array) -> Array:
    """Distances by which sections miss a region [m], shape (n, station)."""
    least, most = keep.region.section_distances(center, tangent, radius)
    return (most if keep.inside else -least) + keep.clearance


class Posed(NamedTuple):
    """The pose chosen for each place under one payload, and what the rules say of it."""

    gaps: Array
    poses: Array
    effort: Array
    nearest: Array
    direction_errors: Array
    value: Array
    excess: Array
    error: Array


def solved(rules: PoseRules, goals: Goals, step: Progress, *, quick: bool = False) -> Posed:
    """The poses at places, in blocks of those that are asked for in the same way.

    From all solutions of the inverse, or `quick` ones from a few descents.
    """
    choose, posed = _descended if quick else _chosen, list[Posed]()
    for block in parallel.blocks(len(goals.places), _PLACES):
        own = rows(goals, block)
        asked = np.column_stack([own.cones, np.where(own.directed, own.within, 0.0)])
        kind = np.unique(asked, axis=0, return_inverse=True)[1].ravel()
        groups = [np.flatnonzero(kind == k) for k in range(kind.max() + 1)]
        each = joined([choose(rules, rows(own, group)) for group in groups])
        posed.append(rows(each, np.argsort(np.concatenate(groups))))
        posed[-1].direction_errors[~own.directed] = np.nan
        step(len(own.places))
    return joined(posed or [_without_equilibrium(rules, goals.places)])


def _chosen(rules: PoseRules, goals: Goals) -> Posed:
    try:
        with no_warnings():
            prepared = prepared_map(rules.arm, TOL, cells=_CELLS)
            solutions = _solutions(prepared, goals, from_rest=True)
    except InvalidLoads:
        return _without_equilibrium(rules, goals.places)
    best, reached = _best(rules, solutions), solutions.statuses == Status.REACHED
    breaks = np.flatnonzero((best.excess.sum(axis=1) > 0.0) & reached)
    if rules.rod.box.dimension > 3 and 0 < len(breaks) <= _MOST_TRIED:
        with no_warnings():
            family = _solutions(prepared, rows(goals, breaks), family=_FAMILY)
        _put(best, breaks, _best(rules, family))
    # A place that is reached to the error of the tips is reached.
    enough = TOL * rules.arm.length
    enough = np.where(goals.directed, np.maximum(goals.within, enough), enough)
    best.gaps[reached] = np.minimum(best.gaps, enough)[reached]
    missed = np.flatnonzero(goals.directed & ~reached)
    if len(missed):
        _put(best, missed, _pointed(rules, prepared, rows(goals, missed)))
    return best


def _pointed(rules: PoseRules, prepared: PreparedMap, goals: Goals) -> Posed:
    """Poses from more searches, and where these do not do, those at the place that turn least."""
    posed = _descended(rules, goals)
    reached = goals.reached(posed.gaps, posed.direction_errors, rules.arm.length)
    if len(left := np.flatnonzero(~reached)):
        with no_warnings():
            owner, known = _owned(solve_inverse(prepared, goals.places[left], from_rest=True))
        owner = np.concatenate([owner, np.arange(len(left))])
        start = np.concatenate([known, posed.poses[left]])
        start = np.where(np.isfinite(start), start, rules.rod.box.low)
        _put(posed, left, _at_ends(rules, rows(goals, left), owner, start, _PLACE_FIRST))
    return posed


def _solutions(prepared: PreparedMap, goals: Goals, **options: Any) -> Solutions:
    """Solutions at places with the same cone and the same distance to which they are reached."""
    if goals.directed.any():
        options = {"cone": goals.cones[0], "within": goals.within[0], **options}
        options["direction"] = goals.directions
    return solve_inverse(prepared, goals.places, **options)


def _put(posed: Posed, chosen: Index, others: Posed) -> None:
    for every, own in zip(posed, others, strict=True):
        every[chosen] = own


def _descended(rules: PoseRules, goals: Goals) -> Posed:
    """Poses at the ends of descents from the samples whose tips are nearest to each place."""
    from scipy.spatial import KDTree

    rod, places = rules.rod, goals.places
    gamma = rod.box.from_cube(sample_cube("sobol", _SEEDS, rod.box.bundles))
    gamma = np.concatenate([gamma, some_corners(rod)])
    tips = rod.tips(gamma)
    known = np.isfinite(tips).all(axis=1)
    if not known.any():
        return _without_equilibrium(rules, places)
    neighbors = range(1, 1 + min(_NEIGHBORS, int(known.sum())))
    near = KDTree(tips[known]).query(places, neighbors)[1]  # pyright: ignore[reportArgumentType]
    owner = np.repeat(np.arange(len(places)), len(neighbors))
    return _at_ends(rules, goals, owner, gamma[known][near.ravel()])


def _at_ends(
    rules: PoseRules, goals: Goals, owner: Index, start: Array, weight: float = _WEIGHT
) -> Posed:
    """Of each place the best pose at the ends of descents from the starts (n, inputs) it owns."""
    rod, enough = rules.rod, TOL * rules.rod.length
    ends, turn = _ends(rod, rows(goals, owner), start, enough, weight)
    # Local minima that are farther away than another are no poses at the place.
    near = np.maximum(goals.within, enough)[owner]
    off = ends.distance
    if goals.directed.any():
        beyond = weight * rod.length * (turn - goals.cones[owner]).clip(0.0)
        off, near = (off - near).clip(0.0) + beyond, weight * enough
    least = np.full(len(goals.places), np.inf)
    np.minimum.at(least, owner, off)
    kept = np.flatnonzero(off <= np.maximum(near, least[owner] * (1.0 + 1e-9)))
    # Most descents to a place end in one pose.
    same = np.column_stack([owner[kept], np.rint(rod.box.to_cube(ends.gamma[kept]) / _SAME)])
    kept = kept[np.unique(same, axis=0, return_index=True)[1]]
    parts = (ends.gamma, ends.distance, ends.tips, turn)
    return _ranked(rules, goals.places, owner[kept], *(part[kept] for part in parts))


def _ends(
    rod: TipMap, goals: Goals, start: Array, enough: float, weight: float
) -> tuple[Nearest, Array]:
    """Ends of descents to places, and angles from the directions wanted there [rad]; 0 if none."""
    if not goals.directed.any():
        return nearest_tips(rod, start, goals.places, enough), np.zeros(len(start))
    options: Any = {
        "residual": enough,
        "reach_tol": enough,
        "direction_weight": weight,
        "cone": float(goals.cones[0]),
        "within": float(goals.within[0]),
    }
    near = np.zeros_like(start)
    request = Request(targets=goals.places, near=near, direction=goals.directions, **options)
    gamma = compromises(rod, request, start).gamma
    tips = placed(rod, gamma)
    distance = np.nan_to_num(np.linalg.norm(tips - goals.places, axis=1), nan=np.inf)
    turn = direction_errors(rod, request, np.arange(len(gamma)), gamma)
    return Nearest(gamma, tips, distance), np.nan_to_num(turn, nan=np.pi)


def _best(rules: PoseRules, solutions: Solutions) -> Posed:
    """Of each target the solution that breaks the rules least, then that of least effort."""
    missing = np.flatnonzero(solutions.counts == 0)
    owner, gamma = _owned(solutions)
    gaps = np.concatenate([solutions.residuals, solutions.gaps[missing]])
    reached = np.repeat(solutions.targets, solutions.counts, axis=0)
    nearest = np.concatenate([reached, solutions.nearest[missing]])
    turn = np.concatenate([solutions.direction_errors, solutions.direction_gaps[missing]])
    return _ranked(rules, solutions.targets, owner, gamma, gaps, nearest, turn)


def _owned(solutions: Solutions) -> tuple[Index, Array]:
    """Numbers of targets with the inputs that reach them, then of others with the nearest ones."""
    missing = np.flatnonzero(solutions.counts == 0)
    owner = np.concatenate([np.repeat(np.arange(len(solutions)), solutions.counts), missing])
    return owner, np.concatenate([solutions.activations, solutions.nearest_activations[missing]])


def _ranked(rules: PoseRules, places: Array, owner: Index, *poses: Array) -> Posed:
    """Of each place the best of the poses that it owns: their inputs, gaps, tips and angles."""
    gamma, gaps, nearest, turn = poses
    lost = ~np.isfinite(gamma).all(axis=1)
    gamma[lost] = rules.rod.box.low
    judged = rules.judged(gamma)
    effort = np.linalg.norm(gamma / effort_scales(rules.arm), axis=1)
    order = np.lexsort((effort, judged.excess.sum(axis=1), owner))
    best = order[np.searchsorted(owner[order], np.arange(len(places)))]
    held = np.isfinite(gaps[best])
    gaps = np.where(held, gaps[best], _farthest(rules, places))
    nearest, turn = np.nan_to_num(nearest[best]), np.where(held, turn[best], np.pi)
    return Posed(gaps, gamma[best], effort[best], nearest, turn, *rows(judged, best))


def effort_scales(arm: Manipulator) -> Array:
    """Largest bound of each input, which its effort counts in, shape (inputs,)."""
    largest = np.abs(arm.input_bounds).max(axis=1, initial=0.0)
    return np.where(largest > 0.0, largest, 1.0)


def _without_equilibrium(rules: PoseRules, places: Array) -> Posed:
    """Poses of an arm that no activation holds under its loads: its tip is near no place."""
    none = np.zeros((count := len(places), len(rules)))
    gamma, base = (np.tile(x, (count, 1)) for x in (rules.rod.box.low, rules.arm.base.position))
    turn = np.full(count, np.pi)
    return Posed(_farthest(rules, places), gamma, np.zeros(count), base, turn, none, none, none)


def _farthest(rules: PoseRules, places: Array) -> Array:
    """Gaps of places without a pose [m]: no tip of the arm as it is drawn is farther away."""
    return np.linalg.norm(places - rules.arm.base.position, axis=1) + rules.arm.length
