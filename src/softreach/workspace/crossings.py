"""Places where the boundary cuts the edges between cell centers, by search from both sides."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array, Index, Mask
from softreach.workspace.image import Lattice
from softreach.workspace.measure import Estimate
from softreach.workspace.search import ENOUGH, Nearest, ReachedGrid, nearest_tips

_PROBE = 0.01  # cells: how closely crossings are enclosed
_ROUNDS = 24
_SWEEPS = 3
_BEYOND = 0.05  # cells by which a sweep looks beyond a crossing
_APART = 0.05  # ranges: activations nearer to each other lead to the same end
_STEEP = 0.02  # cosine below which the tangent plane does not tell where it is cut


@dataclass
class Crossings:
    """Distances from reached centers at which the boundary cuts the edges, enclosed ever closer.

    Places up to `low` are reached, as `gamma` proves at `low`; none was found at `high`, where the
    plane through the nearest tip, `beyond`, says at which place between them the boundary is cut.
    """

    tip_map: TipMap
    lattice: Lattice
    cell: Index  # the center that is reached, as a flat index, (n,)
    axis: Index  # along which axis the center that is not lies, (n,)
    sense: Index  # on which side, 1 or -1, (n,)
    low: Array  # in cells from the reached center, (n,)
    high: Array
    gamma: Array  # activations that reach `low`, (n, bundles)
    beyond: Array  # activations whose tips are nearest to `high`, (n, bundles)
    place: Array  # place where the plane of that tip cuts the edge, between `low` and `high`, (n,)

    @classmethod
    def of(cls, grid: ReachedGrid) -> Crossings:
        """The crossings of all edges at the boundary of what was reached."""
        reached, parts = grid.reached, []
        flat = np.arange(reached.size).reshape(reached.shape)
        for k in range(3):
            before, after = np.moveaxis(reached, k, 0)[:-1], np.moveaxis(reached, k, 0)[1:]
            cells = np.moveaxis(flat, k, 0)
            leaving, entering = cells[:-1][before & ~after], cells[1:][after & ~before]
            for side, places in ((1, leaving), (-1, entering)):
                parts.append((places, np.full(len(places), k), np.full(len(places), side)))
        cell, axis, sense = (np.concatenate(column) for column in zip(*parts, strict=True))
        every, low, high = np.arange(len(cell)), np.zeros(len(cell)), np.ones(len(cell))
        gamma, beyond = grid.gamma[cell], grid.gamma[cell + sense * grid.steps[axis]]
        edges = cell, axis, sense, low, high, gamma, beyond
        crossings = cls(grid.tip_map, grid.lattice, *edges, place=low.copy())
        crossings._cut(every, grid.tip_map.tips(beyond))
        crossings._enclose(every)
        return crossings

    def coordinates(self, which: Index, t: Array) -> Array:
        """Places on edges, t cells from the reached center, in cells, shape (n, 3)."""
        at = np.stack(np.unravel_index(self.cell[which], self.lattice.shape), axis=-1).astype(float)
        at[np.arange(len(which)), self.axis[which]] += self.sense[which] * t
        return at

    def points(self, which: Index, t: Array) -> Array:
        """The same [m]."""
        return self.lattice.places(self.coordinates(which, t))

    def _enclose(self, which: Index) -> None:
        """Bring `low` and `high` together on some of the edges."""
        guess = np.ones(len(which), bool)  # whether to trust the tangent plane
        for _ in range(_ROUNDS):
            wide = self.high[which] - self.low[which] > 1.5 * _PROBE
            which, guess = which[wide], guess[wide]
            if not len(which):
                return
            low, high, place = self.low[which], self.high[which], self.place[which]
            probe = np.minimum(low + _PROBE, 0.5 * (low + high))
            tangent = np.clip(place, low + 0.5 * _PROBE, high - 0.1 * _PROBE)
            t = np.where(guess & (place > low + 0.5 * _PROBE), tangent, probe)
            probed = t == probe
            start = np.where(probed[:, None], self.gamma[which], self.beyond[which])
            reached, nearest = self._search(which, t, start)
            no = which[~reached]
            self.high[no], self.beyond[no] = t[~reached], nearest.gamma[~reached]
            self._cut(no, nearest.tips[~reached])
            # A probe that is reached: the plane lied, and halving follows.
            lied = reached & probed
            self.place[which[lied]] = 0.5 * (self.low[which[lied]] + self.high[which[lied]])
            guess = ~reached | lied

    def _search(self, which: Index, t: Array, start: Array) -> tuple[Mask, Nearest]:
        """Search for places on edges, and keep those that are reached; which these are."""
        enough = ENOUGH * self.lattice.cell
        nearest = nearest_tips(self.tip_map, start, self.points(which, t), enough)
        reached = nearest.distance <= enough
        self.low[which[reached]] = t[reached]
        self.gamma[which[reached]] = nearest.gamma[reached]
        return reached, nearest

    def _cut(self, which: Index, tips: Array) -> None:
        """Cut the edges by the planes through the tips nearest to `high`, square to the way."""
        away = (self.points(which, self.high[which]) - tips) / self.lattice.cell
        distance = np.linalg.norm(away, axis=1).clip(1e-12)
        along = away[np.arange(len(which)), self.axis[which]] * self.sense[which] / distance
        low, high = self.low[which], self.high[which]
        back = np.where(along > _STEEP, distance / along.clip(_STEEP), 0.5 * (high - low))
        self.place[which] = np.clip(high - back, low, high)

    def advance(self, which: Index, start: Array, by: float) -> Array:
        """Search beyond crossings from other activations; by how many cells each moved outward."""
        before = self.place[which].copy()
        reached, _ = self._search(which, np.minimum(before + by, 1.0), start)
        yes = which[reached]
        self.high[yes] = np.maximum(self.high[yes], 1.0)
        self.beyond[yes] = self.gamma[yes]
        self.place[yes] = 0.5 * (self.low[yes] + 1.0)
        self._enclose(yes)
        return self.place[which] - before


def swept_crossings(grid: ReachedGrid) -> tuple[Crossings, float]:
    """Crossings that no neighbor's activation leads beyond, and what may still be missed [m³]."""
    from scipy.spatial import KDTree

    crossings = Crossings.of(grid)
    volume = grid.lattice.cell**3 / 3.0  # three axes see the volume, each by itself
    gain = 0.0
    for sweep in range(1, _SWEEPS + 1):
        count = len(crossings.cell)
        if count <= sweep:
            return crossings, 0.0
        places = crossings.points(np.arange(count), crossings.place)
        others = np.asarray(KDTree(places).query(places, k=sweep + 1)[1])[:, sweep]
        apart = np.abs(crossings.gamma[others] - crossings.gamma) / grid.tip_map.box.scales
        which = np.flatnonzero((apart > _APART).any(axis=1))
        moved = crossings.advance(which, crossings.gamma[others[which]], _BEYOND)
        gain = float(moved.clip(0.0).sum()) * volume
        beyond = np.flatnonzero(crossings.low >= 1.0)
        if len(beyond):
            grid.add(crossings.gamma[beyond], crossings.points(beyond, crossings.low[beyond]))
            crossings = Crossings.of(grid)
    return crossings, gain


