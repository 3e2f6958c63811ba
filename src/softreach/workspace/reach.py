"""From a design to its reachable set: images and volumes."""

from __future__ import annotations

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.rod.rods import as_tip_map, effective
from softreach.rod.tip_map import Frame, TipMap
from softreach.support.arguments import POSITIVE, as_number
from softreach.support.errors import InvalidInput, Range, warn
from softreach.support.progress import Progress, as_progress, silent
from softreach.workspace import measure
from softreach.workspace.cells import lost_share, searched_set
from softreach.workspace.flux import grid_faces, signed_volume
from softreach.workspace.grid import LiftedGrid
from softreach.workspace.image import Image, Lattice, image_of
from softreach.workspace.measure import Estimate, named
from softreach.workspace.reachable import ReachableSet
from softreach.workspace.thin import planar_set, plane_of_tips, thin_set

_MOST_VERTICES = 3.3e6  # of the activation grid
_MOST_CELLS = 2.0**26
_QUICK = 24  # cells, up to which sheets take no time
_TORN = 2.0  # times the error asked for, with which they are left then

ACCURACIES = Range(1e-6, 0.2)  # relative errors of a volume that can be asked for

_LENGTHS, _SIZES = POSITIVE._replace(unit="m"), POSITIVE._replace(unit="bytes")


def reachable_set(
    arm: Manipulator | TipMap,
    *,
    accuracy: float = 3e-3,
    cell: float | None = None,
    tol: float = 1e-6,
    frame: Frame = "world",
    point: str | None = None,
    memory: float | None = None,
    progress: Progress | None = None,
) -> ReachableSet:
    """Everything that the tip can reach: the image of the activation box, without a point cloud.

    Three free bundles: the box is cut into n³ cells and these into tetrahedra (Freudenthal), whose
    corners are mapped; in between the map is taken as linear, and the image is rasterized on cells
    of edge h. The resolutions follow from the accuracy ε: n = √(5/ε), even; h = √(ε/30) times the
    cube root of the volume of the bounding box. The volume itself is then far more accurate than
    asked. Where the map folds, what lies behind the fold is reached more than once: n is doubled
    until the volume of that changes by less than ε as well. A fold thinner than a cell of the grid
    may be missed. Where the raster finds no place reached twice and no fold (`route` is "flux"),
    what flows through the six faces of the box gives the volume to nine digits or so, and their
    images are the surface; under loads and of maps with kinks this is not asked.

    More free bundles: simplices would be too many, so the image is searched for in space, from tips
    of a cloud and from neighbors: how far is the center of each cell from the nearest tip? A closed
    surface of tips is wrapped around all that is nearer than 0.75 h, of whatever thinness; its
    volume changes with h by more than it errs. Where lines of sight through all centers that are
    reached tell the volume better, theirs is taken: where the boundary cuts edges between centers
    is found to 1 % of h. h begins at √ε / 2.5 of the mean side of the bounding box, 1/16 of it at
    most, and shrinks until the estimated error is within ε. Each place that counts has an
    activation that reaches it; parts that no search meets may be missing, gaps below 1.5 h are
    filled. The convex volume lies between the hull of tips and the planes that none goes beyond.

    Under loads all postures count that are held without a snap from rest, on all their sheets and
    up to the edges of these: `hysteresis_share` tells where two are held, `lost_share` where none
    is. Of more bundles than three only the posture to which each activation leads from rest does.

    Args:
        arm: The design, or its tip map. Bundles with equal bounds are held there and add no
            dimension.
        accuracy: Relative error ε allowed in the volume; of several sheets under loads twice that.
        cell: Edge h of a cell [m], instead of the rule's.
        tol: Largest tip error, in L.
        frame: In which places are told: that of the "world", or of the "base", whose z is along the
            straight arm.
        point: Name of the marker that counts as the tip, such as that of a tool; by default that
            of the design. Of a tip map its own counts.
        memory: Limit for more than three free bundles [bytes]; by default a quarter of what is
            free. Cells do not become smaller than it allows.
        progress: Called with the number of grid vertices or cells done since its last call.

    Returns:
        A solid, a surface, a curve or a point (its `dimension` is 3, 2, 1, 0) for three free
        bundles or more, two, one or none; a region for two or more that move the tip in one plane.

    Raises:
        InvalidInput: An argument out of range, or loads under which no activation is stable.

    Warns:
        SoftreachWarning: The estimated error is larger than asked.
    """
    accuracy, progress = as_number("accuracy", accuracy, ACCURACIES), as_progress(progress)
    cell = None if cell is None else as_number("cell", cell, _LENGTHS)
    memory = None if memory is None else as_number("memory", memory, _SIZES)
    tip_map = effective(as_tip_map(arm, tol, frame=frame, point=point))
    m = tip_map.box.dimension
    if m > 1 and (plane := plane_of_tips(tip_map)) is not None:
        return planar_set(tip_map, plane, accuracy, progress)
    if m < 3:
        return thin_set(tip_map)
    if m == 3:
        result = _of_three(tip_map, accuracy, cell, progress)
        allowed = _allowed_error(result, accuracy)
        finer = f"a smaller accuracy, for a grid above {result.cells}"
        finer += "" if cell is None else ", and a smaller cell"
    else:
        cells = searched_set(tip_map, accuracy, cell, memory, progress)
        assert cells.hull is not None
        result = ReachableSet(
            tip_map=tip_map,
            lost_share=lost_share(tip_map),
            route="search",
            covering=cells,
            **named(volume=cells.volume, convex_volume=cells.hull.volume),
        )
        allowed = accuracy
        finer = "a smaller cell" if cell is not None else "more memory"
    if result.volume_error > allowed * result.volume:
        warn(
            f"volume {result.volume:.5g} m³ may be off by {result.volume_error:.2g} m³, more than "
            f"{allowed:g} of it; pass {finer}"
        )
    return result


