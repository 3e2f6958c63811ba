"""Everything that the tip of an arm can reach, as a value to be asked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator
from softreach.errors import InvalidInput
from softreach.geometry.delaunay import finite_points
from softreach.workspace.image import Image
from softreach.workspace.surface import (
    Surface,
    boundary_surface,
    critical_surface,
    signed_field,
)

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["ReachableSet"]

Array = NDArray[np.float64]

_NAMES = ("point", "length", "area", "volume")


@dataclass(frozen=True, kw_only=True, eq=False)
class ReachableSet:
    """The image of the activation box under the map from activations to tips.

    Three bundles or more with room between their bounds fill a solid; two sweep a surface, one a
    curve: these have an area or a length and no volume.
    """

    arm: Manipulator
    dimension: int
    """3 for a solid, 2 for a surface, 1 for a curve, 0 for a point."""
    measure: float
    """Volume [m³], area [m²] or length [m]; see `measure_name`. Places of a solid count once
    however often they are reached, those of a surface or curve as often as they are."""
    measure_error: float
    """How far off `measure` may be, estimated from two resolutions, same unit."""
    convex_volume: float
    """Volume of the convex hull [m³]."""
    multiplicity: Mapping[int, float]
    """Volume of the places that exactly 1, 2, ... activations reach [m³]. Three bundles only:
    with more, every place inside is reached by infinitely many, and this is empty."""
    multiplicity_error: float
    """By how much the volume reached more than once changed from half as fine a grid [m³]."""
    fold_volume: float
    """Volume of the places reached with both orientations of the map [m³]; they lie behind a fold.
    Three bundles only, else 0."""
    cells: int
    """Cells of the activation grid along each axis."""
    image: Image | None = field(repr=False)
    """The rasterized image of a solid; None for surfaces and curves."""
    sheet: Surface | None = field(repr=False)
    """The mapped grid of a surface or curve; None for solids."""

    @property
    def measure_name(self) -> str:
        """What `measure` is: "volume", "area", "length" or "point"."""
        return _NAMES[self.dimension]

    @property
    def volume(self) -> float:
        """Volume [m³]; 0 for surfaces and curves."""
        return self.measure if self.dimension == 3 else 0.0

    @property
    def volume_error(self) -> float:
        """How far off `volume` may be [m³]."""
        return self.measure_error if self.dimension == 3 else 0.0

    @property
    def unreachability(self) -> float:
        """The part of the convex hull that is out of reach, 1 - V / V_convex [-]; NaN for 0/0."""
        return 1.0 - self.volume / self.convex_volume if self.convex_volume > 0 else float("nan")

    @cached_property
    def grid(self) -> xr.Dataset:
        """Cells of a solid: `occupied`, and for three bundles `count` and `degree`, at centers [m].

        `count` is the number of activations that reach the center, `degree` counts those that the
        map turns over as -1. Exact for the map that is linear on the simplices of the grid.

        Raises:
            InvalidInput: A surface or a curve.
        """
        import xarray as xr

        image = self._solid("grid")
        counts, degrees = image.counts
        fields = {"occupied": counts > 0}
        if self.multiplicity:
            fields |= {"count": counts, "degree": degrees}
        variables = {name: (tuple("xyz"), values) for name, values in fields.items()}
        cell, length = image.lattice.cell, self.arm.length
        attrs = {"cell": cell, "length": length, "design": self.arm.to_toml()}
        return xr.Dataset(variables, image.lattice.centers(), attrs)

    def surface(self) -> Surface:
        """The boundary of a solid: closed, oriented outwards, without staircase; or the surface.

        Raises:
            InvalidInput: A curve or a point.
            MissingExtra: scikit-image is not installed.
        """
        if self.dimension < 2:
            raise InvalidInput("dimension", self.dimension, "2 or 3 for a surface")
        return self._boundary

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Whether points are reachable: whether a mapped simplex of the grid covers them.

        Exactly so for three bundles; for more, points a small part of a cell outside may pass.

        Args:
            points: Positions [m], shape (n, 3).

        Raises:
            InvalidInput: Points of another shape or not finite; a surface or a curve, on which no
                point lies but by chance: use `distance`.
        """
        from scipy.ndimage import map_coordinates

        image = self._solid("contains")
        positions = finite_points(np.asarray(points, float))
        # More than a cell's diagonal inside there is nothing to decide. With more bundles very many
        # triangles are critical: there the interpolated field decides wherever it says inside.
        margin = np.sqrt(3.0) if self.multiplicity else 0.0
        at = image.lattice.coordinates(positions)
        found = map_coordinates(self._field, at.T, order=1, cval=np.inf) < -margin
        found[~found] = image.counts_at(positions[~found]) > 0
        return found

    def distance(self, points: ArrayLike) -> Array:
        """Distance to the boundary, negative inside [m]; to a surface or curve, never negative.

        Outside it is the distance to the image of the grid itself. Inside it is the distance to
        `surface()`, in which parts and gaps thinner than a cell are lost.

        Args:
            points: Positions [m], shape (n, 3).

        Raises:
            InvalidInput: Points of another shape or not finite.
            MissingExtra: scikit-image is not installed.
        """
        positions = finite_points(np.asarray(points, float))
        if self.sheet is not None:
            return self.sheet.distance(positions)
        inside = self.contains(positions)
        out = np.empty(len(positions))
        out[inside] = -self._boundary.distance(positions[inside])
        out[~inside] = self._critical.distance(positions[~inside])
        return out

    def _solid(self, asked: str) -> Image:
        if self.image is None:
            hint = f"a {self.measure_name} has no cells: use .distance(points)"
            raise InvalidInput(f"dimension (for {asked})", self.dimension, "3", hint)
        return self.image

    @cached_property
    def _field(self) -> Array:
        return signed_field(self._solid("contains"))

    @cached_property
    def _boundary(self) -> Surface:
        if self.sheet is not None:
            return self.sheet
        return boundary_surface(self._solid("surface"), self._field, self.volume)

    @cached_property
    def _critical(self) -> Surface:
        return critical_surface(self._solid("distance"))
