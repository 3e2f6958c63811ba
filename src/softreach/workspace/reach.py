"""From a design to its reachable set: resolutions, images, volumes."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.errors import InvalidInput, SoftreachWarning
from softreach.geometry.hull import convex_hull
from softreach.kernels.simplices import chains, corner_steps
from softreach.progress import Progress, silent
from softreach.workspace import measure
from softreach.workspace.box import ActivationBox
from softreach.workspace.image import Lattice, image_of
from softreach.workspace.reachable import ReachableSet
from softreach.workspace.surface import Surface

__all__ = ["reachable_set"]

Array = NDArray[np.float64]

_MOST_TRIANGLES = 4e7  # triangles of the activation grid
_MOST_CELLS = 2.0**26
_SHEET = {0: 1, 1: 1024, 2: 128}  # grid of a curve or surface, for distances and pictures


def reachable_set(
    arm: Manipulator,
    *,
    accuracy: float = 3e-3,
    cell: float | None = None,
    grid: int | None = None,
    tol: float = 1e-6,
    report: Progress | None = None,
) -> ReachableSet:
    """Everything that the tip can reach: the image of the activation box, without a point cloud.

    The box is cut into n^m cells and these into simplices (Freudenthal), whose corners are mapped;
    in between the map is taken as linear. For m = 3 these are tetrahedra. For m > 3 a mapped
    simplex is the union of the tetrahedra on its corners (Carathéodory), and all three-dimensional
    faces of the triangulation are used. The result is rasterized on cells of edge h.

    The resolutions follow from the accuracy ε: n = √(5/ε) for m = 3 and √(2.2/ε) for m > 3, even,
    and limited for m > 4 by the number of simplices; h = √(ε/30) times the cube root of the volume
    of the bounding box. For m = 3 the volume itself is then far more accurate than asked. Where the
    map folds, what lies behind the fold is reached more than once: n is doubled until the volume of
    that changes by less than ε as well. A fold thinner than a cell of the grid may be missed.

    Args:
        arm: The design. Bundles with equal bounds are held there and add no dimension.
        accuracy: Relative error ε allowed in the volume.
        cell: Edge h of a cell [m], instead of the rule's.
        grid: Cells n along each axis of the activation box, even, instead of the rule's.
        tol: Largest tip error, in L.
        report: Called with the number of grid vertices done since its last call.

    Raises:
        InvalidInput: An argument out of range.

    Warns:
        SoftreachWarning: The estimated error is larger than asked.
    """
    if not 1e-6 <= accuracy <= 0.2:
        raise InvalidInput("accuracy", accuracy, "1e-6 to 0.2")
    box = ActivationBox(arm=arm, tol=tol)
    if box.m < 3:
        return _thin_set(box)
    cells = _checked_grid(grid) if grid is not None else _grid_for(box.m, accuracy)
    found = _solid_set(box, cells, cell, accuracy, report or silent)
    while grid is None and not _settled(found, accuracy) and _fits(box.m, 2 * found.cells):
        found = _solid_set(box, 2 * found.cells, cell, accuracy, report or silent)
    if found.volume_error > accuracy * found.volume:
        warnings.warn(_inaccurate(found, accuracy), SoftreachWarning, stacklevel=2)
    return found


def _solid_set(
    box: ActivationBox, cells: int, cell: float | None, accuracy: float, report: Progress
) -> ReachableSet:
    tips = box.grid_tips(cells)
    lattice = _lattice(tips, cell, accuracy)
    fine = image_of(tips, (cells,) * box.m, lattice, report)
    coarse = image_of(_every_second(tips, cells, box.m), (cells // 2,) * box.m, lattice)
    several = [measure.multiply_covered(image) if box.m == 3 else {} for image in (fine, coarse)]
    volume, error = measure.solid(box, fine, coarse)
    return ReachableSet(
        arm=box.arm,
        dimension=3,
        measure=volume,
        measure_error=error,
        convex_volume=measure.convex_volume(fine, coarse),
        multiplicity={1: volume - sum(several[0].values()), **several[0]} if box.m == 3 else {},
        multiplicity_error=abs(sum(several[0].values()) - sum(several[1].values())),
        fold_volume=measure.fold_volume(fine) if box.m == 3 else 0.0,
        cells=cells,
        image=fine,
        sheet=None,
    )


def _settled(found: ReachableSet, accuracy: float) -> bool:
    """Whether a finer grid would hardly change the volume or how much of it is reached twice."""
    error = max(found.volume_error, found.multiplicity_error)
    return error <= accuracy * found.volume


def _fits(m: int, cells: int) -> bool:
    return (cells + 1) ** m * len(chains(m, 2)) <= _MOST_TRIANGLES


def _thin_set(box: ActivationBox) -> ReachableSet:
    """A surface, a curve or a point."""
    cells = _SHEET[box.m]
    tips = box.grid_tips(cells)
    fine = box.measure(24) if box.m else 0.0
    rough = box.measure(16) if box.m else 0.0
    return ReachableSet(
        arm=box.arm,
        dimension=box.m,
        measure=fine,
        measure_error=abs(fine - rough),
        convex_volume=convex_hull(tips).volume,
        multiplicity={},
        multiplicity_error=0.0,
        fold_volume=0.0,
        cells=cells,
        image=None,
        sheet=Surface(vertices=tips, faces=_sheet_faces(box.m, cells)),
    )


def _sheet_faces(m: int, cells: int) -> NDArray[np.int64]:
    """Simplices of the grid; those of a curve repeat a corner to make three."""
    base = np.arange(cells**m)
    if m == 2:
        base += base // cells  # each row of vertices has one more
    corners = corner_steps((cells,) * m)[chains(m, m)]
    simplices = (base[:, None, None] + corners).reshape(-1, m + 1)
    return np.pad(simplices, ((0, 0), (0, 2 - m)), mode="edge")


def _every_second(tips: Array, cells: int, m: int) -> Array:
    """Tips of the grid of half as many cells."""
    every = tips.reshape(*(cells + 1,) * m, 3)[(slice(None, None, 2),) * m]
    return np.ascontiguousarray(every).reshape(-1, 3)


def _grid_for(m: int, accuracy: float) -> int:
    """The rule for n: even, within what memory and patience hold."""
    wanted = np.sqrt((5.0 if m == 3 else 2.2) / accuracy)
    most = (_MOST_TRIANGLES / len(chains(m, 2))) ** (1 / m) - 1
    return max(2, 2 * int(np.ceil(min(wanted, most) / 2)))


def _checked_grid(grid: int) -> int:
    if isinstance(grid, bool) or int(grid) != grid or grid < 2 or grid % 2:
        raise InvalidInput("grid", grid, "an even number of cells, 2 or more")
    return int(grid)


def _lattice(tips: Array, cell: float | None, accuracy: float) -> Lattice:
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


def _inaccurate(found: ReachableSet, accuracy: float) -> str:
    return (
        f"volume {found.volume:.5g} m³ may be off by {found.volume_error:.2g} m³, more than "
        f"{accuracy:g} of it; pass a grid above {found.cells} and a smaller cell"
    )
