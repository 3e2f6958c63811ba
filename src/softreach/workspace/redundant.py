"""Reach of the tip with four free bundles or more, by search instead of by simplices.

The box of m activations has m! simplices to a cell of its grid, its image has one boundary. So the
image is found in space: which centers of a lattice are reached, and where the boundary cuts the
edges between those that are and those that are not. Each place that counts as reached has an
activation that proves it; what searches miss is missing from the volume.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from softreach.geometry.hull import convex_hull
from softreach.rod.tip_map import TipMap, no_stable_equilibrium
from softreach.rod.view import stable_tips
from softreach.sampling import cube_blocks
from softreach.support import parallel
from softreach.support.arrays import Array, Index, Mask
from softreach.support.errors import InvalidInput
from softreach.support.progress import Progress
from softreach.workspace.boundary import ReachedCells
from softreach.workspace.crossings import Crossings
from softreach.workspace.image import Lattice, covered_cubes
from softreach.workspace.measure import Estimate, line_volume
from softreach.workspace.search import ENOUGH, Flood

__all__ = [
    "Searched",
    "cloud_on_faces",
    "lost_share",
    "not_among",
    "searched_set",
    "smallest_memory",
]


_SAMPLES = 1 << 14  # of the box, for the share that is lost
_CLOUD = 1 << 16  # tips in a cloud that searches start from
_CLOUDS = 8  # at most
_RULE = 2.5  # cells along the mean side of the bounding box, times the root of the accuracy
_FEWEST = 16.0
_FINER = 1.5
_SHIFT = (0.31, 0.17, 0.43)  # of a cell: lines on a plane of symmetry would all err alike
_SWEEPS = 3
_BEYOND = 0.05  # cells by which a sweep looks beyond a crossing
_APART = 0.05  # ranges: activations nearer to each other lead to the same end
_MOST_CELLS = 2.0**26


class Searched(NamedTuple):
    """A reachable set found by search."""

    cells: ReachedCells
    volume: Estimate
    convex_volume: Estimate


def searched_set(
    rod: TipMap, accuracy: float, cell: float | None, memory: float, progress: Progress
) -> Searched:
    """The image of a box of four free bundles or more.

    Args:
        rod: The tip map.
        accuracy: Relative error asked of the volume: cells become smaller until it is met, or
            `memory` is used.
        cell: Edge of a cell [m], instead of the rule's.
        memory: Memory that the search may use [bytes].
        progress: Called with the number of centers searched since its last call.

    Raises:
        InvalidInput: No activation has a stable equilibrium, or cells are too small for the memory.
    """
    gamma, tips = cloud_on_faces(rod, 0)
    sides = np.ptp(tips, axis=0)
    smallest = _smallest_cell(rod, sides, memory)
    if cell is not None:
        if not smallest <= cell < np.inf:  # NaN too
            raise InvalidInput("cell", cell, f"at least {smallest:.3g} m for {memory:.2g} bytes")
        return _search(rod, _lattice(tips, cell), gamma, tips, progress)
    target = min(np.sqrt(accuracy) / _RULE, 1.0 / _FEWEST) * np.cbrt(np.prod(sides))
    edge = float(max(target, smallest, sides.max() / 1024.0))
    result = _search(rod, _lattice(tips, edge), gamma, tips, progress)
    while result.volume.error > accuracy * result.volume.value and edge / _FINER >= smallest:
        edge /= _FINER
        result = _search(rod, _lattice(tips, edge), gamma, tips, progress)
    return result


def _lattice(tips: Array, cell: float) -> Lattice:
    """A lattice around tips that shares no plane of symmetry with them."""
    lattice = Lattice.around(tips, cell)
    return lattice._replace(origin=lattice.origin + cell * np.array(_SHIFT))


def smallest_memory(rod: TipMap) -> float:
    """Memory that a search cannot do without [bytes]."""
    return _fixed(rod) + 2e4 * _per_cell(rod)


def lost_share(rod: TipMap) -> float:
    """Share of the activation box without a stable equilibrium [-], from a sample."""
    if not rod.supports_unstable:
        return 0.0
    (cube,) = cube_blocks("sobol", _SAMPLES, rod.box.dimension, 0, _SAMPLES)
    tips = stable_tips(rod).tips(rod.box.from_free_cube(cube))
    return float(np.isnan(tips[:, 0]).mean())


def _fixed(rod: TipMap) -> float:
    return 16.0 * 8.0 * _CLOUD * (rod.box.bundles + 3)


def _per_cell(rod: TipMap) -> float:
    """Bytes of a center: its gap and activation, masks, and its part of the edges."""
    return 16.0 * rod.box.bundles + 120.0


def _smallest_cell(rod: TipMap, sides: Array, memory: float) -> float:
    most = min((memory - _fixed(rod)) / _per_cell(rod), _MOST_CELLS)
    low, high = 0.0, 1.0 + float(sides.max())
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if np.prod(sides / middle + 8.0) <= most else (middle, high)
    return high


def _search(
    rod: TipMap, lattice: Lattice, gamma: Array, tips: Array, progress: Progress
) -> Searched:
    flood = _flooded(Flood(rod, lattice, progress), gamma, tips)
    crossings, missed = _swept(flood)
    cells = ReachedCells(rod, flood.lattice, flood.reached, flood.gamma, crossings)
    if not len(crossings.edges.cell):
        convex = _convex_volume(tips, tips[::2])
        return Searched(cells, Estimate(0.0, convex.value + convex.error), convex)
    volume = line_volume(crossings)
    edge = flood.lattice.cell
    area = len(crossings.edges.cell) * edge**2 / 1.5  # a plane cuts 1.5 edges to a square of a cell
    slack = area * (ENOUGH * edge + rod.tol * rod.length)
    convex = _hull(crossings, tips[not_among(flood.reached, flood.lattice, tips)])
    noise = volume.error if np.isfinite(volume.error) else convex.value + convex.error
    error = noise + missed + slack
    return Searched(cells, Estimate(volume.value, error), convex)


def _flooded(flood: Flood, gamma: Array, tips: Array) -> Flood:
    """All centers that searches find, from one cloud after the other until one finds no more."""
    flood.add(gamma, tips)
    for number in range(1, _CLOUDS):
        while not flood.is_bounded:
            flood = _wider(flood)
        before = np.count_nonzero(flood.gap == 0.0)
        flood.add(*cloud_on_faces(flood.rod, number))
        if flood.is_bounded and np.count_nonzero(flood.gap == 0.0) == before:
            break
    return flood


def _wider(flood: Flood) -> Flood:
    """The same on a lattice with room around what is reached."""
    lattice = flood.lattice
    known = np.flatnonzero(flood.gap == 0.0)
    room = 4 + max(lattice.shape) // 8
    larger = Lattice(
        lattice.origin - room * lattice.cell,
        lattice.cell,
        (lattice.shape[0] + 2 * room, lattice.shape[1] + 2 * room, lattice.shape[2] + 2 * room),
    )
    wide = Flood(flood.rod, larger, flood.progress)
    wide.add(flood.gamma[known], flood.centers(known))
    return wide


def _swept(flood: Flood) -> tuple[Crossings, float]:
    """Crossings that no neighbor's activation leads beyond, and what may still be missed [m³]."""
    from scipy.spatial import KDTree

    crossings = Crossings.of(flood)
    volume = flood.lattice.cell**3 / 3.0  # three axes see the volume, each by itself
    gain = 0.0
    for sweep in range(1, _SWEEPS + 1):
        count = len(crossings.edges.cell)
        if count <= sweep:
            return crossings, 0.0
        places = crossings.points(np.arange(count), crossings.place)
        others = np.asarray(KDTree(places).query(places, k=sweep + 1)[1])[:, sweep]
        apart = np.abs(crossings.gamma[others] - crossings.gamma) / flood.rod.box.scales
        which = np.flatnonzero((apart > _APART).any(axis=1))
        moved = crossings.advance(which, crossings.gamma[others[which]], _BEYOND)
        gain = float(moved.clip(0.0).sum()) * volume
        beyond = np.flatnonzero(crossings.low >= 1.0)
        if len(beyond):
            _reach_further(flood, crossings, beyond)
            crossings = Crossings.of(flood)
    return crossings, gain


