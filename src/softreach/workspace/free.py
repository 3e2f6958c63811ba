"""Free motions: what an arm gets to from rest without touching its surroundings or itself.

When activations change by δγ, every section stretches by z·δγ and turns by η U·δγ + (∂η·δγ) u per
length, and carries what lies beyond it. No point of the arm therefore moves farther than

    v·|δγ|,  vⱼ = ∫ |zⱼ| + (η |Uⱼ| + |∂ηⱼ| |u|) ℓ(Z) dZ,

with the longest arc ℓ from there to the tip, or to the point of a tool. Two configurations clear
the straight motion between them where their clearances add up to more; other motions are halved.
Neighbors in the activation box are linked by such motions alone: no wall is passed, however thin.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator
from softreach.geometry.surface import components
from softreach.kernels.rod.linear_response import WEIGHTS
from softreach.rod.clearance import ClearanceMap, Clearances
from softreach.rod.free import FreeRod
from softreach.rod.loaded.flood import edges_along
from softreach.rod.rods import all_inputs, as_tip_map
from softreach.rod.tip_map import TipMap
from softreach.schema import provenance
from softreach.support.arguments import as_integer
from softreach.support.arrays import Array, Index, Mask, over
from softreach.support.errors import InvalidInput, NotPossible
from softreach.support.lazy import lazy
from softreach.support.memory import check_memory
from softreach.workspace.grid import LiftedGrid
from softreach.workspace.image import Image, Lattice, image_of
from softreach.workspace.measure import covered_volume

if TYPE_CHECKING:
    import xarray as xr

CLEAR, UNDECIDED, TOUCHES = 0, 1, 2
"""What is known of a motion: it touches nothing; some of it comes too near to tell; it touches."""
_STEPS, _SAFETY = 24, 1.02  # least steps of the integrals, and what they err by
_ROUNDING = 1e-9  # of ranges
_SHORTEST, _SHORTEST_TO_NODES = 2.0**-6, 2.0**-11  # shares that motions are cut into
_NEAR = 27  # nodes beside an activation
_BYTES, _MOST_CELLS = 300, 400  # of a cell: clearances, places and links; along each bundle
_ALONG = 48  # cells of space along the mean side of the set


class FreeMotions:
    """Which straight motions between activations keep an arm clear of everything.

    Clearances count parts of the arm once their gap is below half of their width, so that no step
    closes so much. Only of an arm bent to a radius below 1.5 of its own may they begin to nearer.
    """

    def __init__(self, tip_map: TipMap, margin: float = 0.0) -> None:
        """Those that keep a margin [m], in all inputs of an arm."""
        self.clearance, self.margin = ClearanceMap(all_inputs(tip_map)), margin
        driving = self.clearance.tip_map.inputs.driving
        is_known = driving is None or driving.is_bundles
        if not is_known or not isinstance(self.clearance.tip_map.rod, FreeRod):
            unknown = "under loads, or with tendons that are driven by length or have guides"
            raise NotPossible(f"free motions are not known of arms {unknown}")
        self.box, self.error = self.clearance.whole.box, self.clearance.error

    def at(self, gamma: Array) -> Clearances:
        """Clearances at activations (n, bundles), less the margin."""
        found = self.clearance.of(gamma)
        return found._replace(value=found.value - self.margin)

    def free_at(self, name: str, activations: ArrayLike | None) -> Array:
        """One activation (bundles,), or that at rest, that is within the bounds and free."""
        box, rest = self.box, self.box.clip(np.zeros(self.box.bundles))
        gamma = box.check(np.atleast_2d(np.asarray(rest if activations is None else activations)))
        if len(gamma) != 1 or (box.excess(gamma) > _ROUNDING).any():
            allowed = f"{box.bundles} numbers between {box.low.tolist()} and {box.high.tolist()}"
            raise InvalidInput(name, activations, allowed)
        value, which, _ = self.at(box.clip(gamma))
        if not value[0] > self.error:
            least = f"{self.margin + value[0]:.2g} m to {self.clearance.names[which[0]]}"
            wanted = f" and must exceed {self.margin:.2g} m" if self.margin else ""
            raise NotPossible(f"at {name} the arm is not free: its clearance is {least}{wanted}")
        return box.clip(gamma)[0]

    @lazy
    def _rates(self) -> tuple[Array, Array]:
        """v of a unit of each activation of the rod [m], with what the arm swells by, (bundle,).

        And the part of the gap at which parts of the arm begin to count that such a unit closes at
        most. A turn between two parts has the shorter arc to one of both as its lever.
        """
        rod: Any = self.clearance.tip_map.rod
        rule, arm, (low, high) = rod.rule, rod.arm, np.array(rod.arm.bounds).T
        edges = rule.edges(max(_STEPS, rod.steps))
        measure, z, eta, curvature = (x.reshape(-1, *x.shape[2:]) for x in rule.nodes(edges))
        weight = _SAFETY * measure * np.tile(WEIGHTS, len(edges) - 1)
        least, most = 1.0 + _least(z, low, high), 1.0 - _least(-z, low, high)
        bend, poisson = np.linalg.norm(curvature, axis=1), self.clearance.poisson
        sharpest = bend @ np.maximum(np.abs(low), np.abs(high))
        turn = (1.0 - _least(-eta, low, high))[:, None] * bend + np.abs(eta) * sharpest[:, None]
        turn, stretch = turn * weight[:, None], np.abs(z) * weight[:, None]
        along = np.cumsum(weight * most)
        point = self.clearance.whole.point
        tool = 0.0 if point is None else float(np.linalg.norm(point.offset))
        speed = (stretch + turn * (along[-1] - along + weight * most + tool)[:, None]).sum(axis=0)
        wide = arm.widest(arm.profile.station(np.repeat(0.5 * (edges[1:] + edges[:-1]), 3)))
        swells = poisson * np.abs(z) / least[:, None]
        speed += 2.0 * (swells * (wide * least**-poisson)[:, None]).max(axis=0)
        middle = (along - 0.5 * weight * most)[:, None]
        turned, levers = np.cumsum(turn, axis=0), np.cumsum(turn * middle, axis=0)
        half = np.searchsorted(along, 0.5 * along)
        closing = along[:, None] * (turned - turned[half]) + 2.0 * levers[half] - levers
        closing += np.cumsum(stretch, axis=0)
        thin = np.minimum.accumulate(wide * most**-poisson)
        return speed, (closing / thin[:, None]).max(axis=0) + 3.0 * swells.max(axis=0)

    def largest(self, delta: Array) -> tuple[Array, Array]:
        """No point moves farther for changes of activation (n, bundles) [m], shape (n,).

        And no gap between parts of the arm closes by more of that at which they begin to count.
        """
        driving, inner = self.clearance.tip_map.inputs.driving, np.abs(delta)
        inner = inner if driving is None else inner @ np.abs(driving.gains).T
        return inner @ self._rates[0], inner @ self._rates[1]

    def check(
        self, begin: Array, end: Array, *, shortest: float, known: Any = None
    ) -> tuple[Index, Index, Array, Array]:
        """Check straight motions between activations (n, bundles), down to the shortest share.

        Clearances of both ends, (2, n), may be known. The outcomes (n,); then the number of the
        motion, the share of it and the clearance of each configuration looked at, in order, (k,).
        """
        delta, n = end - begin, len(begin)
        speed, closing = self.largest(delta)
        a, b = (self.at(begin).value, self.at(end).value) if known is None else known
        outcome = np.full(n, CLEAR)
        pieces: Any = np.arange(n), np.zeros(n), np.ones(n), a, b
        looked_at: list[Any] = [(pieces[0], pieces[1], a), (pieces[0], pieces[2], b)]
        while len(pieces[0]):
            which, low, high, a, b = pieces
            with np.errstate(divide="ignore", invalid="ignore"):
                rooms = [(x - self.error) / speed[which] for x in (a, b)]
                reach = np.minimum(rooms, 1.0 / closing[which]).sum(axis=0)
            worst, clear = np.minimum(a, b), reach > high - low
            unsure = (worst <= self.error) | (~clear & (high - low <= shortest))
            state = np.select([~(worst > 0.0), unsure], [TOUCHES, UNDECIDED], CLEAR)
            np.maximum.at(outcome, which, state)
            left = ~clear & (outcome[which] == CLEAR)
            which, low, high, a, b = (x[left] for x in pieces)
            middle = 0.5 * (low + high)
            c = self.at(begin[which] + middle[:, None] * delta[which]).value
            looked_at.append((which, middle, c))
            halves = (which, which), (low, middle), (middle, high), (a, c), (c, b)
            pieces = [np.concatenate(each) for each in halves]
        which, share, value = (np.concatenate(each) for each in zip(*looked_at, strict=True))
        order = np.lexsort((share, which))
        return outcome, which[order], share[order], value[order]


def _least(factors: Array, low: Array, high: Array) -> Array:
    return np.minimum(factors * low, factors * high).sum(axis=1)


free_motions = lru_cache(maxsize=8)(FreeMotions)  # kept for the next call


class FreeGraph:
    """Activations, and links between those that clear motions connect.

    Links with most room are checked first, until they connect all that they can.
    """

    def __init__(self, motions: FreeMotions, gamma: Array, pairs: Index) -> None:
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
            (a, b), known = gamma[chosen.T], self.clearance[chosen.T]
            found = motions.check(a, b, shortest=_SHORTEST, known=known)[0]
            self.links = np.concatenate([self.links, chosen[found == CLEAR]])
            self._maybe = np.concatenate([self._maybe, chosen[found == UNDECIDED]])
            part = components(self.links, len(gamma))
            left = left[part[left[:, 0]] != part[left[:, 1]]]
            some = len(left) // 2 + 1

    def near(self, gamma: Array) -> Index:
        """Nodes beside an activation (bundles,) to which motions from there are clear."""
        apart = self.motions.box.to_cube(self.gamma) - self.motions.box.to_cube(gamma)
        away = np.where(self.is_free, (apart**2).sum(axis=1), np.inf)
        nodes = np.argsort(away)[:_NEAR]
        ends = np.tile(gamma, (len(nodes), 1)), self.gamma[nodes]
        return nodes[self.motions.check(*ends, shortest=_SHORTEST_TO_NODES)[0] == CLEAR]

    def connected(self, gamma: Array) -> tuple[Mask, Mask]:
        """Masks of nodes that are connected with an activation, and of free ones that may be."""
        near, every = self.near(gamma), np.concatenate([self.links, self._maybe])
        parts = components(self.links, len(self.gamma)), components(every, len(self.gamma))
        sure, maybe = (np.isin(part, part[near]) for part in parts)
        return sure, maybe & self.is_free


@lru_cache(maxsize=2)
def free_grid(motions: FreeMotions, cells: int) -> FreeGraph:
    """The middles of so many cells along each free bundle, the last of which varies fastest."""
    sizes = (cells,) * motions.box.dimension
    check_memory("cells", f"{cells ** len(sizes):,}", _BYTES * cells ** len(sizes))
    places = (np.indices(sizes).reshape(len(sizes), -1).T + 0.5) / cells
    pairs = [np.stack(edges_along(sizes, axis), axis=1) for axis in range(len(sizes))]
    return FreeGraph(motions, motions.box.from_free_cube(places), np.concatenate(pairs))


def free_set(arm: Manipulator | TipMap, *, cells: int = 64) -> xr.Dataset:
    """The parts of the reachable set that an arm gets to with and without touching anything.

    The activation box of three free bundles is cut into n³ cells, which are free where the arm
    touches nothing at their middles. Free neighbors are connected where the motion between them is
    certified, and what is connected with rest is reached. Errors are what half as many cells along
    each bundle change, and what comes too near to be certified.

    Args:
        arm: The design with its `surroundings`, or its tip map; without loads.
        cells: Cells n along each bundle, rounded to an even number. The work grows as n³.

    Returns:
        Dataset of volumes [m³] that add up to that of the reachable set, with errors: `reached` by
        free motions; `walled_off`, where the arm is free but gets through a wall alone; `blocked`,
        which it reaches in contact. `state` (x, y, z) has them as 1, 2, 3; 0 is out of reach.

    Raises:
        InvalidInput: A number of cells out of range.
        NotPossible: There are not three free bundles, or the arm touches something at rest, has
            loads, or tendons that are driven by length.
    """
    half, motions = as_integer("cells", cells, 8, _MOST_CELLS) // 2, free_motions(as_tip_map(arm))
    if motions.box.dimension != 3:
        raise NotPossible("a free set is known of three free bundles: see compute_cloud for others")
    rest = motions.free_at("rest", None)
    grid = LiftedGrid.of(motions.clearance.whole, 2 * half)
    lattice = Lattice.around(grid.tips, float(np.cbrt(np.ptp(grid.tips, axis=0).prod())) / _ALONG)
    return _dataset(*(_images(motions, rest, each, lattice) for each in (grid, grid.coarser())))


def _images(motions: FreeMotions, rest: Array, grid: LiftedGrid, lattice: Lattice) -> list[Image]:
    """Images of the cells that are reached, that may be, that are free, and of all."""
    graph = free_grid(motions, grid.n)
    masks = (each.reshape((grid.n,) * 3) for each in (*graph.connected(rest), graph.is_free))
    some = [replace(grid, is_lifted=~mask, finer=None) for mask in masks]
    return [image_of(each, lattice) for each in (*some, grid)]


def _dataset(fine: list[Image], coarse: list[Image]) -> xr.Dataset:
    import xarray as xr

    sizes = np.array([[covered_volume(x).value for x in images] for images in (fine, coarse)])
    parts = np.diff(sizes[:, [0, 2, 3]], axis=1, prepend=0.0)
    errors = np.abs(parts[0] - parts[1]) + (sizes[0, 1] - sizes[0, 0]) * np.array([1, 1, 0])
    variables: dict[str, Any] = {}
    for name, value, error in zip(
        ("reached", "walled_off", "blocked"), parts[0], errors, strict=True
    ):
        variables |= over((), "m3", **{name: value, f"{name}_error": error})
    reached, _, free, every = (image.counts[0] > 0 for image in fine)
    state = np.select([reached, free, every], [1, 2, 3]).astype(np.int8)
    variables["state"] = tuple("xyz"), state, {"units": "1"}
    tip_map, lattice = fine[0].grid.tip_map, fine[0].lattice
    attrs = provenance(tip_map.arm, tip_map.frame) | {"activation_grid": fine[0].grid.n}
    return xr.Dataset(variables, lattice.centers(), attrs | {"cell": lattice.cell})
