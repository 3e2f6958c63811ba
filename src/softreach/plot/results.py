"""Pictures of results: errors of a calibration, and the designs of a search."""

import math
from itertools import product
from textwrap import fill
from typing import Any

import numpy as np

from softreach.picture.projection import View, on_paper, view_angles
from softreach.plot import style
from softreach.plot.axes import Panel, bounding_box
from softreach.plot.coloring import COLORMAP
from softreach.plot.style import Unit
from softreach.support.arrays import Array, Mask
from softreach.support.lazy import Axes, Dataset, Figure
from softreach.support.palette import BEST, MET, MISSED
from softreach.support.units import LengthUnit, handy_unit, readable, readable_unit

_WIDTH = 7.2  # inches
_SPACE, _ROW = 3.6, 1.75  # heights of the upper part and of each row of inputs [inch]
_COLUMNS = 3
_FAR = 4.0  # times the 95 % quantile, beyond which places would squash all others
_MILLIMETER = LengthUnit("mm", 1e-3)  # of inputs
_MEASURED = "0.45"
_ABOVE, _LINE, _ENDS = 2.5, 0.24, 0.75  # heights of panels, of a parameter, and around these [inch]
_COARSE: dict[str, Any] = {"marker": "o", "s": 14, "facecolors": "none", "edgecolors": MET}
_COARSE["linewidths"] = 0.7
_FINAL: dict[str, Any] = {"marker": "D", "s": 24, "color": BEST, "linewidths": 0, "zorder": 4}
_OUT: dict[str, Any] = {"marker": "x", "s": 16, "color": MISSED, "linewidths": 0.8, "zorder": 3}
_BARS: dict[str, Any] = {"fmt": "none", "ecolor": BEST, "elinewidth": 0.8, "zorder": 4}
_MOST_LINES = 200
_LETTERS = 40  # beside or below a panel


def plot_calibration(calibration: Any, *, view: View = "oblique", unit: Unit = None) -> Figure:
    """Draw how far measured and predicted places of the markers are apart.

    In space, with a line from each measured place to the predicted one; the distances by marker, in
    the order in which samples were taken, and against each input. Samples held out of the fit are
    hollow; what is too far off for the axes is counted in a corner.

    Args:
        calibration: What `calibrate` returned.
        view: The direction of sight of the picture in space, as in `plot_cloud`.
        unit: Unit of lengths, m, cm, mm or L; None for that of the design, as in the report.

    Raises:
        InvalidInput: Unknown view or unit, or no calibration.
        MissingExtra: matplotlib is not installed.
    """
    data = style.a_result("calibration", calibration, "Calibration", "calibrate").to_dataset()
    view_angles(view)
    arm = calibration.arm
    shown = _Errors(data, style.unit_for(arm.length, arm.length_unit if unit is None else unit))
    inputs = shown.moving_inputs
    rows = math.ceil(len(inputs) / _COLUMNS)
    with style.figure_style():
        heights = [_SPACE, *[_ROW * rows] * (rows > 0)]
        figure = style.new_figure(figsize=(_WIDTH, sum(heights)), layout="constrained")
        parts = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
        grid = parts[0].add_gridspec(2, 2, width_ratios=[1.25, 1.0])
        _draw_places(parts[0].add_subplot(grid[:, 0]), shown, view)
        _draw_markers(parts[0].add_subplot(grid[0, 1]), shown)
        _draw_order(parts[0].add_subplot(grid[1, 1]), shown)
        for part in parts[1:]:
            axes = part.subplots(rows, min(_COLUMNS, len(inputs)), sharey=True, squeeze=False)
            for ax, k in zip(axes.flat, inputs, strict=False):
                _draw_input(ax, shown, k)
            for ax in axes[:, 0]:
                ax.set_ylabel(shown.label)
            for ax in list(axes.flat)[len(inputs) :]:
                ax.set_axis_off()
    return figure


