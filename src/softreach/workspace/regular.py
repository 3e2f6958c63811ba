"""Windows of the box in which no two activations lead to one place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["RegularWindows"]

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_LIMIT = 0.8  # of 1, for slopes between the samples
_POWERS = 6
_WORST = 100  # vertices of the boundary that are looked at first
_UNKNOWN, _NO, _YES = -1, 0, 1


class RegularWindows:
    """Cubes of 2 w cells around vertices of a grid in which the map is one to one; w = 1, 2, 4, ...

    Theory (82): with J0 = U Σ Vᵀ in the middle, E is the largest |Σ⁻¹Uᵀ (J - J0) V| in the window,
    entry by entry. If its spectral radius is below 1 every matrix within these bounds is regular,
    that of the mean value theorem too, which takes the difference of two activations to that of
    their tips [Neumaier1990].

    Args:
        slopes: ∂r/∂x at the grid of the unit cube, shape (n + 1, n + 1, n + 1, 3, 3).
    """

    def __init__(self, slopes: Array) -> None:
        self._cells = len(slopes) - 1
        self._slopes = slopes.reshape(-1, 3, 3)
        self._sizes = 2 ** np.arange(int(np.log2(self._cells)))
        self._known = np.full((len(self._sizes), len(self._slopes)), _UNKNOWN, np.int8)
        corners = 2 * np.indices((2, 2, 2)).reshape(3, -1).T - 1
        self._offsets = np.concatenate([corners, np.eye(3, dtype=int), -np.eye(3, dtype=int)])

    def any_hopeless(self) -> bool:
        """Whether the map is not known to be one to one even in small windows at the boundary.

        Looked at are those where the map is flattest.
        """
        n = self._cells
        vertex = np.indices((n + 1,) * 3).reshape(3, -1)
        outer = np.flatnonzero(((vertex == 0) | (vertex == n)).any(axis=0))
        stretch = np.abs(np.linalg.det(self._slopes[outer]))
        worst = outer[np.argpartition(stretch, min(_WORST, len(outer) - 1))[:_WORST]]
        return not self._are_regular(np.zeros(len(worst), np.int64), worst).all()

    def hold(self, low: Array, high: Array) -> tuple[Bools, Bools]:
        """Whether such windows hold boxes, and whether the smallest that might hold one is none.

        Args:
            low: Lowest corners of the boxes in the unit cube, shape (n, 3).
            high: Highest corners.

        Returns:
            Two arrays of shape (n,).
        """
        n = self._cells
        center = np.rint(0.5 * n * (low + high)).astype(np.int64)
        reach = np.maximum(n * high - center, center - n * low).max(axis=1)
        size = np.searchsorted(self._sizes, reach - 1e-9)
        held = size < len(self._sizes)
        vertex = (center[:, 0] * (n + 1) + center[:, 1]) * (n + 1) + center[:, 2]
        found = np.zeros(len(low), bool)
        found[held] = self._are_regular(size[held], vertex[held])
        return found, held & ~found & (size == 0)

    def _are_regular(self, size: Ints, vertex: Ints) -> Bools:
        asked = np.zeros(self._known.shape, bool)
        asked[size, vertex] = True
        number, at = np.nonzero(asked & (self._known == _UNKNOWN))
        self._known[number, at] = np.where(self._judge(self._sizes[number], at), _YES, _NO)
        return self._known[size, vertex] == _YES

    def _judge(self, width: Ints, vertex: Ints) -> Bools:
        n = self._cells
        center = np.stack(np.unravel_index(vertex, (n + 1,) * 3), axis=-1)
        left, stretch, right = np.linalg.svd(self._slopes[vertex])
        back = np.swapaxes(left, 1, 2) / stretch[:, :, None]
        largest = np.zeros((len(vertex), 3, 3))
        for offset in self._offsets:
            other = np.clip(center + offset * width[:, None], 0, n)
            at = (other[:, 0] * (n + 1) + other[:, 1]) * (n + 1) + other[:, 2]
            change = self._slopes[at] - self._slopes[vertex]
            np.maximum(largest, np.abs(back @ change @ np.swapaxes(right, 1, 2)), out=largest)
        return _spectral_bound(largest) < _LIMIT


def _spectral_bound(matrices: Array) -> Array:
    """An upper bound of the spectral radius of matrices without negative entries (Collatz)."""
    vector = np.ones((len(matrices), 3, 1))
    for _ in range(_POWERS):
        vector = matrices @ vector
        vector = vector / vector.max(axis=1, keepdims=True, initial=1e-300) + 1e-6
    return ((matrices @ vector) / vector).max(axis=(1, 2))
