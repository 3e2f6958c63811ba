"""Free paths of activation: from one configuration to another without touching anything.

Links between free activations (`workspace.free`) hold the path: neighbors on a grid, or with more
than three free bundles random ones [Kavraki1996]. Shortcuts shorten it. Between two of its rows no
point of the arm moves as far as it is clear.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import label
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from softreach.arm.manipulator import Manipulator
from softreach.inverse.request import as_rates
from softreach.inverse.solve import solve_inverse
from softreach.rod.rods import as_tip_map
from softreach.rod.tip_map import TipMap
from softreach.schema import AXES, activation_attributes, bundle_coordinates, provenance
from softreach.support.arguments import as_integer, as_number
from softreach.support.arrays import Array, as_points
from softreach.support.errors import InvalidInput, NotPossible, Range
from softreach.workspace.free import CLEAR, FreeGraph, FreeMotions, free_grid, free_motions

if TYPE_CHECKING:
    import xarray as xr

_CELLS = {1: (1024,), 2: (64, 256), 3: (24, 48)}  # along each free bundle, until a path is
_RANDOM, _NEIGHBORS = (1000, 4000, 16_000), 16  # activations with more bundles
_SHORTEST = 2.0**-11  # share that a motion is cut into
_ROUNDS, _TOGETHER, _GAIN = 40, 16, 1e-3  # shortcuts: rounds, trials in each, least that they spare
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

    Up to three free bundles a grid of free activations is searched; where cells that touch a solid
    everywhere part start and goal, there is no path. With more bundles activations are random.

    Args:
        arm: The design with its `surroundings`, or its tip map; without loads.
        start: Activations to begin with [unit of each], shape (bundles,); at rest if left out.
        goal: Activations to end with, shape (bundles,).
        goal_position: Tip to end at [m], shape (3,), by the nearest free solution with a path.
        rate: Largest change of each activation per second, in its own unit, one number for all or
            shape (bundles,).
        margin: Clearance to keep all along [m], beyond that of each obstacle.
        seed: Seed of what is random.

    Returns:
        Dataset over `point` with `activation`, `tip` and `clearance` [m], and at given rates `time`
        [s]. In between activations change in proportion, and the arm touches nothing.

    Raises:
        InvalidInput: An argument of another shape, not finite or out of range; both goals or none.
        NotPossible: The arm touches something at an end, there is no path, or none was found; or it
            has loads, or tendons that are driven by length.
    """
    motions = free_motions(as_tip_map(arm), as_number("margin", margin, Range(0.0, unit="m")))
    seed, rates = as_integer("seed", seed, 0, 2**63), as_rates(rate, motions.box.bundles)
    if (goal is None) == (goal_position is None):
        raise InvalidInput("goal", goal, "either activations, or a goal_position")
    first = motions.free_at("start", start)
    goals: Any = [goal] if goal_position is None else _goals(motions, first, goal_position, seed)
    for each in goals[:-1]:
        with suppress(NotPossible):
            return _planned(motions, first, each, rates, seed)
    return _planned(motions, first, goals[-1], rates, seed)


def _planned(
    motions: FreeMotions, first: Array, goal: ArrayLike, rates: Array | None, seed: int
) -> xr.Dataset:
    import xarray as xr

    corners = _corners(motions, first, motions.free_at("goal", goal), seed)
    _, k, share, clearance = motions.check(corners[:-1], corners[1:], shortest=_SHORTEST)
    rows = corners[k] + share[:, None] * (corners[k + 1] - corners[k])
    once = np.append(share[:-1] < 1.0, True)  # each corner
    rows, clearance, tip_map = rows[once], clearance[once], motions.clearance.whole
    variables: dict[str, Any] = {
        "activation": (("point", "bundle"), rows, activation_attributes(tip_map.arm)),
        "tip": (("point", "axis"), tip_map.tips(rows), {"units": "m"}),
        "clearance": ("point", clearance + motions.margin, {"units": "m"}),
    }
    if rates is not None:
        durations = (np.abs(np.diff(rows, axis=0)) / rates).max(axis=1)
        variables["time"] = "point", np.append(0.0, np.cumsum(durations)), {"units": "s"}
    coordinates = {"axis": list(AXES), **bundle_coordinates(tip_map.arm)}
    return xr.Dataset(variables, coordinates, provenance(tip_map.arm) | {"margin": motions.margin})


