"""Everything that the tip of an arm can reach: sizes with their errors, surface, distances."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator
from softreach.geometry.surface import Surface, without_flakes
from softreach.rod.tip_map import TipMap
from softreach.schema import provenance
from softreach.support.arrays import Array, Mask, as_points
from softreach.support.errors import NotPossible, counted
from softreach.support.lazy import lazy
from softreach.support.quantity import quantity
from softreach.workspace.cells import Covering, ReachedCells, cells_of
from softreach.workspace.image import DIAGONAL, Image, boundary_surface, wrapped_surface
from softreach.workspace.measure import Estimate, extrapolated, face_image
from softreach.workspace.sheets import Sheets, box_sheets, outer_sheets, unfolded

if TYPE_CHECKING:
    import xarray as xr

SIZES = "", "curve_length", "area", "volume"  # names of the size of a set, by its dimension

_POWERS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
_MEANINGS = {
    "volume": ("m3", "volume"),
    "area": ("m2", "area"),
    "curve_length": ("m", "length"),
    "convex_volume": ("m3", "convex hull's volume"),
    "convex_area": ("m2", "convex hull's area"),
    "unreachability": ("1", "share of the convex hull out of reach"),
    "fold_volume": ("m3", "volume reached with both orientations"),
    "shell_area": ("m2", "area of the thin set"),
    "shell_thickness": ("m", "thickness of the thin set"),
}
_ROUTES = {
    "flux": "one to one: by flux through the faces of the activation box",
    "raster": "rasterized, as the image folds or overlaps or may do so",
    "search": "searched for in space",
}
_THIN = 0.01  # of its width, the root of its area, that a shell is thinner than
_SEEN = 2.0  # cells of a raster, below which a set is a sheet to it
_CHORDS = 10.0  # of L over the square of the cells of a grid, whose chords leave sheets
_NEVER_THIN = 0.05  # of L³: no sheet within reach is that large and thin

Route = Literal["flux", "raster", "search"]

_Stored = dict[str, tuple[tuple[()], float, dict[str, str]]]
"""Variables of a dataset, each one number."""


class Shell(NamedTuple):
    """A thin set as a sheet: the area of its middle, half of that of both sides."""

    area: Estimate
    """Area of the sheet [m²]."""
    thickness: Estimate
    """Volume over that area [m]."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ReachableSet:
    """The image of the activation box under the map from activations to tips.

    Three bundles or more with room between their bounds fill a solid; two sweep a surface, one
    draws a curve, and none leaves a point. Two or more that move the tip in one plane fill a region
    of it.

    Of a solid of exactly three, a place inside is reached by a number of activations, each with an
    orientation: `multiplicity` and `fold_volume` say how much space is reached how. With more,
    every place inside is reached by infinitely many and these numbers have no meaning.
    """

    tip_map: TipMap
    """The map whose image this is, with its arm, activation box and tolerance; drives with dead
    zones by inputs beyond these."""
    cells: int = 0
    """Cells of the activation grid along each axis; 0 where there is none."""
    volume: float = 0.0
    """Volume [m³]; places count once however often they are reached. 0 for all but solids."""
    volume_error: float = 0.0
    """Error of `volume`, estimated from two resolutions [m³]."""
    area: float = np.nan
    """Area of a surface, whose places count as often as they are reached, or of a region in one
    plane, each place counted once [m²]; NaN for others."""
    area_error: float = np.nan
    """Error of `area`, estimated from two resolutions [m²]."""
    curve_length: float = np.nan
    """Length of a curve [m]; places count as often as they are reached. NaN for others."""
    curve_length_error: float = np.nan
    """Error of `curve_length`, estimated from two resolutions [m]."""
    convex_volume: float = 0.0
    """Volume of the convex hull [m³]."""
    convex_volume_error: float = 0.0
    """Error of `convex_volume`, estimated from two grids [m³]."""
    convex_area: float = np.nan
    """Area of the convex hull of a region in one plane [m²]; NaN for others."""
    convex_area_error: float = np.nan
    """Half of what is between two bounds [m²]."""
    lost_share: float = 0.0
    """Share of the activation box at which no posture is held [-], by the activation grid; where
    there is none, by one of postures or a sample. 0 for an arm without loads."""
    hysteresis_share: float = 0.0
    """Share of the activation box at which two postures are held, the one or the other by the way
    that the arm has come [-]; mirror images of those that lean do not count. 0 for more than
    three free bundles, where it is not known."""
    multiplicity: Mapping[int, float] = field(default_factory=dict)
    """Volume of the places that exactly 1, 2, ... activations reach [m³]; empty for other
    numbers of free bundles than three."""
    multiplicity_error: float = np.nan
    """Error of the volume reached more than once [m³]; 0 for the route "flux", NaN for other
    numbers of free bundles than three."""
    fold_volume: float = np.nan
    """Volume of the places reached with both orientations of the map [m³]; they lie behind a fold.
    NaN for other numbers of free bundles than three."""
    route: Route = "raster"
    """Source of the volume of a solid. "flux": the map is found to be one to one, and the volume is
    what flows through the images of the six faces of the activation box. "raster": the image folds
    or overlaps, or may do so under loads and at kinks; a signed volume by flux makes it exact
    elsewhere, unless the set is torn. "search": more than three free bundles."""
    is_torn: bool = False
    """True if a solid is the image of several sheets of postures."""
    covering: Covering | None = field(default=None, repr=False)
    """What a solid covers of space: its `image`."""
    mesh: Surface | None = field(default=None, repr=False)
    """Triangles of a surface or region; a curve as chords, from the lower bound to the upper one,
    and a point, as triangles that repeat a corner. None for a solid."""
    outline: Surface | None = field(default=None, repr=False)
    """Closed curves of tips around a region in one plane and its holes [m]: lines from tip to tip,
    as triangles that repeat a corner. Parts of them may enclose nothing. None for others."""

    @property
    def arm(self) -> Manipulator:
        """The design."""
        return self.tip_map.arm

    @property
    def dimension(self) -> int:
        """3 for a solid, 2 for a surface or a region, 1 for a curve, 0 for a point."""
        return min(self.tip_map.box.dimension, 3 if self.mesh is None else 2)

    @property
    def image(self) -> Covering:
        """The mapped activation grid, rasterized; of more than three bundles what was found.

        Raises:
            NotPossible: The set is thin.
        """
        if self.covering is None:
            raise self._is_thin("cells")
        return self.covering

    def _is_thin(self, what: str) -> NotPossible:
        return NotPossible(f"a set of dimension {self.dimension} has no {what}: ask for distances")

    @property
    def unreachability(self) -> float:
        """The part of the convex hull that is out of reach [-]; NaN for 0/0.

        1 - V / V_convex, and of a region in a plane 1 - A / A_convex.
        """
        size, _, convex, _ = self._sizes
        return 1.0 - size / convex if convex > 0 else np.nan

    @property
    def unreachability_error(self) -> float:
        """Error of `unreachability` by those of both volumes or areas [-]; NaN for 0/0."""
        size, error, convex, convex_error = self._sizes
        return (error + size / convex * convex_error) / convex if convex > 0 else np.nan

    @property
    def _sizes(self) -> tuple[float, float, float, float]:
        if self.outline is None:
            return self.volume, self.volume_error, self.convex_volume, self.convex_volume_error
        return self.area, self.area_error, self.convex_area, self.convex_area_error

    @property
    def fold_volume_error(self) -> float:
        """Error of `fold_volume`, as that of the volume reached more than once [m³]."""
        return self.multiplicity_error

    @lazy
    def grid(self) -> xr.Dataset:
        """The cells: `occupied`, and for three free bundles `count` and `degree`, at centers [m].

        `count` is the number of activations that reach the center, `degree` counts those that the
        map turns over as -1. Exact for the map that is linear on the simplices of the grid.

        Raises:
            NotPossible: The set is thin.
        """
        import xarray as xr

        counts, degrees = self.image.counts
        fields = {"occupied": counts > 0}
        if self.multiplicity:
            fields |= {"count": counts.clip(0), "degree": degrees}
        variables = {name: (tuple("xyz"), values) for name, values in fields.items()}
        lattice = self.image.lattice
        attrs = provenance(self.arm, self.tip_map.frame)
        attrs |= {"cell": lattice.cell, "length": self.tip_map.length}
        return xr.Dataset(variables, lattice.centers(), attrs)

    @lazy
    def shell(self) -> Shell | None:
        """The sheet that a set thinner than a hundredth of its width is; None for other sets."""
        if self.dimension < 3 or self.volume > _NEVER_THIN * self.tip_map.length**3:
            return None
        area = self._boundary_area()
        half = Estimate(0.5 * area.value, 0.5 * area.error)
        if not half.value > 0.0 or self.volume > _THIN * half.value**1.5:
            return None
        thickness = self.volume / half.value
        error = self.volume_error / half.value + thickness * half.error / half.value
        return Shell(half, Estimate(thickness, error))

    def _boundary_area(self) -> Estimate:
        if self.route == "search":
            assert isinstance(self.image, ReachedCells)
            fine, coarse = self.image.wrap.area, self.image.coarse.area
            return Estimate(fine, abs(fine - coarse))
        cells = 48 if self.tip_map.supports_unstable else 96
        fine, coarse = (face_image(self.tip_map, count).area for count in (cells, cells // 2))
        area = extrapolated(fine, coarse)
        # What is reached more than once counts once, and may be any part of the faces.
        share = self._several / self.volume if self.volume > 0.0 else 1.0
        return area._replace(error=area.error + share * fine)

    def surface(self) -> Surface:
        """The boundary of a solid: closed, oriented outwards, without staircase; or a surface.

        For the route "flux" it is the image of the faces of the activation box, on which its
        vertices lie exactly; for more than three free bundles a surface of tips, which is wrapped
        around parts of any thinness and leaves corners out by up to half a cell, and so it is for
        three where the set is thinner than two cells. Under loads it goes around the raster, in one
        part for most arms, and fills gaps below two cells. Otherwise it is found in the raster, and
        wrapped where that leaves a corner out by more than the diagonal of a cell. Parts that add
        up to less than the error of the volume are left out.

        Raises:
            NotPossible: The set is a curve or a point.
            MissingExtra: scikit-image is not installed.
        """
        if self.dimension < 2:
            raise self._is_thin("surface")
        return self._surface

    def sheets(self) -> Sheets:
        """The boundary of a solid as the sheets it consists of: images of faces, and folds.

        Unlike `surface()` it is smooth, ends sharply at rims and where sheets cross, has parts of
        any thinness, and knows its `lines` and activations. It is for pictures: there may be gaps
        where sheets meet. Of more than three free bundles, of maps with kinks and under loads where
        the set folds it is `surface()` without slivers that look inward, of surfaces `surface()`.

        Raises:
            NotPossible: The set is a curve or a point.
            MissingExtra: scikit-image is not installed.
        """
        return self._sheets

    def contains(self, points: ArrayLike) -> Mask:
        """Mask of the points that are reachable: a mapped simplex of the grid covers them.

        For more than three free bundles, and of sets thinner than two cells, a search within the
        bounds ends on them, to a hundredth of a cell.

        Args:
            points: Positions [m], shape (n, 3).

        Raises:
            InvalidInput: Points of another shape or not finite.
            NotPossible: The set is thin.
        """
        if self.dimension < 3:
            raise self._is_thin("inside")
        positions, covering = as_points("points", points), self._cover
        inside = covering.are_deep(positions)
        inside[~inside] = covering.counts_at(positions[~inside]) > 0
        return inside

    def distance(self, points: ArrayLike) -> Array:
        """Distance of points to the set [m], shape (n,); of a solid to its boundary, < 0 inside.

        Outside of a solid it is the distance to the image of the grid itself, or for more than
        three free bundles to the nearest tip that a search finds. Inside it is the distance to the
        surface found in the raster, in which parts and gaps thinner than a cell are lost, or to
        `surface`. Of thin sets it is that to the triangles or chords of the mapped grid.

        Args:
            points: Positions [m], shape (n, 3), or (3,) for one.

        Raises:
            InvalidInput: Points of another shape or not finite.
            MissingExtra: scikit-image is not installed.
        """
        positions = as_points("points", points)
        if self.mesh is not None:
            surfaces = [each for each in (self.mesh, self.outline) if each is not None]
            return np.min([each.distance(positions) for each in surfaces], axis=0)
        inside = self.contains(positions)
        out = np.empty(len(positions))
        out[inside] = -self._boundary.distance(positions[inside])
        out[~inside] = self._cover.distance(positions[~inside])
        return out

    def to_dataset(self) -> xr.Dataset:
        """All numbers of the set with their errors and units, and where they come from.

        `multiplicity` is over `activations`.
        """
        import xarray as xr

        attrs = {**provenance(self.arm, self.tip_map.frame), "tol": self.tip_map.tol}
        attrs |= {"activation_grid": self.cells} if self.cells else {}
        attrs["dimension"] = self.dimension
        if self.covering is not None:
            attrs |= {"route": self.route, "cell": self.covering.lattice.cell}
        dataset = xr.Dataset(self._numbers(), attrs=attrs)
        if self.multiplicity:
            name = {"units": "m3", "long_name": "volume that so many activations reach"}
            volumes = "activations", list(self.multiplicity.values()), name
            dataset = dataset.assign_coords(activations=list(self.multiplicity))
            dataset["multiplicity"] = volumes
        return dataset

    def _numbers(self) -> _Stored:
        if not self.dimension:
            assert self.mesh is not None
            return {
                name: ((), float(value), {"units": "m", "long_name": f"{name} of the tip"})
                for name, value in zip("xyz", self.mesh.vertices[0], strict=True)
            }
        numbers: _Stored = {}
        if self.shell is not None:
            area, thickness = self.shell
            numbers |= _with_error("shell_area", *area) | _with_error("shell_thickness", *thickness)
        hull = () if self.outline is None else ("convex_area",)
        for name in (SIZES[self.dimension], *hull, "convex_volume", "unreachability"):
            numbers |= _with_error(name, getattr(self, name), getattr(self, f"{name}_error"))
        if self.multiplicity:
            about = {"units": "m3", "long_name": "error of the volume reached more than once"}
            numbers["multiplicity_error"] = (), self.multiplicity_error, about
            numbers |= _with_error("fold_volume", self.fold_volume, self.fold_volume_error)
        if self.tip_map.supports_unstable:
            meanings = {"lost": "without a posture", "hysteresis": "with two postures"}
            for name, meaning in meanings.items():
                about = {"units": "1", "long_name": f"share of the activation box {meaning}"}
                numbers[f"{name}_share"] = (), getattr(self, f"{name}_share"), about
        return numbers

    def __repr__(self) -> str:
        size, *details = self._lines()
        if self.lost_share > 0.0:
            details.append(f"no posture is held at {100 * self.lost_share:.2g} % of activations")
        if self.hysteresis_share > 0.0:
            share = f"{100 * self.hysteresis_share:.2g} % of activations"
            details.append(f"hysteresis: two postures are held at {share}")
        box, tip_map = self.tip_map.box, self.tip_map
        power = str(box.dimension).translate(_POWERS) if box.dimension > 1 else ""
        grid = f"activation grid of {self.cells}{power} cells, " if self.cells else ""
        free = counted(box.dimension, "free bundle")
        details.append(f"L = {tip_map.length:g} m, {free}; {grid}tip error up to {tip_map.tol:g} L")
        return "\n  ".join([f"ReachableSet: {size}", *details])

    def _lines(self) -> list[str]:
        if not self.dimension:
            assert self.mesh is not None
            return ["({:.6g}, {:.6g}, {:.6g}) m".format(*self.mesh.vertices[0])]
        name, hull = SIZES[self.dimension], "convex_volume"
        lines = [f"{_MEANINGS[name][1]} {self._text(name)}"]
        if self.outline is not None:
            hull = "convex_area"
            lines[0] += f" in one {'plane' if self.convex_area else 'line'}"
        lines.append(f"convex hull {self._text(hull)}")
        if _MEANINGS[name][0] == _MEANINGS[hull][0] and getattr(self, hull) > 0.0:
            lines[1] += f", of which {self._text('unreachability')} are out of reach"
        if self.covering is None:
            return lines
        if self.shell is not None:
            area, thickness = self.shell
            sheet = f"a shell of area {quantity(area.value, 'm²', area.error)}, "
            lines.insert(0, f"{sheet}thickness {quantity(thickness.value, 'm', thickness.error)}")
        if self.multiplicity:
            again = quantity(self._several, "m³", self.multiplicity_error)
            folds = self._text("fold_volume")
            lines.append(f"reached more than once {again}, behind folds {folds}")
        raster = "" if self.route == "flux" else f", cells of {self.image.lattice.cell:.3g} m"
        return [*lines, _ROUTES[self.route] + raster]

    def _text(self, name: str) -> str:
        value, error, unit = getattr(self, name), getattr(self, f"{name}_error"), _MEANINGS[name][0]
        if unit == "1":
            return quantity(100 * value, "%", 100 * error)
        return quantity(value, unit.translate(_POWERS), error)

    @property
    def _several(self) -> float:
        return sum(volume for times, volume in self.multiplicity.items() if times > 1)

    @lazy
    def _boundary(self) -> Surface:
        if isinstance(self._cover, ReachedCells):
            return self._cover.wrap
        if self.tip_map.supports_unstable:
            return wrapped_surface(self._cover, self.volume)
        surface, cell = boundary_surface(self._cover, self.volume), self.image.lattice.cell
        corners = self.tip_map.tips(self.tip_map.box.corners())
        outer = corners[~self._cover.are_deep(corners)]
        if (surface.distance(outer) > DIAGONAL * cell).any():  # a spike that no center is in
            return cells_of(self.tip_map, cell, self._cover.are_deep).wrap
        return surface

    @lazy
    def _cover(self) -> Covering:
        """What tells inside from outside: of sets that are thin to the raster, a search instead."""
        cell, length = self.image.lattice.cell, self.tip_map.length
        may_be = not self.is_torn and self.volume <= _NEVER_THIN * length**3
        if may_be and isinstance(self.image, Image):
            least = max(_SEEN * cell, _CHORDS * length / self.cells**2)
            if 2.0 * self.volume <= least * self._boundary_area().value:  # not of NaN
                return cells_of(self.tip_map, cell)
        return self.image

    @lazy
    def _sheets(self) -> Sheets:
        tip_map = self.tip_map
        if self.route == "flux":
            return box_sheets(tip_map)
        if isinstance(self.covering, Image) and tip_map.is_smooth and not tip_map.supports_unstable:
            return outer_sheets(tip_map, self.covering)
        return Sheets.of(unfolded(self.surface()) if self.dimension == 3 else self.surface())

    @lazy
    def _surface(self) -> Surface:
        if self.mesh is not None:
            return self.mesh
        if self.route == "flux":
            return face_image(self.tip_map)
        return without_flakes(self._boundary, self.volume_error)


def _with_error(name: str, value: float, error: float) -> _Stored:
    """A number and its error, as they are stored."""
    unit, meaning = _MEANINGS[name]
    return {
        name: ((), value, {"units": unit, "long_name": meaning}),
        f"{name}_error": ((), error, {"units": unit, "long_name": f"error of the {meaning}"}),
    }
