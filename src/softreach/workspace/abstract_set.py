"""Everything that the tip of an arm can reach, as a value to be asked."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator
from softreach.rod.tip_map import TipMap
from softreach.schema import provenance
from softreach.support.arrays import Array
from softreach.support.errors import counted
from softreach.support.quantity import quantity

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Number", "ReachableSet", "with_error"]


_POWERS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


class Number(NamedTuple):
    """One number of a reachable set, as it is stored."""

    value: float
    units: str
    long_name: str


def with_error(name: str, value: float, error: float, unit: str, meaning: str) -> dict[str, Number]:
    """A number and its error, as they are stored."""
    return {
        name: Number(value, unit, meaning),
        f"{name}_error": Number(error, unit, f"error of the {meaning}"),
    }


class ReachableSet(ABC):
    """The image of the activation box under the map from activations to tips.

    Three bundles or more with room between their bounds fill a `ReachableSolid`; two sweep a
    `ReachableSurface`, one draws a `ReachableCurve`, and none leaves a `ReachablePoint`.
    """

    dimension: ClassVar[int]
    """3 for a solid, 2 for a surface, 1 for a curve, 0 for a point."""

    tip_map: TipMap
    """The map whose image this is, with its arm, activation box and tolerance; drives with dead
    zones by inputs beyond these."""
    cells: int
    """Cells of the activation grid along each axis; 0 where there is none."""
    volume: float
    """Volume [m³]; places count once however often they are reached. 0 for all but solids."""
    volume_error: float
    """Error of `volume`, estimated from two resolutions [m³]."""
    convex_volume: float
    """Volume of the convex hull [m³]."""
    convex_volume_error: float
    """Error of `convex_volume`, estimated from two grids [m³]."""
    lost_share: float
    """Share of the activation box that is left out, by volume [-]: cells of the activation grid
    with a corner that has no stable equilibrium, or with neighbors on different branches. It
    shrinks on finer grids toward the share of activations that have no stable equilibrium. For more
    than three free bundles, which have no grid, this is what a sample of the box tells. 0 for an
    arm without loads."""

    @property
    def arm(self) -> Manipulator:
        """The design."""
        return self.tip_map.arm

    @property
    def unreachability(self) -> float:
        """The part of the convex hull that is out of reach [-]; NaN for 0/0.

        1 - V / V_convex, and of a region in a plane 1 - A / A_convex.
        """
        size, _, convex, _ = self._sizes()
        return 1.0 - size / convex if convex > 0 else np.nan

    @property
    def unreachability_error(self) -> float:
        """Error of `unreachability` by those of both volumes or areas [-]; NaN for 0/0."""
        size, error, convex, convex_error = self._sizes()
        return (error + size / convex * convex_error) / convex if convex > 0 else np.nan

    @abstractmethod
    def distance(self, points: ArrayLike) -> Array:
        """Distance of points to the set [m], shape (n,).

        Args:
            points: Positions [m], shape (n, 3), or (3,) for one.

        Raises:
            InvalidInput: Points of another shape or not finite.
        """

    def to_dataset(self) -> xr.Dataset:
        """All numbers of the set with their errors and units, and where they come from."""
        import xarray as xr

        variables = {
            name: ((), number.value, {"units": number.units, "long_name": number.long_name})
            for name, number in {**self._numbers(), **self._lost()}.items()
        }
        attrs = {**provenance(self.arm, self.tip_map.frame), "tol": self.tip_map.tol}
        attrs |= {"activation_grid": self.cells} if self.cells else {}
        return xr.Dataset(variables, attrs=attrs | {"dimension": self.dimension})

    def __repr__(self) -> str:
        size, *details = self._lines()
        if self.lost_share > 0.0:
            share = f"{100 * self.lost_share:.2g} % of the activation box"
            details.append(f"{share} left out: no stable equilibrium, or torn")
        return "\n  ".join([f"{type(self).__name__}: {size}", *details, self._origin()])

    def _lost(self) -> dict[str, Number]:
        if not self.tip_map.supports_unstable:
            return {}
        meaning = "share of the activation box left out: no stable equilibrium, or torn"
        return {"lost_share": Number(self.lost_share, "1", meaning)}

    @abstractmethod
    def _lines(self) -> list[str]:
        """Lines to print: the size first."""

    @abstractmethod
    def _numbers(self) -> dict[str, Number]:
        """Numbers to store."""

    def _sizes(self) -> tuple[float, float, float, float]:
        """Size and error of the set, and of its convex hull."""
        return self.volume, self.volume_error, self.convex_volume, self.convex_volume_error

    def _convex_numbers(self) -> dict[str, Number]:
        convex = self.convex_volume, self.convex_volume_error
        share = self.unreachability, self.unreachability_error
        return {
            **with_error("convex_volume", *convex, "m3", "convex hull's volume"),
            **with_error("unreachability", *share, "1", "share of the convex hull out of reach"),
        }

    def _convex_text(self) -> str:
        return f"convex hull {quantity(self.convex_volume, 'm³', self.convex_volume_error)}"

    def _origin(self) -> str:
        box, rod = self.tip_map.box, self.tip_map
        free = counted(box.dimension, "free bundle")
        power = str(box.dimension).translate(_POWERS) if box.dimension > 1 else ""
        grid = f"activation grid of {self.cells}{power} cells, " if self.cells else ""
        return f"L = {rod.length:g} m, {free}; {grid}tip error up to {rod.tol:g} L"
