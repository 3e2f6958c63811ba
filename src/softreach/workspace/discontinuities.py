"""Tears in the map from activations to tips: cells that have no image of their own.

A loaded arm may lose its stable equilibrium within the activation box, or snap to another branch. A
cell of the box that holds such a place would be mapped across a gap through which no tip passes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array, Index, Mask
from softreach.workspace.image import Image

_SUSPECT = 2.5  # times the shorter neighbor; where stability ends like √x it is 2.4
_KEPT = 0.5  # of its length that a torn edge keeps, however often it is halved
_HALVINGS = 12
_NOISE = 10.0  # times the tolerance, in which tips of neighbors may differ by errors alone
_INSIDE = np.stack(np.meshgrid(*[[0.25, 0.75]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
_MOST = 20_000  # cells looked into
_TAKEN = 1.5


def left_out_cells(rod: TipMap, tips: Array, cells: int) -> Mask:
    """Cells of a grid with a corner that is not stable, or with an edge that is torn.

    An edge between stable corners is suspect if its tips are more than 2.5 times as far apart as
    those of the shorter of its neighbors on the same grid line. It is then halved, each time
    keeping the half whose tips are farther apart. However steep, a continuous map brings the tips
    together; across a jump they stay apart, by more than half of the first distance after twelve
    halvings. If a middle is not stable, the edge is torn as well. The rule has no scale of its own.
    A jump shorter than about one and a half edges of the grid is bridged until the grid is finer.

    Args:
        rod: The tip map, with m free bundles.
        tips: Stable tips of the grid [m], NaN elsewhere, in C order, shape ((cells + 1)^m, 3).
        cells: Number of cells along each axis.

    Returns:
        Shape (cells,) * m.
    """
    m = rod.box.dimension
    if not rod.supports_unstable:
        return np.zeros((cells,) * m, bool)
    field = tips.reshape(*(cells + 1,) * m, 3)
    lost: Mask = np.any(corner_values(~np.isfinite(field[..., 0])), axis=-1)
    for axis, torn in enumerate(_torn_edges(rod, field)):
        others = [other for other in range(m) if other != axis]
        lost = lost | np.any(corner_values(torn, others), axis=-1)
    return lost


def remainder(rod: TipMap, image: Image, stretches: Array, left_out: Mask) -> tuple[float, Array]:
    """Reach of cells with a stable corner that are left out, by eight places in each.

    A place counts with the |det J| of the cell's corners, the median of those that are stable, if
    it is stable and its tip lies outside the image. Where stability is lost at a fold, det J grows
    like 1/√x toward it and twice as much is swept as this tells: one and a half times is taken,
    which is right to a third of itself, and a half is stated as the error.

    Args:
        rod: The tip map, with three free bundles.
        image: Of the other cells.
        stretches: det J at the vertices of the grid, 0 where there is no stable equilibrium.
        left_out: Mask of the cells that are left out, shape (cells, cells, cells).

    Returns:
        Volume outside the image [m³], right to a half of itself, and some tips [m], shape (n, 3).
    """
    cells = left_out.shape[0]
    corners = corner_values(np.abs(stretches).reshape((cells + 1,) * 3)).reshape(-1, 8)
    cut = np.flatnonzero(left_out.ravel() & corners.any(axis=1))
    looked = cut
    if len(cut) > _MOST:
        looked = np.sort(np.random.default_rng(0).choice(cut, _MOST, replace=False))
    places = np.stack(np.unravel_index(looked, left_out.shape), axis=1)[:, None] + _INSIDE
    tips = rod.tips(rod.box.from_free_cube(places.reshape(-1, 3) / cells))
    stable = np.isfinite(tips[:, 0])
    counted = stable.copy()
    counted[stable] = image.counts_at(tips[stable]) == 0
    values = corners[looked]
    stretch = np.nanmedian(np.where(values > 0.0, values, np.nan), axis=1) if len(looked) else 0.0
    swept = float((stretch * counted.reshape(-1, 8).mean(axis=1)).sum())
    each = rod.box.volume / cells**3 * len(cut) / max(len(looked), 1)
    return _TAKEN * swept * each, tips[stable]


def corner_values(values: NDArray, axes: list[int] | None = None) -> NDArray:
    """Values at the corners of cells, on a last axis, from values at the vertices of a grid.

    Args:
        values: At the vertices.
        axes: Along which the cells extend; all by default.
    """
    corners = [values]
    for axis in range(values.ndim) if axes is None else axes:
        n = values.shape[axis]
        ends = np.arange(n - 1), np.arange(1, n)
        corners = [np.take(corner, end, axis) for corner in corners for end in ends]
    return np.stack(corners, axis=-1)


def coarser(left_out: Mask) -> Mask:
    """Cells of twice the edge of which a part is left out."""
    for axis in range(left_out.ndim):
        halves = np.moveaxis(left_out, axis, 0)
        left_out = np.moveaxis(halves[::2] | halves[1::2], 0, axis)
    return left_out


def finer(cells: Mask) -> Mask:
    """The same of cells of half the edge."""
    for axis in range(cells.ndim):
        cells = np.repeat(cells, 2, axis)
    return cells


def _torn_edges(rod: TipMap, field: Array) -> list[Mask]:
    """Edges along each axis that are torn, in the order of the grid."""
    axes = range(field.ndim - 1)
    apart = [np.linalg.norm(np.diff(field, axis=axis), axis=-1) for axis in axes]
    noise = _NOISE * rod.tol * rod.length
    suspects = [
        np.argwhere(_suspects(each, axis) & (each > noise))  # NaN where an end is not stable
        for axis, each in enumerate(apart)
    ]
    along = np.repeat(axes, [len(each) for each in suspects])
    stay = _stay_apart(rod, np.concatenate(suspects), along, field)
    torn = [np.zeros(each.shape, bool) for each in apart]
    for axis in axes:
        torn[axis][tuple(suspects[axis][stay[along == axis]].T)] = True
    return torn


def _suspects(apart: Array, axis: int) -> Mask:
    """Edges far longer than the shorter neighbor; those that have none are suspect as well."""
    rows = np.moveaxis(apart, axis, 0)
    none = np.full((1, *rows.shape[1:]), np.nan)
    neighbor = np.fmin(np.concatenate([none, rows[:-1]]), np.concatenate([rows[1:], none]))
    with np.errstate(invalid="ignore"):
        suspects = np.isfinite(rows) & ~(rows <= _SUSPECT * neighbor)
    return np.moveaxis(suspects, 0, axis)


def _stay_apart(rod: TipMap, edges: Index, along: Index, field: Array) -> Mask:
    """Mask of edges whose tips stay apart as these are halved.

    Args:
        rod: The tip map.
        edges: First vertex of each, shape (n, m).
        along: Axis of each, shape (n,).
        field: Tips of the grid [m], shape (cells + 1, ..., 3).
    """
    cells = field.shape[0] - 1
    step = np.eye(edges.shape[1], dtype=int)[along]
    low, high = edges / cells, (edges + step) / cells
    at_low, at_high = field[tuple(edges.T)], field[tuple((edges + step).T)]
    first = np.linalg.norm(at_high - at_low, axis=1)
    torn, open_ = np.zeros(len(edges), bool), np.arange(len(edges))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low[open_] + high[open_])
        tips = rod.tips(rod.box.from_free_cube(middle))
        down = np.linalg.norm(tips - at_low[open_], axis=1)
        up = np.linalg.norm(at_high[open_] - tips, axis=1)
        torn[open_[np.isnan(down)]] = True
        below = down >= up
        high[open_[below]], at_high[open_[below]] = middle[below], tips[below]
        low[open_[~below]], at_low[open_[~below]] = middle[~below], tips[~below]
        open_ = open_[np.maximum(down, up) > _KEPT * first[open_]]  # NaN is decided
    torn[open_] = True
    return torn