def _goals(motions: FreeMotions, first: Array, position: ArrayLike, seed: int) -> Array:
    """Free activations that put the tip at a place, the nearest first, shape (k, bundles)."""
    whole, place = motions.clearance.whole, as_points("goal_position", position)
    (solution,) = solve_inverse(whole, place, near=first, family=_FAMILY, seed=seed, free=True)
    if not len(solution):
        why = solution.status.name.lower().replace("_", " ")
        raise NotPossible(f"no free activation puts the tip at goal_position, which is {why}")
    return solution.activations


def _corners(motions: FreeMotions, first: Array, last: Array, seed: int) -> Array:
    ends, rng = np.stack([first, last]), np.random.default_rng(seed)
    if motions.check(ends[:1], ends[1:], shortest=_SHORTEST)[0] == CLEAR:
        return ends
    for graph, cells in _graphs(motions, rng):
        if cells and _are_parted(graph, cells, first, last):
            raise NotPossible("there is no free path: contact all around parts start and goal")
        if (path := _on_links(graph, first, last)) is not None:
            return _shortened(motions, path, rng)
    raise NotPossible("no free path was found; that there is none is not proved")


def _graphs(motions: FreeMotions, rng: np.random.Generator) -> Iterator[tuple[FreeGraph, int]]:
    """Finer and finer graphs of free activations, and cells of their grids; 0 for random ones."""
    m = motions.box.dimension
    for cells in _CELLS.get(m, ()):
        yield free_grid(motions, cells), cells
    for count in _RANDOM if m > max(_CELLS) else ():
        places = rng.random((count, m))
        pairs = import_module("scipy.spatial").cKDTree(places).query(places, _NEIGHBORS)[1]
        pairs = np.stack([np.repeat(pairs[:, 0], _NEIGHBORS - 1), pairs[:, 1:].ravel()], axis=1)
        yield FreeGraph(motions, motions.box.from_free_cube(places), pairs), 0


def _are_parted(grid: FreeGraph, cells: int, first: Array, last: Array) -> bool:
    """True if cells that touch a solid wherever the arm is in them part two activations."""
    box, m = grid.motions.box, grid.motions.box.dimension
    (depth,), _ = grid.motions.largest(box.widths[None] / (2.0 * cells))
    touches = (grid.clearance < -depth) & (grid.which >= 0)
    number: Any = label(~touches.reshape((cells,) * m), np.ones((3,) * m))
    places = box.to_cube(np.stack([first, last]))[:, box.free] * cells
    a, b = number[0][tuple(np.clip(places.astype(int), 0, cells - 1).T)]
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


def _shortened(motions: FreeMotions, path: Array, rng: np.random.Generator) -> Array:
    scales = motions.box.scales
    for _ in range(_ROUNDS):
        lengths = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(path, axis=0) / scales, axis=1)))
        cuts = np.sort(lengths[-1] * rng.random((_TOGETHER, 2)), axis=1)
        ends = np.stack([np.interp(cuts, lengths, x) for x in path.T], axis=-1)
        gain = np.diff(cuts, axis=1)[:, 0]
        gain -= np.linalg.norm(np.diff(ends, axis=1)[:, 0] / scales, axis=1)
        gain[motions.check(ends[:, 0], ends[:, 1], shortest=_SHORTEST)[0] != CLEAR] = 0.0
        best = gain.argmax()
        if gain[best] > _GAIN * lengths[-1]:
            before, after = path[lengths < cuts[best, 0]], path[lengths > cuts[best, 1]]
            path = np.concatenate([before, ends[best], after])
    return path
