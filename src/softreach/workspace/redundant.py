"""Reach of the tip with four free bundles or more, by search instead of by simplices.

The box of m activations has m! simplices to a cell of its grid, its image has one boundary. So the
image is found in space: a lattice tells how far its centers are from the nearest tip, and a surface
of tips is wrapped around. Where this leaves a larger error, lines of sight through the centers that
are reached add up to the volume. Each place that counts as reached has an activation that proves
it; what searches miss is missing from the volume.
"""

from __future__ import annotations

import numpy as np

from softreach.rod.tip_map import TipMap, no_stable_equilibrium
from softreach.sampling import cube_blocks
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput
from softreach.support.memory import free_memory
from softreach.support.progress import Progress
from softreach.workspace.cells import ReachedCells
from softreach.workspace.convex import climbed_hull
from softreach.workspace.image import Lattice
from softreach.workspace.search import Flood
from softreach.workspace.wrap import DISTANCE, spread, wrapped

_SAMPLES = 1 << 14  # of the box, for the share that is lost
_CLOUD = 1 << 16  # tips in a cloud that searches start from
_CLOUDS = 8  # at most
_RULE = 2.5  # cells along the mean side of the bounding box, times the root of the accuracy
_FEWEST = 16.0
_FINER = 1.5
_SHIFT = np.array([0.31, 0.17, 0.43])  # of a cell: lines on a plane of symmetry would all err alike
_MOST_ALONG = 96.0
_THINNEST = 128.0  # cells along the mean side: below are no sheets
_MOST_CELLS = 2.0**26


CLIMBERS = 1024
"""Of these, for the convex hull beside tips on the boundary: more make countless facets."""


def smallest_memory(tip_map: TipMap) -> float:
    """Memory that a search cannot do without [bytes]."""
    fixed, each = _bytes(tip_map)
    return fixed + 2e4 * each


def searched_set(
    tip_map: TipMap, accuracy: float, cell: float | None, memory: float | None, progress: Progress
) -> ReachedCells:
    """The image of a box of four free bundles or more.

    Args:
        tip_map: The tip map.
        accuracy: Relative error asked of the volume: cells become smaller until it is met, or
            `memory` is used.
        cell: Edge of a cell [m], instead of the rule's.
        memory: Memory that the search may use [bytes]; a quarter of what is free if None.
        progress: Called with the number of centers searched since its last call.

    Raises:
        InvalidInput: No activation has a stable equilibrium, too little memory, or cells too small
            for it.
    """
    least = smallest_memory(tip_map)
    memory = max(free_memory() / 4.0, least) if memory is None else memory
    if not least <= memory < np.inf:
        raise InvalidInput("memory", memory, f"at least {least:.3g} bytes")
    cloud = gamma, tips = cloud_on_faces(tip_map, 0)
    sides = np.ptp(tips, axis=0)
    smallest = _smallest_cell(tip_map, sides, memory)
    if cell is not None and not smallest <= cell < np.inf:  # NaN too
        raise InvalidInput("cell", cell, f"at least {smallest:.3g} m for {memory:.2g} bytes")
    mean = float(np.cbrt(np.prod(sides)))
    target = min(np.sqrt(accuracy) / _RULE, 1.0 / _FEWEST) * mean
    edge = float(max(target, smallest, sides.max() / 1024.0)) if cell is None else cell

    def of_cells(edge: float) -> Flood:
        return flooded(Flood(tip_map, shifted_lattice(tips, edge), progress), *cloud)

    coarse = wrapped(of_cells(_FINER * edge))
    begin = tip_map.box.to_cube(np.concatenate([gamma[:CLIMBERS], coarse.gamma]))[
        :, tip_map.box.free
    ]
    hull = climbed_hull(tip_map, begin.clip(0.0, 1.0), accuracy)
    while True:
        flood = of_cells(edge)
        found = ReachedCells(flood, cloud, wrapped(flood), coarse, hull)
        if cell is not None or not _may_meet(found, accuracy, smallest, mean / _THINNEST):
            return found
        edge, coarse = edge / _FINER, found.wrap


def _may_meet(cells: ReachedCells, accuracy: float, smallest: float, of_sheets: float) -> bool:
    """True if an accuracy is not met but may be, by cells that are no smaller than allowed.

    Where nothing is seen between both sides of a sheet, its error falls as the square of the edge,
    until the sheet is thin enough for its thickness to be found.
    """
    edge = cells.lattice.cell
    value, error = cells.volume
    if error <= accuracy * value or edge / _FINER < smallest:
        return False
    if cells.is_thick:
        return True
    is_sheet = cells.wrap.volume_of_tips.value != cells.wrap.tight_volume
    needed = edge / _FINER if is_sheet else edge * np.sqrt(accuracy * max(value, 0.0) / error)
    return needed >= of_sheets


