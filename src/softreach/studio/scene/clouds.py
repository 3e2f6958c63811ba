"""Clouds of a scene: colors, light and slices of their points, and which are left out."""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

from softreach.arm.manipulator import Manipulator
from softreach.cloud.dexterity import dexterity, manipulability_unit
from softreach.cloud.redundancy import activation_distance
from softreach.plot.coloring import POWERS, BundleKey, Coloring, ScalarKey, color_samples
from softreach.rod.tip_map import has_tip
from softreach.schema import activation_symbols
from softreach.studio import markup
from softreach.studio.multiplicity import count_activations
from softreach.studio.reach import Reach, shown_rows, shown_samples
from softreach.studio.state import Slice, rod_of
from softreach.studio.work import all_cores

if TYPE_CHECKING:
    import xarray as xr
    from viser import SceneApi

Array = NDArray[np.float64]

_USUAL, _SIZE = 1 << 17, 0.007  # points of the usual cloud, and the edge of each [L]
_SIZES = 0.003, 0.01


@dataclass(frozen=True, kw_only=True, eq=False)
class Dots:
    """Points [L] and how they look."""

    points: Array
    """Shape (n, 3)."""
    colors: NDArray[np.uint8]
    """RGB, shape (n, 3) or (3,)."""
    size: float
    """[L]."""
    shape: Literal["circle", "diamond"] = "circle"

    def where(self, kept: NDArray[np.bool_]) -> Dots:
        """Those that are kept."""
        colors = self.colors[kept] if self.colors.ndim == 2 else self.colors
        return Dots(points=self.points[kept], colors=colors, size=self.size, shape=self.shape)


class Clouds:
    """Draws clouds, and draws those again whose hidden points change as camera or arm move."""

    def __init__(self, api: SceneApi) -> None:
        self._api, self._lock = api, threading.RLock()
        self._known: dict[str, tuple[Dots, NDArray[np.bool_]]] = {}
        self._ahead: Array | None = None
        self._base = np.zeros(3)
        self._most: int | None = None

    def draw(self, path: str, dots: Dots) -> None:
        """All but the points in the way of what the last `look` wanted to see."""
        with self._lock:
            kept = self._kept(dots)
            self._known[path] = dots, kept
            self._send(path, dots.where(kept))

    def look(self, ahead: Array | None, base: Array, most: int | None = None) -> None:
        """Cut away the half in front of the arm; nothing is sent of a cloud that keeps its points.

        Args:
            ahead: Where the camera looks, level with the ground, shape (3,); None for no cut.
            base: Of the arm [L], shape (3,).
            most: How many points to draw of a cloud, the first of it, which then stay the same
                until another number is wanted; None for all.
        """
        is_thin = most is not None and most == self._most
        self._ahead, self._base, self._most = ahead, base, most
        if is_thin:  # it hides little, and the page draws no frame while it takes up another
            return
        with self._lock:
            for path, (dots, before) in list(self._known.items()):
                kept = self._kept(dots)
                if not np.array_equal(kept, before):
                    self._known[path] = dots, kept
                    self._send(path, dots.where(kept))

    def forget(self, path: str) -> None:
        """Draw a cloud no more; its node is the caller's to remove."""
        self._known.pop(path, None)

    def hidden(self, points: Array) -> NDArray[np.bool_]:
        """Mask of the points [L], shape (n, 3), that are cut away."""
        if self._ahead is None:
            return np.zeros(len(points), bool)
        return (points - self._base) @ self._ahead < 0.0

    def _kept(self, dots: Dots) -> NDArray[np.bool_]:
        kept = ~self.hidden(dots.points)
        if self._most is not None:
            kept[self._most :] = False
        return kept

    def _send(self, path: str, dots: Dots) -> None:
        if not len(dots.points):
            if self._api.get_handle_by_name(path) is not None:
                self._api.remove_by_name(path)
            return
        # viser's default is float16: a quarter of a millimeter in a meter
        self._api.add_point_cloud(
            path,
            dots.points.astype(np.float32),
            dots.colors,
            point_size=dots.size,
            precision="float32",
            point_shape=dots.shape,
            point_shading="gradient",
        )


def point_size(count: int) -> float:
    """Edge of each of so many points of a cloud [L]: the fewer there are, the larger they are."""
    return float(np.clip(_SIZE * (_USUAL / max(count, 1)) ** (1 / 3), *_SIZES))


# Colors of the points, and the key to them.


FAINT = (196, 198, 206)
"""Gray, of the cloud without loads."""

_MOST_COUNTS = 8
"""Numbers of activations that the key tells apart."""
_CLIPPED = ("manipulability", "activation distance")
_PERCENTILES = (1.0, 99.0)
_RADIUS = 1 / 60  # [L], within which D̄ compares activations


