"""Derivatives of the reachable volume by parameters of the design: theory (83), (84) and (98)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice, repeat
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.parameters import Parameter, find_parameters
from softreach.rod.rods import as_tip_map, effective, refined
from softreach.schema import provenance
from softreach.support import parallel
from softreach.support.arguments import as_names, as_number
from softreach.support.arrays import Array, Index
from softreach.support.errors import InvalidInput
from softreach.support.lazy import lazy
from softreach.support.progress import Progress, as_progress, silent
from softreach.support.quantity import quantity
from softreach.workspace.cells import ReachedCells, Wrap
from softreach.workspace.image import Image, Lattice
from softreach.workspace.measure import (
    FLUX_PART,
    Estimate,
    Flux,
    HullCorners,
    face_image,
    flux_tol,
    grid_faces,
    outer_vertices,
    signed_volume,
)
from softreach.workspace.reach import ACCURACIES, rasterized_set, reachable_set
from softreach.workspace.reachable import ReachableSet
from softreach.workspace.tip_derivatives import Shifts, TipDerivatives, shifts_along

if TYPE_CHECKING:
    import xarray as xr
    from scipy.spatial import KDTree

_CLASSES = 4  # every other line along both directions
_LINES = 2  # times as many lines of sight along each direction as for the volume itself
_TOL = 3e-10  # in L, of what the flux alone tells
_HULL_CELLS = 28  # along each edge of the box, of which corners of a hull are at least
_MISSING = 0.4  # of the share of the volume that may be missing: of the boundary
_CHANGES = 3.0  # times the change from larger cells, of what a wrap sweeps
_AROUND = np.indices((3, 3, 3)).reshape(3, -1).T - 1
_RASTER_STEP = 2e-2  # of a parameter, where neighbors are rasterized, which is rough
_ROUGHNESS = np.array([1.0, -4.0, 6.0, -4.0, 1.0])  # fourth differences: nothing smooth is left
_MEANINGS = {
    "volume": ("m3 per unit", "derivative of the reachable volume"),
    "convex_volume": ("m3 per unit", "derivative of the convex hull's volume"),
    "unreachability": ("1 per unit", "derivative of the unreachability"),
}
_CELLS = 40  # along each edge of the box, where its faces are the boundary
_BLOCK = 1 << 21  # numbers at once
_SLIVER = 1e-2  # of the mean area: the normal of what is smaller tells nothing


def volume_gradient(
    arm: Manipulator,
    parameters: str | Sequence[str],
    *,
    accuracy: float = 3e-3,
    progress: Progress | None = None,
) -> VolumeGradient:
    """Derivatives of the reachable volume by design parameters, for three free bundles or more.

    The images of the six faces of the activation box move with the design. The volume that they
    sweep is the change of the signed volume, theory (83), exact to seven digits or so; no more is
    needed where the map is one to one. Where the image of three bundles folds or overlaps, the
    volume that folds and hidden faces sweep is added. With more bundles the boundary alone sweeps,
    theory (98), and most of the stated error comes from lines of sight. Where cells without a
    stable equilibrium are left out of the box, the motion of the boundary is unknown: derivatives
    are then differences between neighboring designs, which take much longer and are rougher.

    The convex hull changes with its corners, theory (84). Its volume, as that of the reachable set,
    has kinks where the touched places jump; there the derivative is that of one side.

    The derivative by a parameter that several parts share is the sum of those by the parts' own:
    all of them grow by the same amount, revolutions each in its own sense.

    Args:
        arm: The design.
        parameters: Names as in atlases: `taper`, `revolution`, `rings[0].inner_ratio`,
            `left.offset`, and the bounds of activations, `lower`, `upper` or `left.lower[1]`.
        accuracy: As for `reachable_set`: of the convex hull, and of lines of sight.
        progress: Called with the number of parameters done since its last call.

    Raises:
        InvalidInput: Fewer than three free bundles, no parameters, one that the design lacks or
            that counts something, or one whose change holds or frees a bundle.
        InvalidDesign: The design has no neighbors with other values of a parameter.

    Examples:
        >>> found = sr.volume_gradient(sr.designs.minimal_trunk(), ["taper", "revolution"])
        >>> found.volume.round(1)  # [m³/rad]
        array([-1.5,  0.2])
    """
    arm, names = a_manipulator("arm", arm), as_names("parameters", parameters)
    accuracy, progress = as_number("accuracy", accuracy, ACCURACIES), as_progress(progress)
    if not names:
        raise InvalidInput("parameters", "none", "the name of one or more")
    if twice := [name for name in names if names.count(name) > 1]:
        raise InvalidInput("parameters", twice[0], "given once")
    find_parameters(arm, names)  # refused before the set is computed
    if (free := as_tip_map(arm).box.dimension) < 3:
        raise InvalidInput("arm", f"{free} free bundles", "three of them or more")
    return gradient_of(reachable_set(arm, accuracy=accuracy), names, accuracy, progress)


def gradient_of(
    solid: ReachableSet, names: tuple[str, ...], accuracy: float, progress: Progress = silent
) -> VolumeGradient:
    """As `volume_gradient`, of a reachable set that is known to an accuracy."""
    if solid.dimension < 3:
        raise InvalidInput("arm", "a set without a volume", "one of three free bundles or more")
    parameter_of = find_parameters(solid.arm, names)
    wanted = [parameter_of[name] for name in names]
    if solid.is_torn or solid.lost_share > 0.0:
        volume, convex = _by_differences(solid, wanted, accuracy, progress)
    else:
        tip_map, searched = solid.tip_map, solid.route == "search"
        if solid.route == "flux" or tip_map.supports_unstable:
            tip_map = refined(tip_map, flux_tol(tip_map))
        tips = TipDerivatives(tip_map, wanted, _TOL, progress)
        of_volume = _searched(solid) if searched else _flowing(solid, accuracy)
        volume, convex = _told(tips, of_volume, _dragged(solid))
        progress(len(names))
    return VolumeGradient(
        solid=solid,
        parameters=names,
        units=tuple(each.unit for each in wanted),
        volume=volume[0],
        volume_error=volume[1],
        convex_volume=convex[0],
        convex_volume_error=convex[1],
    )


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class VolumeGradient:
    """Derivatives of volume, convex volume and unreachability by parameters of a design."""

    solid: ReachableSet
    """Reachable set of the design itself."""
    parameters: tuple[str, ...]
    """Names of the parameters."""
    units: tuple[str, ...]
    """Unit of each parameter."""
    volume: Array
    """∂V/∂p [m³ per unit of the parameter], shape (parameter,)."""
    volume_error: Array
    """Errors of these derivatives [m³ per unit]."""
    convex_volume: Array
    """Derivatives of the volume of the convex hull [m³ per unit], shape (parameter,)."""
    convex_volume_error: Array
    """Errors of these derivatives [m³ per unit]."""

    @property
    def route(self) -> str:
        """Source of the volume and its derivatives, as `ReachableSet.route`."""
        return self.solid.route

    @property
    def unreachability(self) -> Array:
        """Derivatives of 1 - V / V_convex [1 per unit], shape (parameter,)."""
        volume, convex = self.solid.volume, self.solid.convex_volume
        return (volume * self.convex_volume / convex - self.volume) / convex

    @property
    def unreachability_error(self) -> Array:
        """Errors of these derivatives [1 per unit]."""
        volume, convex = self.solid.volume, self.solid.convex_volume
        return (volume * self.convex_volume_error / convex + self.volume_error) / convex

    def to_dataset(self) -> xr.Dataset:
        """All derivatives with their errors over `parameter`, and where they come from."""
        import xarray as xr

        numbers = {}
        for name, (unit, meaning) in _MEANINGS.items():
            for of, what in (("", ""), ("_error", "error of the ")):
                about = {"units": unit, "long_name": what + meaning}
                numbers[name + of] = ("parameter", getattr(self, name + of), about)
        coordinates = {"parameter": list(self.parameters), "unit": ("parameter", list(self.units))}
        attrs = {**provenance(self.solid.arm, self.solid.tip_map.frame), "route": self.route}
        return xr.Dataset(numbers, coordinates, attrs)

    def __repr__(self) -> str:
        rows = zip(self.parameters, self.units, self.volume, self.volume_error, strict=True)
        lines = [
            f"∂V/∂({name}) = {quantity(value, f'm³/{unit}' if unit != '1' else 'm³', error)}"
            for name, unit, value, error in rows
        ]
        return "\n  ".join([f"VolumeGradient: route {self.route}", *lines])


_Swept = tuple[Array, Array]
"""Derivatives by all parameters, and their errors, shape (parameters,) each."""


def _searched(solid: ReachableSet) -> _Part:
    """Derivatives of the volume of more than three bundles: of all that the boundary sweeps."""
    assert isinstance(solid.image, ReachedCells)

    def of_wraps(wrap: _Sum, coarse: _Sum) -> _Swept:
        return wrap.value, wrap.error + _CHANGES * np.abs(wrap.value - coarse.value)

    def of_lines(swept: _Sum) -> _Swept:
        # What no search meets is at rims of either sign.
        missing = _MISSING * solid.volume_error / solid.volume * swept.size
        return swept.value, swept.error + missing

    if solid.image.is_thick:
        return [boundary_samples(solid.image)], of_lines
    return [solid.image.wrap, solid.image.coarse], of_wraps


def _flowing(solid: ReachableSet, accuracy: float) -> _Part:
    """Derivatives of the volume of three: of the flux, and of what lines of sight add to it."""
    enough = 0.0 if solid.route == "flux" else FLUX_PART * accuracy
    flux = signed_volume(solid.tip_map, enough=enough)
    sense, nodes = 1 if flux.value >= 0 else -1, list[_Nodes]([flux])
    if solid.route != "flux":
        assert isinstance(solid.image, Image)
        images = solid.image.with_more_lines(_LINES), solid.image.coarse
        nodes += [boundary_samples(image, sense) for image in images]

    def told(whole: _Sum, *seen: _Sum) -> _Swept:
        value, error = sense * whole.value, whole.error + flux.error / abs(flux.value) * whole.size
        if not seen:
            return value, error
        fine, coarse = seen
        removed = (fine.value - coarse.value) / 3.0
        return value + fine.value + removed, error + fine.error + np.abs(removed)

    return nodes, told


def _dragged(solid: ReachableSet) -> _Part:
    """Derivatives of the convex volume, by what the corners drag along, for infinitely fine grids.

    Corners jump from vertex to vertex: the largest part removed of the derivative by any parameter
    may be wrong of each, and so may the part that hulls of corners lack of the convex volume.
    """
    corners = _hull_corners(solid)
    hull, rough = (each.volume for each in corners)
    missing = abs(hull + (hull - rough) / 3.0 - solid.convex_volume) / hull

    def told(fine: _Sum, coarse: _Sum) -> _Swept:
        removed = (fine.value - coarse.value) / 3.0
        share = np.max(np.abs(removed) / np.maximum(fine.size, np.finfo(float).tiny))
        error = fine.error + np.abs(removed) + (share + missing) * fine.size
        return fine.value + removed, error

    return corners, told


_Nodes: TypeAlias = "BoundarySamples | HullCorners | Flux | Wrap"
_Part: TypeAlias = "tuple[Sequence[_Nodes], Callable[..., _Swept]]"
"""Sets of nodes, and what the sums over each come to."""


class _Sum(NamedTuple):
    """Sums over nodes, by all parameters, shape (parameters,) each."""

    value: Array
    size: Array  # of the terms without their signs
    error: Array  # by ∂r/∂p, and by where lines of sight lie


def _told(tips: TipDerivatives, *parts: _Part) -> list[_Swept]:
    """What the sums of each part come to; the tips of all their nodes are found together."""
    several = [nodes for own, _ in parts for nodes in own]
    ends = np.cumsum([len(nodes.cube) for nodes in several])[:-1]
    slopes = np.split(tips.at(np.concatenate([nodes.cube for nodes in several])), ends)
    sums = map(_sum, several, slopes, repeat(tips.error))
    return [told(*islice(sums, len(own))) for own, told in parts]


def _sum(nodes: _Nodes, slopes: Array, each: Array) -> _Sum:
    area = nodes.corner_areas if isinstance(nodes, Wrap) else nodes.area
    swept = np.einsum("ni,nip->np", area, slopes)
    error = each * float(np.linalg.norm(area, axis=1).sum())
    if isinstance(nodes, BoundarySamples):
        error += nodes.noise(slopes)
    return _Sum(swept.sum(axis=0), np.abs(swept).sum(axis=0), error)


def _by_differences(
    solid: ReachableSet, parameters: Sequence[Parameter], accuracy: float, progress: Progress
) -> tuple[_Swept, _Swept]:
    """Derivatives of volume and convex volume of a torn set, from neighbors as finely computed."""
    cell, estimates = solid.image.lattice.cell, list[tuple[Estimate, Estimate]]()

    def like_this(arm: Manipulator) -> ReachableSet:
        if arm is solid.arm:
            return solid
        if solid.route != "search":
            return rasterized_set(effective(as_tip_map(arm)), solid.cells, cell, accuracy)
        return reachable_set(arm, accuracy=accuracy, cell=cell)

    for parameter in parameters:
        shifts = shifts_along(solid.arm, parameter, 2, _RASTER_STEP)
        solids = [like_this(arm) for arm in shifts.arms]
        volume = _rough_derivative(shifts, [each.volume for each in solids])
        convex = _rough_derivative(shifts, [each.convex_volume for each in solids])
        estimates.append((volume, convex))
        progress(1)
    volumes, convexes = np.moveaxis(np.array(estimates), 0, 2)
    return (volumes[0], volumes[1]), (convexes[0], convexes[1])


def _rough_derivative(shifts: Shifts, values: Sequence[float]) -> Estimate:
    value, smooth = float(shifts.weights @ values), float(shifts.rough_weights @ values)
    noise = abs(float(_ROUGHNESS @ values)) / float(np.linalg.norm(_ROUGHNESS))
    error = abs(value - smooth) + 2.0 * noise * float(np.linalg.norm(shifts.weights))
    return Estimate(value, float(error))


def _hull_corners(solid: ReachableSet) -> tuple[HullCorners, HullCorners]:
    """Corners of the hull of a solid, and of that of half as fine a grid, or before a climb."""
    tip_map = solid.tip_map
    if solid.route == "flux":
        cells = 2 * round(solid.cells / 3)
        cube = grid_faces(cells)
        tips = tip_map.tips(tip_map.box.from_free_cube(cube))
        even = (np.rint(cells * cube) % 2 == 0).all(axis=1)
        return HullCorners.of(tips, cube), HullCorners.of(tips[even], cube[even])
    if isinstance(solid.image, ReachedCells):
        hull = solid.image.hull
        assert hull is not None
        return hull.corners, hull.before
    corners = _corners_of(solid.image)
    if solid.cells >= _HULL_CELLS:
        return corners, _corners_of(solid.image.coarse)
    # Of a grid twice as fine only what is beside the corners is mapped.
    cells = 2 * solid.cells
    places = np.rint(cells * corners.cube).astype(np.int64)[:, None] + _AROUND
    cube = np.unique(places.clip(0, cells).reshape(-1, 3), axis=0) / cells
    return HullCorners.of(tip_map.tips(tip_map.box.from_free_cube(cube)), cube), corners


def _corners_of(image: Image) -> HullCorners:
    which = outer_vertices(image)
    return HullCorners.of(image.places[which], image.cube_vertices(which))


@dataclass(frozen=True, eq=False)
class MovingBoundary:
    """Triangles of the boundary, and what each adds or loses when a parameter changes.

    With the velocity v = ∂r/∂p of the places of the box that lead there, a triangle of outward area
    vector A sweeps the volume v · A per unit of p, to first order.
    """

    places: Array  # centers of the triangles [m], (n, 3)
    area: Array  # their areas [m²], (n,)
    swept: Array  # v · A [m³ per unit], (n, parameters)

    @classmethod
    def of(cls, solid: ReachableSet, parameters: Sequence[Parameter]) -> MovingBoundary:
        """The boundary of a set, and its velocity by some parameters.

        Triangles that are found in a raster move as the nearest place does at which a line of sight
        cuts the boundary.
        """
        tips = TipDerivatives(solid.tip_map, parameters)
        by_faces = solid.route == "flux"
        surface = face_image(solid.tip_map, _CELLS) if by_faces else solid.surface()
        centers = surface.vertices[surface.faces].mean(axis=1)
        if by_faces:
            velocity = tips.at(grid_faces(_CELLS))[surface.faces].mean(axis=1)
        else:
            from scipy.spatial import KDTree

            nodes = boundary_samples(solid.image)
            used, which = np.unique(KDTree(nodes.places).query(centers)[1], return_inverse=True)
            velocity = tips.at(nodes.cube[used])[which]
        a, b, c = np.moveaxis(surface.vertices[surface.faces], 1, 0)
        area = 0.5 * np.cross(b - a, c - a)
        swept = np.nan_to_num(np.einsum("ni,nip->np", area, velocity))
        return cls(centers, np.linalg.norm(area, axis=1), swept)

    def lost(self, changes: Array) -> Array:
        """Volume of what is no longer reached after changes (draws, parameters) [m³], (draws,)."""
        out, swept = np.empty(len(changes)), self.swept.astype(np.float32)

        def task(block: slice) -> None:
            volumes = changes[block].astype(np.float32) @ swept.T
            out[block] = -np.minimum(volumes, 0.0, out=volumes).sum(axis=1, dtype=float)

        size = max(1, _BLOCK // max(1, len(self.area)))
        parallel.run(partial(task, block) for block in parallel.blocks(len(changes), size))
        return out

    def mean_lost(self, deviations: Array) -> float:
        """Its mean over independent normal changes of these deviations: ∮ σ_n dA / √(2π) [m³]."""
        across = np.linalg.norm(self.swept * deviations, axis=1).sum()
        return float(across / np.sqrt(2.0 * np.pi))

    @property
    def growth(self) -> Array:
        """Derivatives of the volume [m³ per unit], shape (parameters,)."""
        return self.swept.sum(axis=0)

    def speed_at(self, points: Array) -> Array:
        """Velocity of the nearest part of the boundary outwards [m per unit], (n, parameters)."""
        rows = self._wide[self._tree.query(points)[1]]
        return self.swept[rows] / self.area[rows, None]

    def distance(self, points: Array) -> Array:
        """Distance to the center of the nearest triangle [m], shape (n,)."""
        return np.asarray(self._tree.query(points)[0])

    @lazy
    def _wide(self) -> Index:
        """Numbers of the triangles that are no slivers."""
        return np.flatnonzero(self.area > _SLIVER * self.area.mean())

    @lazy
    def _tree(self) -> KDTree:
        from scipy.spatial import KDTree

        return KDTree(self.places[self._wide])


@dataclass(frozen=True, eq=False)
class BoundarySamples:
    """Nodes on the boundary, with the activations that lead there: theory (98), without normals.

    Lines of sight along an axis cut the boundary at places that each stand for a square of a cell.
    """

    cube: Array  # in the unit cube of the free bundles, (n, dimension)
    places: Array  # places [m], (n, 3)
    area: Array  # outward area vectors [m²], (n, 3)
    group: Index  # number of the set of lines that each is on: an axis, and every other line, (n,)

    def derivative(self, slopes: Array, weights: Array | None = None) -> Array:
        """Derivatives of the volume by ∂r/∂p at the nodes (n, 3, parameters), shape (parameters,).

        Weights (n,) that are 1 in a region and 0 elsewhere give that of the part of the set there.
        """
        area = self.area if weights is None else self.area * weights[:, None]
        return np.einsum("ni,nip->p", area, slopes)

    def noise(self, slopes: Array) -> Array:
        """Two standard deviations of `derivative`, from every other line, shape (parameters,)."""
        groups = np.zeros((3 * _CLASSES, slopes.shape[2]))
        np.add.at(groups, self.group, np.einsum("ni,nip->np", self.area, slopes))
        of_axes = groups.reshape(3, _CLASSES, -1)
        off = _CLASSES * of_axes - of_axes.sum(axis=1, keepdims=True)
        return np.sqrt((off**2).mean(axis=1).sum(axis=0))


def boundary_samples(image: Image | ReachedCells, sense: int = 0) -> BoundarySamples:
    """Nodes on all of the boundary of an image; the vertices of what is wrapped.

    With a sense, the orientation that most of a map of three bundles keeps, 1 or -1, those for the
    derivative of ∫ ([x is reached] - sense · d) dx, theory (34).
    """
    if isinstance(image, ReachedCells):
        wrap, box = image.wrap, image.grid.tip_map.box
        if not image.is_thick:
            group = np.arange(len(wrap.vertices)) % (3 * _CLASSES)
            return BoundarySamples(wrap.cube, wrap.vertices, wrap.corner_areas, group)
        crossings, _ = image.swept
        cube = box.to_cube(crossings.beyond)[:, box.free].clip(0.0, 1.0)
        at = crossings.coordinates(np.arange(len(cube)), crossings.place)
        return _on_lines(image.lattice, cube, crossings.axis, at, crossings.sense)
    lattice, cuts = image.lattice, list[tuple[Array, Index, Array, Index]]()
    for axis, spans in enumerate(image.spans):
        jumps = np.diff((spans.cover > 0).astype(np.int64), prepend=0)
        jumps -= sense * np.diff(spans.degree, prepend=0)
        which = np.flatnonzero(jumps)
        i, j = np.divmod(spans.column[which], lattice.shape[(axis + 2) % 3])
        at = np.roll(np.stack([spans.start[which], i, j], axis=1), axis, axis=1)
        cube = image.cube_places(spans, axis, which)
        cuts.append((cube, np.full(len(which), axis), at, -jumps[which]))
    return _on_lines(lattice, *(np.concatenate(parts) for parts in zip(*cuts, strict=True)))


def _on_lines(
    lattice: Lattice, cube: Array, axis: Index, at: Array, sense: Index
) -> BoundarySamples:
    """Nodes at coordinates (n, 3) in cells, where lines along an axis leave the set or enter it."""
    every = np.arange(len(at))
    i, j = (at[every, (axis + k) % 3].astype(np.int64) for k in (1, 2))
    area = np.zeros((len(every), 3))
    area[every, axis] = lattice.cell**2 * sense
    group = _CLASSES * axis + 2 * (i % 2) + j % 2
    return BoundarySamples(cube, lattice.places(at), area, group)
