"""Map of an atlas: a metric over two parameters, its board in the scene, its numbers in words."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import find_parameter
from softreach.atlas import over_length
from softreach.plot.metric_map import metric_label, plot_metric_map
from softreach.studio.scene.board import Board
from softreach.studio.scene.scene import Scene
from softreach.studio.state import MapView
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    import xarray as xr

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
        """Place of a design in the picture: the inverse of `parameters_at`."""
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


def fixed_places(atlas: xr.Dataset, view: MapView, design: Manipulator) -> dict[str, int]:
    """Of each parameter that a map does not show, the number of the value nearest to a design's."""
    _, *shown = map_choices(atlas, view)
    others = [str(dim) for dim in atlas["status"].dims if dim not in shown]
    return {name: _nearest_place(atlas, name, design) for name in others}


def atlas_map(atlas: xr.Dataset, view: MapView, fixed: dict[str, int]) -> AtlasMap:
    """Draw a metric over two parameters, the others fixed as `fixed_places` says.

    Raises:
        InvalidInput: There is no such map.
    """
    metric, *names = map_choices(atlas, view)
    shown = atlas[["status", metric]].isel(fixed).transpose(*names)
    x, y = (atlas[name].values.astype(float) for name in names)
    labels = [_label(atlas, name) for name in names]
    title = "\n".join([metric_label(atlas[metric]), *_fixed_text(atlas, fixed)])
    return AtlasMap(
        image=_drawn(shown, metric, labels, title),
        x=x,
        y=y,
        names=(names[0], names[1]),
        fixed={name: float(atlas[name].values[place]) for name, place in fixed.items()},
    )


def _fixed_text(atlas: xr.Dataset, fixed: dict[str, int]) -> list[str]:
    """One line with the fixed parameters, if there are any."""
    parts = (f"{_label(atlas, name)} = {_shown(atlas, name)[k]:.4g}" for name, k in fixed.items())
    return [", ".join(parts)] if fixed else []


def _nearest(values: NDArray[np.float64], share: float) -> float:
    target = values[0] + share * (values[-1] - values[0])
    return float(values[np.abs(values - target).argmin()])


def _shown(atlas: xr.Dataset, name: str) -> NDArray[np.float64]:
    """The values of a parameter as a person reads them: angles in degrees."""
    values = atlas[name].values.astype(float)
    return np.degrees(values) if atlas[name].attrs.get("units") == "rad" else values


def _label(atlas: xr.Dataset, name: str) -> str:
    stored = atlas[name].attrs.get("units", "1")
    unit = {"rad": "deg", "1": ""}.get(stored, stored)
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


# What an atlas says of the design that is nearest, and why its numbers differ.


_PAIRS = {"volume": ("V / L³", 1.0, ""), "unreachability": ("UNR", 100.0, " %")}
_SPACINGS = 3.0
"""Radii below so many mean spacings fall through between the samples."""


def nearest_numbers(atlas: xr.Dataset, metric: str, design: Manipulator) -> str:
    """The metric at the design of the atlas that is nearest; beside it what it is compared with.

    The volume and the unreachability are known in two ways: of the α-shape of samples, and exactly.

    Args:
        atlas: From `open_atlas`.
        metric: Which one.
        design: The present one.
    """
    places = _nearest_places(atlas, design)
    name = metric.removeprefix("exact_")
    both = {name, f"exact_{name}", "exact_volume"} <= set(atlas.data_vars)
    where = f"Nearest design of the atlas ({_place(atlas, places)}): "
    if name not in _PAIRS or not both:
        return f"{where}{metric.replace('_', ' ')} {_value(atlas, metric, places):.4g}."
    symbol, scale, unit = _PAIRS[name]
    exact, sampled = (scale * _value(atlas, each, places) for each in (f"exact_{name}", name))
    if not np.isfinite([exact, sampled]).all():
        return f"{where}not computed."
    return (
        f"{where}{symbol} {exact:.4g}{unit} exact, {sampled:.4g}{unit} of the α-shape of "
        f"{_command(atlas)['n']:,} samples. {_reason(atlas, places)}"
    )


