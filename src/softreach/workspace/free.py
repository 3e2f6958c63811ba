"""What an arm reaches among its surroundings: the free activations, flooded from rest.

The activation box is cut into cells. Neighbors are connected where the straight motion between
their middles is certified to touch nothing, so that no wall is passed, however thin it is. A way
that is narrower than a cell may be missed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import label

from softreach.arm.manipulator import Manipulator
from softreach.rod.clear_motion import ClearMotions, Motion, clear_motions
from softreach.rod.loaded.flood import edges_along
from softreach.rod.tip_map import TipMap
from softreach.schema import provenance
from softreach.support.arguments import as_integer
from softreach.support.arrays import Array, Index, Mask
from softreach.support.errors import NotPossible
from softreach.support.lazy import lazy
from softreach.support.memory import check_memory
from softreach.support.quantity import quantity
from softreach.workspace.grid import LiftedGrid, components
from softreach.workspace.image import Image, Lattice, image_of
from softreach.workspace.measure import Estimate, covered_volume, named

if TYPE_CHECKING:
    import xarray as xr

_SHORTEST, _SHORTEST_TO_GRID = 2.0**-6, 2.0**-12  # shares that motions are cut into
_BYTES = 250  # of a cell: clearances, places and edges
_ALONG = 48  # cells of space along the mean side of the set
_MOST_CELLS = 400


class FreeCells:
    """A grid of cells over the activation box: which are free, and which connected.

    Attributes:
        gamma: Middles of the cells, the last bundle varying fastest, shape (n, bundles).
        room: Clearance that their middles have at least [m], shape (n,).
        links: Neighbors between which motions are clear, shape (k, 2).
        lengths: Lengths of these motions, in ranges, shape (k,).
    """

    def __init__(self, motions: ClearMotions, cells: int) -> None:
        """Flood a grid of so many cells along each free bundle."""
        self.motions, self.cells = motions, cells
        box = motions.box
        self.sizes = (cells,) * box.dimension
        count = cells**box.dimension
        check_memory("cells", f"{count:,}", _BYTES * count)
        places = (np.indices(self.sizes).reshape(box.dimension, count).T + 0.5) / cells
        self.gamma = box.from_free_cube(places)
        found = motions.at(self.gamma)
        self.room, self._which = found.value - motions.error, found.which
        self.links, self._may = self._linked()

    @property
    def is_free(self) -> Mask:
        """Mask of cells whose middle touches nothing, of the shape of the grid."""
        return (self.room > -self.motions.error).reshape(self.sizes)

    def _linked(self) -> tuple[Index, Index]:
        """Links that are clear, and those between parts of which that is not decided."""
        free, links, maybe = self.is_free.ravel(), list[Index](), np.empty((0, 2), np.int64)
        axes = [np.stack(edges_along(self.sizes, k), axis=1) for k in range(len(self.sizes))]
        left = np.concatenate(axes)
        along = np.repeat(np.arange(len(axes)), [len(each) for each in axes])
        usable = free[left].all(axis=1)
        left, along, most = left[usable], along[usable], 1
        chosen = np.flatnonzero(along == 0)  # lines of cells first, then links between lines
        while len(chosen):
            outcome = self._outcomes(left[chosen], along[chosen])
            links.append(left[chosen[outcome == Motion.CLEAR]])
            maybe = np.concatenate([maybe, left[chosen[outcome == Motion.UNDECIDED]]])
            left, along = (np.delete(each, chosen, axis=0) for each in (left, along))
            part = components(np.concatenate(links), len(free))
            apart = part[left[:, 0]] != part[left[:, 1]]
            left, along = left[apart], along[apart]
            chosen, most = self._widest(left, np.sort(part[left], axis=1), most), 4 * most
        return np.concatenate([maybe[:0], *links]), maybe

    def _widest(self, pairs: Index, parts: Index, most: int) -> Index:
        """For any two parts the links between them with most room, so many at most."""
        key = parts[:, 0] * len(self.room) + parts[:, 1]
        order = np.lexsort((-self.room[pairs].min(axis=1), key))
        starts = np.flatnonzero(np.diff(key[order], prepend=-1))
        rank = np.arange(len(key)) - np.repeat(starts, np.diff(starts, append=len(key)))
        return order[rank < most]

    def _outcomes(self, pairs: Index, along: Index) -> Index:
        """`Motion` of links along axes."""
        outcome = np.empty(len(pairs), np.int64)
        for axis in np.unique(along):
            rows = np.flatnonzero(along == axis)
            (a, b), rooms = pairs[rows].T, self.room[pairs[rows].T]
            speeds = self.motions.speeds(self.gamma[b[:1]] - self.gamma[a[:1]])
            ends = self.gamma[a], self.gamma[b]
            outcome[rows] = self.motions.check(*ends, _SHORTEST, rooms, speeds).outcome
        return outcome

    @lazy
    def _parts(self) -> tuple[Index, Index]:
        """Numbers of connected parts, and of those with what is not decided."""
        both = np.concatenate([self.links, self._may])
        return components(self.links, len(self.room)), components(both, len(self.room))

    def near(self, gamma: Array) -> Index:
        """Cells to whose middles motions from an activation (bundles,) are clear."""
        place = self._place(gamma)
        ways = np.indices((3,) * len(self.sizes)).reshape(len(self.sizes), -1).T - 1
        around = place + ways
        around = around[((around >= 0) & (around < self.cells)).all(axis=1)]
        which = np.ravel_multi_index(tuple(around.T), self.sizes)
        begin = np.tile(gamma, (len(which), 1))
        checked = self.motions.check(begin, self.gamma[which], _SHORTEST_TO_GRID)
        return which[checked.outcome == Motion.CLEAR]

    def connected(self, gamma: Array) -> tuple[Mask, Mask]:
        """Masks of free cells that are connected with an activation, and of those that may be."""
        near = self.near(gamma)
        masks = (np.isin(each, each[near]) for each in self._parts)
        sure, maybe = (mask.reshape(self.sizes) & self.is_free for mask in masks)
        return sure, maybe

    def are_parted(self, some: Array, other: Array) -> bool:
        """True if it is proved that every motion between two activations touches something.

        Then cells in which every configuration touches a solid lie between them.
        """
        box, m = self.motions.box, len(self.sizes)
        corners = box.from_free_cube(np.indices((2,) * m).reshape(m, -1).T.astype(float))
        depth = self.motions.speeds((corners - corners.mean(axis=0)) / self.cells)[0].max()
        touches = (self.room + self.motions.error < -depth) & (self._which >= 0)
        number, _ = label(~touches.reshape(self.sizes), np.ones((3,) * m))
        first, second = (number[tuple(self._place(each))] for each in (some, other))
        return bool(first != second)

    def _place(self, gamma: Array) -> Index:
        cube = self.motions.box.to_cube(gamma)[self.motions.box.free]
        return np.clip((cube * self.cells).astype(int), 0, self.cells - 1)


@lru_cache(maxsize=4)
def free_cells(motions: ClearMotions, cells: int) -> FreeCells:
    """The grid of an arm, kept for the next call."""
    return FreeCells(motions, cells)


_MEANINGS = {
    "reached": "reached from rest",
    "walled_off": "reached only through a wall",
    "blocked": "reached only in contact",
}


@dataclass(frozen=True, eq=False, repr=False)
class FreeSet:
    """What the tip reaches with an arm that touches nothing."""

    tip_map: TipMap
    """The tip map of the arm."""
    cells: int
    """Cells of the activation grid along each bundle."""
    reached: float
    """Volume that free motions from rest lead to [m³]."""
    reached_error: float
    """Error of `reached` [m³]."""
    walled_off: float
    """Volume where the arm is free, but to which it gets through a wall alone [m³]."""
    walled_off_error: float
    """Error of `walled_off` [m³]."""
    blocked: float
    """Volume that the tip reaches only if the arm touches something [m³]."""
    blocked_error: float
    """Error of `blocked` [m³]."""
    grid: xr.Dataset
    """`state` of cells of space, over x, y and z [m]: 0 out of reach, 1 reached, 2 walled off, 3
    blocked."""

    @property
    def arm(self) -> Manipulator:
        """The design."""
        return self.tip_map.arm

    def to_dataset(self) -> xr.Dataset:
        """All volumes with their errors and units, and where they come from."""
        import xarray as xr

        numbers = {
            f"{name}{end}": ((), getattr(self, f"{name}{end}"), {"units": "m3", "long_name": text})
            for name, text in _MEANINGS.items()
            for end in ("", "_error")
        }
        attrs = provenance(self.arm, self.tip_map.frame) | {"activation_grid": self.cells}
        return xr.Dataset(numbers, attrs=attrs)

    def __repr__(self) -> str:
        lines = [f"FreeSet of {self.cells}³ cells of activation"]
        for name, text in _MEANINGS.items():
            value = quantity(getattr(self, name), "m³", getattr(self, f"{name}_error"))
            lines.append(f"{text}: {value}")
        return "\n  ".join(lines)


def free_set(arm: Manipulator | TipMap, *, cells: int = 64) -> FreeSet:
    """The part of the reachable set that an arm gets to from rest without touching anything.

    The activation box of three free bundles is cut into n³ cells. A cell is free where the arm
    touches nothing at its middle, neither its surroundings nor itself. Free neighbors are connected
    where the motion between their middles is certified (`rod.clear_motion`), and all that is
    connected with the shape at rest is reached. The images of these cells give the volumes. Errors
    are what half as many cells along each bundle change, and what is free but not certified to be
    connected. A way that is narrower than a cell may be missed.

    Args:
        arm: The design with its `surroundings`, or its tip map; without loads.
        cells: Cells n along each bundle, an even number. The work grows as n³.

    Returns:
        Three volumes with errors, which add up to that of the reachable set.

    Raises:
        InvalidInput: A number of cells out of range.
        NotPossible: There are not three free bundles, the arm touches something at rest, has loads,
            or has tendons that are driven by length.
    """
    n = 2 * (as_integer("cells", cells, 8, _MOST_CELLS) // 2)
    motions = clear_motions(arm)
    if (m := motions.box.dimension) != 3:
        raise NotPossible(
            f"a free set is known of three free bundles, and this arm has {m}: hold some of them, "
            "or mark the samples of a cloud by compute_cloud(arm, clearance=True)"
        )
    tip_map, rest = motions.clearance.whole, motions.box.clip(np.zeros((1, motions.box.bundles)))
    rest = motions.free_at("rest", rest[0])
    grid = LiftedGrid.of(tip_map, n)
    lattice = Lattice.around(grid.tips, float(np.cbrt(np.ptp(grid.tips, axis=0).prod())) / _ALONG)
    fine = _images(FreeCells(motions, n), rest, grid, lattice)
    coarse = _images(FreeCells(motions, n // 2), rest, grid.coarser(), lattice)
    return FreeSet(tip_map=tip_map, cells=n, grid=_states(fine, tip_map), **_volumes(fine, coarse))


def _images(cells: FreeCells, rest: Array, grid: LiftedGrid, lattice: Lattice) -> list[Image]:
    """Images of the cells that are reached, may be reached, are free, and of all."""
    masks = (*cells.connected(rest), cells.is_free)
    nothing = np.empty((0, 8), np.int64)
    parts = [replace(grid, is_lifted=~mask, lifted=nothing, finer=None) for mask in masks]
    return [image_of(each, lattice) for each in (*parts, grid)]


def _volumes(fine: list[Image], coarse: list[Image]) -> dict[str, float]:
    """The three volumes, with their errors."""
    found = [covered_volume(image) for image in fine]
    rough = [covered_volume(image).value for image in coarse]
    unsure = found[1].value - found[0].value
    volumes = {"reached": Estimate(found[0].value, abs(found[0].value - rough[0]) + unsure)}
    for name, outer, inner in (("walled_off", 2, 0), ("blocked", 3, 2)):
        value = found[outer].value - found[inner].value
        change = abs(value - rough[outer] + rough[inner])
        volumes[name] = Estimate(value, change + unsure * (inner == 0))
    scatter = max(each.error for each in found)
    return named(**{name: Estimate(x, error + scatter) for name, (x, error) in volumes.items()})


def _states(images: list[Image], tip_map: TipMap) -> xr.Dataset:
    """What is known of the cells of space, see `FreeSet.grid`."""
    import xarray as xr

    reached, _, free, every = (image.counts[0] > 0 for image in images)
    state = np.select([reached, free, every], [1, 2, 3]).astype(np.int8)
    lattice = images[0].lattice
    attrs = provenance(tip_map.arm, tip_map.frame) | {"cell": lattice.cell}
    meanings = "0=out_of_reach 1=reached 2=walled_off 3=blocked"
    values = (tuple("xyz"), state, {"units": "1", "meanings": meanings})
    return xr.Dataset({"state": values}, lattice.centers(), attrs)