def _reach_further(flood: Flood, crossings: Crossings, beyond: Index) -> None:
    """Note that the far ends of edges are reached after all."""
    gamma = crossings.gamma[beyond]
    flood.add(gamma, crossings.points(beyond, crossings.low[beyond]))


def _hull(crossings: Crossings, tips: Array) -> Estimate:
    """Volume of the convex hull [m³] from points of the boundary, and from every fourth line."""
    every = np.arange(len(crossings.edges.cell))
    index = np.stack(np.unravel_index(crossings.edges.cell, crossings.lattice.shape), axis=-1)
    index[every, crossings.edges.axis] = 0
    even = (index % 2 == 0).all(axis=1)
    points = crossings.points(every, crossings.place)
    nearest = crossings.rod.tips(crossings.beyond)
    return _convex_volume(
        np.concatenate([points, nearest, tips]), np.concatenate([points[even], nearest[even]])
    )


def not_among(reached: Mask, lattice: Lattice, tips: Array) -> Mask:
    """Mask of tips not between eight centers that are reached, where no hull has a corner."""
    cubes = covered_cubes(reached)
    index = np.floor(lattice.coordinates(tips)).astype(np.int64)
    inside = np.all((index >= 0) & (index < cubes.shape), axis=1)
    x, y, z = (index * inside[:, None]).T
    return ~(inside & cubes[x, y, z])


def _convex_volume(points: Array, fewer: Array) -> Estimate:
    """Limit of the hulls of ever more boundary points, as far as two of them tell."""
    hulls = parallel.in_order(partial(convex_hull, places) for places in (points, fewer))
    value, rough = (hull.volume for hull in hulls)
    missing = max(value - rough, 0.0) / 3.0
    return Estimate(value + 0.5 * missing, missing)


def cloud_on_faces(rod: TipMap, seed: int) -> tuple[Array, Array]:
    """Activations on faces of all dimensions of the box, and their tips."""
    box, rng = rod.box, np.random.default_rng(seed)
    m = box.dimension
    cube = rng.random((_CLOUD, m))
    free = np.maximum(rng.integers(0, m + 1, _CLOUD), 2)
    bound = rng.random((_CLOUD, m)).argsort(axis=1) >= free[:, None]
    cube[bound] = rng.integers(0, 2, int(bound.sum()))
    gamma = np.ascontiguousarray(box.from_free_cube(cube))
    tips = stable_tips(rod).tips(gamma)
    if not rod.supports_unstable:
        return gamma, tips
    stable = np.isfinite(tips[:, 0])
    if not stable.any():
        raise no_stable_equilibrium(len(tips))
    return gamma[stable], tips[stable]