class _Errors:
    def __init__(self, data: Dataset, unit: LengthUnit) -> None:
        self.data, self.unit, self.label = data, unit, unit.label("error")
        self.markers = [str(name) for name in data["marker"].values]
        moving = np.ptp(data["input_value"].values, axis=0) > 0
        self.moving_inputs: list[int] = np.flatnonzero(moving).tolist()
        self.measured = unit.of(data["measured"].values)
        residual = unit.of(data["residual"].values)
        self.predicted = self.measured + residual
        self.distance = np.linalg.norm(residual, axis=2)
        self.held = data["held_out"].values
        known = self.distance[np.isfinite(self.distance)]
        limit = _FAR * float(np.quantile(known, 0.95)) if known.size else 1.0
        self.top = min(1.08 * float(known.max(initial=0.0)), limit) or 1.0
        colors = style.pyplot().get_cmap("tab10")
        self.colors = [colors(k % 10) for k in range(data.sizes["marker"])]

    def scatter(self, ax: Axes, x: Array) -> None:
        """Distances of all markers over x, shape (sample,) or (marker, sample)."""
        size = {"s": 9 if x.shape[-1] < 300 else 4, "linewidths": 0.6, "zorder": 3}
        places = np.broadcast_to(x, self.distance.T.shape)
        for own, distance, color in zip(places, self.distance.T, self.colors, strict=True):
            for rows, face in ((~self.held, color), (self.held, "none")):
                ax.scatter(own[rows], distance[rows], color=face, edgecolors=color, **size)

    def frame(self, ax: Axes) -> None:
        ax.set_ylim(0.0, self.top)
        if far := int((self.distance > self.top).sum()):
            style.write_note(ax, f"{far} beyond", 0.98, 0.96)


def _draw_places(ax: Axes, shown: _Errors, view: View) -> None:
    from matplotlib.collections import LineCollection

    near = np.isfinite(shown.distance) & (shown.distance <= shown.top)
    places = shown.measured[near], shown.predicted[near]
    colors = [shown.colors[k] for k in np.nonzero(near)[1]]
    here, there = (on_paper(points, view) for points in places)
    lines = np.stack([here, there], axis=1)
    ax.add_collection(LineCollection(list(lines), colors=colors, linewidths=0.7, zorder=2))
    size: Any = 10 if len(here) < 1000 else 3
    hollow: dict[str, Any] = {"facecolors": "none", "linewidths": 0.7}
    ax.scatter(*here.T, s=size, color=_MEASURED, linewidths=0, zorder=3, label="measured")
    ax.scatter(*there.T, s=size, edgecolors=colors, zorder=4, **hollow)
    ax.scatter([], [], s=10, edgecolors="0.2", label="predicted", **hollow)
    ax.set_aspect("equal")
    Panel(ax, bounding_box(*places), view, shown.unit).frame()
    style.legend_above(ax, 2, handletextpad=0.2)


def _draw_markers(ax: Axes, shown: _Errors) -> None:
    apart = 0.25 * (2.0 * np.random.default_rng(0).random(shown.distance.T.shape) - 1.0)
    shown.scatter(ax, np.arange(len(apart))[:, None] + apart)
    for k, (rows, look) in product(range(len(apart)), ((~shown.held, "-"), (shown.held, ":"))):
        own = shown.distance[rows, k]
        if np.isfinite(own).any():
            rms = float(np.sqrt(np.nanmean(own**2)))
            ax.hlines(rms, k - 0.38, k + 0.38, color="0.1", lw=1.2, ls=look, zorder=4)
    ax.set_xticks(range(len(shown.markers)), shown.markers)
    if len(shown.markers) > 4 or len("".join(shown.markers)) > _LETTERS:
        ax.tick_params(axis="x", labelrotation=40)
    ax.set(ylabel=shown.label, xlim=(-0.6, len(shown.markers) - 0.4))
    style.remark(ax, "line: rms" + ("; hollow, dotted: held out" if shown.held.any() else ""))
    shown.frame(ax)


def _draw_order(ax: Axes, shown: _Errors) -> None:
    rank = shown.data["rank"].values
    shown.scatter(ax, rank)
    runs = shown.data["run"].values[np.argsort(rank)]
    for end in np.flatnonzero(np.diff(runs)):
        ax.axvline(end + 0.5, color="0.85", linewidth=0.5, zorder=1)
    ax.set(xlabel="sample, in order of time", ylabel=shown.label)
    shown.frame(ax)


