"""Colors of samples, and the key that explains them."""

import math
import textwrap
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.schema import activation_symbols, activation_units
from softreach.support.arrays import Array, as_floats
from softreach.support.errors import InvalidInput
from softreach.support.lazy import Axes, DataArray, Dataset, Figure
from softreach.support.palette import activation_colors, bundle_color

Pixels = NDArray[np.uint8]  # RGB from 0 to 255
COLORMAP = "viridis"
_MISSING = 204  # light gray
UNSTABLE = (255, 0, 200)
"""Magenta, RGB from 0 to 255, of unstable equilibria: no scale of colors has it."""
_LINE, _PAGE = 44, 100  # characters above axes of a column's width, and above a figure
_AROUND, _ROW = 0.1, 0.15  # heights around the rows of a legend, and of each [inch]
_LETTER = 0.09  # width of one of a label [inch]
_MIXED = 3  # bundles whose lights can be told apart in a mixture
POWERS = str.maketrans("23", "²³")
_WIDE = 8.0  # ratio of the largest to the smallest value from which ratios are shown


class BundleKey(NamedTuple):
    """Each bundle has a color, which it adds to a mixture or which stands for it."""

    names: tuple[str, ...]
    colors: Pixels
    symbols: tuple[str, ...]  # Symbol of the activation of each: γ, τ or P
    unstable: bool = False  # True if some samples are marked as unstable equilibria
    title: str = ""  # Meaning of a color by itself; empty if it is one part of a mixture

    @property
    def labels(self) -> tuple[str, ...]:
        """Label of each color."""
        pairs = zip(self.symbols, self.names, strict=True)
        return self.names if self.title else tuple(f"|{symbol}| {name}" for symbol, name in pairs)


class ScalarKey(NamedTuple):
    """A color stands for a number from low to high."""

    label: str
    low: float
    high: float
    unstable: bool = False  # True if some samples are marked as unstable equilibria
    logarithmic: bool = False
    """True if equal ratios, and not equal differences, are equal steps of color."""
    clipped: bool = False  # True if the ends stand for all values beyond them too

    @property
    def extend(self) -> str:
        """Ends of a color bar that point outward, as matplotlib has it."""
        return "both" if self.clipped else "neither"


Key = BundleKey | ScalarKey


class Coloring(NamedTuple):
    """RGB of every sample, shape (sample, 3), and what it means."""

    rgb: Pixels
    key: Key | None


def color_samples(cloud: Dataset, color: str | int | ArrayLike | None = None) -> Coloring:
    """Color samples by all activations, by one bundle's magnitude, or by given values.

    Args:
        cloud: activation(sample, bundle), each in its unit.
        color: "rgb" for |γ| / max |γ| of all bundles, of each where their units differ, as a
            mixture of lights; "strongest" for the bundle whose |γ| is the largest there, in the
            color that it has in pictures of the arm; "effort" for the mean of |γ| / max |γ|; the
            name or index of one bundle; None for "rgb" of up to three bundles, beyond which
            mixtures cannot be told apart, and for "strongest" of more; one number per sample, whose
            attributes `long_name` and `units` go to the key if it is a DataArray, of which the
            attribute `scale` is "log" if ratios count, and `clipped` true if its extreme values
            stand for all beyond them; or RGB from 0 to 1 per sample.

    Unstable equilibria of arms under loads are always magenta.
    """
    coloring = _colored(cloud, color)
    unstable = cloud["status"].values == 1 if "status" in cloud else np.zeros(0, bool)
    if not unstable.any():
        return coloring
    rgb = np.where(unstable[:, None], np.array(UNSTABLE, np.uint8), coloring.rgb)
    return Coloring(rgb, None if coloring.key is None else coloring.key._replace(unstable=True))