def rasterized_set(
    tip_map: TipMap, cells: int, cell: float | None, accuracy: float, progress: Progress = silent
) -> ReachableSet:
    """Reach of three free bundles by one raster on an even number of cells, one to one or not."""
    grid = LiftedGrid.of(tip_map, cells, progress)
    return _by_raster(image_of(grid, _lattice_around(grid, cell, accuracy), progress), accuracy)


def _allowed_error(solid: ReachableSet, accuracy: float) -> float:
    """The error of several sheets falls as 1/n: twice as much is enough on grids that take time."""
    has_sheets = solid.is_torn and solid.cells > _QUICK
    return (_TORN if has_sheets else 1.0) * accuracy


def _of_three(
    tip_map: TipMap, accuracy: float, cell: float | None, progress: Progress
) -> ReachableSet:
    most = np.cbrt(_MOST_VERTICES) - 1.0
    cells = max(2, 2 * int(np.ceil(min(np.sqrt(5.0 / accuracy), most) / 2)))
    before: LiftedGrid | None = None
    while True:
        grid = LiftedGrid.of(tip_map, cells, progress)
        image = image_of(grid, _lattice_around(grid, cell, accuracy), progress, before)
        if tip_map.is_smooth and not tip_map.supports_unstable and image.is_one_to_one:
            return _by_faces(image)
        solid = _by_raster(image, accuracy)
        most = _MOST_VERTICES / (4.0 if solid.is_torn else 1.0)  # that memory holds
        errs = solid.volume_error > _allowed_error(solid, accuracy) * solid.volume
        if not errs or (2 * cells + 1) ** 3 > most:
            return solid
        cells, before = 2 * cells, grid


def _by_faces(image: Image) -> ReachableSet:
    grid, flux = image.grid, signed_volume(image.grid.tip_map)
    faces = np.rint(grid_faces(grid.n) * grid.n).astype(int)
    tips = grid.tips[np.ravel_multi_index(tuple(faces.T), (grid.n + 1,) * 3)]
    convex = measure.extrapolated_hull(tips, tips[(faces % 2 == 0).all(axis=1)])
    return ReachableSet(
        tip_map=grid.tip_map,
        cells=grid.n,
        multiplicity={1: abs(flux.value)},
        multiplicity_error=0.0,
        fold_volume=0.0,
        route="flux",
        covering=image,
        **named(volume=Estimate(abs(flux.value), flux.error), convex_volume=convex),
    )


def _by_raster(image: Image, accuracy: float) -> ReachableSet:
    grid = image.grid
    corners = (each.places[measure.outer_vertices(each)] for each in (image, image.coarse))
    convex = measure.extrapolated_hull(*corners)
    volume = Estimate(np.nan) if grid.is_torn else measure.solid_volume(image, accuracy)
    several, change = measure.multiply_covered(image)
    if np.isnan(volume.value):
        volume = measure.torn_volume(image)
    else:  # a fold out of place errs by as much in both
        volume = volume._replace(error=volume.error + change)
    return ReachableSet(
        tip_map=grid.tip_map,
        cells=grid.n,
        multiplicity={1: volume.value - sum(several.values()), **several},
        multiplicity_error=max(volume.error, change),
        fold_volume=measure.fold_volume(image),
        lost_share=grid.lost_share,
        hysteresis_share=grid.hysteresis_share,
        is_torn=grid.is_torn,
        route="raster",
        covering=image,
        **named(volume=volume, convex_volume=convex),
    )


def _lattice_around(grid: LiftedGrid, cell: float | None, accuracy: float) -> Lattice:
    """Cells in space around the image of a grid, of an edge by the rule for h if `cell` is None."""
    tips = grid.tips[np.isfinite(grid.tips[:, 0])]
    sides = np.ptp(tips, axis=0)
    if cell is None:
        edge = np.sqrt(accuracy / 30.0) * np.cbrt(np.prod(sides))
        # An image that is almost flat would need countless cells along it.
        cell = float(max(edge, sides.max() / 1024.0))
    elif cell < (smallest := float(np.cbrt(np.prod(sides) / _MOST_CELLS))):
        allowed = f"at least {smallest:.3g} m for {_MOST_CELLS:.0g} cells"
        raise InvalidInput("cell", cell, allowed)
    return Lattice.around(tips, cell)
