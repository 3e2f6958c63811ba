"""Cell centers within reach, each with an activation that proves it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from softreach.kernels.box import bounded_descent as kernels
from softreach.kernels.box.box_projection import project
from softreach.kernels.image.raster import claim_corners
from softreach.rod.tip_map import BLOCK, TipMap, TipOutputs, no_equilibrium
from softreach.support import parallel
from softreach.support.arrays import Array, Index, Mask, rows
from softreach.support.progress import Progress, silent
from softreach.workspace.grid import AllPostures
from softreach.workspace.image import Lattice, covered_cubes

_TOGETHER = BLOCK // 16  # searches that one thread runs side by side
ENOUGH = 1e-3  # distance at which a place counts as reached, in cells
_CHUNK = 1 << 16  # places searched for at a time
CLOUD = 1 << 16  # tips in a cloud that searches start from
_CLOUDS = 8  # at most
_FAR = 3.0  # cells, from which on distances are not told apart
DISTANCE = 0.75  # of the level set, in cells: below 0.71 a thread has holes, below 0.5 a sheet
CLEARLY = 0.02  # cells by which a tip must be closer to start another search


class Stop(NamedTuple):
    """When a search gives up that gets no nearer to its target."""

    settled: float  # gain that the linear map promises, of the distance [-]
    most: int  # steps


ROUGHLY = Stop(settled=1e-3, most=30)  # for targets that are reached or not
CLOSELY = Stop(settled=1e-13, most=1000)  # for the nearest tip itself


class ReachedGrid:
    """Cell centers that are reached, grown from tips of a cloud to their neighbors.

    A center is reached if a search from the activation of a neighbor, or of a tip nearby, ends on
    it. Others have the distance to the nearest tip found, and its activation. Of a flat set only
    centers in its plane, the third of five layers of the lattice, are searched.
    """

    def __init__(
        self, tip_map: TipMap, lattice: Lattice, progress: Progress = silent, is_flat: bool = False
    ) -> None:
        self.tip_map, self.lattice = tip_map, lattice
        self.progress, self.is_flat = progress, is_flat
        _, ny, nz = lattice.shape
        self.steps = np.array([ny * nz, nz, 1])
        # Of each center the distance to the nearest tip found in cells, 0 where reached, -1 at the
        # sides of the lattice, where nothing is searched; and its activation, where that is finite.
        gap = np.full(lattice.shape, -1.0)
        gap[1:-1, 1:-1, slice(2, -2) if is_flat else slice(1, -1)] = np.inf
        self.gap, self.gamma = gap.ravel(), np.zeros((gap.size, tip_map.box.bundles))

    @property
    def reached(self) -> Mask:
        """Of the lattice's shape."""
        return (self.gap == 0.0).reshape(self.lattice.shape)

    @property
    def distances(self) -> Array:
        """From centers to the nearest tips in cells, 3 at most, of the lattice's shape."""
        known = np.where(self.gap < 0.0, _FAR, self.gap)
        return np.minimum(known, _FAR).reshape(self.lattice.shape)

    def near(self, within: float = ENOUGH) -> Mask:
        """Mask of centers with a tip nearer than so many cells, shape (cells,): reached ones."""
        return (self.gap >= 0.0) & (self.gap < within)

    def fits(self, within: float = ENOUGH) -> bool:
        """True if these end within the lattice."""
        near = self.near(within).reshape(self.lattice.shape)
        return bool(np.count_nonzero(near) == np.count_nonzero(near[2:-2, 2:-2, 2:-2]))

    def centers(self, cells: Index) -> Array:
        """Places [m] of cells given by flat index, shape (n, 3)."""
        return self.lattice.places(np.stack(np.unravel_index(cells, self.lattice.shape), axis=-1))

    def add_inside(self, inside: Callable[[Array], Mask]) -> None:
        """Take centers for reached, without a search, that are within a part known to be [m]."""
        free = np.flatnonzero(self.gap > 0.0)
        known = np.zeros(len(self.gap), bool)
        known[free] = inside(self.centers(free))
        known = covered_cubes(covered_cubes(known.reshape(self.lattice.shape)))
        self.gap[np.pad(known, 1).ravel()] = 0.0  # what is beside has to be searched from tips
        self.gamma[self.gap == 0.0] = self.tip_map.box.low

    def add(self, gamma: Array, tips: Array) -> None:
        """Search around tips that come closer to a center than all before."""
        at = self.lattice.coordinates(tips)
        within = ((at >= 0) & (at < np.array(self.lattice.shape) - 1)).all(axis=1)
        owner, closest = np.full(len(self.gap), -1), self.gap - CLEARLY
        claim_corners(at[within], np.flatnonzero(within), self.steps, closest, owner)
        cells = np.flatnonzero(owner >= 0)
        self.search(cells, gamma[owner[cells]])
        self.grow(cells[self.gap[cells] == 0.0])

    def grow(self, cells: Index) -> None:
        """Search the neighbors of reached cells from there, and theirs, until none is new."""
        while len(cells):
            fresh = []
            for step in (*self.steps, *-self.steps):
                sources = cells[self.gap[cells + step] > 0]
                neighbors = sources + step
                self.search(neighbors, self.gamma[sources])
                fresh.append(neighbors[self.gap[neighbors] == 0.0])
            cells = np.unique(np.concatenate(fresh))

    def search(self, cells: Index, starts: Array) -> None:
        """Search for centers, and keep what comes closer."""
        cell = self.lattice.cell
        for block in parallel.blocks(len(cells), _CHUNK):
            some = cells[block]
            centers = self.centers(some)
            nearest = nearest_tips(self.tip_map, starts[block], centers, ENOUGH * cell)
            gap = nearest.distance / cell
            gap[gap <= ENOUGH] = 0.0
            closer = gap < self.gap[some]
            self.gap[some[closer]] = gap[closer]
            self.gamma[some[closer]] = nearest.gamma[closer]
            self.progress(len(some))