def _colored(cloud: Dataset, color: str | int | ArrayLike | None) -> Coloring:
    activation = bundle_activations(cloud)
    names, units = bundle_names(cloud), activation_units(activation)
    symbols, magnitude = activation_symbols(activation), np.abs(activation.values)
    if color is None:
        color = "rgb" if len(names) <= _MIXED else "strongest"
    if not isinstance(color, str | int | np.integer) or isinstance(color, bool):
        return _given(color, len(activation))
    if color == "strongest" and color not in names:
        return _strongest(_comparable(magnitude, units), names, symbols)
    if color == "effort" and color not in names:
        return _effort(magnitude, symbols)
    if color == "rgb":
        key = BundleKey(names, activation_colors(np.eye(len(names))), symbols)
        return Coloring(activation_colors(_comparable(magnitude, units)), key)
    if color not in names and color not in range(len(names)):
        known = f"a bundle ({', '.join(names)}) or its index"
        raise InvalidInput("color", color, f'"rgb", "strongest", "effort", {known}, or an array')
    bundle = names.index(color) if isinstance(color, str) else int(color)
    unit = "" if units[bundle] == "1" else f" [{units[bundle]}]"
    label = f"|{symbols[bundle]}| {names[bundle]}{unit}"
    return Coloring(*_scalar(magnitude[:, bundle], label, 0.0))


def _comparable(activation: Array, units: Sequence[str]) -> Array:
    if len(set(units)) == 1:
        return activation
    largest = np.nanmax(np.abs(activation), axis=0, initial=0.0)
    return activation / np.where(largest > 0, largest, 1.0)


def _strongest(shares: Array, names: tuple[str, ...], symbols: tuple[str, ...]) -> Coloring:
    known = np.isfinite(shares).all(axis=1) & np.any(shares > 0.0, axis=1)
    colors = np.array([bundle_color(k) for k in range(len(names))])
    table = np.vstack([np.rint(255 * colors), np.full(3, _MISSING)]).astype(np.uint8)
    which = np.where(known, np.argmax(np.where(known[:, None], shares, 0.0), axis=1), len(names))
    key = BundleKey(names, table[:-1], symbols, title="strongest bundle:")
    return Coloring(table[which], key)


def _effort(magnitude: Array, symbols: tuple[str, ...]) -> Coloring:
    largest = np.asarray(np.nanmax(magnitude, axis=0, initial=0.0))
    acts = largest > 0.0
    share = (magnitude[:, acts] / largest[acts]).sum(axis=1) / max(np.count_nonzero(acts), 1)
    symbol = "a" if len(set(symbols)) > 1 else symbols[0]
    return Coloring(*_scalar(share, f"effort: mean |{symbol}| / max |{symbol}| [-]", 0.0))


def bundle_activations(cloud: Dataset) -> DataArray:
    """Activations over samples and bundles, for any name of that dimension."""
    activation = cloud["activation"]
    (bundle,) = (dim for dim in activation.dims if dim != "sample")
    return activation.transpose("sample", bundle)


def bundle_names(cloud: Dataset) -> tuple[str, ...]:
    """Names of the bundles, or their numbers from 1 up if the cloud has none."""
    activation = bundle_activations(cloud)
    bundle, numbers = activation.dims[1], range(1, activation.shape[1] + 1)
    return tuple(map(str, activation[bundle].values if bundle in activation.coords else numbers))


def draw_key(ax: Axes, key: Key | None) -> None:
    """Explain the colors in axes, by a legend above them or a color bar beside them."""
    if isinstance(key, ScalarKey):
        bar = {"label": key.label, "fraction": 0.046, "pad": 0.03, "extend": key.extend}
        ax.figure.colorbar(color_map(key), ax=ax, **bar)
    _draw_legend(ax, key, _LINE, 2)


def draw_figure_key(figure: Figure, key: Key | None, room: float) -> None:
    """Explain the colors once for a figure, in the room [inch] at its upper edge."""
    width, height = figure.get_size_inches()
    top = room / height
    place = (0.5, 1 - top / 2)
    if isinstance(key, ScalarKey):
        place = (0.88, 1 - 0.4 * top)
        bar = figure.add_axes((0.4, 1 - 0.5 * top, 0.4, 0.2 * top))
        figure.colorbar(color_map(key), cax=bar, orientation="horizontal", extend=key.extend)
        label = textwrap.fill(key.label, int(0.38 * width / _LETTER))
        bar.set_ylabel(label, rotation=0, ha="right", va="center")
    _draw_legend(figure, key, _PAGE, 4, loc="center", bbox_to_anchor=place)


