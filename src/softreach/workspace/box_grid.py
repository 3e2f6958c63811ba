"""Grids of the activation box, and integrals over it, asked of a tip map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softreach.errors import InvalidInput
from softreach.kernels.contour import stretches
from softreach.rod.tip_map import TipMap

__all__ = ["every_second", "grid_stretches", "grid_tips", "image_measure"]

Array = NDArray[np.float64]

_TOL = 1e-9  # far fewer evaluations than on the grids: their steps may be short
_DIFFERENCES = 200.0  # over n², more than differences on n cells err by, of the largest det J


def grid_tips(rod: TipMap, cells: int) -> Array:
    """Tips [m] of the grid of cells^m boxes over the free bundles, in C order.

    Returns:
        Shape ((cells + 1)^m, 3), the last free bundle varying fastest.
    """
    ticks = [np.linspace(0.0, 1.0, cells + 1)] * rod.box.dimension
    tips = rod.tips(rod.box.from_free_cube(_product(ticks)))
    if rod.supports_unstable and not np.isfinite(tips).all():
        lost = f"{int(np.isnan(tips[:, 0]).sum())} of {len(tips)} activations have no equilibrium"
        raise InvalidInput("loads", lost, "such that every activation has one", "lighten the load")
    return tips


def grid_stretches(rod: TipMap, tips: Array, cells: int) -> Array:
    """det J of three free bundles at the vertices of a grid, up to a positive factor.

    From differences of the tips, and where these might have the wrong sign by J itself.

    Returns:
        Shape ((cells + 1)³,).
    """
    found = stretches(tips, np.array([cells] * 3))
    found *= cells**3 / (8.0 * rod.box.volume)
    small = np.flatnonzero(np.abs(found) <= _DIFFERENCES / cells**2 * np.abs(found).max())
    places = np.stack(np.unravel_index(small, (cells + 1,) * 3), axis=1) / cells
    found[small] = _stretch(rod, rod.box.from_free_cube(places))
    return found


def every_second(values: Array, cells: int, m: int) -> Array:
    """Values at the vertices of the grid of half as many cells."""
    fields = values.shape[1:]
    every = values.reshape(*(cells + 1,) * m, *fields)[(slice(None, None, 2),) * m]
    return np.ascontiguousarray(every).reshape(-1, *fields)


def image_measure(rod: TipMap, nodes: int) -> float:
    """Length, area or signed volume of the image, ∫ √det(JᵀJ) dγ or ∫ det J dγ; for m <= 3.

    By Gauss and Legendre's rule, as the map is smooth: its error falls faster than any power of the
    number of nodes. Places reached more than once count as often.

    Args:
        rod: The tip map, with m <= 3 free bundles.
        nodes: Nodes along each axis of the box.

    Returns:
        Length [m], area [m²] or signed volume [m³] for one, two or three free bundles.
    """
    x, w = np.polynomial.legendre.leggauss(nodes)
    m = rod.box.dimension
    gamma = rod.box.from_free_cube(_product([(1.0 + x) / 2.0] * m))
    weights = np.prod(_product([w / 2.0] * m), axis=1) * rod.box.volume
    # Not a BLAS product, whose rounding would depend on its threads.
    return float((weights * _stretch(rod.refined(_TOL), gamma)).sum())


def _stretch(rod: TipMap, gamma: Array) -> Array:
    """The change of measure of the map at each activation: det J where J is square."""
    slopes = rod.tips_and_slopes(gamma)[1][:, :, rod.box.free]
    if rod.box.dimension == 3:
        return np.linalg.det(slopes)
    return np.sqrt(np.linalg.det(np.swapaxes(slopes, 1, 2) @ slopes).clip(0.0))


def _product(ticks: list[Array]) -> Array:
    """All combinations of the values, the last varying fastest, shape (n, len(ticks))."""
    if not ticks:
        return np.zeros((1, 0))
    return np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, len(ticks))
