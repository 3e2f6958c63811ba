"""Grids of the activation box, and integrals over it, asked of a tip map."""

from __future__ import annotations

import numpy as np

from softreach.kernels.image.contour import stretches
from softreach.rod.rods import refined
from softreach.rod.tip_map import TipMap, no_stable_equilibrium
from softreach.support.arrays import Array, Mask
from softreach.support.parallel import blocks
from softreach.support.progress import Progress, silent

_BLOCK = 1 << 16  # vertices
_TOL = 1e-9  # far fewer evaluations than on the grids: their steps may be short
_NEARLY_ALL = 0.9
_DIFFERENCES = 200.0  # over n², more than differences on n cells err by, of the largest det J


def grid_ticks(tip_map: TipMap, cells: int) -> list[Array]:
    """Ticks of a grid along each free bundle in the unit cube, kinks of the map among them.

    Args:
        tip_map: The tip map.
        cells: Along each axis, a multiple of four; so are those between kinks.
    """
    box, ticks = tip_map.box, list[Array]()
    for k in box.free:
        places = np.unique((tip_map.kinks[k] - box.low[k]) / box.widths[k])
        knots = np.array([0.0, *places[(places > 1e-6) & (places < 1.0 - 1e-6)], 1.0])
        counts = 4 * np.maximum(np.rint(np.diff(knots) * cells / 4).astype(int), 1)
        counts[counts.argmax()] += cells - counts.sum()
        ticks.append(np.interp(np.arange(cells + 1), np.cumsum([0, *counts]), knots))
    return ticks


def grid_tips(
    tip_map: TipMap, cells: int, progress: Progress = silent, ticks: list[Array] | None = None
) -> Array:
    """Tips [m] of the grid of cells^m boxes over the free bundles, in C order.

    Args:
        tip_map: The tip map.
        cells: Along each axis.
        progress: Called with 0 now and then, so that it can raise.
        ticks: Along each axis, if they are not even.

    Returns:
        Shape ((cells + 1)^m, 3), the last free bundle varying fastest; NaN where there is no stable
        equilibrium.

    Raises:
        InvalidInput: There is none anywhere.
    """
    even = [np.linspace(0.0, 1.0, cells + 1)] * tip_map.box.dimension
    places = _product(ticks or even)
    tips = np.empty((len(places), 3))
    for rows in blocks(len(places), _BLOCK):
        tips[rows] = tip_map.tips(tip_map.box.from_free_cube(places[rows]))
        progress(0)
    if tip_map.supports_unstable and np.isnan(tips[:, 0]).all():
        raise no_stable_equilibrium(len(tips))
    return tips


def grid_stretches(tip_map: TipMap, tips: Array, cells: int, is_lifted: Mask) -> Array:
    """det J of three free bundles at the vertices of a grid, for tips in m per unit of activation.

    From differences of the tips, and by J itself where these might have the wrong sign, and
    everywhere if the map has kinks.

    Args:
        tip_map: The tip map.
        tips: Of the vertices [m].
        cells: Number of cells along each axis.
        is_lifted: Cells that are not mapped by their vertices, shape (cells, cells, cells).

    Returns:
        Shape ((cells + 1)³,); 0 at vertices of no other cells.
    """
    used = corners_of(~is_lifted).ravel()
    determinants = np.where(used, stretches(tips, np.array([cells] * 3)), 0.0)
    determinants *= cells**3 / (8.0 * tip_map.box.volume)
    share = _NEARLY_ALL if tip_map.supports_unstable else 1.0  # |det J| grows toward instability
    largest = float(np.quantile(np.abs(determinants[used]), share)) if used.any() else 0.0
    unsure = np.abs(determinants) <= _DIFFERENCES / cells**2 * largest
    small = np.flatnonzero((unsure | (not tip_map.is_smooth)) & used)
    places = np.stack(np.unravel_index(small, (cells + 1,) * 3), axis=1) / cells
    determinants[small] = _stretch(tip_map, tip_map.box.from_free_cube(places))
    determinants[~np.isfinite(determinants)] = 0.0
    return determinants


def cube_grid(cells: int, m: int = 3) -> Array:
    """Vertices of a grid of cells^m boxes over the unit cube, in C order, shape (n, m)."""
    return np.indices((cells + 1,) * m).reshape(m, -1).T / cells


def corners_of(cells: Mask) -> Mask:
    """Vertices of a grid that are corners of some of its cells."""
    for axis in range(cells.ndim):
        none = np.zeros_like(np.take(cells, [0], axis))
        cells = np.concatenate([cells, none], axis) | np.concatenate([none, cells], axis)
    return cells


def image_measure(tip_map: TipMap, nodes: int) -> float:
    """Length or area of the image of one or two free bundles, ∫ √det(JᵀJ) dγ.

    By Gauss and Legendre's rule, as the map is smooth: its error falls faster than any power of the
    number of nodes. Places reached more than once count as often.

    Args:
        tip_map: The tip map, with one or two free bundles.
        nodes: Nodes along each axis of the box.

    Returns:
        Length [m] or area [m²]; NaN if a node has no stable equilibrium.
    """
    x, w = np.polynomial.legendre.leggauss(nodes)
    m = tip_map.box.dimension
    gamma = tip_map.box.from_free_cube(_product([(1.0 + x) / 2.0] * m))
    weights = np.prod(_product([w / 2.0] * m), axis=1) * tip_map.box.volume
    # Not a BLAS product, whose rounding would depend on its threads.
    return float((weights * _stretch(refined(tip_map, _TOL), gamma)).sum())


def _stretch(tip_map: TipMap, gamma: Array) -> Array:
    """The change of measure of the map at each activation: det J where J is square."""
    slopes = tip_map.tips_and_slopes(gamma)[1][:, :, tip_map.box.free]
    with np.errstate(invalid="ignore"):  # NaN where there is no stable equilibrium
        if tip_map.box.dimension == 3:
            return np.linalg.det(slopes)
        return np.sqrt(np.linalg.det(np.swapaxes(slopes, 1, 2) @ slopes).clip(0.0))


def _product(ticks: list[Array]) -> Array:
    """All combinations of the values, the last varying fastest, shape (n, len(ticks))."""
    if not ticks:
        return np.zeros((1, 0))
    return np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, len(ticks))