def nearest_tips(
    tip_map: TipMap, start: Array, targets: Array, enough: float, stop: Stop = ROUGHLY
) -> Nearest:
    """The activations whose tips come closest to targets, as far as a descent from `start` finds.

    Starts (n, bundles) are within the bounds, and each has a target (n, 3) [m], which counts as
    reached at the distance `enough` [m]. Only stable equilibria are taken.
    """
    gamma = np.ascontiguousarray(start)
    nearest = Nearest(gamma.copy(), np.empty_like(targets), np.empty(len(targets)))
    # Searches that end make room for others; only the last of a task run by a few.
    share = max(_TOGETHER, -(-len(targets) // parallel.thread_count()))
    blocks = parallel.blocks(len(targets), share)
    tip_map.prepare()
    parallel.run(
        partial(_descend, tip_map, targets[block], enough, stop, rows(nearest, block))
        for block in blocks
    )
    return nearest


class Nearest(NamedTuple):
    """Ends of searches: local minima of the distance, one for each target."""

    gamma: Array  # activations within the bounds, (n, bundles)
    tips: Array  # their tips [m], (n, 3)
    distance: Array  # to the target [m], (n,); infinite where a start has no equilibrium


def _descend(tip_map: TipMap, targets: Array, enough: float, stop: Stop, nearest: Nearest) -> None:
    """Damped Gauss and Newton steps that stay within the bounds; on the calling thread."""
    total, box = len(targets), tip_map.box
    bounds = box.low, box.high, box.scales
    size, m = min(total, _TOGETHER), box.bundles
    shapes = (), (), (3, m), (3,), (), (m,), (m,), (m,)
    numbers = (np.zeros((size, *shape)) for shape in shapes)
    running = kernels.Running(np.zeros(size, np.int64), np.zeros(size, np.int64), *numbers)
    center = np.zeros((size, m))
    tips, ahead = np.empty_like(running.wanted), np.empty_like(running.slope)
    step, multiplier = np.empty_like(running.trial), np.empty_like(running.wanted)
    torn, begun, n = tip_map.supports_unstable, 0, 0
    while begun < total or n:
        more = min(total - begun, len(tips) - n)
        new, old = slice(n, n + more), slice(begun, begun + more)
        running.row[new], running.steps[new] = np.arange(begun, begun + more), 0
        running.trial[new], running.damping[new] = nearest.gamma[old], kernels.FIRST_DAMPING
        n, begun = n + more, begun + more
        tip_map.fill(running.trial[:n], TipOutputs(tips[:n], ahead[:n]))
        if torn:
            tips[np.isnan(tips[:n, 0]).nonzero()[0]] = kernels.NOWHERE
        n = kernels.judge(running, n, tips, ahead, targets, nearest, enough, stop, bounds)
        at = rows(running, slice(n))
        multiplier[:n] = 0.0
        ends = step[:n], multiplier[:n]
        project(center[:n], at.slope, at.wanted, at.softness, at.low, at.high, *ends)
        kernels.next_trials(running, n, step, multiplier, nearest.gamma, *bounds)
    nowhere = nearest.distance >= kernels.NOWHERE
    nearest.distance[nowhere], nearest.tips[nowhere] = np.inf, np.nan


def all_reached(grid: ReachedGrid, gamma: Array, tips: Array) -> ReachedGrid:
    """All centers that searches find, from one cloud after the other, and distances around."""
    grid.add(gamma, tips)
    for number in range(1, _CLOUDS):
        while not grid.fits():
            grid = _wider(grid)
        before = np.count_nonzero(grid.gap == 0.0)
        grid.add(*cloud_on_faces(grid.tip_map, number))
        if grid.fits() and np.count_nonzero(grid.gap == 0.0) == before:
            break
    _spread(grid)
    while not grid.fits(DISTANCE):
        grid = _wider(grid)
        _spread(grid)
    return grid


def _wider(grid: ReachedGrid) -> ReachedGrid:
    """The same on a lattice with room around what is reached."""
    lattice = grid.lattice
    known = np.flatnonzero(grid.near(DISTANCE))
    room = np.full(3, 4 + max(lattice.shape) // 8)
    room[2] *= not grid.is_flat
    nx, ny, nz = np.array(lattice.shape) + 2 * room
    origin = lattice.origin - room * lattice.cell
    larger = Lattice(origin, lattice.cell, (int(nx), int(ny), int(nz)))
    wide = ReachedGrid(grid.tip_map, larger, grid.progress, is_flat=grid.is_flat)
    wide.add(grid.gamma[known], grid.tip_map.tips(grid.gamma[known]))
    return wide


def cloud_on_faces(tip_map: TipMap, seed: int) -> tuple[Array, Array]:
    """Activations on faces of all dimensions of the box, and their tips."""
    if isinstance(tip_map, AllPostures):
        return tip_map.with_sheets(*cloud_on_faces(tip_map.from_rest, seed))
    box, m, rng = tip_map.box, tip_map.box.dimension, np.random.default_rng(seed)
    cube = rng.random((CLOUD, m))
    free = np.maximum(rng.integers(0, m + 1, CLOUD), 2)
    bound = rng.random((CLOUD, m)).argsort(axis=1) >= free[:, None]
    cube[bound] = rng.integers(0, 2, int(bound.sum()))
    gamma = np.ascontiguousarray(box.from_free_cube(cube))
    tips = tip_map.tips(gamma)
    stable = np.isfinite(tips[:, 0])
    if not stable.any():
        raise no_equilibrium(len(tips))
    return gamma[stable], tips[stable]


def _spread(grid: ReachedGrid) -> None:
    """Search around centers that are near a tip, and around the rim, until gaps no longer fall."""
    offsets = (np.indices((3, 3, 3)).reshape(3, -1).T - 1) @ grid.steps
    offsets = offsets[offsets != 0]
    near, known = (grid.gap < DISTANCE) & (grid.gap > 0.0), grid.gap <= 0.0
    inside = covered_cubes(covered_cubes(known.reshape(grid.lattice.shape)))
    rim = np.flatnonzero((grid.gap == 0.0) & ~np.pad(inside, 1).ravel())
    front = np.concatenate([np.flatnonzero(near), rim])
    while len(front):
        tips = grid.tip_map.tips(grid.gamma[front])
        sources, ways = np.nonzero(grid.gap[front[:, None] + offsets] > 0.0)
        cells = front[sources] + offsets[ways]
        away = np.linalg.norm(grid.centers(cells) - tips[sources], axis=1) / grid.lattice.cell
        closer = np.flatnonzero(away < grid.gap[cells] - CLEARLY)
        order = closer[np.lexsort((away[closer], cells[closer]))]
        order = order[np.diff(cells[order], prepend=-1) > 0]
        cells, sources = cells[order], front[sources[order]]
        before = grid.gap[cells]
        grid.search(cells, grid.gamma[sources])
        front = cells[(grid.gap[cells] < before) & (grid.gap[cells] < DISTANCE)]