def key_height(key: Key | None) -> float:
    """Height of the legend of a figure [inch]."""
    entries, title, columns = _arranged(key, _PAGE, 4)
    return _AROUND + _ROW * (bool(title) + math.ceil(len(entries) / columns))


def _draw_legend(owner: Axes | Figure, key: Key | None, room: int, columns: int, **at: Any) -> None:
    entries, title, columns = _arranged(key, room, columns)
    if entries:
        above = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "columnspacing": 1.2}
        look = above | {"title": title or None, "ncols": columns, "handlelength": 1.0}
        draw_entries(owner, entries, **look | at)


def _arranged(key: Key | None, room: int, columns: int) -> tuple[list[tuple[str, Any]], str, int]:
    """Entries, title and columns: all in one line where there is room, else below the title."""
    entries = key_entries(key)
    title, names = (key.title, key.names) if isinstance(key, BundleKey) else ("", ())
    if len(title) + sum(len(name) + 6 for name in names) > room:
        return entries, title, columns
    entries = [(title, "none"), *entries] if title else entries
    return entries, "", max(len(entries), 1)


def key_entries(key: Key | None) -> list[tuple[str, Any]]:
    """Label and RGB from 0 to 1 of what has a color by itself; unstable samples are the last."""
    named = zip(key.labels, key.colors / 255, strict=True) if isinstance(key, BundleKey) else ()
    unstable = ("unstable", np.array(UNSTABLE) / 255)
    return [*named, unstable] if key is not None and key.unstable else [*named]


def draw_entries(owner: Axes | Figure, entries: Iterable[tuple[str, Any]], **look: Any) -> None:
    """A legend of colors that stand for something each."""
    from matplotlib.patches import Patch

    owner.legend(handles=[Patch(facecolor=color, label=label) for label, color in entries], **look)


def _given(color: ArrayLike, samples: int) -> Coloring:
    values = as_floats("color", color, '"rgb", a bundle or its index, or an array of numbers')
    if values.shape == (samples, 3):
        return Coloring(np.rint(255 * np.clip(values, 0, 1)).astype(np.uint8), None)
    if values.shape != (samples,):
        raise InvalidInput("color.shape", values.shape, f"({samples},) or ({samples}, 3)")
    attrs = getattr(color, "attrs", {})
    name, unit = attrs.get("long_name", ""), attrs.get("units", "").translate(POWERS)
    label = f"{name} [{'-' if unit == '1' else unit}]" if unit else name
    known = values[np.isfinite(values)]
    if attrs.get("scale") == "log" and known.size and 0.0 < _WIDE * known.min() < known.max():
        rgb, key = _scalar(np.log(values), label)
        ends = {"low": math.exp(key.low), "high": math.exp(key.high)}
        return Coloring(rgb, key._replace(**ends, logarithmic=True))
    rgb, key = _scalar(values, label)
    return Coloring(rgb, key._replace(clipped=bool(attrs.get("clipped"))))


def _scalar(values: Array, label: str, low: float | None = None) -> tuple[Pixels, ScalarKey]:
    known = values[np.isfinite(values)]
    start = low if low is not None else float(known.min()) if known.size else 0.0
    stop = float(known.max(initial=start)) if known.size else start + 1.0
    return scale_colors(values, start, stop), ScalarKey(label, start, stop)


def scale_colors(values: Array, low: float, high: float, missing: int = _MISSING) -> Pixels:
    """Colors of numbers from low to high, and the gray of those that are missing, shape (n, 3)."""
    from matplotlib import colormaps

    table = colormaps[COLORMAP](np.arange(257), bytes=True)[:, :3]
    table[256] = missing
    finite = np.isfinite(values)
    share = np.where(finite, (values - low) / ((high - low) or 1.0), 0.0)
    index = np.minimum(255, 256 * share).astype(np.int16)
    return table[np.where(finite, index, 256)]


def color_map(key: ScalarKey) -> Any:
    """Scale of colors, from which matplotlib draws a color bar."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm, Normalize

    norm = LogNorm if key.logarithmic else Normalize
    return ScalarMappable(norm(key.low, key.high), COLORMAP)
