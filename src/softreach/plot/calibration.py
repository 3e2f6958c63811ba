"""Pictures of a calibration: places in space, and errors by marker, by input and in time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.picture.projection import View, is_mirrored, on_paper, plane_of, view_angles
from softreach.plot.axes import bounding_box, draw_box, view_extent
from softreach.plot.lengths import Unit, unit_for
from softreach.plot.style import (
    HasDataset,
    dataset_of,
    figure_style,
    legend_above,
    pyplot,
    remark,
    write_note,
)
from softreach.support.arrays import Array
from softreach.support.units import LengthUnit, handy_unit, readable_unit

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH = 7.2  # inches
_SPACE, _ROW = 3.6, 1.75  # heights of the upper part and of each row of inputs [inch]
_COLUMNS = 3
_FAR = 4.0  # times the 95 % quantile, beyond which places would squash all others
_MILLIMETER = LengthUnit("mm", 1e-3)  # of inputs
_MEASURED = "0.45"


def plot_calibration(
    calibration: HasDataset, *, view: View = "oblique", unit: Unit = None
) -> Figure:
    """Draw how far measured and predicted places of the markers are apart.

    In space, with a line from each measured place to the predicted one; the distances by marker, in
    the order in which samples were taken, and against each input. Samples held out of the fit are
    hollow; what is too far off for the axes is counted in a corner.

    Args:
        calibration: What `calibrate` returned.
        view: The direction of sight of the picture in space, as in `plot_cloud`.
        unit: Unit of lengths, m, cm, mm or L; None for mm, or m for arms from 1 m.

    Raises:
        InvalidInput: Unknown view or unit, or no calibration.
        MissingExtra: matplotlib is not installed.
    """
    data = dataset_of("calibration", calibration, "calibrate", "residual")
    view_angles(view)
    length = float(data.attrs["length"])
    shown = _Shown(data, unit_for(length, handy_unit(length) if unit is None else unit))
    inputs = shown.moving_inputs
    rows = math.ceil(len(inputs) / _COLUMNS)
    with figure_style():
        size = (_WIDTH, _SPACE + _ROW * rows)
        figure = pyplot().figure(figsize=size, layout="constrained")
        heights = [_SPACE, _ROW * rows][: 1 + (rows > 0)]
        parts = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
        upper = parts[0]
        grid = upper.add_gridspec(2, 2, width_ratios=[1.25, 1.0])
        _draw_places(upper.add_subplot(grid[:, 0]), shown, view)
        _draw_markers(upper.add_subplot(grid[0, 1]), shown)
        _draw_order(upper.add_subplot(grid[1, 1]), shown)
        if rows:
            axes = parts[1].subplots(rows, min(_COLUMNS, len(inputs)), sharey=True, squeeze=False)
            for ax, k in zip(axes.flat, inputs, strict=False):
                _draw_input(ax, shown, k)
            for ax in axes[:, 0]:
                ax.set_ylabel(shown.label)
            for ax in list(axes.flat)[len(inputs) :]:
                ax.set_axis_off()
    return figure


class _Shown:
    def __init__(self, data: xr.Dataset, unit: LengthUnit) -> None:
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
        colors = pyplot().get_cmap("tab10")
        self.colors = [colors(k % 10) for k in range(data.sizes["marker"])]

    def scatter(self, ax: Axes, x: Array, marker: int) -> None:
        size = {"s": 9 if len(x) < 300 else 4, "linewidths": 0.6, "zorder": 3}
        color: Any = self.colors[marker]
        for rows, face in ((~self.held, color), (self.held, "none")):
            ax.scatter(x[rows], self.distance[rows, marker], color=face, edgecolors=color, **size)

    def frame(self, ax: Axes) -> None:
        ax.set_ylim(0.0, self.top)
        far = int((self.distance > self.top).sum())
        if far:
            write_note(ax, f"{far} beyond", 0.98, 0.96)


def _draw_places(ax: Axes, shown: _Shown, view: View) -> None:
    from matplotlib.collections import LineCollection

    near = np.isfinite(shown.distance) & (shown.distance <= shown.top)
    measured, predicted = shown.measured[near], shown.predicted[near]
    box = bounding_box(measured, predicted)
    colors = [shown.colors[k] for k in np.nonzero(near)[1]]
    here, there = on_paper(measured, view), on_paper(predicted, view)
    lines = LineCollection(list(np.stack([here, there], axis=1)), colors=colors, linewidths=0.7)
    lines.set_zorder(2)
    ax.add_collection(lines)
    size = 10 if len(here) < 1000 else 3
    ax.scatter(*here.T, s=size, color=_MEASURED, linewidths=0, zorder=3, label="measured")
    ax.scatter(*there.T, s=size, facecolors="none", edgecolors=colors, linewidths=0.7, zorder=4)
    ax.scatter([], [], s=10, facecolors="none", edgecolors="0.2", linewidths=0.7, label="predicted")
    left, right, low, high = view_extent(box, view)
    mirror = -1 if is_mirrored(view) else 1
    ax.set(xlim=(mirror * left, mirror * right), ylim=(low, high), aspect="equal")
    if plane := plane_of(view):
        ax.set(xlabel=shown.unit.label(plane[0]), ylabel=shown.unit.label(plane[1]))
    else:
        draw_box(ax, box, view, shown.unit)
    legend_above(ax, 2, handletextpad=0.2)


def _draw_markers(ax: Axes, shown: _Shown) -> None:
    rng = np.random.default_rng(0)
    for k in range(len(shown.markers)):
        shown.scatter(ax, k + 0.25 * (2.0 * rng.random(len(shown.distance)) - 1.0), k)
        for rows, style in ((~shown.held, "-"), (shown.held, ":")):
            own = shown.distance[rows, k]
            if np.isfinite(own).any():
                rms = float(np.sqrt(np.nanmean(own**2)))
                ax.hlines(rms, k - 0.38, k + 0.38, color="0.1", lw=1.2, ls=style, zorder=4)
    ax.set_xticks(range(len(shown.markers)), shown.markers)
    if len(shown.markers) > 4:
        ax.tick_params(axis="x", labelrotation=40)
    ax.set(ylabel=shown.label, xlim=(-0.6, len(shown.markers) - 0.4))
    remark(ax, "line: rms" + ("; hollow, dotted: held out" if shown.held.any() else ""))
    shown.frame(ax)


def _draw_order(ax: Axes, shown: _Shown) -> None:
    rank = shown.data["rank"].values
    for k in range(len(shown.markers)):
        shown.scatter(ax, rank, k)
    runs = shown.data["run"].values[np.argsort(rank)]
    for end in np.flatnonzero(np.diff(runs)):
        ax.axvline(end + 0.5, color="0.85", linewidth=0.5, zorder=1)
    ax.set(xlabel="sample, in order of time", ylabel=shown.label)
    shown.frame(ax)


def _draw_input(ax: Axes, shown: _Shown, k: int) -> None:
    unit, values = str(shown.data["input_unit"].values[k]), shown.data["input_value"].values[:, k]
    name, size = readable_unit(unit, 1e3, _MILLIMETER)
    for marker in range(len(shown.markers)):
        shown.scatter(ax, values / size, marker)
    label = str(shown.data["input"].values[k])
    ax.set_xlabel(f"{label} [{name}]" if name else label)
    shown.frame(ax)