class Runs(NamedTuple):
    """Stretches of lines of sight that are reached, line by line, upwards; in cells."""

    line: Index  # index of the line, (i, j) as i · width + j over the other two axes, (n,)
    first: Index  # number of the first center, (n,)
    last: Index  # number of the last center, (n,)
    start: Array  # beginning of the run, before its first center, (n,)
    end: Array  # end of the run, behind its last center, (n,)
    width: int  # number of lines along the last of the other two axes


def runs_along(crossings: Crossings, axis: int) -> Runs:
    """All runs along an axis."""
    shape = crossings.lattice.shape
    others = [a for a in range(3) if a != axis]
    ends = []
    for sense in (-1, 1):
        which = np.flatnonzero((crossings.axis == axis) & (crossings.sense == sense))
        index = np.unravel_index(crossings.cell[which], shape)
        line = index[others[0]] * shape[others[1]] + index[others[1]]
        order = np.lexsort((index[axis], line))
        center = index[axis][order]
        ends.append((line[order], center, center + sense * crossings.place[which[order]]))
    (line, first, start), (_, last, end) = ends
    return Runs(line, first, last, start, end, shape[others[1]])


def length_sum(runs: Runs, spacing: int = 1, parity: int = 0) -> Array:
    """What each run adds to the length that is reached on its line, in cells, shape (runs,).

    Every so many centers are looked at, from number `parity` on. A stretch or a gap shorter than
    the spacing s holds one with a chance of length / s only: counted as s, it is right on average.
    """
    length = np.maximum(runs.end - runs.start, 0.0)
    seen = (runs.last - parity) // spacing * spacing + parity >= runs.first
    total = np.where(seen, np.maximum(length, spacing), 0.0)
    follows = (np.diff(runs.line) == 0) & seen[1:] & seen[:-1]
    gap = runs.start[1:] - runs.end[:-1]
    open_ = (runs.first[1:] - 1 - parity) // spacing * spacing + parity > runs.last[:-1]
    change = np.where(open_, gap - np.maximum(gap, spacing), gap)
    total[1:] += np.where(follows, change, 0.0)
    return total


def line_volume(crossings: Crossings) -> Estimate:
    """Volume from the lines along all three axes [m³]; each counts by the square of its lines.

    Its error is noise by where the lattice lies: half of what every other line on every other
    center tells of each axis, and how far the axes are apart; two standard deviations of both.
    """
    lattice = crossings.lattice
    axes = [runs_along(crossings, axis) for axis in range(3)]
    lines = np.array([float(len(np.unique(runs.line))) for runs in axes])
    if not lines.all():
        return Estimate(0.0, np.inf)
    weights = lines**2 / (lines**2).sum()
    values = np.array([length_sum(runs).sum() for runs in axes])
    coarse = np.array([_sparse(runs) for runs in axes])  # (axis, 8)
    value = float(weights @ values)
    variances = np.mean((coarse - values[:, None]) ** 2, axis=1) / 4.0
    spread = float(weights @ (values - value) ** 2)
    noise = 2.0 * np.sqrt(float(weights**2 @ variances) + spread / 3.0)
    return Estimate(value * lattice.cell**3, float(noise) * lattice.cell**3)


def _sparse(runs: Runs) -> Array:
    """Sums of lengths from every other line along both directions and every other center, (8,)."""
    i, j = np.divmod(runs.line, runs.width)
    group, sums = 2 * (i % 2) + j % 2, (length_sum(runs, 2, parity) for parity in range(2))
    return 4.0 * np.array([np.bincount(group, each, 4) for each in sums], float).ravel()
