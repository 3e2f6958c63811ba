"""What an arm reaches among its surroundings: free activations, flooded from rest.

Neighbors in the activation box are linked where the straight motion between them is certified to
touch nothing, so that no wall is passed, however thin it is. A way that is narrower than a cell of
the box may be missed.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.rod.clear_motion import CLEAR, UNDECIDED, ClearMotions, clear_motions
from softreach.rod.loaded.flood import edges_along
from softreach.rod.rods import as_tip_map
from softreach.rod.tip_map import TipMap
from softreach.schema import provenance
from softreach.support.arguments import as_integer
from softreach.support.arrays import Array, Index, Mask
from softreach.support.errors import NotPossible
from softreach.support.memory import check_memory
from softreach.workspace.grid import LiftedGrid, components
from softreach.workspace.image import Image, Lattice, image_of
from softreach.workspace.measure import covered_volume

if TYPE_CHECKING:
    import xarray as xr

_SHORTEST, _SHORTEST_TO_NODES = 2.0**-6, 2.0**-11  # shares that motions are cut into
_PART = 2  # of links that are left, checked at once
_NEAR = 27  # nodes beside an activation
_BYTES = 300  # of a cell: clearances, places and links
_ALONG = 48  # cells of space along the mean side of the set
_MOST_CELLS = 400


class FreeGraph:
    """Activations that may be free, and links between those between which motions are clear.

    Links are checked until they connect all that they can, those with most room first.
    """

    links: Index
    """Nodes at both ends of each, shape (k, 2)."""

    def __init__(self, motions: ClearMotions, gamma: Array, pairs: Index) -> None:
        """Link nodes (n, bundles) where pairs of them (k, 2) are neighbors."""
        self.motions, self.gamma = motions, gamma
        self.clearance, self.which, _ = motions.at(gamma)
        self.is_free: Mask = self.clearance > 0.0
        left = pairs[self.is_free[pairs].all(axis=1)]
        rank = self.clearance[left]
        left = np.take_along_axis(left, rank.argsort(axis=1), axis=1)  # the narrower node first
        left = left[np.lexsort((-rank.max(axis=1), -rank.min(axis=1)))]
        widest = np.unique(left[:, 0], return_index=True)[1]
        left, some = np.concatenate([left[widest], np.delete(left, widest, axis=0)]), len(widest)
        self.links, self._maybe = left[:0], left[:0]
        while len(left):
            chosen, left = np.split(left, [some])
            rooms = self.clearance[chosen.T] - motions.error
            found = motions.check(*gamma[chosen.T], _SHORTEST, rooms).outcome
            self.links = np.concatenate([self.links, chosen[found == CLEAR]])
            self._maybe = np.concatenate([self._maybe, chosen[found == UNDECIDED]])
            part = components(self.links, len(gamma))
            left = left[part[left[:, 0]] != part[left[:, 1]]]
            some = len(left) // _PART + 1

    def near(self, gamma: Array) -> Index:
        """Nodes beside an activation (bundles,) to which motions from there are clear."""
        apart = self.motions.box.to_cube(self.gamma) - self.motions.box.to_cube(gamma)
        away = np.where(self.is_free, (apart**2).sum(axis=1), np.inf)
        nodes = np.argsort(away)[:_NEAR]
        begin = np.tile(gamma, (len(nodes), 1))
        outcome = self.motions.check(begin, self.gamma[nodes], _SHORTEST_TO_NODES).outcome
        return nodes[outcome == CLEAR]

    def connected(self, gamma: Array) -> tuple[Mask, Mask]:
        """Masks of nodes that are connected with an activation, and of free ones that may be."""
        near, every = self.near(gamma), np.concatenate([self.links, self._maybe])
        parts = components(self.links, len(self.gamma)), components(every, len(self.gamma))
        sure, maybe = (np.isin(part, part[near]) for part in parts)
        return sure, maybe & self.is_free


@lru_cache(maxsize=4)
def free_grid(motions: ClearMotions, cells: int) -> FreeGraph:
    """The middles of so many cells along each free bundle, the last of which varies fastest."""
    sizes = (cells,) * motions.box.dimension
    check_memory("cells", f"{cells ** len(sizes):,}", _BYTES * cells ** len(sizes))
    places = (np.indices(sizes).reshape(len(sizes), -1).T + 0.5) / cells
    pairs = [np.stack(edges_along(sizes, axis), axis=1) for axis in range(len(sizes))]
    return FreeGraph(motions, motions.box.from_free_cube(places), np.concatenate(pairs))


def free_set(arm: Manipulator | TipMap, *, cells: int = 64) -> xr.Dataset:
    """The parts of the reachable set that an arm gets to with and without touching anything.

    The activation box of three free bundles is cut into n³ cells. A cell is free where the arm
    touches nothing at its middle, neither its surroundings nor itself. Free neighbors are connected
    where the motion between their middles is certified (`rod.clear_motion`), and what is connected
    with the shape at rest is reached. The images of these cells give the volumes. Errors are what
    half as many cells along each bundle change, and what is not certified. A way that is narrower
    than a cell may be missed.

    Args:
        arm: The design with its `surroundings`, or its tip map; without loads.
        cells: Cells n along each bundle, rounded to an even number. The work grows as n³.

    Returns:
        Dataset with volumes [m³] that add up to that of the reachable set, and their errors:
        `reached` by free motions from rest; `walled_off`, where the arm is free, but to which it
        gets through a wall alone; `blocked`, which the tip reaches only in contact. `state` says
        the same of cells of space, over x, y and z [m]: 1, 2, 3; 0 out of reach.

    Raises:
        InvalidInput: A number of cells out of range.
        NotPossible: There are not three free bundles, the arm touches something at rest, has loads,
            or has tendons that are driven by length.
    """
    n, motions = (
        2 * (as_integer("cells", cells, 8, _MOST_CELLS) // 2),
        clear_motions(as_tip_map(arm)),
    )
    if (m := motions.box.dimension) != 3:
        raise NotPossible(
            f"a free set is known of three free bundles, and this arm has {m}: hold some of them, "
            "or mark the samples of a cloud by compute_cloud(arm, clearance=True)"
        )
    rest = motions.free_at("rest", motions.box.clip(np.zeros((1, motions.box.bundles))))
    grid = LiftedGrid.of(motions.clearance.whole, n)
    lattice = Lattice.around(grid.tips, float(np.cbrt(np.ptp(grid.tips, axis=0).prod())) / _ALONG)
    fine = _images(free_grid(motions, n), rest, grid, lattice)
    coarse = _images(free_grid(motions, n // 2), rest, grid.coarser(), lattice)
    return _dataset(fine, coarse)


def _images(graph: FreeGraph, rest: Array, grid: LiftedGrid, lattice: Lattice) -> list[Image]:
    """Images of the cells that are reached, that may be, that are free, and of all."""
    images = list[Image]()
    for mask in (*graph.connected(rest), graph.is_free):
        left_out = ~mask.reshape((grid.n,) * 3)
        images.append(image_of(replace(grid, is_lifted=left_out, finer=None), lattice))
    return [*images, image_of(grid, lattice)]


def _dataset(fine: list[Image], coarse: list[Image]) -> xr.Dataset:
    import xarray as xr

    found = [covered_volume(image) for image in fine]
    size, rough = np.array([x.value for x in found]), [covered_volume(x).value for x in coarse]
    scatter, unsure = max(each.error for each in found), size[1] - size[0]
    variables, about = dict[str, tuple[object, ...]](), {"units": "m3"}
    for name, outer, inner in (("reached", 0, None), ("walled_off", 2, 0), ("blocked", 3, 2)):
        value, before = (x[outer] - (0.0 if inner is None else x[inner]) for x in (size, rough))
        error = abs(value - before) + scatter + (0.0 if inner == 2 else unsure)
        variables |= {name: ((), value, about), f"{name}_error": ((), error, about)}
    reached, _, free, every = (image.counts[0] > 0 for image in fine)
    state = np.select([reached, free, every], [1, 2, 3]).astype(np.int8)
    meanings = "0=out_of_reach 1=reached 2=walled_off 3=blocked"
    variables["state"] = tuple("xyz"), state, {"units": "1", "meanings": meanings}
    tip_map, lattice = fine[0].grid.tip_map, fine[0].lattice
    attrs = provenance(tip_map.arm, tip_map.frame) | {"activation_grid": fine[0].grid.n}
    return xr.Dataset(variables, lattice.centers(), attrs | {"cell": lattice.cell})
