"""Polynomials of the tip that recover three activations: they prove a map to be one to one.

Theory (100): if g(r(x)) grows with x from every place of a convex box toward every other, no two of
them lead to the same tip, whatever g is. A polynomial g is fitted by least squares; only the growth
that it then has is believed.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.support.arrays import Array
from softreach.workspace.grid import least_in_cells, second_differences

_LEAST = 0.2  # growth, of 1, that must be left: slopes between the samples are not known
_DEGREE = 5
_FITTED = 4  # cells along each axis that tell the coefficients
_RIDGE = 1e-12  # of the mean square of a monomial: flat images leave some of them undetermined


def recovers(tips: Array, slopes: Array) -> bool:
    """True if a polynomial of the tip is found that grows with the activations everywhere.

    Its growth between the vertices is bounded by second differences.

    Args:
        tips: At a grid of n cells along each axis of the unit cube [m], shape ((n + 1)³, 3).
        slopes: ∂r/∂x there [m], shape (n + 1, n + 1, n + 1, 3, 3); n a power of two.
    """
    grid = slopes.shape[:3]
    growth = monomial_slopes(tips, slopes.reshape(-1, 3, 3), _DEGREE)
    # Not BLAS, whose threads would take more time than they save.
    slope = np.einsum("mi,mkn->ikn", _coefficients(growth, len(slopes) - 1), growth)
    both = np.moveaxis(0.5 * (slope + np.swapaxes(slope, 0, 1)), 2, 0)
    least = np.asarray(np.linalg.eigvalsh(both)[:, 0], float).reshape(grid)
    bound = least_in_cells(least, second_differences(both.reshape(*grid, 9)))
    return bool(bound.min() > _LEAST)


def monomial_slopes(tips: Array, slopes: Array, degree: int) -> Array:
    """Derivatives of all monomials of the tip but 1, in its bounding box, by places of the cube.

    Args:
        tips: Shape (n, 3).
        slopes: Shape (n, 3, 3).
        degree: The largest.

    Returns:
        Shape (monomials, 3, n).
    """
    low, high = tips.min(axis=0), tips.max(axis=0)
    half = 0.5 * (high - low)[:, None]
    place = (tips.T - 0.5 * (low + high)[:, None]) / half
    moved = np.moveaxis(slopes, 0, 2) / half[:, None]
    count = math.comb(degree + 3, 3)
    values, growth = np.ones((count, len(tips))), np.zeros((count, 3, len(tips)))
    done, last = 1, [(0, 0)]  # monomials of the degree before, with the first axis that may follow
    for _ in range(degree):
        made = [(number, axis) for number, first in last for axis in range(first, 3)]
        for k, (number, axis) in enumerate(made, done):
            values[k] = values[number] * place[axis]
            growth[k] = growth[number] * place[axis] + values[number] * moved[axis]
        last = [(done + k, axis) for k, (_, axis) in enumerate(made)]
        done += len(made)
    return growth[1:]


def _coefficients(growth: Array, cells: int) -> Array:
    """Of the polynomials whose slopes are nearest to 1, shape (monomials, 3)."""
    count, grid = len(growth), (cells + 1,) * 3
    every = slice(None, None, max(1, cells // _FITTED))
    some = growth.reshape(count, 3, *grid)[:, :, every, every, every].reshape(count, 3, -1)
    rows = some.reshape(count, -1)
    gram = np.einsum("an,bn->ab", rows, rows)
    gram[np.diag_indices(count)] += _RIDGE * np.trace(gram) / count
    return np.linalg.solve(gram, some.sum(axis=2))
