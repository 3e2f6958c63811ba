"""Points sorted into the cubes of a regular grid."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softreach.support.arrays import Array, Index, as_points
from softreach.support.errors import InvalidInput

_MOST_CELLS = 1 << 26


@dataclass(frozen=True, kw_only=True, eq=False)
class CellGrid:
    """Cubes whose corners lie at whole multiples of their edge, so that grids of clouds agree."""

    edge: float  # of a cube [m]
    first: Index  # lower corner in edges, (3,)
    shape: tuple[int, ...]  # number of cubes along each axis
    cells: Index  # the cube of each point, in C order, (n,); their number for a point that is NaN

    @classmethod
    def around(cls, points: Array, edge: float) -> CellGrid:
        """The grid around points [m], shape (n, 3); rows of NaN are in no cube."""
        placed = np.asarray(~np.isnan(points).all(axis=-1))
        points = as_points("points", points[placed], any_scale=True)
        if len(points) == 0:
            raise InvalidInput("points", "none", "at least one")
        if not 0 < edge < np.inf:  # NaN too
            raise InvalidInput("cell", edge, "an edge > 0 [m]")
        place = np.floor(points / edge)
        low, high = place.min(axis=0), place.max(axis=0)
        if not np.prod(high - low + 1) <= _MOST_CELLS:
            raise InvalidInput("cell", edge, f"so large that {_MOST_CELLS:,} cells hold all points")
        shape = tuple(int(n) for n in high - low + 1)
        cells = np.full(len(placed), int(np.prod(shape)))
        cells[placed] = np.ravel_multi_index(tuple((place - low).astype(np.intp).T), shape)
        return cls(edge=float(edge), first=low.astype(np.intp), shape=shape, cells=cells)

    @property
    def volume(self) -> float:
        """Of one cube [m³]."""
        return self.edge**3

    def centers(self) -> list[Array]:
        """Coordinates [m] of the centers along x, y and z."""
        pairs = zip(self.first, self.shape, strict=True)
        return [(first + 0.5 + np.arange(n)) * self.edge for first, n in pairs]

    def count(self, points: Index | slice = slice(None)) -> Index:
        """Number of points in each cube, of some of them or, by default, of all."""
        return self._sums(self.cells[points])

    def sum(self, values: Array) -> Array:
        """Sum of a value of every point in each cube."""
        return self._sums(self.cells, values).astype(float)

    def mean(self, values: Array, points: Index | slice = slice(None)) -> Array:
        """Mean of the finite values of some points in each cube; NaN where there is none."""
        known = np.isfinite(values)
        cells = self.cells[points][known]
        total, count = self._sums(cells, values[known]), self._sums(cells)
        return np.divide(total, count, out=np.full(self.shape, np.nan), where=count > 0)

    def _sums(self, cells: Index, values: Array | None = None) -> NDArray[Any]:
        """Sums of values, or numbers of points, in each cube but of the points in none."""
        size = math.prod(self.shape)
        return np.bincount(cells, values, size)[:size].reshape(self.shape)
