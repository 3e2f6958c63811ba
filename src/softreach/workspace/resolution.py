"""How finely a reachable set is resolved: cells of the activation box, and cells in space."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softreach.arguments import as_given, plain
from softreach.errors import InvalidInput
from softreach.memory import check_room
from softreach.workspace.image import Lattice
from softreach.workspace.solid import ReachableSolid

__all__ = ["even_cells", "grid_for", "is_settled", "is_worthwhile", "lattice_for"]

Array = NDArray[np.float64]

_MOST_VERTICES = 3.3e6  # of the activation grid
_OF_VERTEX = 8  # doubles that a vertex of the grid takes at least
_MOST_CELLS = 2.0**26


def grid_for(accuracy: float) -> int:
    """The rule for n: even, within what memory and patience hold.

    Args:
        accuracy: Relative error of the volume.
    """
    most = np.cbrt(_MOST_VERTICES) - 1.0
    return max(2, 2 * int(np.ceil(min(np.sqrt(5.0 / accuracy), most) / 2)))


def even_cells(name: str, value: object) -> int:
    """A number of cells along each axis of the activation box, instead of the rule's.

    Raises:
        InvalidInput: It is odd, less than 2, or more than fits into memory.
    """
    cells = plain(value)
    if isinstance(cells, int) and cells >= 2 and cells % 2 == 0:
        check_room(name, (cells + 1) ** 3, _OF_VERTEX)
        return cells
    raise InvalidInput(name, as_given(value), "an even number of cells, 2 or more")


def lattice_for(tips: Array, *, cell: float | None, accuracy: float) -> Lattice:
    """Cells in space around tips.

    Args:
        tips: [m], shape (n, 3).
        cell: Edge of a cell [m]; by the rule for h if None.
        accuracy: Relative error of the volume that the rule is for.

    Raises:
        InvalidInput: Cells so small that memory does not hold them.
    """
    sides = np.ptp(tips, axis=0)
    if cell is not None:
        smallest = float(np.cbrt(np.prod(sides) / _MOST_CELLS))
        if not smallest <= cell < np.inf:  # NaN too
            raise InvalidInput(
                "cell", cell, f"at least {smallest:.3g} m for {_MOST_CELLS:.0g} cells"
            )
        return Lattice.around(tips, float(cell))
    wanted = np.sqrt(accuracy / 30.0) * np.cbrt(np.prod(sides))
    # An image that is almost flat would need countless cells along it.
    return Lattice.around(tips, float(max(wanted, sides.max() / 1024.0)))


def is_settled(found: ReachableSolid, accuracy: float) -> bool:
    """Whether a finer grid would hardly change the volume or how much of it is reached twice."""
    return found.volume_error <= accuracy * found.volume


def is_worthwhile(found: ReachableSolid, accuracy: float) -> bool:
    """Whether grids that memory holds may be fine enough.

    Where cells are left out the error falls as 1/n, as fast as n grows and no faster.
    """
    cells = 2 * found.cells
    while found.lost_share > 0.0 and found.volume_error > accuracy * found.volume * (
        cells / found.cells
    ):
        cells *= 2
    return _fits(cells)


def _fits(cells: int) -> bool:
    return (cells + 1) ** 3 <= _MOST_VERTICES
