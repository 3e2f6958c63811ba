"""Distributions of curvature along an arm, one design beside another."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from softreach.plot.lengths import Unit, common_unit, unit_of
from softreach.plot.style import as_axes, figure_style, small_axes
from softreach.support.arguments import as_dataset, as_mapping, as_one_of
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput
from softreach.support.units import LengthUnit

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

__all__ = ["plot_curvature"]

_COLORS = ("#2f6db5", "#e8a020")  # the paper's blue and yellow
_SYMBOLS = {"bending": "κ", "torsion": "u₃", "extension": "ζ"}
_BINS = 64


def plot_curvature(
    statistics: Mapping[str, xr.Dataset],
    *,
    ax: Axes | None = None,
    quantity: str = "bending",
    unit: Unit = None,
) -> Axes:
    """Distributions at the stations of one or two designs (figure 3c); dots are medians.

    Each distribution is drawn to the same width. Curvatures are shown times L, or in 1/m if the
    statistics do not know L, unless there is a unit.

    Args:
        statistics: Label -> what `curvature_statistics` returned; the first is drawn to the left
            of each station and the second to the right.
        ax: Axes to draw in; None for a new figure.
        quantity: "bending", "torsion" or "extension".
        unit: Of lengths: "m", "cm", "mm" or "L"; None for L if the statistics know it, else m.

    Raises:
        InvalidInput: Not one or two designs, an unknown quantity, stations at other places along
            the arm, or designs of which only one knows L.
    """
    statistics, ax = as_mapping("statistics", statistics, _statistics), as_axes(ax)
    if not 1 <= len(statistics) <= 2:
        raise InvalidInput("statistics", f"of {len(statistics)} designs", "of one or two")
    as_one_of("quantity", quantity, _SYMBOLS)
    units = [unit_of(data, unit) for data in statistics.values()]
    counted = common_unit(units)
    places = _common_places(statistics, units)
    with figure_style(ax):
        ax = small_axes() if ax is None else ax
        sides = (-1, 1) if len(statistics) == 2 else (0,)
        for (label, data), side, color, one in zip(
            statistics.items(), sides, _COLORS, units, strict=False
        ):
            scale = 1.0 if quantity == "extension" else one.size
            _draw(ax, data, quantity, side, color, label, scale)
        ax.set(xlabel=counted.label("station Z"), ylabel=_label(quantity, counted))
        digits = ".2g" if counted.relative else ".4g"
        ax.set_xticks(range(len(places)), [f"{place:{digits}}" for place in places])
        ax.legend(loc="upper left")
    return ax


def _statistics(name: str, value: object) -> xr.Dataset:
    return as_dataset(name, value, "bending_count", "Z")


def _common_places(statistics: Mapping[str, xr.Dataset], units: list[LengthUnit]) -> Array:
    both = zip(units, statistics.values(), strict=True)
    places = [unit.of(data["Z"].values) for unit, data in both]
    for other in places[1:]:
        if other.shape != places[0].shape or not np.allclose(other, places[0]):
            raise InvalidInput(
                "stations", other.tolist(), f"those of the first: {places[0].tolist()}"
            )
    return places[0]


def _label(quantity: str, unit: LengthUnit) -> str:
    symbol = _SYMBOLS[quantity]
    if quantity == "extension":
        return symbol
    return f"{symbol}L" if unit.relative else f"{symbol} [1/{unit.name}]"


def _draw(
    ax: Axes, data: xr.Dataset, quantity: str, side: int, color: str, label: str, scale: float
) -> None:
    medians = data[f"{quantity}_quantile"].sel(quantile=0.5).values * scale
    for k in range(len(medians)):
        edges, density = _coarse(data.isel(station=k), quantity)
        reach = 0.46 * density / density.max()
        low, high = (k - reach if side <= 0 else k), (k + reach if side >= 0 else k)
        name = label if k == 0 else None
        ax.fill_betweenx(
            edges * scale, low, high, color=color, alpha=0.75, lw=0.3, ec="w", label=name
        )
    ax.plot(np.arange(len(medians)) + 0.1 * side, medians, ".", color="k", ms=3, zorder=3)


def _coarse(data: xr.Dataset, quantity: str) -> tuple[Array, Array]:
    """Centers of fewer bins, between the smallest and largest value, and counts per width."""
    count, edges = data[f"{quantity}_count"].values, data[f"{quantity}_edge"].values
    used = np.flatnonzero(count)
    first, last = used[0], used[-1] + 1
    ends = np.unique(np.linspace(first, last, _BINS + 1).astype(int))
    sums = np.add.reduceat(count, ends[:-1])
    sums[-1] = count[ends[-2] : last].sum()
    centers = (edges[ends[:-1]] + edges[ends[1:]]) / 2
    return centers, sums / np.diff(edges[ends])
