"""Free paths of activation: from one configuration to another without touching anything.

Up to three free bundles, cells of the activation box that are free and connected
(`workspace.free`) hold the path; with more, trees of random activations grow from both ends until
they meet [KuffnerLaValle2000]. Both are then shortened. Every piece is certified by
`rod.clear_motion`: between two rows no point of the arm moves as far as it is clear.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from softreach.arm.manipulator import Manipulator
from softreach.inverse.solve import solve_inverse
from softreach.rod.clear_motion import ClearMotions, Motion, clear_motions
from softreach.rod.tip_map import TipMap
from softreach.schema import (
    AXES,
    activation_attributes,
    bundle_coordinates,
    column_names,
    provenance,
)
from softreach.support.arguments import as_integer, as_number
from softreach.support.arrays import Array, Mask, as_floats, as_points
from softreach.support.errors import InvalidInput, NotPossible, Range
from softreach.support.files.text import write_text
from softreach.workspace.free import FreeCells, free_cells

if TYPE_CHECKING:
    import xarray as xr

_CELLS = {1: (1024,), 2: (64, 256), 3: (24, 48, 72)}  # along each bundle, until one does
_SHORTEST = 2.0**-11  # share that a motion is cut into
_ROUNDS, _TOGETHER = 40, 16  # of shortening, and motions tried in each
_GAIN = 1e-3  # of the length of a path, that a shortcut must spare
_FAMILY = 16  # solutions for a goal that are looked at, with four free bundles or more
_GROWTHS, _NEW, _STRIDE = 400, 32, 0.3  # of trees: rounds, activations in each, ranges at once


@dataclass(frozen=True, eq=False, repr=False)
class Plan:
    """A free path of activation, straight between its rows."""

    activations: Array
    """Inputs of the arm [unit of each], shape (n, bundles); from the start to the goal."""
    tips: Array
    """Their tips [m], shape (n, 3)."""
    clearances: Array
    """Their clearances [m], shape (n,); more than the margin between rows too."""
    times: Array | None
    """When the arm is there, at its rates [s], shape (n,); None without rates."""
    is_corner: Mask
    """Mask of the rows where the path turns, with its ends; the others are where it was checked."""
    margin: float
    """Clearance that is kept all along [m]."""
    arm: Manipulator
    """The design."""
    bundles: tuple[str, ...]
    """Names of the inputs."""

    def __len__(self) -> int:
        return len(self.activations)

    def __repr__(self) -> str:
        unit = self.arm.length_unit
        least, corners = unit.rounded(float(self.clearances.min())), int(self.is_corner.sum())
        time = "" if self.times is None else f", {self.times[-1]:.3g} s"
        pieces = "1 straight piece" if corners == 2 else f"{corners - 1} straight pieces"
        return f"<Plan of {len(self)} rows in {pieces}: least clearance {least}{time}>"

    def to_dataset(self) -> xr.Dataset:
        """Activations, tips, clearances and times over `point`."""
        import xarray as xr

        units = activation_attributes(self.arm, self.bundles)
        variables = {
            "activation": (("point", "bundle"), self.activations, units),
            "tip": (("point", "axis"), self.tips, {"units": "m"}),
            "clearance": ("point", self.clearances, {"units": "m"}),
            "is_corner": ("point", self.is_corner, {}),
        }
        if self.times is not None:
            variables["time"] = "point", self.times, {"units": "s"}
        coordinates = {"axis": list(AXES), **bundle_coordinates(self.arm, self.bundles)}
        return xr.Dataset(variables, coordinates, provenance(self.arm) | {"margin": self.margin})

    def to_csv(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
        """Write a row for each configuration: time, activations, tip and clearance [s, m].

        Args:
            path: The file.
            overwrite: Whether it may replace a file.

        Raises:
            NotWritten: It cannot be written.
        """
        names = [*column_names(self.bundles), "x", "y", "z", "clearance_m"]
        columns = [self.activations, self.tips, self.clearances]
        if self.times is not None:
            names, columns = ["time_s", *names], [self.times, *columns]
        rows = np.column_stack(columns).tolist()
        lines = [",".join(names), *(",".join(f"{x:.12g}" for x in row) for row in rows), ""]
        write_text(path, "\n".join(lines), overwrite=overwrite)


def plan(
    arm: Manipulator | TipMap,
    start: ArrayLike,
    goal: ArrayLike | None = None,
    *,
    goal_position: ArrayLike | None = None,
    rate: ArrayLike | None = None,
    margin: float = 0.0,
    seed: int = 0,
) -> Plan:
    """A path of activation that keeps the whole arm clear of its surroundings and of itself.

    Up to three free bundles the activation box is cut into cells, finer and finer ones until those
    that are free connect start and goal; where cells that touch a solid all over part them, that
    proves that there is no path. With more bundles trees of random activations grow from both ends,
    which proves nothing. The path is then shortened.

    Args:
        arm: The design with its `surroundings`, or its tip map; without loads.
        start: Activations to begin with [unit of each], shape (bundles,).
        goal: Activations to end with, shape (bundles,).
        goal_position: Position of the tip to end at [m], shape (3,), in place of `goal`: the
            nearest of its free solutions to which there is a path.
        rate: Largest change of each activation per second, in its own unit, one number for all or
            shape (bundles,). The times of the plan follow from it.
        margin: Clearance to keep all along [m], beyond that of each obstacle.
        seed: Seed of what is random.

    Returns:
        Configurations in order. From one to the next the activations change in proportion, and no
        point of the arm moves as far as both clearances add up to.

    Raises:
        InvalidInput: An argument of another shape, not finite or out of range; both goals or none.
        NotPossible: The arm touches something at an end, or there is no path, or none was found;
            the arm has loads, or tendons that are driven by length.

    Examples:
        >>> path = sr.inverse.plan(sr.designs.minimal_trunk(), [0, 0, 0], [-1, 0, -0.5], rate=0.5)
        >>> print(f"{path.times[-1]:.3g} s")
        2 s
    """
    motions = clear_motions(arm, as_number("margin", margin, Range(0.0, unit="m")))
    seed, rates = as_integer("seed", seed, 0, 2**63), _as_rates(rate, motions.box.bundles)
    if (goal is None) == (goal_position is None):
        raise InvalidInput("goal", goal, "either activations, or a goal_position")
    first = motions.free_at("start", start)
    if goal is not None:
        corners = _corners(motions, first, motions.free_at("goal", goal), seed)
    else:
        corners = _to_position(motions, first, goal_position, seed)
    return _planned(motions, corners, rates)


def _as_rates(rate: ArrayLike | None, bundles: int) -> Array | None:
    if rate is None:
        return None
    rates = as_floats("rate", rate)
    if rates.shape not in ((), (bundles,)) or not ((rates > 0.0) & (rates < np.inf)).all():
        raise InvalidInput("rate", rate, f"one positive number or {bundles}")
    return np.broadcast_to(rates, bundles)


def _planned(motions: ClearMotions, corners: Array, rates: Array | None) -> Plan:
    """The path with the configurations that certify it."""
    checked = motions.check(corners[:-1], corners[1:], _SHORTEST)
    first = np.append(checked.share[:-1] < 1.0, True)  # each corner once
    k, t = checked.motion[first], checked.share[first]
    rows = corners[k] + t[:, None] * (corners[k + 1] - corners[k])
    times = None
    if rates is not None:
        times = np.append(0.0, np.cumsum((np.abs(np.diff(rows, axis=0)) / rates).max(axis=1)))
    return Plan(
        activations=rows,
        tips=motions.clearance.whole.tips(rows),
        clearances=checked.room[first] + motions.error + motions.margin,
        times=times,
        is_corner=(t == 0.0) | (t == 1.0),
        margin=motions.margin,
        arm=motions.clearance.arm,
        bundles=motions.box.names,
    )


def _to_position(motions: ClearMotions, first: Array, position: ArrayLike, seed: int) -> Array:
    """The shortest way to one of the free activations that put the tip there."""
    whole, box = motions.clearance.whole, motions.box
    place = as_points("goal_position", position)
    family = {"family": _FAMILY, "seed": seed} if box.dimension > 3 else {}
    (solution,) = solve_inverse(whole, place, near=first, free=True, **family)
    if not len(solution):
        why = solution.status.name.lower().replace("_", " ")
        where = "" if solution.gap <= whole.tol * whole.length else f", {solution.gap:.3g} m away"
        raise NotPossible(f"no free activation puts the tip at goal_position: {why}{where}")
    failed: NotPossible | None = None
    for goal in solution.activations:
        try:
            return _corners(motions, first, motions.free_at("goal", goal), seed)
        except NotPossible as error:
            failed = error
    assert failed is not None
    raise failed


def _corners(motions: ClearMotions, first: Array, last: Array, seed: int) -> Array:
    """Corners of a free path, shape (k, bundles)."""
    ends = np.stack([first, last])
    if _are_clear(motions, ends[:1], ends[1:])[0]:
        return ends
    search = _through_cells if motions.box.dimension <= 3 else _between_trees
    rng = np.random.default_rng(seed)
    return _shortened(motions, search(motions, first, last, rng), rng)


def _are_clear(motions: ClearMotions, begin: Array, end: Array) -> Mask:
    return motions.check(begin, end, _SHORTEST).outcome == Motion.CLEAR


def _through_cells(
    motions: ClearMotions, first: Array, last: Array, rng: np.random.Generator
) -> Array:
    del rng
    tried = _CELLS[motions.box.dimension]
    for cells in tried:
        grid = free_cells(motions, cells)
        if grid.are_parted(first, last):
            raise NotPossible(
                "there is no free path: activations at which the arm touches its surroundings part "
                f"start and goal, as cells of 1/{cells} of each range prove"
            )
        path = _on_links(grid, first, last)
        if path is not None:
            return path
    raise NotPossible(
        f"no free path was found through cells of 1/{tried[-1]} of each range; it is not proved "
        "that there is none, as a way may be narrower"
    )


def _on_links(grid: FreeCells, first: Array, last: Array) -> Array | None:
    """The shortest path over links of cells; None if they do not connect both ends."""
    begin, end = grid.near(first), grid.near(last)
    if not len(begin) or not len(end):
        return None
    steps = grid.motions.box.to_cube(grid.gamma[grid.links])
    lengths, size = np.linalg.norm(np.diff(steps, axis=1)[:, 0], axis=1), len(grid.gamma)
    graph = coo_array((lengths, grid.links.T), shape=(size, size)).tocsr()
    found = dijkstra(graph, directed=False, indices=begin, min_only=True, return_predecessors=True)
    cell = end[found[0][end].argmin()]
    if not np.isfinite(found[0][cell]):
        return None
    cells = [cell]
    while found[1][cells[-1]] >= 0:
        cells.append(found[1][cells[-1]])
    return np.concatenate([first[None], grid.gamma[cells[::-1]], last[None]])


def _between_trees(
    motions: ClearMotions, first: Array, last: Array, rng: np.random.Generator
) -> Array:
    """A path where two trees meet that grow toward random activations, in turn."""
    trees, parents = [first[None], last[None]], [np.array([-1]), np.array([-1])]
    scales, box = motions.box.scales, motions.box
    for growth in range(_GROWTHS):
        own, other = growth % 2, 1 - growth % 2
        wanted = box.from_free_cube(rng.random((_NEW, box.dimension)))
        source = _nearest(trees[own], wanted, scales)
        way = wanted - trees[own][source]
        far = np.linalg.norm(way / scales, axis=1) / (_STRIDE * np.sqrt(box.dimension))
        new = trees[own][source] + way / np.maximum(far, 1.0)[:, None]
        clear = _are_clear(motions, trees[own][source], new)
        grown = len(trees[own]) + np.arange(clear.sum())
        trees[own] = np.concatenate([trees[own], new[clear]])
        parents[own] = np.concatenate([parents[own], source[clear]])
        across = _nearest(trees[other], new[clear], scales)
        meets = np.flatnonzero(_are_clear(motions, new[clear], trees[other][across]))
        if len(meets):
            ends = {own: grown[meets[0]], other: across[meets[0]]}
            halves = [trees[k][_up(parents[k], ends[k])] for k in (0, 1)]
            return np.concatenate([halves[0][::-1], halves[1]])
    raise NotPossible(
        f"no free path was found with {_GROWTHS * _NEW:,} random activations; it is not proved "
        "that there is none: another seed may find one"
    )


def _nearest(tree: Array, places: Array, scales: Array) -> Array:
    apart = ((places[:, None] - tree) / scales) ** 2
    return apart.sum(axis=2).argmin(axis=1)


def _up(parents: Array, node: int) -> list[int]:
    nodes = [node]
    while parents[nodes[-1]] >= 0:
        nodes.append(int(parents[nodes[-1]]))
    return nodes


def _shortened(motions: ClearMotions, path: Array, rng: np.random.Generator) -> Array:
    """The path with shortcuts, first between its corners, then between random places on it."""
    kept, k = [0], 0
    while k < len(path) - 1:
        ahead = np.unique(np.minimum(k + 2 ** np.arange(len(path).bit_length()), len(path) - 1))
        clear = _are_clear(motions, np.tile(path[k], (len(ahead), 1)), path[ahead])
        k = int(ahead[clear].max(initial=k + 1))
        kept.append(k)
    path, scales = path[kept], motions.box.scales
    for _ in range(_ROUNDS if len(path) > 2 else 0):
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
