"""How the reachable sets of the sweep extend: from the plane of symmetry, behind, in thickness."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.designs import minimal_trunk
from softreach.workspace import ReachableSolid, reachable_set

__all__ = ["Shape", "shapes"]

Array = NDArray[np.float64]

ASIDE = 0.3
"""From where on a place lies far from the plane of symmetry [L]."""
_ACCURACY = 2e-2  # finer is not needed for what is shown


class Shape(NamedTuple):
    """Of one design, in L."""

    aside: float
    """Volume farther than `ASIDE` from the plane of symmetry [L³]."""
    behind: float
    """Volume on the helical fibers' side, y > 0 [L³]."""
    thickness: float
    """Mean thickness 2 V / A [L]."""


def shapes(revolutions: Array, tapers: Array, accuracy: float) -> dict[str, list[list[float]]]:
    """The shapes of exact reachable sets over (revolution, taper) [rad], by name."""
    accuracy = max(accuracy, _ACCURACY)
    found = np.array([[_shape(o, p, accuracy) for p in tapers] for o in revolutions])
    return {name: found[..., k].tolist() for k, name in enumerate(Shape._fields)}


def _shape(revolution: float, taper: float, accuracy: float) -> Shape:
    reached = reachable_set(minimal_trunk(revolution, taper), accuracy=accuracy)
    assert isinstance(reached, ReachableSolid)
    grid, length = reached.grid, reached.arm.length
    occupied, cell = grid["occupied"], (grid.attrs["cell"] / length) ** 3
    return Shape(
        aside=float((occupied & (abs(grid.x) > ASIDE * length)).sum()) * cell,
        behind=float((occupied & (grid.y > 0)).sum()) * cell,
        thickness=2 * reached.volume / reached.surface().area / length,
    )
