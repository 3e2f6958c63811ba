"""Pictures of arms, lit tubes with their bundles: alone, side by side, at their targets."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.skin import arm_surface, bundle_skins, inside, marker_points
from softreach.picture.projection import View, plane_of
from softreach.picture.zbuffer import ZBuffer, draw_mesh, faces_to_eye
from softreach.plot import style
from softreach.plot.axes import Panel, bounding_box
from softreach.plot.cross_section import plot_cross_section, section_reach
from softreach.rod.kinematics import rest_configuration
from softreach.schema import a_configuration
from softreach.support.arguments import as_flag, as_given, as_instance, as_number
from softreach.support.arrays import Array, as_stations
from softreach.support.errors import InvalidInput
from softreach.support.palette import BODY, MET, MISSED, bundle_color
from softreach.support.units import LengthUnit, in_lengths

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_SIDES = 96
_BULGE = 1.01  # of R2, beyond which a bundle makes the picture wider
_FADE = 0.62  # how far the colors of the arm at rest go toward white
_CHECKED = 0.35  # and those of arms at their targets
_LEAST, _LEAST_OBLIQUE = 1.5, 2.2  # widths of a panel, and of a figure seen obliquely [inch]
_LETTERS = 14  # of titles an inch
_POSES = 5  # of places that are apart
_REGIONS = {
    "stay_inside": {"color": (0.25, 0.35, 0.60), "linestyle": "-", "label": "stay inside"},
    "avoid": {"color": (0.75, 0.42, 0.05), "linestyle": "--", "label": "avoid"},
    "cover": {"color": MET, "linestyle": ":", "label": "to be covered"},
}


def plot_arm(
    arm: Manipulator,
    configuration: xr.Dataset | None = None,
    *,
    ax: Axes | None = None,
    view: View = "front",
    rest: bool = True,
    bundles: Collection[int] | None = None,
    box: ArrayLike | None = None,
    unit: style.Unit = None,
) -> Axes:
    """Draw an arm; where both are shown, the arm at rest is pale and behind.

    Args:
        arm: The design.
        configuration: One configuration of that arm or several along `sample`; None for the arm at
            rest alone.
        ax: Axes to draw in; None for a new figure.
        view: As in `plot_cloud`.
        rest: Whether to draw the arm at rest beside its configurations.
        bundles: Which to draw, by index; None for all.
        box: What to show, lower and upper corner [m], shape (2, 3); None for all that is drawn.
        unit: Of the axes: "m", "cm", "mm" or "L"; None for L.

    Raises:
        InvalidInput: Unknown view or unit.
        MissingExtra: matplotlib is not installed.
    """
    arm, rest = a_manipulator("arm", arm), as_flag("rest", rest)
    shapes, counted = shapes_of(configuration), style.unit_for(arm.length, unit)
    resting = [rest_configuration(arm)] if rest or not shapes else []
    drawn = style.some_bundles(arm, bundles)
    points = np.concatenate([arm_points(arm, shape, counted) for shape in shapes + resting])
    with Panel.opened(points, counted, ax, view, box) as panel:
        draw_arms(panel, arm, resting, drawn, _FADE if shapes else 0.0)
        draw_arms(panel, arm, shapes, drawn)
    return panel.ax


def shapes_of(configuration: xr.Dataset | None) -> list[xr.Dataset]:
    """The single configurations of a dataset that may hold several."""
    if configuration is None:
        return []
    configuration = a_configuration("configuration", configuration)
    if "sample" not in configuration.dims:
        return [configuration]
    return [configuration.isel(sample=k) for k in range(configuration.sizes["sample"])]


def arm_points(arm: Manipulator, shape: xr.Dataset, unit: LengthUnit) -> Array:
    """Points of one configuration: its surface, bundles outside of it, markers; shape (n, 3)."""
    outline = arm.outline(shape["Z"].values)
    out = (outline.outer_ratio > _BULGE) & outline.acts
    surfaces = [arm_surface(arm, shape, _SIDES)]
    if out.any():
        skins = bundle_skins(arm, shape)
        surfaces += [skin for k, skin in enumerate(skins) if out[:, k].any()]
    points = [surface.vertices for surface in surfaces]
    return unit.of(np.concatenate([*points, marker_points(arm.markers, shape)]))


def draw_arms(
    panel: Panel,
    arm: Manipulator,
    shapes: list[xr.Dataset],
    bundles: Collection[int],
    fade: float = 0.0,
) -> None:
    """One image of all shapes, over what the axes hold, and their markers in front."""
    if shapes:
        panel.show(*arm_images(panel, arm, shapes, bundles, fade))
        draw_markers(panel, arm, shapes, fade)


def draw_markers(panel: Panel, arm: Manipulator, shapes: list[xr.Dataset], fade: float) -> None:
    """Small dots where the markers of all shapes are."""
    if arm.markers:
        points = np.concatenate([marker_points(arm.markers, shape) for shape in shapes])
        edge = {"color": "0.1", "markeredgecolor": "1", "markeredgewidth": 0.4, "zorder": 3}
        panel.plot(panel.unit.of(points), "o", markersize=3, alpha=1.0 - fade, **edge)


def arm_images(
    panel: Panel,
    arm: Manipulator,
    shapes: list[xr.Dataset],
    bundles: Collection[int],
    fade: float = 0.0,
) -> tuple[ZBuffer, ZBuffer | None]:
    """All shapes in a panel, and what shows through them; None for nothing."""
    buffer, within = panel.buffer(oversample=3), panel.buffer(oversample=3)
    hidden = inside(arm)
    clear = any(hidden[index] for index in bundles)
    for shape in shapes:
        body = arm_surface(arm, shape, _SIDES)
        caps = 2 * _SIDES  # the last faces; apart, so that light breaks at the rim
        for part in (body.faces[:-caps], body.faces[-caps:]):
            draw_mesh(buffer, panel.unit.of(body.vertices), part, BODY, panel.view, fade)
        skins = bundle_skins(arm, shape, lift=0.008)
        for index in bundles:
            points, faces = panel.unit.of(skins[index].vertices), skins[index].faces
            look = bundle_color(index), panel.view, fade
            draw_mesh(buffer, points, faces, *look)
            if clear:
                draw_mesh(within, points, faces_to_eye(points, faces, panel.view), *look)
    return buffer, within if clear else None


class DesignPanel(NamedTuple):
    """One arm in a row of arms."""

    title: str
    arm: Manipulator
    view: View = "front"
    bundles: Collection[int] | None = None
    """Bundles to draw, by index; None for all."""


def plot_designs(
    panels: Sequence[DesignPanel],
    *,
    stations_over_length: Sequence[float] = (0.0,),
    width: float | None = None,
    unit: style.Unit = None,
) -> Figure:
    """Draw arms at rest, and under each its cross-sections, all at one scale (figures 1b-d, 4a).

    Args:
        panels: The arms, from left to right.
        stations_over_length: Z / L of the cross-sections [-], from 0 to 1; none for the arms alone.
        width: Of the figure [inch]; None for 1.5 a panel.
        unit: As in `plot_arm`.

    Raises:
        InvalidInput: A station off an arm, or an unknown view.
        MissingExtra: matplotlib is not installed.
    """
    if not isinstance(panels, list | tuple) or not panels:
        raise InvalidInput("panels", as_given(panels), "a list or tuple of DesignPanels")
    for k, panel in enumerate(panels):
        as_instance(f"panels[{k}]", panel, DesignPanel, "a DesignPanel")
    stations = as_stations("stations_over_length", stations_over_length).tolist()
    least = _LEAST if all(plane_of(p.view) for p in panels) else _LEAST_OBLIQUE
    usual = max(_LEAST * len(panels), least)
    width = usual if width is None else as_number("width", width, style.WIDTH)
    box = bounding_box(
        *(arm_points(p.arm, rest_configuration(p.arm), in_lengths(p.arm.length)) for p in panels)
    )
    places = [(p.arm, s * p.arm.length) for p in panels for s in (*stations, 0.0)]
    reach = 1.08 * max(section_reach(arm, z) / arm.length for arm, z in places)
    with style.figure_style():
        heights = [2.6, *[width / len(panels)] * len(stations)]
        figure = style.new_figure(figsize=(width, sum(heights) + 0.1), layout="constrained")
        shape = len(heights), len(panels)
        axes = figure.subplots(*shape, height_ratios=heights, squeeze=False)
        for k, panel in enumerate(panels):
            arm, length = panel.arm, panel.arm.length
            drawn, shown = panel.bundles, length * box
            plot_arm(arm, ax=axes[0, k], view=panel.view, bundles=drawn, box=shown, unit=unit)
            axes[0, k].set_title(fill(panel.title, round(_LETTERS * width / len(panels))))
            for ax, station in zip(axes[1:, k], stations, strict=True):
                z, half = station * length, reach * length
                shared = {"bundles": drawn, "half_width": half, "legend": False, "unit": unit}
                plot_cross_section(arm, z, ax=ax, **shared)
                ax.set_title(f"Z = {station:.2g} L" if station else "Z = 0")
        for ax in np.ravel(axes[:, 1:]):
            ax.set(ylabel="", yticklabels=[])
    return figure


def plot_check(
    check: Any, *, ax: Axes | None = None, view: View = "oblique", unit: style.Unit = None
) -> Axes:
    """Draw an arm at the places that it must reach, and the regions that it must keep to.

    Five poses are drawn, of places that are apart. Places that are reached under every payload are
    green dots; those that are missed are red crosses, each with a line to the nearest tip. The
    legend says which kinds of regions are missed or undecided.

    Args:
        check: What `check` returned.
        ax: Axes to draw in; None for a new figure.
        view: As in `plot_cloud`.
        unit: Of the axes: "m", "cm", "mm" or "L"; None for that of the design, as in the report.

    Raises:
        InvalidInput: Unknown view or unit, or no check.
        MissingExtra: matplotlib is not installed.
    """
    arm = style.a_result("check", check, "Check", "check").arm
    counted = style.unit_for(arm.length, arm.length_unit if unit is None else unit)
    shapes = shapes_of(check.shapes(_POSES)) or [rest_configuration(arm)]
    points = [arm_points(arm, shape, counted) for shape in shapes]
    points.append(counted.of(check.places))
    around = counted.size * bounding_box(*points)
    lines: dict[str, list[Array]] = {kind: [] for kind in _REGIONS}
    for kind, region in check.regions:
        lines[kind] += [counted.of(line) for line in region.wireframe(around)]
    points += [line for each in lines.values() for line in each]
    with Panel.opened(np.concatenate(points), counted, ax, view) as panel:
        draw_arms(panel, arm, shapes, range(arm.bundles), _CHECKED)
        for kind, each in lines.items():
            look = {"linewidth": 0.9, **_REGIONS[kind]}
            words = {each.verdict for each in check.findings if each.kind == kind} - {"met"}
            look["label"] = ": ".join([str(look["label"]), *sorted(words)])
            _draw_lines(panel, each, look)
        _draw_places(panel, check)
        if panel.ax.get_legend_handles_labels()[1]:
            style.legend_above(panel.ax)
    return panel.ax


def _draw_places(panel: Panel, check: Any) -> None:
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


def _draw_lines(panel: Panel, lines: Iterable[Array], look: dict[str, Any]) -> None:
    for line in lines:
        panel.plot(line, **look)
        look = {**look, "label": None}
