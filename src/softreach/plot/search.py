"""Pictures of a search: its progress or its front, and the best designs in their ranges."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.plot.lengths import Unit, unit_for
from softreach.plot.style import (
    HasDataset,
    dataset_of,
    figure_style,
    legend_above,
    pyplot,
    remark,
)
from softreach.support.arrays import Mask
from softreach.support.palette import BEST, MET, MISSED
from softreach.support.units import LengthUnit, handy_unit, readable, readable_unit

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH = 7.2  # inches
_ABOVE, _ROW, _ENDS = 2.5, 0.24, 0.75  # heights of panels, of a parameter, and around these [inch]
_COARSE: dict[str, Any] = {"marker": "o", "s": 14, "facecolors": "none", "linewidths": 0.7}
_FINAL: dict[str, Any] = {"marker": "D", "s": 24, "color": BEST, "linewidths": 0, "zorder": 4}
_OUT: dict[str, Any] = {"marker": "x", "s": 16, "color": MISSED, "linewidths": 0.8, "zorder": 3}
_MOST_LINES = 200


def plot_search(search: HasDataset, *, unit: Unit = None) -> Figure:
    """Draw what a search came to: designs that were judged, and the best in their ranges.

    Of one objective, its value against the designs that were looked at, with the best so far, and
    values on coarse sets against those of full accuracy. Of two, designs and the front; of more,
    the front as lines over all of them. Designs that miss requirements are crosses.

    Args:
        search: What `search` returned.
        unit: Unit of lengths and volumes, m, cm, mm or L; None for mm, or m for arms from 1 m.

    Raises:
        InvalidInput: Unknown unit, or no search.
        MissingExtra: matplotlib is not installed.
    """
    data = dataset_of("search", search, "search", "objective_value")
    length = float(data.attrs["length"])
    name = data.attrs["display_unit"] or handy_unit(length)
    shown = _Shown(data, unit_for(length, name if unit is None else unit))
    goals, below = data.sizes["objective"], _ENDS + _ROW * data.sizes["parameter"]
    with figure_style():
        figure = pyplot().figure(figsize=(_WIDTH, _ABOVE + below), layout="constrained")
        grid = figure.add_gridspec(2, 2, height_ratios=[_ABOVE, below], width_ratios=[1.6, 1.0])
        if goals == 1:
            _draw_progress(figure.add_subplot(grid[0, 0]), shown)
            _draw_fidelities(figure.add_subplot(grid[0, 1]), shown)
        elif goals:
            beside = bool((~shown.feasible & ~shown.final).any())
            ax = figure.add_subplot(grid[0, 0] if beside else grid[0, :])
            (_draw_front if goals == 2 else _draw_objectives)(ax, shown)
            if beside:
                _draw_missed(figure.add_subplot(grid[0, 1]), shown)
        else:
            _draw_missed(figure.add_subplot(grid[0, :]), shown)
        _draw_ranges(figure.add_subplot(grid[1, :]), shown)
    return figure


class _Shown:
    def __init__(self, data: xr.Dataset, unit: LengthUnit) -> None:
        self.data, self.unit = data, unit
        self.feasible: Mask = data["feasible"].values
        count = data.sizes["design"]
        self.final: Mask = np.arange(count) >= count - int(data.attrs["finalists"])
        self.front: Mask = data["front"].values & self.final
        self.looked_at, self.senses = data["looked_at"].values, data["sense"].values
        self.values, self.errors = data["objective_value"].values, data["objective_error"].values
        self.labels: list[str] = []
        for k, own in enumerate(data["objective_unit"].values):
            largest = np.nanmax(np.abs(self.values[:, k]), initial=0.0)
            name, size = readable_unit(str(own), float(largest), unit)
            self.values[:, k] /= size
            self.errors[:, k] = np.nan_to_num(self.errors[:, k] / size)
            objective, relative = str(data["objective"].values[k]), name.startswith("L")
            label = f"{objective} / {name}" if relative else f"{objective} [{name}]"
            self.labels.append(label if name else objective)


def _draw_progress(ax: Axes, shown: _Shown) -> None:
    value, at = shown.values[:, 0], shown.looked_at
    way, final = shown.feasible & ~shown.final, shown.feasible & shown.final
    ax.scatter(at[way], value[way], edgecolors=MET, label="on the way", zorder=3, **_COARSE)
    if way.any():
        best = np.maximum if shown.senses[0] > 0 else np.minimum
        so_far = best.accumulate(value[way])
        ends = [*at[way], shown.looked_at[-1]], [*so_far, so_far[-1]]
        ax.step(*ends, where="post", color="0.35", lw=0.9, zorder=2, label="best so far")
    if final.any():
        bars = {"fmt": "none", "ecolor": BEST, "elinewidth": 0.8, "capsize": 2, "zorder": 4}
        ax.errorbar(at[final], value[final], shown.errors[final, 0], **bars)
        ax.scatter(at[final], value[final], label="full accuracy", **_FINAL)
    out = ~shown.feasible & ~shown.final
    if out.any():  # which have no value
        places = {"transform": ax.get_xaxis_transform(), "clip_on": False}
        ax.scatter(at[out], np.zeros(out.sum()), label="requirements missed", **places, **_OUT)
    ax.set(xlabel="designs looked at", ylabel=shown.labels[0])
    legend_above(ax, 4, handletextpad=0.3)


def _draw_fidelities(ax: Axes, shown: _Shown) -> None:
    rows = np.flatnonzero(shown.final & shown.feasible)
    before = shown.data["coarse_design"].values[rows]
    rows, before = rows[before >= 0], before[before >= 0]
    coarse, full = shown.values[before, 0], shown.values[rows, 0]
    known = np.isfinite(coarse)
    if not known.any():
        ax.set_axis_off()
        return
    errors = shown.errors[rows[known], 0], shown.errors[before[known], 0]
    bars = {"fmt": "none", "ecolor": "0.5", "elinewidth": 0.7, "capsize": 2, "zorder": 2}
    ax.errorbar(coarse[known], full[known], *errors, **bars)
    ax.scatter(coarse[known], full[known], **_FINAL)
    first = float(full[known][0])
    ax.axline((first, first), slope=1.0, color="0.7", lw=0.7, zorder=1)
    ax.set(xlabel=f"{shown.labels[0]}, coarse", ylabel="full accuracy")
    remark(ax, "the best, judged again")
    ax.locator_params(nbins=4)


def _draw_front(ax: Axes, shown: _Shown) -> None:
    way = shown.feasible & ~shown.final
    ax.scatter(*shown.values[way].T, edgecolors=MET, label="on the way", zorder=3, **_COARSE)
    rows = np.flatnonzero(shown.front & shown.feasible)
    if len(rows):
        points = shown.values[rows]
        points = points[np.argsort(points[:, 0])]
        # Between two designs nothing is known to be better than the worse one of each value.
        where = "post" if shown.senses[0] < 0 else "pre"
        ax.step(*points.T, where=where, color=BEST, lw=0.9, zorder=2)
        bars = {"fmt": "none", "ecolor": BEST, "elinewidth": 0.8, "zorder": 4}
        ax.errorbar(*shown.values[rows].T, *shown.errors[rows].T[::-1], **bars)
        ax.scatter(*shown.values[rows].T, label="front, full accuracy", **_FINAL)
    words = [
        f"{label} ({'large' if sense > 0 else 'small'} is better)"
        for label, sense in zip(shown.labels, shown.senses, strict=True)
    ]
    ax.set(xlabel=words[0], ylabel=words[1])
    legend_above(ax, handletextpad=0.3)


def _draw_missed(ax: Axes, shown: _Shown) -> None:
    """Excess of each design, in their order; infinite ones stand at the upper edge."""
    way = ~shown.final
    excess, at = shown.data["excess"].values, shown.looked_at
    met, never = way & shown.feasible, way & ~np.isfinite(excess)
    out = way & ~met & ~never
    if met.any():
        ax.scatter(at[met], excess[met], edgecolors=MET, label="met", **_COARSE)
    if out.any():
        ax.scatter(at[out], excess[out], label="missed", **_OUT)
    if never.any():
        top = {"transform": ax.get_xaxis_transform(), "clip_on": False}
        style = {**_OUT, "marker": "v"}
        ax.scatter(at[never], np.ones(never.sum()), label="no such arm", **top, **style)
    ax.set(xlabel="designs looked at", ylabel="requirements missed, sum [-]")
    ax.set_ylim(bottom=min(0.0, ax.get_ylim()[0]), top=None if out.any() else 1.0)
    legend_above(ax, handletextpad=0.3)


def _draw_objectives(ax: Axes, shown: _Shown) -> None:
    """The front over three or more objectives: a line for each design, the better end up."""
    rows = np.flatnonzero(shown.front & shown.feasible)[:_MOST_LINES]
    values = shown.values[rows]
    if not len(rows):
        ax.set_axis_off()
        return
    low, high = values.min(axis=0), values.max(axis=0)
    shares = (values - low) / np.where(high > low, high - low, 1.0)
    shares = np.where(shown.senses > 0, shares, 1.0 - shares)
    colors = pyplot().get_cmap("viridis")(0.9 * shares[:, 0])
    places = np.arange(values.shape[1])
    for share, color in zip(shares, colors, strict=True):
        ax.plot(places, share, "-D", color=color, lw=0.9, ms=3.5)
    for k, place in enumerate(places):
        ends = (low[k], high[k]) if shown.senses[k] > 0 else (high[k], low[k])
        ax.axvline(place, color="0.8", lw=0.6, zorder=0)
        for end, up, across in ((ends[0], -0.04, "top"), (ends[1], 1.04, "bottom")):
            ax.text(place, up, f"{end:.4g}", ha="center", va=across, fontsize=7, color="0.25")
    ax.set_xticks(places, [label.replace(" [", "\n[") for label in shown.labels])
    ax.set(ylim=(-0.16, 1.16), xlim=(-0.4, places[-1] + 0.4), yticks=[0, 1])
    ax.set_yticklabels(["worse", "better"])


def _draw_ranges(ax: Axes, shown: _Shown) -> None:
    data = shown.data
    low, high = data["low"].values, data["high"].values
    shares = (data["value"].values - low) / np.where(high > low, high - low, 1.0)
    way, rows = ~shown.final, np.flatnonzero(shown.front)
    count = len(low)
    for k in range(count):
        ax.hlines(k, 0.0, 1.0, color="0.85", lw=0.8, zorder=0)
        met, out = way & shown.feasible, way & ~shown.feasible
        small = {"s": 9, "linewidths": 0.5, "alpha": 0.6}
        ax.scatter(shares[met, k], np.full(met.sum(), k), edgecolors=MET, **{**_COARSE, **small})
        ax.scatter(shares[out, k], np.full(out.sum(), k), **{**_OUT, **small})
        ax.scatter(shares[rows, k], np.full(len(rows), k), **_FINAL)
        for place, end, across in ((-0.01, low[k], "right"), (1.01, high[k], "left")):
            text = _end_text(shown, k, float(end))
            ax.text(place, k, text, ha=across, va="center", fontsize=7, color="0.25")
    ax.set_yticks(range(count), [str(name) for name in data["parameter"].values])
    ax.tick_params(axis="y", length=0, pad=42)
    ax.set(xlim=(-0.02, 1.1), ylim=(count - 0.4, -0.6), xticks=[])
    word = "the best" if len(rows) < 2 else "the front"
    remark(ax, f"free parameters in their ranges, {word} ◆")
    ax.spines[:].set_visible(False)


def _end_text(shown: _Shown, k: int, end: float) -> str:
    choices = str(shown.data["choices"].values[k])
    if choices:
        return choices.split(", ")[round(end)]
    return readable(end, str(shown.data["parameter_unit"].values[k]), shown.unit)
