"""The solid that three bundles reach where no place is reached twice: all from the boundary."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from softreach.geometry.hull import convex_hull
from softreach.progress import Progress
from softreach.rod.tip_map import TipMap
from softreach.workspace.box_grid import grid_stretches, grid_tips
from softreach.workspace.faces import grid_faces
from softreach.workspace.flux import signed_volume
from softreach.workspace.image import Image, Lattice, image_of
from softreach.workspace.measure import Estimate, extrapolated
from softreach.workspace.solid import ReachableSolid

__all__ = ["solid_by_flux"]

Array = NDArray[np.float64]


def solid_by_flux(
    rod: TipMap, cells: int, lattice_for: Callable[[Array], Lattice], progress: Progress
) -> ReachableSolid:
    """The solid of a tip map that is one to one; it is rasterized when a question needs it.

    Args:
        rod: The tip map.
        cells: Of the activation grid along each axis, even: for the convex hull and the raster.
        lattice_for: The lattice to rasterize on, for the tips that it must hold.
        progress: Called with the number of grid vertices done since its last call.
    """
    flux = signed_volume(rod)
    places = grid_faces(cells)
    tips = rod.tips(rod.box.from_free_cube(places))
    lattice = lattice_for(tips)
    convex = _convex_volume(tips, places * cells)
    progress(len(places))
    volume = abs(flux.value)
    return ReachableSolid(
        tip_map=rod,
        cells=cells,
        volume=volume,
        volume_error=flux.error,
        convex_volume=convex.value,
        convex_volume_error=convex.error,
        multiplicity={1: volume},
        multiplicity_error=0.0,
        fold_volume=0.0,
        fold_volume_error=0.0,
        route="flux",
        rasterize=partial(_rasterized, rod, cells, lattice),
    )


def _convex_volume(tips: Array, vertices: Array) -> Estimate:
    """From all vertices on the faces and from every second one, as from images of grids."""
    second = (np.rint(vertices) % 2 == 0).all(axis=1)
    fine, coarse = (Estimate(convex_hull(each).volume, 0.0) for each in (tips, tips[second]))
    return extrapolated(fine, coarse)


def _rasterized(rod: TipMap, cells: int, lattice: Lattice) -> Image:
    """The image of the activation grid."""
    tips = grid_tips(rod, cells)
    stretches = grid_stretches(rod, tips, cells, np.zeros((cells,) * 3, bool))
    return image_of(tips, stretches, (cells, cells, cells), lattice)