def cells_of(tip_map: TipMap, cell: float) -> ReachedCells:
    """What is reached of the image of a box of any number of free bundles, without its hull.

    Args:
        tip_map: The tip map.
        cell: Edge of a cell [m]; larger where that takes more than 96 cells along the longest side.
    """
    cloud = cloud_on_faces(tip_map, 0)
    edge = max(cell, float(np.ptp(cloud[1], axis=0).max()) / _MOST_ALONG)
    flood = flooded(Flood(tip_map, shifted_lattice(cloud[1], edge)), *cloud)
    wrap = wrapped(flood)
    return ReachedCells(flood, cloud, wrap, wrap)


def shifted_lattice(tips: Array, cell: float) -> Lattice:
    """A lattice around tips [m], shape (n, 3), that shares no plane of symmetry with them."""
    lattice = Lattice.around(tips, cell)
    return lattice._replace(origin=lattice.origin + cell * _SHIFT)


def lost_share(tip_map: TipMap) -> float:
    """Share of the activation box without a stable equilibrium [-], from a sample."""
    if not tip_map.supports_unstable:
        return 0.0
    (cube,) = cube_blocks("sobol", _SAMPLES, tip_map.box.dimension, 0, _SAMPLES)
    tips = tip_map.tips(tip_map.box.from_free_cube(cube))
    return float(np.isnan(tips[:, 0]).mean())


def _bytes(tip_map: TipMap) -> tuple[float, float]:
    """Of clouds, and of a center: its gap and activation, masks, and its part of the edges."""
    return 16.0 * 8.0 * _CLOUD * (tip_map.box.bundles + 3), 16.0 * tip_map.box.bundles + 120.0


def _smallest_cell(tip_map: TipMap, sides: Array, memory: float) -> float:
    fixed, each = _bytes(tip_map)
    most = min((memory - fixed) / each, _MOST_CELLS)
    low, high = 0.0, 1.0 + float(sides.max())
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if np.prod(sides / middle + 8.0) <= most else (middle, high)
    return high


def flooded(flood: Flood, gamma: Array, tips: Array) -> Flood:
    """All centers that searches find, from one cloud after the other until one finds no more.

    And the distances of those around to the nearest tips.
    """
    flood.add(gamma, tips)
    for number in range(1, _CLOUDS):
        while not flood.fits():
            flood = _wider(flood)
        before = np.count_nonzero(flood.gap == 0.0)
        flood.add(*cloud_on_faces(flood.tip_map, number))
        if flood.fits() and np.count_nonzero(flood.gap == 0.0) == before:
            break
    spread(flood)
    while not flood.fits(DISTANCE):
        flood = _wider(flood)
        spread(flood)
    return flood


def _wider(flood: Flood) -> Flood:
    """The same on a lattice with room around what is reached."""
    lattice = flood.lattice
    known = np.flatnonzero(flood.near(DISTANCE))
    room = np.full(3, 4 + max(lattice.shape) // 8)
    room[2] *= not flood.is_flat
    nx, ny, nz = np.array(lattice.shape) + 2 * room
    origin = lattice.origin - room * lattice.cell
    larger = Lattice(origin, lattice.cell, (int(nx), int(ny), int(nz)))
    wide = Flood(flood.tip_map, larger, flood.progress, is_flat=flood.is_flat)
    wide.add(flood.gamma[known], flood.tip_map.tips(flood.gamma[known]))
    return wide


def cloud_on_faces(tip_map: TipMap, seed: int) -> tuple[Array, Array]:
    """Activations on faces of all dimensions of the box, and their tips."""
    box, rng = tip_map.box, np.random.default_rng(seed)
    m = box.dimension
    cube = rng.random((_CLOUD, m))
    free = np.maximum(rng.integers(0, m + 1, _CLOUD), 2)
    bound = rng.random((_CLOUD, m)).argsort(axis=1) >= free[:, None]
    cube[bound] = rng.integers(0, 2, int(bound.sum()))
    gamma = np.ascontiguousarray(box.from_free_cube(cube))
    tips = tip_map.tips(gamma)
    if not tip_map.supports_unstable:
        return gamma, tips
    stable = np.isfinite(tips[:, 0])
    if not stable.any():
        raise no_stable_equilibrium(len(tips))
    return gamma[stable], tips[stable]
