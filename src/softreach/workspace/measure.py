"""Volume that an image fills, by multiplicity, and its error."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.geometry.hull import convex_hull
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array, Index
from softreach.workspace.crossings import Crossings
from softreach.workspace.flux import signed_volume
from softreach.workspace.image import Image, Spans, covered_cubes

_LEFT = 0.35  # of what is removed; for four bundles 0.28 to 0.34 of it were found wrong
SURE_ACCURACY = 3e-3  # down from which integrals are as exact as a raster can ever use
FLUX_PART = 0.01  # of a larger accuracy: relative error of what flows through the faces
_NODES = 24  # Gauss nodes along each side of a face; two thirds of them tell the error


class Estimate(NamedTuple):
    """A number and how far off it may be."""

    value: float
    error: float


def solid_volume(
    tip_map: TipMap, fine: Image, coarse: Image, accuracy: float = SURE_ACCURACY
) -> Estimate:
    """Volume of the image of a box [m³] from grids of n and n/2 cells along each of three axes.

    With the degree d(x), the sum of the orientations of the activations that reach x,
    V = ∫ [x is reached] dx = |∫ det J dγ| + ∫ ([x is reached] - |d|) dx for an image whose larger
    part keeps (or turns) the orientation. The first integral is exact to many digits by what flows
    through the faces; the second lives only where the image folds or overlaps and is taken from
    the rasterized images. What is rasterized errs by O(1/n²), which both grids together remove. All
    that they remove is the error stated: folds that a coarse grid makes up vanish faster than that.

    Args:
        tip_map: The tip map.
        fine: Image of the grid of n cells.
        coarse: Image of that of n/2.
        accuracy: Relative error that is asked for: above 0.003, the integral may err by a hundredth
            of it.

    Returns:
        NaN if a node of the integral has no stable equilibrium.
    """
    rough = accuracy > SURE_ACCURACY
    signed = signed_volume(tip_map, None if rough else _NODES, enough=FLUX_PART * accuracy * rough)
    sense = 1 if signed.value >= 0 else -1
    at_fine, at_coarse = _correction(fine, sense), _correction(coarse, sense)
    removed = (at_fine.value - at_coarse.value) / 3.0
    value = abs(signed.value) + (at_fine.value + removed)
    return Estimate(value, signed.error + abs(removed) + at_fine.error)


def torn_volume(fine: Image, half: Image, third: Image) -> Estimate:
    """Volume of the images of several sheets [m³], where no integral over the box is known.

    As `solid_volume`, with the signed volume of the mapped tetrahedra for the integral of det J.
    Inside of sheets these err by O(1/n²), and at their edges by O(1/n), more or less by how the
    edges meet the grid. Half of what the finer grid changes is added, and all of it is the error.

    Args:
        fine: Image of the grid of n cells.
        half: Of half as many cells.
        third: Of a third of them, whose change counts by half.
    """
    sense = 1 if _signed_volume(fine) >= 0 else -1
    value, *rough = (_covered(image, sense) for image in (fine, half, third))
    changes = [(value.value - each.value) / k for k, each in enumerate(rough, 1)]
    change = max(changes, key=abs)
    return Estimate(value.value + 0.5 * change, abs(change) + value.error)


def multiply_covered(fine: Image, coarse: Image) -> tuple[dict[int, float], float]:
    """Volume of the places that a given number of activations, 2 or more, reach [m³].

    A number whose volume is below the error, or changes by more than itself on half as fine a
    grid, is not a finding but the roughness of a fold: such places count with the next smaller.

    Args:
        fine: Of n cells along each axis.
        coarse: Of half as many.

    Returns:
        The volumes, and by how much their sum changes on half as fine a grid.
    """

    def by_cover(spans: Spans) -> ArrayLike:
        return np.bincount(spans.cover, spans.length)

    covers = [_mean(image, by_cover) for image in (fine, coarse)]
    size = max(*(len(cover) for cover in covers), 3)
    volumes, rough = (np.pad(v, (0, size - len(v)))[2:] for v in covers)
    error = float(abs(volumes.sum() - rough.sum()))
    sure = np.maximum(np.abs(volumes - rough), error) < volumes
    sure[0] = True
    measures, unsure = {}, 0.0
    for number in range(size - 1, 1, -1):
        unsure += float(volumes[number - 2])
        if sure[number - 2] and unsure > 0.0:
            measures[number], unsure = unsure, 0.0
    return dict(sorted(measures.items())), error


def fold_volume(image: Image) -> float:
    """Volume reached with both orientations [m³]; it errs by as much as the volume itself."""
    return float(_mean(image, lambda spans: spans.length[spans.cover > np.abs(spans.degree)].sum()))


def convex_volume(fine: Image, coarse: Image) -> Estimate:
    """Volume of the convex hull of the image [m³]: from corners of critical triangles."""
    return extrapolated_hull(*(image.places[outer_vertices(image)] for image in (fine, coarse)))


def extrapolated_hull(points: Array, fewer: Array) -> Estimate:
    """Volume of the convex hull [m³] from mapped vertices, and from those of half as fine a grid.

    The hull of mapped vertices lies inside that of the image by O(1/n²), which is removed.
    """
    fine, coarse = convex_hull(points).volume, convex_hull(fewer).volume
    removed = (fine - coarse) / 3.0
    return Estimate(fine + removed, _LEFT * abs(removed))


def outer_vertices(image: Image) -> Index:
    """Numbers of the vertices of critical triangles that may be corners of the convex hull.

    A plane through such a corner leaves the image on one side, and with it at least one of the
    eight cell centers around the corner.
    """
    used = np.zeros(len(image.vertices), bool)
    used[image.triangles[:, :3]] = True
    vertices = np.flatnonzero(used)
    covered = covered_cubes(image.counts[0] > 0)
    i, j, k = np.floor(image.vertices[vertices] / image.unit).astype(int).T
    return vertices[~covered[i, j, k]]


def _correction(image: Image, sense: int) -> Estimate:
    """∫ ([x is reached] - sense · d) dx [m³], with the scatter of three directions of sight."""

    def missing(spans: Spans) -> float:
        return float((spans.length * ((spans.cover > 0) - sense * spans.degree)).sum())

    values = [missing(spans) for spans in image.spans]
    scale = image.lattice.cell**3
    return Estimate(scale * float(np.mean(values)), scale * float(np.ptp(values)))


def _covered(image: Image, sense: int) -> Estimate:
    """∫ [x is reached] dx [m³], with the scatter of three directions of sight."""
    again = _correction(image, sense)
    return Estimate(sense * _signed_volume(image) + again.value, again.error)


def _signed_volume(image: Image) -> float:
    """Volume of the mapped tetrahedra that keep the orientation less that of the others [m³].

    By the divergence theorem: the degree changes at critical triangles only.
    """
    if not len(image.triangles):
        return 0.0
    corners = image.vertices[image.triangles[:, :3]] / image.unit
    a, b, c = np.moveaxis(corners - corners.mean(axis=(0, 1)), 1, 0)
    flux = np.einsum("ti,ti->t", a, np.cross(b, c)) * image.triangles[:, 4]
    return -float(flux.sum()) / 6.0 * image.lattice.cell**3


def _mean(image: Image, quantity: Callable[[Spans], ArrayLike]) -> Array:
    """Mean over the three directions of sight, in m³; shorter arrays are filled with zeros."""
    rows = [np.atleast_1d(quantity(spans)) for spans in image.spans]
    size = max(len(row) for row in rows)
    mean = sum(np.pad(row, (0, size - len(row))) for row in rows) / 3.0
    return np.squeeze(mean * image.lattice.cell**3)


class Runs(NamedTuple):
    """Stretches of lines of sight that are reached, line by line, upwards; in cells."""

    line: Index
    """Index of the line, (i, j) as i · width + j over the other two axes, shape (n,)."""
    first: Index
    """Number of the first center, shape (n,)."""
    last: Index
    """Number of the last center, shape (n,)."""
    start: Array
    """Beginning of the run, before its first center, shape (n,)."""
    end: Array
    """End of the run, behind its last center, shape (n,)."""
    width: int
    """Number of lines along the last of the other two axes."""


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
    """Length of what is reached on each line that has a run, in cells, from some of the centers.

    A stretch shorter than the spacing s holds a center with a chance of length / s only: counted as
    s where it does, it is right on average over where the centers lie. So are gaps.

    Args:
        runs: Stretches between crossings.
        spacing: Every how many centers are looked at.
        parity: Number of the first of them.

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


def line_volume(crossings: Crossings) -> Estimate:
    """Volume from the lines along all three axes [m³]; each counts by the square of its lines.

    On average over where the lattice lies the sum of lengths is the volume, so that what it errs by
    is noise. Every other line along each axis, looked at on every other center, tells how much: the
    noise of twice the spacing, which at the spacing itself is no more than half of it; so
    does how far the axes are apart. Two standard deviations of both together are stated.
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
    sums = (length_sum(runs, 2, parity) for parity in range(2))
    return (
        4.0 * np.array([np.bincount(2 * (i % 2) + j % 2, each, 4) for each in sums], float).ravel()
    )
