"""Picture of an arm at the places that it must reach, and of what it must keep to."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.picture.projection import View
from softreach.plot.arm import arm_points, draw_arms, shapes_of
from softreach.plot.axes import Panel, bounding_box
from softreach.plot.lengths import Unit, unit_for
from softreach.plot.style import figure_style, legend_above, panel_arguments
from softreach.rod.arm_shape import rest_configuration
from softreach.support.arguments import as_given
from softreach.support.arrays import Array, Mask
from softreach.support.errors import InvalidInput
from softreach.support.palette import MET, MISSED

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

_FADE = 0.35
_POSES = 5  # of places that are apart
_REGIONS = {
    "stay_inside": {"color": (0.25, 0.35, 0.60), "linestyle": "-", "label": "stay inside"},
    "avoid": {"color": (0.75, 0.42, 0.05), "linestyle": "--", "label": "avoid"},
    "cover": {"color": MET, "linestyle": ":", "label": "to be covered"},
}


class _Check(Protocol):
    @property
    def arm(self) -> Manipulator: ...
    @property
    def places(self) -> Array: ...
    @property
    def reached(self) -> Mask: ...
    @property
    def nearest(self) -> Array: ...
    @property
    def regions(self) -> Sequence[tuple[str, Any]]: ...
    @property
    def findings(self) -> Sequence[Any]: ...
    def shapes(self, count: int) -> xr.Dataset | None: ...


def plot_check(
    check: _Check,
    *,
    ax: Axes | None = None,
    view: View = "oblique",
    unit: Unit = None,
) -> Axes:
    """Draw an arm at the places that it must reach, and the regions that it must keep to.

    Five poses are drawn, of places that are apart. Places that are reached under every payload are
    green dots; those that are missed are red crosses, each with a line to the nearest tip. The
    legend says which kinds of regions are missed or undecided.

    Args:
        check: What `check` returned.
        ax: Axes to draw in; None for a new figure.
        view: As in `plot_cloud`.
        unit: Of the axes: "m", "cm", "mm" or "L"; None for L.

    Returns:
        The axes, in that unit.

    Raises:
        InvalidInput: Unknown view or unit, or no check.
        MissingExtra: matplotlib is not installed.
    """
    if isinstance(check, type) or not hasattr(check, "requirements"):
        raise InvalidInput("check", as_given(check), "what `check` returned")
    arm = check.arm
    ax, _ = panel_arguments(ax, view, None)
    counted = unit_for(arm.length, unit)
    shapes = shapes_of(check.shapes(_POSES)) or [rest_configuration(arm)]
    with figure_style(ax):
        points = [arm_points(arm, shape, counted) for shape in shapes]
        points.append(counted.of(check.places))
        around = counted.size * bounding_box(*points)
        lines: dict[str, list[Array]] = {kind: [] for kind in _REGIONS}
        for kind, region in check.regions:
            lines[kind] += [counted.of(line) for line in region.wireframe(around)]
        points += [line for each in lines.values() for line in each]
        panel = Panel.opened(np.concatenate(points), counted, ax, view, None)
        draw_arms(panel, arm, shapes, range(arm.bundles), _FADE)
        for kind, each in lines.items():
            style = {"linewidth": 0.9, **_REGIONS[kind]}
            words = {each.verdict for each in check.findings if each.kind == kind} - {"met"}
            style["label"] = ": ".join([str(style["label"]), *sorted(words)])
            _draw_lines(panel, each, style)
        _draw_places(panel, check)
        if panel.ax.get_legend_handles_labels()[1]:
            legend_above(panel.ax)
    return panel.ax


def _draw_places(panel: Panel, check: _Check) -> None:
    met = check.reached.all(axis=0)
    load = (~check.reached).sum(axis=1).argmax()  # under which most are missed
    gaps = np.stack([check.places[~met], check.nearest[load, ~met]], axis=1)
    _draw_lines(panel, panel.unit.of(gaps), {"color": MISSED, "linewidth": 1.0, "label": "gap"})
    styles = ((met, "o", MET, "reached", 4.5), (~met, "X", MISSED, "missed", 6.0))
    for rows, marks, color, label, size in styles:
        if rows.any():
            edge = {"markeredgecolor": "white", "markeredgewidth": 0.5, "zorder": 5}
            look = {"color": color, "markersize": size, "label": label}
            panel.plot(panel.unit.of(check.places[rows]), marks, **look, **edge)


def _draw_lines(panel: Panel, lines: Iterable[Array], style: dict[str, Any]) -> None:
    for line in lines:
        panel.plot(line, **style)
        style = {**style, "label": None}
