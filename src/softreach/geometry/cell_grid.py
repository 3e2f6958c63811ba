"""Points sorted into the cubes of a regular grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softreach.errors import InvalidInput
from softreach.geometry.delaunay import finite_points

__all__ = ["CellGrid"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_MOST_CELLS = 1 << 26


@dataclass(frozen=True, kw_only=True, eq=False)
class CellGrid:
    """Cubes whose corners lie at whole multiples of their edge, so that grids of clouds agree."""

    edge: float
    """Of a cube [m]."""
    first: Index
    """Lower corner in edges, shape (3,)."""
    shape: tuple[int, ...]
    """Number of cubes along each axis."""
    cells: Index
    """The cube of each point, in C order, shape (n,)."""

    @classmethod
    def around(cls, points: Array, edge: float) -> CellGrid:
        """The grid around points [m], shape (n, 3).

        Raises:
            InvalidInput: Points of another shape, not finite or none; an edge that is not positive,
                or so small that the grid would not fit into memory.
        """
        points = finite_points(points)
        if len(points) == 0:
            raise InvalidInput("points", "none", "at least one")
        if not 0 < edge < np.inf:  # NaN too
            raise InvalidInput("cell", edge, "an edge > 0 [m]")
        place = np.floor(points / edge)
        low, high = place.min(axis=0), place.max(axis=0)
        if not np.prod(high - low + 1) <= _MOST_CELLS:
            raise InvalidInput("cell", edge, f"so large that {_MOST_CELLS:,} cells hold all points")
        shape = tuple(int(n) for n in high - low + 1)
        cells = np.ravel_multi_index(tuple((place - low).astype(np.intp).T), shape)
        return cls(edge=float(edge), first=low.astype(np.intp), shape=shape, cells=np.array(cells))

    @property
    def volume(self) -> float:
        """Of one cube [m³]."""
        return self.edge**3

    def centers(self) -> list[Array]:
        """Coordinates [m] of the centers along x, y and z."""
        pairs = zip(self.first, self.shape, strict=True)
        return [(first + 0.5 + np.arange(n)) * self.edge for first, n in pairs]

    def count(self, points: Index | slice = slice(None)) -> Index:
        """How many of some points, all by default, each cube holds."""
        return np.bincount(self.cells[points], minlength=self._size).reshape(self.shape)

    def sum(self, values: Array) -> Array:
        """Sum of a value of every point in each cube."""
        return np.bincount(self.cells, values, self._size).astype(float).reshape(self.shape)

    def mean(self, values: Array, points: Index | slice = slice(None)) -> Array:
        """Mean of the finite values of some points in each cube; NaN where there is none."""
        known = np.isfinite(values)
        cells = self.cells[points][known]
        total, count = (
            np.bincount(cells, values[known], self._size),
            np.bincount(cells, None, self._size),
        )
        mean = np.full(self._size, np.nan)
        return np.divide(total, count, out=mean, where=count > 0).reshape(self.shape)

    @property
    def _size(self) -> int:
        return int(np.prod(self.shape))
