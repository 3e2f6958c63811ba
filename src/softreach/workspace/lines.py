"""Volume from the lengths of lines of sight through cell centers, and how sure it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.workspace.crossings import Crossings

__all__ = ["Runs", "length_sum", "line_volume", "runs_along"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class Runs(NamedTuple):
    """Stretches of lines of sight that are reached, line by line, upwards; in cells."""

    line: Ints
    """Which line, (i, j) as i · width + j over the other two axes, shape (n,)."""
    first: Ints
    """Number of the first center, shape (n,)."""
    last: Ints
    """Number of the last center, shape (n,)."""
    start: Array
    """Where it begins, before its first center, shape (n,)."""
    end: Array
    """Where it ends, behind its last center, shape (n,)."""
    width: int
    """Number of lines along the last of the other two axes."""


def runs_along(crossings: Crossings, axis: int) -> Runs:
    """All runs along an axis."""
    edges, shape = crossings.edges, crossings.lattice.shape
    others = [a for a in range(3) if a != axis]
    ends = []
    for sense in (-1, 1):
        which = np.flatnonzero((edges.axis == axis) & (edges.sense == sense))
        index = np.unravel_index(edges.cell[which], shape)
        line = index[others[0]] * shape[others[1]] + index[others[1]]
        order = np.lexsort((index[axis], line))
        center = index[axis][order]
        ends.append((line[order], center, center + sense * crossings.place[which[order]]))
    (line, first, start), (_, last, end) = ends
    return Runs(line, first, last, start, end, shape[others[1]])


def length_sum(runs: Runs, spacing: int = 1, parity: int = 0) -> Array:
    """Length of what is reached on each line that has a run, in cells, from some of the centers.

    A stretch shorter than the spacing s holds a center with a chance of length / s only: counted as
    s where it does, it is right on average over where the centers lie. So are gaps.

    Args:
        runs: Stretches between crossings.
        spacing: Every how many centers are looked at.
        parity: Which of them comes first.

    Returns:
        Shape (runs,): what each run adds to its line.
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


class LineVolume(NamedTuple):
    """A volume and its noise."""

    value: float
    """Volume [m³]."""
    noise: float
    """How far off it may be for where the lines happen to lie [m³]."""


def line_volume(crossings: Crossings) -> LineVolume:
    """Volume from the lines along all three axes; each axis counts by the square of its lines.

    On average over where the lattice lies the sum of lengths is the volume, so that what it errs by
    is noise. Every other line along each axis, looked at on every other center, tells how much: the
    noise of twice the spacing, which at the spacing itself is no more than half of it; so
    does how far the axes are apart. Two standard deviations of both together are stated.
    """
    lattice = crossings.lattice
    axes = [runs_along(crossings, axis) for axis in range(3)]
    lines = np.array([float(len(np.unique(runs.line))) for runs in axes])
    if not lines.all():
        return LineVolume(0.0, np.inf)
    weights = lines**2 / (lines**2).sum()
    values = np.array([length_sum(runs).sum() for runs in axes])
    coarse = np.array([_sparse(runs) for runs in axes])  # (axis, 8)
    value = float(weights @ values)
    variances = np.mean((coarse - values[:, None]) ** 2, axis=1) / 4.0
    spread = float(weights @ (values - value) ** 2)
    noise = 2.0 * np.sqrt(float(weights**2 @ variances) + spread / 3.0)
    return LineVolume(value * lattice.cell**3, float(noise) * lattice.cell**3)


def _sparse(runs: Runs) -> list[float]:
    """Sums of lengths from every other line along both directions and every other center."""
    i, j = np.divmod(runs.line, runs.width)
    found = []
    for parity in range(2):
        lengths = length_sum(runs, 2, parity)
        for a in range(2):
            for b in range(2):
                found.append(4.0 * float(lengths[(i % 2 == a) & (j % 2 == b)].sum()))
    return found