def color_names(arm: Manipulator) -> dict[str, str]:
    """Colors that points can have: name -> what the menu says."""
    box = rod_of(arm).box
    names = {"effort": "effort: mean |γ| / max |γ|", "rgb": "all activations (RGB)"}
    if arm.inputs > 3:  # mixtures of more lights cannot be told apart
        names["strongest"] = "strongest bundle"
    labels = zip(activation_symbols(arm.input_units), box.names, strict=True)
    names |= {f"bundle {k}": f"|{symbol}| {name}" for k, (symbol, name) in enumerate(labels)}
    names["manipulability"] = "manipulability"
    names["activation distance"] = "activation distance D̄"
    if box.dimension == 3:
        names["multiplicity"] = "multiplicity"
    return names


def sample_colors(reach: Reach, level: int, color: str) -> Coloring:
    """Colors of the samples that are shown; an unknown name colors by all activations.

    The few smallest and largest values of a scale look like the next ones: they would leave the
    others one color.
    """
    cloud = reach.cloud[["tip", "activation"]].isel(sample=shown_samples(reach, level))
    values = sample_values(reach, level, color)
    coloring = color_samples(cloud, values)
    if shown_color(reach.arm, color) == "multiplicity" and not isinstance(values, str | int):
        return coloring._replace(key=counts_key(coloring.rgb, values.values))
    return coloring


def counts_key(colors: NDArray[np.uint8], counts: Array, shares: bool = True) -> BundleKey:
    """Color of each number of activations, and the share of the places that have it.

    Args:
        colors: RGB of places, shape (n, 3).
        counts: Numbers of activations that reach them, shape (n,).
        shares: Whether to tell shares: those of vertices of a surface mean nothing.
    """
    known, first, many = np.unique(counts, return_index=True, return_counts=True)
    last = min(len(known), _MOST_COUNTS) - 1
    names = [f"{count:.0f}" for count in known[: last + 1]]
    if len(known) > _MOST_COUNTS:
        names[last] += f" to {known[-1]:.0f}"
    if shares:
        parts = np.add.reduceat(100 * many / len(counts), np.arange(last + 1))
        names = [f"{name}: {part:.2g} %" for name, part in zip(names, parts, strict=True)]
    kept = slice(len(names))
    title = "activations that reach a place:"
    return BundleKey(tuple(names), colors[first][kept], ("",) * len(names), title=title)


def sample_values(
    reach: Reach, level: int, color: str
) -> Literal["rgb", "strongest"] | int | xr.DataArray:
    """Values behind the colors of the samples shown, as the library's own figures take them."""
    import xarray as xr

    color = shown_color(reach.arm, color)
    if color == "rgb" or color == "strongest":
        return color
    if color.startswith("bundle "):
        return int(color[7:])
    if color == "multiplicity" and not reach.fine:
        return "rgb"  # coarse clouds last for a moment only, in which nothing is counted
    values = _values(reach, shown_rows(reach, level), color)
    clipped = color in _CLIPPED and np.isfinite(values).any()
    if clipped:
        values = np.clip(values, *np.nanpercentile(values, _PERCENTILES))
    attrs = {"long_name": color_label(color, reach.arm), "clipped": clipped}
    return xr.DataArray(values, dims="sample", attrs=attrs)


def _values(reach: Reach, rows: NDArray[np.int64], color: str) -> Array:
    if color == "multiplicity":
        return count_activations(reach, rows)  # which lets others have their turn
    with all_cores:
        return _VALUES[color](reach, rows)


def shown_color(arm: Manipulator, color: str) -> str:
    """Color of points where that name is wanted, which may be one of another arm."""
    return color if color in color_names(arm) else "rgb"


def color_label(color: str, arm: Manipulator) -> str:
    """Label of the key of a color; "" where the key needs none."""
    unit = manipulability_unit(arm.input_units, "L").translate(POWERS)
    return _LABELS.get(color, "").format(unit=unit)


def key_html(key: BundleKey | ScalarKey | None) -> str:
    """The colors explained, as HTML without anything from elsewhere."""
    if isinstance(key, BundleKey):
        named = zip(key.labels, key.colors.tolist(), strict=True)
        parts = ((markup.Swatch(rgb), f" {label} \N{EN SPACE} ") for label, rgb in named)
        title = (f"{key.title} \N{EN SPACE} ",) if key.title else ()
        return _line(markup.inline(*title, *(part for pair in parts for part in pair)))
    if key is None:
        return ""
    stops = ("#440154", "#3b528b", "#21918c", "#5ec962", "#fde725")  # viridis
    bar = f"background:linear-gradient(90deg,{','.join(stops)});height:0.6em;margin:0.2em 0"
    below, above = ("≤ ", "≥ ") if key.clipped else ("", "")
    ends = markup.spread(f"{below}{key.low:.3g}", key.label, f"{above}{key.high:.3g}")
    return _line(f'<div style="{bar}"></div>{ends}')


