"""Derivatives of the reachable volume by parameters of the design: theory (83) and (84)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.parameters import Parameter, find_parameters
from softreach.geometry.hull import convex_hull
from softreach.rod.rods import tip_map
from softreach.rod.tip_map import TipMap
from softreach.rod.view import stable_tips
from softreach.schema import provenance
from softreach.support.arguments import as_names, as_number
from softreach.support.arrays import Array, Index
from softreach.support.errors import InvalidInput
from softreach.support.progress import Progress, as_progress
from softreach.support.quantity import quantity
from softreach.workspace.flux import Flux, flux_tol, grid_faces, signed_volume
from softreach.workspace.grid import cube_grid
from softreach.workspace.measure import Estimate
from softreach.workspace.reach import ACCURACIES, rasterized_set, reachable_set
from softreach.workspace.shifts import Shifts, shifts_along
from softreach.workspace.solid import ReachableSolid

if TYPE_CHECKING:
    import xarray as xr

_MOST_CELLS = 48  # of a grid of which all vertices are looked at
_MOST_FACE_CELLS = 84  # of one of which those on the faces are
_STEP = 3e-3  # of a parameter, for what is smooth to the tolerance of tips
_RASTER_STEP = 2e-2  # for what is rasterized, which is rough
_ROUGHNESS = np.array([1.0, -4.0, 6.0, -4.0, 1.0])  # fourth differences: nothing smooth is left
_MEANINGS = {
    "volume": ("m3 per unit", "derivative of the reachable volume"),
    "volume_error": ("m3 per unit", "error of the derivative of the reachable volume"),
    "convex_volume": ("m3 per unit", "derivative of the convex hull's volume"),
    "convex_volume_error": ("m3 per unit", "error of the derivative of the convex hull's volume"),
    "unreachability": ("1 per unit", "derivative of the unreachability"),
    "unreachability_error": ("1 per unit", "error of the derivative of the unreachability"),
}


def volume_gradient(
    arm: Manipulator,
    parameters: str | Sequence[str],
    *,
    accuracy: float = 3e-3,
    progress: Progress | None = None,
) -> VolumeGradient:
    """Derivatives of the reachable volume by design parameters, for three free bundles.

    The images of the six faces of the activation box move with the design: what they sweep is the
    change of the signed volume, theory (83), and is exact to seven digits or so. That is all where
    the map is one to one. Where the image folds or overlaps, the derivative of the rest that is
    rasterized is added, from differences between neighboring designs; it is by far the larger part
    of the error stated. Where cells are left out of the box, for lack of a stable equilibrium,
    everything is from such differences.

    The convex hull changes with its corners, theory (84). Its volume, as that of the reachable set,
    has kinks where the touched places jump; there the derivative is that of one side.

    By a parameter that several parts share, the derivative is the sum of those by the parts' own:
    all of them grow by the same amount, revolutions each in its own sense.

    Args:
        arm: The design.
        parameters: Names as in atlases: `taper`, `revolution`, `rings[0].inner_ratio`,
            `left.offset`, and the bounds of activations, `lower`, `upper` or `left.lower[1]`.
        accuracy: As for `reachable_set`: of the convex hull, and of what is rasterized.
        progress: Called with 1 for each parameter done.

    Raises:
        InvalidInput: Other than three free bundles, no parameters, one that the design lacks or
            that counts something, or one whose change holds or frees a bundle.
        InvalidDesign: The design has no neighbors with other values of a parameter.
    """
    arm, names = a_manipulator("arm", arm), as_names("parameters", parameters)
    accuracy, progress = as_number("accuracy", accuracy, ACCURACIES), as_progress(progress)
    if not names:
        raise InvalidInput("parameters", "none", "the name of one or more")
    if twice := [name for name in names if names.count(name) > 1]:
        raise InvalidInput("parameters", twice[0], "given once")
    parameter_of = find_parameters(arm, names)
    solid = _solid(arm, accuracy)
    base = _Base(solid, accuracy)
    rows = []
    for name in names:
        rows.append(base.derivatives(parameter_of[name]))
        progress(1)
    volume, convex = zip(*rows, strict=True)
    return VolumeGradient(
        solid=solid,
        parameters=names,
        units=tuple(parameter_of[name].unit for name in names),
        volume=np.array([each.value for each in volume]),
        volume_error=np.array([each.error for each in volume]),
        convex_volume=np.array([each.value for each in convex]),
        convex_volume_error=np.array([each.error for each in convex]),
    )


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class VolumeGradient:
    """Derivatives of volume, convex volume and unreachability by parameters of a design."""

    solid: ReachableSolid
    """Reachable set of the design itself."""
    parameters: tuple[str, ...]
    """Names of the parameters."""
    units: tuple[str, ...]
    """Unit of each parameter."""
    volume: Array
    """∂V/∂p [m³ per unit of the parameter], shape (parameter,)."""
    volume_error: Array
    """Errors of these derivatives."""
    convex_volume: Array
    """Derivatives of the volume of the convex hull [m³ per unit], shape (parameter,)."""
    convex_volume_error: Array
    """Errors of these derivatives."""

    @property
    def route(self) -> str:
        """Source of the volume and its derivatives, as `ReachableSolid.route`."""
        return self.solid.route

    @property
    def unreachability(self) -> Array:
        """Derivatives of 1 - V / V_convex [1 per unit], shape (parameter,)."""
        volume, convex = self.solid.volume, self.solid.convex_volume
        return (volume * self.convex_volume / convex - self.volume) / convex

    @property
    def unreachability_error(self) -> Array:
        """Errors of these derivatives."""
        volume, convex = self.solid.volume, self.solid.convex_volume
        return (volume * self.convex_volume_error / convex + self.volume_error) / convex

    def to_dataset(self) -> xr.Dataset:
        """All derivatives with their errors over `parameter`, and where they come from."""
        import xarray as xr

        numbers = {
            name: ("parameter", getattr(self, name), {"units": unit, "long_name": meaning})
            for name, (unit, meaning) in _MEANINGS.items()
        }
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


def hull_corners(solid: ReachableSolid) -> dict[int, HullCorners]:
    """Corners of the hulls of images of some grids, by their number of cells along each axis.

    Where the image folds, vertices inside the box may be corners as well as those on its faces.
    """
    folds = solid.route != "flux"
    most = _MOST_CELLS if folds else _MOST_FACE_CELLS
    grids = (most // 2, 3 * most // 4, most)
    return {n: _corners(solid.tip_map, cube_grid(n) if folds else grid_faces(n)) for n in grids}


class HullCorners(NamedTuple):
    """Activations whose tips are the corners of a convex hull."""

    cube: Array
    """In the unit cube of the free bundles, shape (n, 3)."""
    area: Array
    """∂V_convex/∂r of each corner [m²], shape (n, 3)."""


def _corners(rod: TipMap, cube: Array) -> HullCorners:
    tips = stable_tips(rod).tips(rod.box.from_free_cube(cube))
    hull = convex_hull(tips)
    area = np.zeros_like(hull.vertices)
    corners = (hull.vertices - hull.vertices.mean(axis=0))[hull.faces]
    for k in range(3):
        # The volume is a sum of triple products over 6: linear in each corner.
        share = np.cross(corners[:, (k + 1) % 3], corners[:, (k + 2) % 3]) / 6.0
        np.add.at(area, hull.faces[:, k], share)
    return HullCorners(cube[_rows_of(hull.vertices, tips)], area)


def _rows_of(some: Array, every: Array) -> Index:
    """Places of some points in a list of all; one place for those that come twice."""
    from scipy.spatial import KDTree  # lazily

    return np.asarray(KDTree(every).query(some)[1], np.int64)


def _solid(arm: Manipulator, accuracy: float) -> ReachableSolid:
    free = tip_map(arm).box.dimension
    if free != 3:
        raise InvalidInput("arm", f"{free} free bundles", "three of them")
    solid = reachable_set(arm, accuracy=accuracy)
    assert isinstance(solid, ReachableSolid)
    return solid


class _Base:
    """The design whose volume is differentiated, with all that its neighbors are compared to."""

    def __init__(self, solid: ReachableSolid, accuracy: float) -> None:
        self._solid, self._accuracy = solid, accuracy
        self._flux = None if solid.lost_share > 0.0 else signed_volume(solid.tip_map)
        self._corners = None if self._flux is None else hull_corners(solid)

    def derivatives(self, parameter: Parameter) -> tuple[Estimate, Estimate]:
        """Of volume and convex volume."""
        arm = self._solid.arm
        if self._flux is None or self._corners is None:
            return self._by_raster(parameter)
        shifts = shifts_along(arm, parameter, 3, _STEP)
        rods = [tip_map(each, flux_tol(self._solid.tip_map)) for each in shifts.arms]
        volume = _swept(self._flux, shifts, rods)
        convex = _limit({n: _dragged(each, shifts, rods) for n, each in self._corners.items()})
        if self._solid.route == "raster":
            beyond, _ = self._by_raster(parameter)
            volume = Estimate(volume.value + beyond.value, volume.error + beyond.error)
        return volume, convex

    def _by_raster(self, parameter: Parameter) -> tuple[Estimate, Estimate]:
        """Derivatives of what is rasterized: the volume beyond the flux, and the convex volume."""
        shifts = shifts_along(self._solid.arm, parameter, 2, _RASTER_STEP)
        solids = [self._like_this(each) for each in shifts.arms]
        rests = [self._beyond_flux(each) for each in solids]
        convex = [each.convex_volume for each in solids]
        return _rough_derivative(shifts, rests), _rough_derivative(shifts, convex)

    def _like_this(self, arm: Manipulator) -> ReachableSolid:
        """A neighbor, with the same grid and cells."""
        if arm is self._solid.arm:
            return self._solid
        cell = self._solid.image.lattice.cell
        return rasterized_set(tip_map(arm), self._solid.cells, cell, self._accuracy)

    def _beyond_flux(self, solid: ReachableSolid) -> float:
        """Volume less what the flux says of it, if it is used."""
        if self._flux is None:
            return solid.volume
        return solid.volume - abs(signed_volume(solid.tip_map).value)


def _swept(flux: Flux, shifts: Shifts, rods: Sequence[TipMap]) -> Estimate:
    """Derivative of |signed volume|: what the moving faces sweep."""

    def along(tips: Array) -> float:
        return float(np.sign(flux.value) * (tips * flux.area).sum())

    noise = rods[0].tol * rods[0].length * float(np.linalg.norm(flux.area, axis=1).sum())
    return _derivative(shifts, rods, flux.faces.cube, along, noise)


def _dragged(corners: HullCorners, shifts: Shifts, rods: Sequence[TipMap]) -> Estimate:
    """Derivative of the volume of a convex hull: what its moving corners drag along."""

    def along(tips: Array) -> float:
        return float((tips * corners.area).sum())

    noise = rods[0].tol * rods[0].length * float(np.linalg.norm(corners.area, axis=1).sum())
    return _derivative(shifts, rods, corners.cube, along, noise)


def _limit(of_grids: Mapping[int, Estimate]) -> Estimate:
    """For infinitely fine grids, whose error falls as 1/n² or a little slower.

    Corners jump from vertex to vertex: twice what is removed is part of the error, and so is how
    far the grids are from the rule.
    """
    cells = np.array(list(of_grids), float)
    values = np.array([each.value for each in of_grids.values()])
    rule = np.stack([np.ones_like(cells), cells**-2.0], axis=1)
    coefficients = np.linalg.lstsq(rule, values, rcond=None)[0]
    off = float(np.abs(rule @ coefficients - values).max())
    smooth = max(each.error for each in of_grids.values())
    limit = float(coefficients[0])
    return Estimate(limit, smooth + 2.0 * off + 2.0 * abs(limit - values[-1]))


def _derivative(
    shifts: Shifts,
    rods: Sequence[TipMap],
    cube: Array,
    along: Callable[[Array], float],
    noise: float,
) -> Estimate:
    """Derivative of a linear function of the tips at places in the box that moves with the design.

    Args:
        shifts: The neighbors.
        rods: Their tip maps.
        cube: Places in the unit cube of the free bundles, shape (n, 3).
        along: The function.
        noise: Largest error of a value.
    """
    values = np.array([along(rod.tips(rod.box.from_free_cube(cube))) for rod in rods])
    value, rough = float(shifts.weights @ values), float(shifts.rough_weights @ values)
    return Estimate(value, abs(value - rough) + noise * float(np.linalg.norm(shifts.weights)))


def _rough_derivative(shifts: Shifts, values: Sequence[float]) -> Estimate:
    """Derivative of values that a raster has made rough."""
    value, smooth = float(shifts.weights @ values), float(shifts.rough_weights @ values)
    noise = abs(float(_ROUGHNESS @ values)) / float(np.linalg.norm(_ROUGHNESS))
    error = abs(value - smooth) + 2.0 * noise * float(np.linalg.norm(shifts.weights))
    return Estimate(value, float(error))
