"""Free paths of activation: from one configuration to another without touching anything.

Links between activations that are free (`workspace.free`) hold the path: neighbors on a grid up to
three free bundles, random ones with more [Kavraki1996]. It is then shortened. Every piece is
certified by `rod.clear_motion`: between two rows no point of the arm moves as far as it is clear.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import label
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from softreach.arm.manipulator import Manipulator
from softreach.inverse.request import as_rates
from softreach.inverse.solve import solve_inverse
from softreach.rod.clear_motion import CLEAR, ClearMotions, clear_motions
from softreach.rod.rods import as_tip_map
from softreach.rod.tip_map import TipMap
from softreach.schema import AXES, activation_attributes, bundle_coordinates, provenance
from softreach.support.arguments import as_integer, as_number
from softreach.support.arrays import Array, Mask, as_points
from softreach.support.errors import InvalidInput, NotPossible, Range
from softreach.workspace.free import FreeGraph, free_grid

if TYPE_CHECKING:
    import xarray as xr

_CELLS = {1: (1024,), 2: (64, 256), 3: (24, 48, 72)}  # along each free bundle, until a path is
_RANDOM, _NEIGHBORS = (1000, 4000, 16_000), 16  # activations with more bundles
_SHORTEST = 2.0**-11  # share that a motion is cut into
_ROUNDS, _TOGETHER = 40, 16  # of shortening, and motions tried in each
_GAIN = 1e-3  # of the length of a path, that a shortcut must spare
_FAMILY = 16  # solutions for a goal that are looked at, with four free bundles or more


def plan(
    arm: Manipulator | TipMap,
    start: ArrayLike | None = None,
    goal: ArrayLike | None = None,
    *,
    goal_position: ArrayLike | None = None,
    rate: ArrayLike | None = None,
    margin: float = 0.0,
    seed: int = 0,
) -> xr.Dataset:
    """A path of activation that keeps the whole arm clear of its surroundings and of itself.

    Up to three free bundles cells of the activation box are searched, finer and finer ones until
    those that are free connect start and goal. Where cells in which the arm touches a solid
    everywhere part them, there is no path. With more bundles random activations are linked, which
    proves nothing. The path found is shortened.

    Args:
        arm: The design with its `surroundings`, or its tip map; without loads.
        start: Activations to begin with [unit of each], shape (bundles,); at rest if left out.
        goal: Activations to end with, shape (bundles,).
        goal_position: Position of the tip to end at [m], shape (3,), in place of `goal`: the
            nearest of its free solutions to which there is a path.
        rate: Largest change of each activation per second, in its own unit, one number for all or
            shape (bundles,). The times of the plan follow from it.
        margin: Clearance to keep all along [m], beyond that of each obstacle.
        seed: Seed of what is random.

    Returns:
        Dataset over `point` with `activation`, `tip` [m], `clearance` [m] and, at given rates,
        `time` [s]. From one point to the next activations change in proportion, and no point of the
        arm moves as far as both clearances add up to.

    Raises:
        InvalidInput: An argument of another shape, not finite or out of range; both goals or none.
        NotPossible: The arm touches something at an end, or there is no path, or none was found;
            the arm has loads, or tendons that are driven by length.

    Examples:
        >>> path = sr.inverse.plan(sr.designs.minimal_trunk(), goal=[-1, 0, -0.5], rate=0.5)
        >>> print(f"{float(path.time[-1]):.3g} s")
        2 s
    """
    motions = clear_motions(as_tip_map(arm), as_number("margin", margin, Range(0.0, unit="m")))
    seed, rates = as_integer("seed", seed, 0, 2**63), as_rates(rate, motions.box.bundles)
    if (goal is None) == (goal_position is None):
        raise InvalidInput("goal", goal, "either activations, or a goal_position")
    rest = motions.box.clip(np.zeros((1, motions.box.bundles)))
    first = motions.free_at("start", rest if start is None else start)
    goals = [goal] if goal_position is None else _goals(motions, first, goal_position, seed)
    for left, each in enumerate(goals, 1 - len(goals)):
        try:
            corners = _corners(motions, first, motions.free_at("goal", each), seed)
            return _dataset(motions, corners, rates)
        except NotPossible:
            if left == 0:
                raise
    raise AssertionError


def _dataset(motions: ClearMotions, corners: Array, rates: Array | None) -> xr.Dataset:
    """The path with the configurations that certify it."""
    import xarray as xr

    checked = motions.check(corners[:-1], corners[1:], _SHORTEST)
    own = np.append(checked.share[:-1] < 1.0, True)  # each corner once
    k, share = checked.motion[own], checked.share[own, None]
    rows = corners[k] + share * (corners[k + 1] - corners[k])
    tip_map, clearance = motions.clearance.whole, checked.room[own] + motions.error + motions.margin
    variables: dict[str, Any] = {
        "activation": (("point", "bundle"), rows, activation_attributes(tip_map.arm)),
        "tip": (("point", "axis"), tip_map.tips(rows), {"units": "m"}),
        "clearance": ("point", clearance, {"units": "m"}),
    }
    if rates is not None:
        durations = (np.abs(np.diff(rows, axis=0)) / rates).max(axis=1)
        variables["time"] = "point", np.append(0.0, np.cumsum(durations)), {"units": "s"}
    coordinates = {"axis": list(AXES), **bundle_coordinates(tip_map.arm)}
    return xr.Dataset(variables, coordinates, provenance(tip_map.arm) | {"margin": motions.margin})


def _goals(motions: ClearMotions, first: Array, position: ArrayLike, seed: int) -> Array:
    """Free activations that put the tip at a place, the nearest first, shape (k, bundles)."""
    whole, family = motions.clearance.whole, _FAMILY if motions.box.dimension > 3 else 1
    place, options = as_points("goal_position", position), {"family": family, "seed": seed}
    (solution,) = solve_inverse(whole, place, near=first, free=True, **options)
    if not len(solution):
        why = solution.status.name.lower().replace("_", " ")
        where = "" if solution.gap <= whole.tol * whole.length else f", {solution.gap:.3g} m away"
        raise NotPossible(f"no free activation puts the tip at goal_position: {why}{where}")
    return solution.activations


def _corners(motions: ClearMotions, first: Array, last: Array, seed: int) -> Array:
    """Corners of a free path, shape (k, bundles)."""
    ends, rng = np.stack([first, last]), np.random.default_rng(seed)
    if _are_clear(motions, ends[:1], ends[1:])[0]:
        return ends
    for graph, cells in _graphs(motions, rng):
        if cells and _are_parted(graph, cells, first, last):
            raise NotPossible(
                "there is no free path: activations at which the arm touches its surroundings part "
                f"start and goal, as cells of 1/{cells} of each range prove"
            )
        if (path := _on_links(graph, first, last)) is not None:
            return _shortened(motions, path, rng)
    raise NotPossible(
        "no free path was found, which does not prove that there is none: a way may be narrower "
        "than what was searched"
    )


def _are_clear(motions: ClearMotions, begin: Array, end: Array) -> Mask:
    return motions.check(begin, end, _SHORTEST).outcome == CLEAR


def _graphs(motions: ClearMotions, rng: np.random.Generator) -> Iterator[tuple[FreeGraph, int]]:
    """Finer and finer graphs of free activations, and cells of their grids; 0 for random ones."""
    m = motions.box.dimension
    for cells in _CELLS.get(m, ()):
        yield free_grid(motions, cells), cells
    from scipy.spatial import cKDTree

    for count in _RANDOM if m > max(_CELLS) else ():
        places = rng.random((count, m))
        pairs = cKDTree(places).query(places, _NEIGHBORS)[1]
        pairs = np.stack([np.repeat(pairs[:, 0], _NEIGHBORS - 1), pairs[:, 1:].ravel()], axis=1)
        yield FreeGraph(motions, motions.box.from_free_cube(places), pairs), 0


def _are_parted(grid: FreeGraph, cells: int, first: Array, last: Array) -> bool:
    """True if cells that touch a solid wherever the arm is in them part two activations."""
    box, m = grid.motions.box, grid.motions.box.dimension
    (depth,), _ = grid.motions.largest(box.widths[None] / (2.0 * cells))
    touches = (grid.clearance < -depth) & (grid.which >= 0)
    number, _ = label(~touches.reshape((cells,) * m), np.ones((3,) * m))
    places = box.to_cube(np.stack([first, last]))[:, box.free] * cells
    a, b = number[tuple(np.clip(places.astype(int), 0, cells - 1).T)]
    return bool(a != b)


def _on_links(graph: FreeGraph, first: Array, last: Array) -> Array | None:
    """The shortest path over links; None if they do not connect both ends."""
    begin, end = graph.near(first), graph.near(last)
    if not len(begin) or not len(end):
        return None
    steps = graph.motions.box.to_cube(graph.gamma[graph.links])
    lengths, size = np.linalg.norm(np.diff(steps, axis=1)[:, 0], axis=1), len(graph.gamma)
    links = coo_array((lengths, graph.links.T), shape=(size, size)).tocsr()
    found = dijkstra(links, directed=False, indices=begin, min_only=True, return_predecessors=True)
    nodes = [end[found[0][end].argmin()]]
    if not np.isfinite(found[0][nodes[0]]):
        return None
    while found[1][nodes[-1]] >= 0:
        nodes.append(found[1][nodes[-1]])
    return np.concatenate([first[None], graph.gamma[nodes[::-1]], last[None]])


def _shortened(motions: ClearMotions, path: Array, rng: np.random.Generator) -> Array:
    """The path with shortcuts between random places on it."""
    scales = motions.box.scales
    for _ in range(_ROUNDS):
        lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0) / scales, axis=1)))
        cuts = np.sort(lengths[-1] * rng.random((_TOGETHER, 2)), axis=1)
        ends = np.stack([np.interp(cuts, lengths, x) for x in path.T], axis=-1)
        gain = np.diff(cuts, axis=1)[:, 0]
        gain -= np.linalg.norm(np.diff(ends, axis=1)[:, 0] / scales, axis=1)
        gain[~_are_clear(motions, ends[:, 0], ends[:, 1])] = 0.0
        best = gain.argmax()
        if gain[best] > _GAIN * lengths[-1]:
            before, after = path[lengths < cuts[best, 0]], path[lengths > cuts[best, 1]]
            path = np.concatenate([before, ends[best], after])
    return path