def _draw_input(ax: Axes, shown: _Errors, k: int) -> None:
    unit, values = str(shown.data["input_unit"].values[k]), shown.data["input_value"].values[:, k]
    name, size = readable_unit(unit, 1e3, _MILLIMETER)
    shown.scatter(ax, values / size)
    label = str(shown.data["input"].values[k])
    ax.set_xlabel(f"{label} [{name}]" if name else label)
    shown.frame(ax)


def plot_search(search: Any, *, unit: Unit = None) -> Figure:
    """Draw what a search came to: designs that were judged, and the best in their ranges.

    Of one objective, its value against the designs that were looked at, with the best so far. Of
    two, designs and the front; of more, the front as lines over all of them. Beside it, how far
    designs miss requirements, if some do: they are crosses.

    Args:
        search: What `search` returned.
        unit: Of lengths and volumes, m, cm, mm or L; None for that of the design, as in the report.

    Raises:
        InvalidInput: Unknown unit, or no search.
        MissingExtra: matplotlib is not installed.
    """
    data = style.a_result("search", search, "Search", "search").to_dataset()
    length = float(data.attrs["length"])
    name = data.attrs["display_unit"] or handy_unit(length)
    shown = _Designs(data, style.unit_for(length, name if unit is None else unit))
    goals, below = data.sizes["objective"], _ENDS + _LINE * data.sizes["parameter"]
    with style.figure_style():
        figure = style.new_figure(figsize=(_WIDTH, _ABOVE + below), layout="constrained")
        grid = figure.add_gridspec(2, 2, height_ratios=[_ABOVE, below], width_ratios=[1.6, 1.0])
        beside = bool(goals and shown.missed.any())
        draw = (_draw_missed, _draw_progress, _draw_front, _draw_objectives)[min(goals, 3)]
        draw(figure.add_subplot(grid[0, 0] if beside else grid[0, :]), shown)
        if beside:
            _draw_missed(figure.add_subplot(grid[0, 1]), shown)
        _draw_ranges(figure.add_subplot(grid[1, :]), shown)
    return figure


class _Designs:
    def __init__(self, data: Dataset, unit: LengthUnit) -> None:
        self.data, self.unit = data, unit
        self.feasible: Mask = data["feasible"].values
        count = data.sizes["design"]
        self.final: Mask = np.arange(count) >= count - int(data.attrs["finalists"])
        self.front: Mask = data["front"].values & self.final
        self.met, self.missed = self.feasible & ~self.final, ~self.feasible & ~self.final
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

    def mark(self, ax: Axes, rows: Mask, heights: Array, **look: Any) -> None:
        if rows.any():
            ax.scatter(self.looked_at[rows], heights[rows], **look)


def _draw_progress(ax: Axes, shown: _Designs) -> None:
    value, at, met = shown.values[:, 0], shown.looked_at, shown.met
    ax.scatter(at[met], value[met], label="on the way", zorder=3, **_COARSE)
    if met.any():
        best = np.maximum if shown.senses[0] > 0 else np.minimum
        so_far = best.accumulate(value[met])
        ends = [*at[met], at[-1]], [*so_far, so_far[-1]]
        ax.step(*ends, where="post", color="0.35", lw=0.9, zorder=2, label="best so far")
    final = shown.feasible & shown.final
    if final.any():
        ax.errorbar(at[final], value[final], shown.errors[final, 0], capsize=2, **_BARS)
    shown.mark(ax, final, value, label="full accuracy", **_FINAL)
    edge = {"transform": ax.get_xaxis_transform(), "clip_on": False}  # what is missed has no value
    shown.mark(ax, shown.missed, 0.0 * at, label="requirements missed", **edge, **_OUT)
    ax.set(xlabel="designs looked at", ylabel=shown.labels[0])
    style.legend_above(ax, 4, handletextpad=0.3)


def _draw_front(ax: Axes, shown: _Designs) -> None:
    ax.scatter(*shown.values[shown.met].T, label="on the way", zorder=3, **_COARSE)
    rows = np.flatnonzero(shown.front & shown.feasible)
    if len(rows):
        points, errors = shown.values[rows].T, shown.errors[rows].T
        # Between two designs nothing is known to be better than the worse one of each value.
        where = "post" if shown.senses[0] < 0 else "pre"
        ax.step(*points[:, points[0].argsort()], where=where, color=BEST, lw=0.9, zorder=2)
        ax.errorbar(*points, *errors[::-1], **_BARS)
        ax.scatter(*points, label="front, full accuracy", **_FINAL)
    ways = ("large" if sense > 0 else "small" for sense in shown.senses)
    pairs = zip(shown.labels, ways, strict=True)
    words = [fill(f"{label} ({way} is better)", _LETTERS) for label, way in pairs]
    ax.set(xlabel=words[0], ylabel=words[1])
    style.legend_above(ax, handletextpad=0.3)


