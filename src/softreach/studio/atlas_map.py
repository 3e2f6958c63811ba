"""A contour map over two parameters of an atlas, and the design under a click."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import find_parameter
from softreach.plot.metric_map import metric_label, plot_metric_map
from softreach.studio.state import MapView
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["AtlasMap", "atlas_map", "held_places", "map_choices", "metric_names"]

_INCHES, _DPI = 3.1, 400  # small type would be lost in the scene, few pixels would blur it
_FRAME = (0.19, 0.16, 0.57, 0.68)  # of the axes: left, bottom, width, height
_SLACK = 0.03  # of the axes: designs lie on their rim
_BAR = (0.79, 0.16, 0.035, 0.68)
_TICKS = 5  # intervals between them, at most


@dataclass(frozen=True, kw_only=True, eq=False)
class AtlasMap:
    """A square picture."""

    image: NDArray[np.uint8]
    """RGB, shape (pixels, pixels, 3)."""
    x: NDArray[np.float64]
    """Values of the parameter to the right, SI."""
    y: NDArray[np.float64]
    names: tuple[str, str]
    fixed: dict[str, float]
    """The other parameters, SI."""

    def parameters_at(self, right: float, up: float) -> dict[str, float] | None:
        """The design nearest to a place, 0 to 1 from the picture's lower left; None outside."""
        left, bottom, width, height = _FRAME
        share = (right - left) / width, (up - bottom) / height
        if not all(-_SLACK <= part <= 1 + _SLACK for part in share):
            return None
        places = zip(self.names, (self.x, self.y), share, strict=True)
        return {name: _nearest(values, part) for name, values, part in places} | self.fixed

    def values_of(self, design: Manipulator) -> dict[str, float] | None:
        """The two parameters of a design, if the map goes so far."""
        at = {name: find_parameter(design, name).value(design) for name in self.names}
        places = (self.x, self.y)
        inside = (
            min(values) - 1e-9 <= value <= max(values) + 1e-9
            for value, values in zip(at.values(), places, strict=True)
        )
        return at if all(inside) else None

    def place_of(self, **at: float) -> tuple[float, float]:
        """Where a design is in the picture: the inverse of `parameters_at`."""
        shares = [
            (at[name] - values[0]) / ((values[-1] - values[0]) or 1.0)
            for name, values in zip(self.names, (self.x, self.y), strict=True)
        ]
        left, bottom, width, height = _FRAME
        return left + width * shares[0], bottom + height * shares[1]


def metric_names(atlas: xr.Dataset) -> list[str]:
    """The single numbers that an atlas holds of every design, volume and unreachability first."""
    dims = atlas["status"].dims
    names = [str(n) for n, v in atlas.data_vars.items() if v.dims == dims and v.dtype.kind == "f"]
    first = ("exact_volume", "exact_unreachability", "volume", "unreachability")
    return sorted(names, key=lambda name: first.index(name) if name in first else len(first))


def map_choices(atlas: xr.Dataset, view: MapView) -> tuple[str, str, str]:
    """Metric, parameter to the right and parameter upward of a view; what it leaves open, first.

    Raises:
        InvalidInput: The atlas is no grid of two parameters or more, or holds no such thing.
    """
    names, metrics = [str(dim) for dim in atlas["status"].dims], metric_names(atlas)
    if len(names) < 2:
        raise InvalidInput("atlas", ", ".join(names), "a grid of two parameters or more for a map")
    right = view.right or next(name for name in names if name != view.up)
    up = view.up or next(name for name in names if name != right)
    if right == up or not {right, up} <= set(names):
        raise InvalidInput("map", f"{right} and {up}", f"two of {', '.join(names)}")
    if view.metric and view.metric not in metrics:
        raise InvalidInput("metric", view.metric, f"one of {', '.join(metrics)}")
    return view.metric or metrics[0], right, up


def held_places(atlas: xr.Dataset, view: MapView, design: Manipulator) -> dict[str, int]:
    """Of each parameter that a map does not show, the number of the value nearest to a design's."""
    _, *shown = map_choices(atlas, view)
    others = [str(dim) for dim in atlas["status"].dims if dim not in shown]
    return {
        name: int(np.abs(atlas[name].values - find_parameter(design, name).value(design)).argmin())
        for name in others
    }


def atlas_map(atlas: xr.Dataset, view: MapView, held: dict[str, int]) -> AtlasMap:
    """Draw a metric over two parameters, the others held as `held_places` says.

    Raises:
        InvalidInput: There is no such map.
    """
    metric, *names = map_choices(atlas, view)
    shown = atlas[["status", metric]].isel(held).transpose(*names)
    x, y = (atlas[name].values.astype(float) for name in names)
    labels = [_label(atlas, name) for name in names]
    title = "\n".join([metric_label(atlas[metric]), *_held_text(atlas, held)])
    return AtlasMap(
        image=_drawn(shown, metric, labels, title),
        x=x,
        y=y,
        names=(names[0], names[1]),
        fixed={name: float(atlas[name].values[place]) for name, place in held.items()},
    )


def _held_text(atlas: xr.Dataset, held: dict[str, int]) -> list[str]:
    """One line with the parameters that are held, if there are any."""
    parts = (f"{_label(atlas, name)} = {_shown(atlas, name)[k]:.4g}" for name, k in held.items())
    return [", ".join(parts)] if held else []


def _nearest(values: NDArray[np.float64], share: float) -> float:
    wanted = values[0] + share * (values[-1] - values[0])
    return float(values[np.abs(values - wanted).argmin()])


def _shown(atlas: xr.Dataset, name: str) -> NDArray[np.float64]:
    """The values of a parameter as a person reads them: angles in degrees."""
    values = atlas[name].values.astype(float)
    return np.degrees(values) if atlas[name].attrs.get("units") == "rad" else values


def _label(atlas: xr.Dataset, name: str) -> str:
    given = atlas[name].attrs.get("units", "1")
    unit = {"rad": "deg", "1": ""}.get(given, given)
    words = " ".join([name.replace("_", " "), *_symbol(atlas[name])])
    return f"{words} [{unit}]" if unit else words


def _symbol(parameter: xr.DataArray) -> list[str]:
    """Its symbol, if the atlas knows one and the name does not say whose it is."""
    symbol = str(parameter.attrs.get("symbol", ""))
    return [symbol] if symbol and "." not in str(parameter.name) else []


def _drawn(atlas: xr.Dataset, metric: str, labels: list[str], title: str) -> NDArray[np.uint8]:
    # Not through pyplot, which belongs to one thread.
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    figure = Figure(figsize=(_INCHES, _INCHES), dpi=_DPI)
    canvas = FigureCanvasAgg(figure)
    ax = plot_metric_map(atlas, metric, ax=figure.add_axes(_FRAME), designs=True, key=False)
    ax.set(xlabel=labels[0], ylabel=labels[1], title=title)
    x, y = (_shown(atlas, str(name)) for name in atlas["status"].dims)
    ax.set_xlim(x[0], _end(x))
    ax.set_ylim(y[0], _end(y))
    ax.locator_params(nbins=_TICKS)
    figure.colorbar(ax.collections[0], cax=figure.add_axes(_BAR), ticks=MaxNLocator(_TICKS))
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _end(values: NDArray[np.float64]) -> float:
    return float(values[-1]) if len(values) > 1 else float(values[0]) + 1.0
