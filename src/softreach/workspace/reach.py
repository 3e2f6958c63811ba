"""From a design to its reachable set: images and volumes, by the number of its free bundles.

Arms that move in one plane have an area, as two bundles have; one bundle has a length.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softreach.arm.base import Base
from softreach.arm.manipulator import Manipulator
from softreach.geometry.hull import (
    Plane,
    are_inside,
    convex_edges,
    convex_hull,
    enclosed_area,
    plane_of,
)
from softreach.geometry.surface import Surface, compact_surface, surface_area
from softreach.kernels.image.activation_mesh import chains
from softreach.rod.rods import ArmMap, as_tip_map, effective, refined
from softreach.rod.tip_map import Frame, TipMap
from softreach.sampling import cube_blocks
from softreach.support.arguments import POSITIVE, as_number
from softreach.support.arrays import Array, Index
from softreach.support.errors import InvalidInput, Range, check_installed, warn
from softreach.support.progress import Progress, as_progress, silent
from softreach.workspace import measure
from softreach.workspace.cells import (
    CLIMBERS,
    drawn_tight,
    lost_share,
    searched_set,
    shifted_lattice,
)
from softreach.workspace.grid import (
    LiftedGrid,
    all_postures,
    box_slopes,
    cube_grid,
    grid_ticks,
    grid_tips,
    product_of,
)
from softreach.workspace.image import Image, Lattice, image_of
from softreach.workspace.measure import Estimate, climbed_hull, grid_faces, named, signed_volume
from softreach.workspace.reachable import SIZES, ReachableSet
from softreach.workspace.search import DISTANCE, ENOUGH, ReachedGrid, all_reached, cloud_on_faces

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
    corners are mapped. In between the map counts as linear, and the image is rasterized on cells of
    edge h. The accuracy ε decides both: n = √(5/ε), even, and h = √(ε/30) times the cube root of
    the volume of the bounding box. The volume is then far more accurate than asked. Where the map
    folds, places behind the fold are reached more than once, and n is doubled until their volume
    changes by less than ε too. A fold thinner than a cell of the grid may be missed. Where the
    raster finds no fold and no place reached twice (`route` is "flux"), the flux through the six
    faces of the box gives the volume to nine digits or so, and their images are the surface. Arms
    under loads and maps with kinks always use the raster.

    More free bundles: the image is searched in space, from tips of a cloud and from neighbors. A
    closed surface of tips is wrapped around all that is nearer than 0.75 h to a tip, of whatever
    thinness. Lines of sight through the centers that are reached give the volume instead where they
    give it better; the boundary between two centers is found to 1 % of h. h begins at √ε / 2.5 of
    the mean side of the bounding box, 1/16 of it at most, and shrinks until the estimated error is
    within ε. Every place that counts has an activation that reaches it. Parts that no search meets
    may be missing, and gaps below 1.5 h are filled. The convex volume lies between the hull of tips
    and the planes that no tip crosses.

    Under loads every posture counts that is held without a snap from rest, on all sheets and up to
    their edges: `hysteresis_share` is where two are held, `lost_share` where none is. With more
    than three bundles only the posture counts to which each activation leads from rest.

    Args:
        arm: The design, or its tip map. Bundles with equal bounds are held there and add no
            dimension.
        accuracy: Relative error ε allowed in the volume [-]; twice that of sheets under loads.
        cell: Edge h of a cell [m], in place of the rule above.
        tol: Largest tip error, in L.
        frame: Frame of the places: that of the "world", or of the "base", whose z is along the
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

    Examples:
        >>> reach = sr.reachable_set(sr.designs.minimal_trunk(), accuracy=0.02)
        >>> print(f"{reach.volume:.3f} m³")
        0.692 m³
        >>> reach.contains([[0, 0, 0.5], [0, 0, 2]])
        array([ True, False])
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


_CELLS = {1: 1024, 2: 128}  # of the grids of a curve and of a surface, for distances and pictures
_NODES = 24, 16  # Gauss nodes along each axis, and those that tell the error
_TOL = 1e-9  # far fewer evaluations than on the grids: their steps may be short
_SAMPLES = 256  # of the box, that tell whether all tips lie in one plane
_FLAT = 4.0  # tolerances of a tip: what is no thicker is flat
_RULE = 2.5  # cells along the mean side, times the root of the accuracy
_FEWEST = 24.0
_MOST = 1024.0  # cells along the longer side
_FINER = 1.5
_SIGNS = 16  # cells of the grid that tells whether two bundles fold


def thin_set(tip_map: TipMap) -> ReachableSet:
    """The reachable set of a tip map with fewer than three free bundles."""
    m = tip_map.box.dimension
    if m == 0:
        point = Surface(vertices=grid_tips(tip_map, 1), faces=np.zeros((1, 3), np.int32))
        return ReachableSet(tip_map=tip_map, cells=1, mesh=point)
    n = _CELLS[m]
    # kinks are on lines of the grid
    ticks = None if tip_map.supports_unstable else grid_ticks(tip_map, n)
    grid = LiftedGrid.of(tip_map, n, ticks=ticks)
    corners = grid.cells[:, chains(m, m)].reshape(-1, m + 1)
    faces = np.pad(corners, [(0, 0), (0, 2 - m)], mode="edge")
    vertices, faces = compact_surface(grid.tips, faces)
    return ReachableSet(
        tip_map=tip_map,
        cells=n,
        lost_share=grid.lost_share,
        hysteresis_share=grid.hysteresis_share,
        mesh=Surface(vertices=vertices, faces=faces),
        **named(**{SIZES[m]: _measure(tip_map, grid)}, convex_volume=_convex_volume(grid)),
    )


def by_nodes(tip_map: TipMap) -> Estimate:
    """Length [m] or area [m²] of the image, ∫ √det(JᵀJ) dγ, and how fewer Gauss nodes change it.

    Places count as often as they are reached; NaN if a node has no stable equilibrium.
    """
    box, tip_map, values = tip_map.box, refined(tip_map, _TOL), list[float]()
    for nodes in _NODES:
        x, w = np.polynomial.legendre.leggauss(nodes)
        places, weights = (product_of([each / 2.0] * box.dimension) for each in (1.0 + x, w))
        slopes = tip_map.tips_and_slopes(box.from_free_cube(places))[1][:, :, box.free]
        with np.errstate(invalid="ignore"):
            sizes = np.sqrt(np.linalg.det(np.swapaxes(slopes, 1, 2) @ slopes).clip(0.0))
        # Not a BLAS product, whose rounding would depend on its threads.
        values.append(float((np.prod(weights, axis=1) * box.volume * sizes).sum()))
    return Estimate(values[0], abs(values[0] - values[1]))


def _measure(tip_map: TipMap, grid: LiftedGrid) -> Estimate:
    """Length or area of the image, by Gauss nodes where it is one smooth sheet, else by cells.

    What these err by, O(1/n²), is removed. Where the map has kinks, or sheets end, it is O(1/n):
    the largest change by a finer grid is stated.
    """
    if tip_map.is_smooth and not grid.is_torn and np.isfinite(smooth := by_nodes(tip_map)).all():
        return smooth
    fine, times = _size(grid), (2, 3) if grid.is_torn else (2,)
    changes = [fine - _size(grid.coarser(k)) for k in times]
    removed = max((c / (k - 1) for k, c in zip(times, changes, strict=True)), key=abs) / 3.0
    return Estimate(fine + removed, max(map(abs, changes)))


def _size(grid: LiftedGrid) -> float:
    if grid.is_lifted.ndim == 2:
        return surface_area(grid.tips, grid.cells[:, chains(2, 2)].reshape(-1, 3))
    return float(np.linalg.norm(np.diff(grid.tips[grid.cells], axis=1), axis=-1).sum())


def _convex_volume(grid: LiftedGrid) -> Estimate:
    """Volume of the convex hull of mapped vertices [m³]."""
    # A grid with a quarter of the cells along each axis differs by 15 times the error O(1/n²).
    tips = (each.tips[np.isfinite(each.tips[:, 0])] for each in (grid, grid.coarser(4)))
    fine, coarse = (convex_hull(points).volume for points in tips)
    return Estimate(fine, abs(fine - coarse) / 10.0)


def plane_of_tips(tip_map: TipMap) -> Plane | None:
    """The plane in which all tips lie to their tolerance; None if there is none."""
    (cube,) = cube_blocks("sobol", _SAMPLES, tip_map.box.dimension, 0, _SAMPLES)
    tips = tip_map.tips(tip_map.box.from_free_cube(np.concatenate([cube, np.rint(cube)])))
    tips = tips[np.isfinite(tips[:, 0])]
    return plane_of(tips, _FLAT * tip_map.tol * tip_map.length) if len(tips) > 2 else None


def planar_set(tip_map: TipMap, plane: Plane, accuracy: float, progress: Progress) -> ReachableSet:
    """The region that two bundles or more reach in a plane, as `searched_set` finds volumes."""
    turned = Base(
        points=tuple(map(tuple, plane.rotation.tolist())),  # pyright: ignore[reportArgumentType]
        position=tuple((-plane.rotation @ plane.origin).tolist()),  # pyright: ignore[reportArgumentType]
    )
    every = all_postures(tip_map)  # the map in the axes of the plane
    flat = ArmMap.of(tip_map, turned) if every is None else every.seen_from(turned)
    cloud = gamma, tips = cloud_on_faces(flat, 0)
    sides = np.ptp(tips[:, :2], axis=0)
    mean = float(np.sqrt(np.prod(sides)))
    edge = max(min(np.sqrt(accuracy) / _RULE, 1.0 / _FEWEST) * mean, float(sides.max()) / _MOST)

    def outline(edge: float) -> _Outline:
        x, y, _ = (lattice := shifted_lattice(tips, edge)).shape
        layers = Lattice(np.array([*lattice.origin[:2], -2.0 * edge]), edge, (x, y, 5))
        return _Outline.of(all_reached(ReachedGrid(flat, layers, progress, is_flat=True), *cloud))

    coarse = outline(_FINER * edge)
    while True:
        fine = outline(edge)
        slack = fine.length * (ENOUGH * edge + tip_map.tol * tip_map.length)
        area = Estimate(fine.area, abs(fine.area - coarse.area) + slack)
        if area.error <= accuracy * area.value or edge / _FINER < sides.max() / _MOST:
            break
        edge, coarse = edge / _FINER, fine
    area = _smooth(tip_map, flat, area)
    cube = flat.box.to_cube(np.concatenate([gamma[:CLIMBERS], fine.gamma]))[:, flat.box.free]
    return ReachableSet(
        tip_map=tip_map,
        lost_share=lost_share(flat),
        hysteresis_share=0.0 if every is None else every.hysteresis_share,
        mesh=_mesh(fine, plane),
        outline=Surface(vertices=plane.places(fine.tips), faces=fine.edges[:, [0, 1, 1]]),
        **named(area=area, convex_area=climbed_hull(flat, cube, accuracy, convex_edges).volume),
    )


class _Outline(NamedTuple):
    tips: Array  # (n, 3)
    gamma: Array  # activations that lead to them, (n, bundles)
    edges: Index  # from each tip to the next of its curve, (e, 2)
    centers: Array  # of cells that are reached [m], (c, 3)

    @classmethod
    def of(cls, grid: ReachedGrid) -> _Outline:
        """The level set of the distances, drawn tight."""
        check_installed("skimage")
        from skimage.measure import find_contours

        curves = find_contours(grid.distances[:, :, 2], DISTANCE, positive_orientation="low")
        at = np.insert(np.concatenate([np.empty((0, 2)), *curves]), 2, 2.0, axis=1)
        first = np.delete(np.arange(len(at)), np.cumsum([len(curve) for curve in curves]) - 1)
        gamma, tips, _ = drawn_tight(grid, at)
        edges = np.stack([first, first + 1], axis=1)
        return cls(tips, gamma, edges, grid.centers(np.flatnonzero(grid.gap == 0.0)))

    @property
    def area(self) -> float:
        return enclosed_area(self.tips, self.edges)

    @property
    def length(self) -> float:
        return float(np.linalg.norm(np.diff(self.tips[self.edges], axis=1), axis=2).sum())


def _smooth(tip_map: TipMap, flat: TipMap, area: Estimate) -> Estimate:
    """The area of two bundles that do not fold by Gauss nodes, as far as the outline agrees."""
    if tip_map.box.dimension != 2 or tip_map.supports_unstable or not tip_map.is_smooth:
        return area
    sign = np.linalg.det(box_slopes(flat, cube_grid(_SIGNS, 2))[1][:, :2])
    smooth = by_nodes(tip_map)
    folds = sign.min() * sign.max() <= 0.0 or abs(smooth.value - area.value) > area.error
    return area if folds else smooth


def _mesh(outline: _Outline, plane: Plane) -> Surface:
    from scipy.spatial import Delaunay

    points = np.concatenate([outline.tips, outline.centers])
    if len(points) < 3 or not outline.area > 0.0:
        return Surface(vertices=np.empty((0, 3)), faces=np.empty((0, 3), np.int32))
    points = np.unique(points, axis=0)
    faces = Delaunay(points[:, :2], qhull_options="QJ Pp").simplices
    kept = are_inside(points[faces].mean(axis=1), outline.tips[outline.edges])
    vertices, faces = compact_surface(plane.places(points), faces[kept].astype(np.int32))
    return Surface(vertices=vertices, faces=faces)