def _reason(atlas: xr.Dataset, places: dict[str, int]) -> str:
    """Reason why an α-shape is not the exact set."""
    command = _command(atlas)
    alpha, exact = command["alpha_over_length"], _value(atlas, "exact_volume", places)
    if alpha == "critical" or not exact > 0:
        return "Samples fill less than the set, a wide α bridges what is hollow."
    spacing = (exact / float(command["n"])) ** (1 / 3)
    needed = _SPACINGS * spacing
    if float(alpha) < needed:
        return (
            f"The samples are too few: {spacing:.2g} L apart, they need α ≥ {needed:.2g} L, and "
            f"it is {float(alpha):g} L, so that the α-shape is full of holes."
        )
    return (
        f"Samples {spacing:.2g} L apart fill a few percent less than the set; α = "
        f"{float(alpha):g} L bridges gaps and hollows narrower than {2 * float(alpha):g} L."
    )


def _nearest_places(atlas: xr.Dataset, design: Manipulator) -> dict[str, int]:
    """Its place along each parameter."""
    return {str(name): _nearest_place(atlas, str(name), design) for name in atlas["status"].dims}


def _nearest_place(atlas: xr.Dataset, name: str, design: Manipulator) -> int:
    """Number of the value that is nearest to a design's; to all of them where its parts differ."""
    values = np.array(find_parameter(design, name).values(design))
    return int(np.abs(atlas[name].values[:, None] - values).max(axis=1).argmin())


def _place(atlas: xr.Dataset, places: dict[str, int]) -> str:
    parts = []
    for name, k in places.items():
        value, unit = float(atlas[name].values[k]), atlas[name].attrs.get("units", "1")
        if unit == "rad":
            value, unit = float(np.degrees(value)), "deg"
        parts.append(f"{name.replace('_', ' ')} {value:.4g}{'' if unit == '1' else f' {unit}'}")
    return ", ".join(parts)


def _value(atlas: xr.Dataset, metric: str, places: dict[str, int]) -> float:
    return float(over_length(atlas, metric).isel(places))


def _command(atlas: xr.Dataset) -> dict[str, int | float | str]:
    return json.loads(atlas.attrs["command"])


# The map of an atlas as a board in the scene: drawn, marked, and read under a click.


Array = NDArray[np.float64]


class MapBoard:
    """The board of one tab."""

    def __init__(self, scene: Scene, atlas: xr.Dataset) -> None:
        """Nothing is drawn yet."""
        self._scene, self.atlas = scene, atlas
        self._board = Board(scene, "/atlas/map")
        self.map: AtlasMap | None = None
        """The map that is drawn."""
        self._drawn: tuple[MapView, dict[str, int]] | None = None

    def draw(self, view: MapView, design: Manipulator) -> None:
        """Show a map and where the design is on it; the map is drawn anew if it changes.

        Raises:
            InvalidInput: There is no such map.
        """
        content = view, fixed_places(self.atlas, view, design)
        if content != self._drawn:
            self.map = atlas_map(self.atlas, view, content[1]) if view.shown else None
            self._drawn = content
            self._scene.remove("/atlas")
            if self.map is not None:
                self._board.draw(self.map.image)
        self._mark(design)

    def parameters_under(
        self, origin: Sequence[float], direction: Sequence[float]
    ) -> dict[str, float] | None:
        """The place of the atlas under the cursor, {} beside the axes, None beside the board."""
        place = self._board.place_under(origin, direction)
        if self.map is None or place is None:
            return None
        return self.map.parameters_at(*place) or {}

    def place_of(self, **at: float) -> Array:
        """Place in the scene where the map shows a design [L]."""
        assert self.map is not None
        return self._board.in_scene(*self.map.place_of(**at))

    @property
    def corners(self) -> Array:
        """Corners of the board in the scene [L], shape (4, 3)."""
        return self._board.corners

    def _mark(self, design: Manipulator) -> None:
        self._scene.remove("/atlas/here")
        at = None if self.map is None else self.map.values_of(design)
        if at is not None:
            self._scene.draw_mark("/atlas/here", self.place_of(**at))


def board_of(scene: Scene, atlas: xr.Dataset | None) -> MapBoard | None:
    """A board, if there is an atlas that a map can be drawn of."""
    if atlas is None or len(atlas["status"].dims) < 2:
        return None
    return MapBoard(scene, atlas)