def _draw_missed(ax: Axes, shown: _Designs) -> None:
    excess = shown.data["excess"].values
    never = ~np.isfinite(excess) & ~shown.final
    missed = shown.missed & ~never
    shown.mark(ax, shown.met, excess, label="met", **_COARSE)
    shown.mark(ax, missed, excess, label="missed", **_OUT)
    edge = {"marker": "v", "transform": ax.get_xaxis_transform(), "clip_on": False}
    shown.mark(ax, never, np.ones(len(excess)), label="no such arm", **_OUT | edge)
    ax.set(xlabel="designs looked at", ylabel="requirements missed, sum [-]")
    ax.set_ylim(bottom=min(0.0, ax.get_ylim()[0]), top=None if missed.any() else 1.0)
    style.legend_above(ax, handletextpad=0.3)


def _draw_objectives(ax: Axes, shown: _Designs) -> None:
    rows = np.flatnonzero(shown.front & shown.feasible)[:_MOST_LINES]
    values = shown.values[rows]
    if not len(rows):
        ax.set_axis_off()
        return
    low, high = values.min(axis=0), values.max(axis=0)
    shares = (values - low) / np.where(high > low, high - low, 1.0)
    shares = np.where(shown.senses > 0, shares, 1.0 - shares)
    colors = style.pyplot().get_cmap(COLORMAP)(0.9 * shares[:, 0])
    places, wide = np.arange(values.shape[1]), max(8, 48 // values.shape[1])
    for share, color in zip(shares, colors, strict=True):
        ax.plot(places, share, "-D", color=color, lw=0.9, ms=3.5)
    for k, place in enumerate(places):
        ends = (low[k], high[k]) if shown.senses[k] > 0 else (high[k], low[k])
        ax.axvline(place, color="0.8", lw=0.6, zorder=0)
        for end, up, across in ((ends[0], -0.04, "top"), (ends[1], 1.04, "bottom")):
            ax.text(place, up, f"{end:.4g}", ha="center", va=across, fontsize=7, color="0.25")
    ax.set_xticks(places, [fill(label, wide).replace(" [", "\n[") for label in shown.labels])
    ax.set(ylim=(-0.16, 1.16), xlim=(-0.4, places[-1] + 0.4), yticks=[0, 1])
    ax.set_yticklabels(["worse", "better"])


def _draw_ranges(ax: Axes, shown: _Designs) -> None:
    data, small = shown.data, {"s": 9, "linewidths": 0.5, "alpha": 0.6}
    low, high = data["low"].values, data["high"].values
    shares = (data["value"].values - low) / np.where(high > low, high - low, 1.0)
    styles = [(shown.met, _COARSE | small), (shown.missed, _OUT | small), (shown.front, _FINAL)]
    for k in range(len(low)):
        ax.hlines(k, 0.0, 1.0, color="0.85", lw=0.8, zorder=0)
        for rows, look in styles:
            ax.scatter(shares[rows, k], np.full(rows.sum(), k), **look)
        for place, end, across in ((-0.01, low[k], "right"), (1.01, high[k], "left")):
            if choices := str(data["choices"].values[k]):
                text = choices.split(", ")[round(float(end))]
            else:
                text = readable(float(end), str(data["parameter_unit"].values[k]), shown.unit)
            ax.text(place, k, text, ha=across, va="center", fontsize=7, color="0.25")
    ax.set_yticks(range(len(low)), [str(name) for name in data["parameter"].values])
    ax.tick_params(axis="y", length=0, pad=42)
    ax.set(xlim=(-0.02, 1.1), ylim=(len(low) - 0.4, -0.6), xticks=[])
    word = "the best" if shown.front.sum() < 2 else "the front"
    style.remark(ax, f"free parameters in their ranges, {word} ◆")
    ax.spines[:].set_visible(False)
