"""How many activations reach the places of a plane, as the inverse finds them.

The grid of the exact set counts as well, but not near its folds.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.studio.multiplicity import counts_at
from softreach.studio.reach import Reach
from softreach.studio.state import solvable_rod
from softreach.studio.work import StaleCheck

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["plane_counts", "within"]

Array = NDArray[np.float64]

_CELLS, _CELLS_LOADED = 120, 40  # along the longer side: under loads each place costs much


def within(curves: Sequence[Array], points: Array, axis: int) -> NDArray[np.bool_]:
    """Which points in a plane across an axis an odd number of closed curves surround."""
    from matplotlib.path import Path

    flat = np.delete(points, axis, axis=1)
    found = np.zeros(len(points), bool)
    for curve in curves:
        found ^= Path(np.delete(curve, axis, axis=1)).contains_points(flat)
    return found


def plane_counts(
    reach: Reach, curves: Sequence[Array], axis: int, check: StaleCheck = lambda: None
) -> xr.Dataset:
    """Cells of a plane, as `ReachableSolid.grid` has them: `count`, or `occupied`.

    Args:
        reach: Of a design with a solid.
        curves: Where its boundary meets the plane [L], closed, at least one.
        axis: Across the plane.
        check: Called between blocks of targets; raises to stop.
    """
    import xarray as xr

    around, length = np.concatenate(curves), reach.arm.length
    low, high = around.min(axis=0), around.max(axis=0)
    loaded = reach.arm.loads is not None
    cell = float((high - low).max()) / (_CELLS_LOADED if loaded else _CELLS)
    middles = [np.arange(a + cell / 2, b + cell / 2, cell) for a, b in zip(low, high, strict=True)]
    middles[axis] = low[axis : axis + 1]
    places = np.stack(np.meshgrid(*middles, indexing="ij"), axis=-1)
    inside = within(curves, places.reshape(-1, 3), axis).reshape(places.shape[:3])
    name, values = "occupied", inside
    if solvable_rod(reach.arm).box.dimension == 3:
        name, values = "count", inside.astype(np.int64)
        values[inside] = counts_at(reach, places[inside] * length, check)
    coordinates = {
        each: (each, at * length, {"units": "m"}) for each, at in zip("xyz", middles, strict=True)
    }
    attrs = {"cell": cell * length, "length": length}
    return xr.Dataset({name: (tuple("xyz"), values)}, coordinates, attrs)