def _line(content: str) -> str:
    return f'<div style="font-size:0.8em;padding:0 0.8em 0.4em">{content}</div>'


def _effort(reach: Reach, rows: NDArray[np.int64]) -> Array:
    """Mean over the bundles of |γ| over the largest that each can have [-]."""
    largest = np.abs(rod_of(reach.arm).box.bounds).max(axis=1)
    share = np.abs(reach.cloud.activation.values[rows]) / np.where(largest > 0, largest, 1.0)
    return share.sum(axis=1) / max(np.count_nonzero(largest), 1)


def _manipulability(reach: Reach, rows: NDArray[np.int64]) -> Array:
    """√det(J Jᵀ) with J = ∂r/∂γ [L per input]; of fewer than three bundles an area or a length."""
    volume = dexterity(reach.cloud.isel(sample=rows)).manipulability.values
    return volume / reach.arm.length ** min(reach.arm.inputs, 3)


def _activation_distance(reach: Reach, rows: NDArray[np.int64]) -> Array:
    """D̄ of the samples that are shown, among all that have a tip; NaN where isolated."""
    settled = np.flatnonzero(has_tip(reach.status))
    cloud = reach.cloud if len(settled) == reach.samples else reach.cloud.isel(sample=settled)
    shown = np.searchsorted(settled, rows)
    distance = activation_distance(cloud, _RADIUS * reach.arm.length, queries=np.sort(shown))
    return distance.values[np.argsort(np.argsort(shown))]


_VALUES = {
    "effort": _effort,
    "manipulability": _manipulability,
    "activation distance": _activation_distance,
}

_LABELS = {
    "effort": "effort: mean |γ| / max |γ| [-]",
    "multiplicity": "multiplicity",
    "manipulability": "manipulability [{unit}]",
    "activation distance": "activation distance D̄ [-]",
}


# Slices of points.


def in_slice(points: Array, cut: Slice) -> NDArray[np.bool_]:
    """Mask of the points [L], shape (n, 3), that a slice shows."""
    if cut.axis == "none":
        return np.ones(len(points), bool)
    return np.abs(points[:, "xyz".index(cut.axis)] - cut.center) <= cut.thickness / 2


# Light on a cloud: points at its surface are as bright as the surface would be.


_CELLS = 48  # along the longest side
_BLUR = 1.2  # [cells]
_LIGHT = np.array([0.35, -0.55, 0.76])  # from the front, the right and above
_DARKEST, _BRIGHTEST = 0.62, 1.0


def lit(colors: NDArray[np.uint8], points: Array) -> NDArray[np.uint8]:
    """Colors, shape (n, 3), as a lamp beside the reader lights them; those inside are bright.

    Args:
        colors: RGB from 0 to 255.
        points: Where they are, any unit, shape (n, 3).
    """
    if len(points) < 2:
        return colors
    return shaded(colors, _outward(points))


def shaded(colors: NDArray[Any], outward: Array) -> NDArray[np.uint8]:
    """Colors, shape (n, 3), as the lamp lights what looks this way, shape (n, 3).

    What has no direction is inside, where no surface could turn away from the lamp.
    """
    facing = np.clip(outward @ _LIGHT, -1.0, 1.0)
    shade = _BRIGHTEST - (_BRIGHTEST - _DARKEST) * 0.5 * (1.0 - facing)
    surface = np.minimum(np.linalg.norm(outward, axis=1), 1.0)
    shade = surface * shade + (1.0 - surface) * (_DARKEST + _BRIGHTEST) / 2
    return np.rint(colors * shade[:, None]).astype(np.uint8)


def _outward(points: Array) -> Array:
    """Towards where there are fewer points: of length 1 at the surface, 0 deep inside."""
    low, high = points.min(axis=0), points.max(axis=0)
    step = max(float((high - low).max()) / _CELLS, 1e-12)
    places = (points - low) / step + 3.0
    shape = tuple(np.ceil((high - low) / step).astype(int) + 7)
    full = np.zeros(shape)
    i, j, k = np.rint(places).astype(np.intp).T
    full[i, j, k] = 1.0  # whether a cell has points, not how many: the activations decide that
    slopes = np.gradient(gaussian_filter(full, _BLUR, truncate=2.5))
    outward = -np.stack([map_coordinates(slope, places.T, order=1) for slope in slopes], axis=1)
    length = np.linalg.norm(outward, axis=1, keepdims=True)
    return outward / np.maximum(length, 0.08)
