"""Everything that the tip of an arm can reach, as a value to be asked."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

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

_POWERS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
_MEANINGS = {
    "volume": ("m3", "volume"),
    "area": ("m2", "area"),
    "curve_length": ("m", "length"),
    "convex_volume": ("m3", "convex hull's volume"),
    "convex_area": ("m2", "convex hull's area"),
    "unreachability": ("1", "share of the convex hull out of reach"),
}

Stored = dict[str, tuple[tuple[()], float, dict[str, str]]]
"""Variables of a dataset, each one number."""


def with_error(name: str, value: float, error: float, unit: str, meaning: str) -> Stored:
    """A number and its error, as they are stored."""
    return {
        name: ((), value, {"units": unit, "long_name": meaning}),
        f"{name}_error": ((), error, {"units": unit, "long_name": f"error of the {meaning}"}),
    }


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ReachableSet(ABC):
    """The image of the activation box under the map from activations to tips.

    Three bundles or more with room between their bounds fill a `ReachableSolid`; two sweep a
    `ReachableSurface`, one draws a `ReachableCurve`, and none leaves a `ReachablePoint`.
    """

    dimension: ClassVar[int]
    """3 for a solid, 2 for a surface, 1 for a curve, 0 for a point."""
    _stored: ClassVar[tuple[str, ...]]
    """Names of the numbers that are stored with an error: its size and its hull's first."""

    tip_map: TipMap
    """The map whose image this is, with its arm, activation box and tolerance; drives with dead
    zones by inputs beyond these."""
    cells: int = 0
    """Cells of the activation grid along each axis; 0 where there is none."""
    volume: float = 0.0
    """Volume [m³]; places count once however often they are reached. 0 for all but solids."""
    volume_error: float = 0.0
    """Error of `volume`, estimated from two resolutions [m³]."""
    convex_volume: float = 0.0
    """Volume of the convex hull [m³]."""
    convex_volume_error: float = 0.0
    """Error of `convex_volume`, estimated from two grids [m³]."""
    lost_share: float = 0.0
    """Share of the activation box at which no posture is held [-], told by the activation grid; for
    more than three free bundles, which have no grid, by a sample. 0 for an arm without loads."""
    hysteresis_share: float = 0.0
    """Share of the activation box at which two postures are held, the one or the other by the way
    that the arm has come [-]; mirror images of those that lean do not count. 0 where nothing tells:
    for more than three free bundles, and in one plane."""

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

        variables = self._numbers()
        if self.tip_map.supports_unstable:
            meanings = {"lost": "without a posture", "hysteresis": "with two postures"}
            for name, meaning in meanings.items():
                about = {"units": "1", "long_name": f"share of the activation box {meaning}"}
                variables[f"{name}_share"] = ((), getattr(self, f"{name}_share"), about)
        attrs = {**provenance(self.arm, self.tip_map.frame), "tol": self.tip_map.tol}
        attrs |= {"activation_grid": self.cells} if self.cells else {}
        return xr.Dataset(variables, attrs=attrs | {"dimension": self.dimension})

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
        return "\n  ".join([f"{type(self).__name__}: {size}", *details])

    def _lines(self) -> list[str]:
        """Lines to print: the size first."""
        size, hull = self._stored[:2]
        lines = [f"{_MEANINGS[size][1]} {self._text(size)}", f"convex hull {self._text(hull)}"]
        if _MEANINGS[size][0] == _MEANINGS[hull][0] and getattr(self, hull) > 0.0:
            lines[1] += f", of which {self._text('unreachability')} are out of reach"
        return lines

    def _numbers(self) -> Stored:
        """Numbers to store."""
        each = (
            with_error(name, getattr(self, name), getattr(self, f"{name}_error"), *_MEANINGS[name])
            for name in self._stored
        )
        return {name: number for numbers in each for name, number in numbers.items()}

    def _sizes(self) -> tuple[float, float, float, float]:
        """Size and error of the set, and of its convex hull."""
        return self.volume, self.volume_error, self.convex_volume, self.convex_volume_error

    def _text(self, name: str) -> str:
        """A number with its error, shares in percent."""
        value, error, unit = getattr(self, name), getattr(self, f"{name}_error"), _MEANINGS[name][0]
        if unit == "1":
            return quantity(100 * value, "%", 100 * error)
        return quantity(value, unit.translate(_POWERS), error)
