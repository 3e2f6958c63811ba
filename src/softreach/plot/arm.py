"""Pictures of arms, lit tubes with their bundles: side by side, at their targets, under loads."""

from collections.abc import Collection, Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.skin import arm_surface, bundle_skins, inside, marker_points
from softreach.picture.projection import View, on_paper, plane_of
from softreach.picture.zbuffer import ZBuffer, draw_mesh, faces_to_eye
from softreach.plot import style
from softreach.plot.axes import Panel, bounding_box
from softreach.plot.cross_section import plot_cross_section, section_reach
from softreach.rod.kinematics import rest_configuration
from softreach.rod.tip_map import TipStatus
from softreach.schema import a_configuration
from softreach.support.arguments import as_flag, as_given, as_number
from softreach.support.arrays import Array, as_stations
from softreach.support.errors import InvalidInput
from softreach.support.lazy import Axes, Dataset, Figure
from softreach.support.palette import BODY, MET, MISSED, bundle_color
from softreach.support.units import LengthUnit

if TYPE_CHECKING:
    from softreach.rod.loaded.all_equilibria import AllEquilibria
    from softreach.workspace.payload import LargestPayload, PayloadCurve

Shapes = list[Dataset]  # Single configurations of an arm
_SIDES = 96
_BULGE = 1.01  # of R2, beyond which a bundle makes the picture wider
_FADE = 0.62  # how far the colors of the arm at rest go toward white
_CHECKED = 0.35  # and those of arms at their targets
_LEAST, _LEAST_OBLIQUE = 1.5, 2.2  # widths of a panel, and of a figure seen obliquely [inch]
_LETTERS = 14  # of titles an inch
_POSES = 5  # of places that are apart
_WAY = 0.08  # L: lines along the directions that are wanted
_REGIONS = {
    "stay_inside": {"color": (0.25, 0.35, 0.60), "linestyle": "-", "label": "stay inside"},
    "avoid": {"color": (0.75, 0.42, 0.05), "linestyle": "--", "label": "avoid"},
    "cover": {"color": MET, "linestyle": ":", "label": "to be covered"},
}
_STATIONS = 121
_PALE = 0.7  # how far the colors of other stable arms go toward white
_FOLLOWED, _STABLE, _UNSTABLE = "0.05", "#1f4e9e", "0.55"
_BASE = 1.7  # radius of the disk that the arm stands on, in R2(0)
_ARROW = 26  # length of the arrow of gravity [points]
_SHORTEST_ARROW = 0.1  # part of a direction in the paper, below which an arrow says nothing


def plot_arm(
    arm: Manipulator,
    configuration: Dataset | None = None,
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
        configuration: One of that arm or several along `sample`; None for the arm at rest alone.
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


def shapes_of(configuration: Dataset | None) -> list[Dataset]:
    """The single configurations of a dataset that may hold several."""
    if configuration is None:
        return []
    configuration = a_configuration("configuration", configuration)
    if "sample" not in configuration.dims:
        return [configuration]
    return [configuration.isel(sample=k) for k in range(configuration.sizes["sample"])]


def arm_points(arm: Manipulator, shape: Dataset, unit: LengthUnit) -> Array:
    """Points of one configuration: its surface, bundles outside of it, markers; shape (n, 3)."""
    outline = arm.outline(shape["Z"].values)
    out = (outline.outer_ratio > _BULGE) & outline.acts
    surfaces = [arm_surface(arm, shape, _SIDES)]
    if out.any():
        surfaces += [skin for k, skin in enumerate(bundle_skins(arm, shape)) if out[:, k].any()]
    points = [surface.vertices for surface in surfaces]
    return unit.of(np.concatenate([*points, marker_points(arm.markers, shape)]))


def draw_arms(
    panel: Panel, arm: Manipulator, shapes: Shapes, bundles: Collection[int], fade: float = 0.0
) -> None:
    """One image of all shapes, over what the axes hold, and their markers in front."""
    if shapes:
        panel.show(*arm_images(panel, arm, shapes, bundles, fade))
        draw_markers(panel, arm, shapes, fade)


def draw_markers(panel: Panel, arm: Manipulator, shapes: list[Dataset], fade: float) -> None:
    """Small dots where the markers of all shapes are."""
    if arm.markers:
        points = np.concatenate([marker_points(arm.markers, shape) for shape in shapes])
        edge = {"color": "0.1", "markeredgecolor": "1", "markeredgewidth": 0.4, "zorder": 3}
        panel.plot(panel.unit.of(points), "o", markersize=3, alpha=1.0 - fade, **edge)


def arm_images(
    panel: Panel, arm: Manipulator, shapes: Shapes, bundles: Collection[int], fade: float = 0.0
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
    """Text above the arm."""
    arm: Manipulator
    """The arm that is drawn."""
    view: View = "front"
    """Side from which it is seen."""
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
    known = isinstance(panels, list | tuple) and all(isinstance(p, DesignPanel) for p in panels)
    if not known or not panels:
        raise InvalidInput("panels", as_given(panels), "a list or tuple of DesignPanels")
    stations = as_stations("stations_over_length", stations_over_length).tolist()
    least = _LEAST if all(plane_of(p.view) for p in panels) else _LEAST_OBLIQUE
    usual = max(_LEAST * len(panels), least)
    width = usual if width is None else as_number("width", width, style.WIDTH)
    rests = [(p.arm, rest_configuration(p.arm), LengthUnit("L", p.arm.length)) for p in panels]
    box = bounding_box(*(arm_points(*each) for each in rests))
    places = [(p.arm, s * p.arm.length) for p in panels for s in (*stations, 0.0)]
    reach = 1.08 * max(section_reach(arm, z) / arm.length for arm, z in places)
    with style.figure_style():
        heights = [2.6, *[width / len(panels)] * len(stations)]
        figure = style.new_figure(figsize=(width, sum(heights) + 0.1), layout="constrained")
        shape = len(heights), len(panels)
        axes = figure.subplots(*shape, height_ratios=heights, squeeze=False)
        for k, panel in enumerate(panels):
            arm, length = panel.arm, panel.arm.length
            shared: dict[str, Any] = {"bundles": panel.bundles, "unit": unit}
            plot_arm(arm, ax=axes[0, k], view=panel.view, box=length * box, **shared)
            axes[0, k].set_title(fill(panel.title, round(_LETTERS * width / len(panels))))
            shared |= {"half_width": reach * length, "legend": False}
            for ax, station in zip(axes[1:, k], stations, strict=True):
                plot_cross_section(arm, station * length, ax=ax, **shared)
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
            for line in each:
                panel.plot(line, **look)
        _draw_places(panel, check)
        style.legend_above(panel.ax)
    return panel.ax


def _draw_places(panel: Panel, check: Any) -> None:
    met = check.reached.all(axis=0)
    load = (~check.reached).sum(axis=1).argmax()  # under which most are missed
    for gap in np.stack([check.places[~met], check.nearest[load, ~met]], axis=1):
        panel.plot(panel.unit.of(gap), color=MISSED, linewidth=1.0, label="gap")
    goals, reach = check.requirements.goals, _WAY * check.arm.length
    for place, way in zip(goals.places, goals.directions, strict=True):
        if np.isfinite(way).all():
            panel.plot(panel.unit.of([place, place + reach * way]), color="0.2", linewidth=0.8)
    styles = ((met, "o", MET, "reached", 4.5), (~met, "X", MISSED, "missed", 6.0))
    for rows, marks, color, label, size in styles:
        if rows.any():
            edge = {"markeredgecolor": "white", "markeredgewidth": 0.5, "zorder": 5}
            look = {"color": color, "markersize": size, "label": label}
            panel.plot(panel.unit.of(check.places[rows]), marks, **look, **edge)


def plot_equilibria(
    equilibria: "AllEquilibria",
    *,
    ax: Axes | None = None,
    view: View = "front",
    box: ArrayLike | None = None,
    unit: style.Unit = None,
) -> Axes:
    """Draw every equilibrium of an arm: stable ones solid, unstable ones dashed.

    The posture, which the tip map reports, is drawn as a body with its bundles, other stable ones
    pale; of a ring one arm, and a dotted circle where its tip may be. An arrow shows the direction
    of gravity, or of the force that stands for it.

    Args:
        equilibria: What `softreach.equilibria` returned.
        ax: Axes to draw in; None for a new figure.
        view: As in `plot_cloud`.
        box: What to show, lower and upper corner [m], shape (2, 3); None for all that is drawn.
        unit: As in `plot_arm`.

    Raises:
        InvalidInput: Unknown view.
        MissingExtra: matplotlib is not installed.
    """
    style.a_result("equilibria", equilibria, "AllEquilibria", "softreach.equilibria")
    arm = equilibria.rod.arm
    shapes = shapes_of(equilibria.configuration(_STATIONS))
    stable = equilibria.status == TipStatus.STABLE
    pale = [shapes[k] for k in np.flatnonzero(stable) if k != equilibria.followed]
    followed = [] if equilibria.followed is None else [shapes[equilibria.followed]]
    counted = style.unit_for(arm.length, unit)
    rings = np.flatnonzero(equilibria.is_ring).tolist()
    circles = {k: counted.of(_circle(equilibria, k)) for k in rings}
    turn = np.linspace(0.0, 2.0 * np.pi, 65)
    disk = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    disk *= _BASE * float(arm.profile.radius(0.0))
    rim = counted.of(equilibria.rod.pose.to_world(disk))
    points = [rim, *(arm_points(arm, shape, counted) for shape in shapes), *circles.values()]
    with Panel.opened(np.concatenate(points), counted, ax, view, box) as panel:
        draw_arms(panel, arm, pale, range(arm.bundles), _PALE)
        draw_arms(panel, arm, followed, range(arm.bundles))
        for k, circle in circles.items():
            color = _STABLE if stable[k] else _UNSTABLE
            panel.plot(circle, color=color, linestyle=":", linewidth=0.8, solid_capstyle="round")
        for k, shape in enumerate(shapes):
            follows, ring = k == equilibria.followed, " ring" * bool(equilibria.is_ring[k])
            kind = ("stable" if stable[k] else "unstable") + ring
            look = {
                "color": _FOLLOWED if follows else _STABLE if stable[k] else _UNSTABLE,
                "linestyle": "-" if stable[k] else "--",
                "solid_capstyle": "round",
                "label": f"{kind}, the posture" if follows else kind,
            }
            wide = 1.4 if stable[k] or follows else 1.0
            panel.plot(counted.of(shape["position"].values), linewidth=wide, **look)
        panel.plot(rim, color="0.2", linewidth=2.0, solid_capstyle="round")
        _gravity_arrow(panel, equilibria)
        style.legend_above(panel.ax, 1)
    return panel.ax


def plot_payload_curve(
    curve: "PayloadCurve", *, ax: Axes | None = None, largest: "Sequence[LargestPayload]" = ()
) -> Axes:
    """Draw the share of the reachable volume against the payload, with its errors.

    Args:
        curve: What `payload_curve` gives.
        ax: Axes to draw in; None for a new figure.
        largest: Payloads to mark, from `PayloadCurve.largest_payload`.

    Returns:
        The axes, payloads in kg.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    points = [(0.0, 1.0), *((point.payload, point.share) for point in largest)]
    points += zip(curve.payloads[1:], curve.shares[1:], strict=True)
    mass, share = zip(*sorted(points), strict=True)
    with style.styled_axes(ax, 3.4, 2.6) as ax:
        (line,) = ax.plot(mass, share, linewidth=1.2)
        look = {"fmt": "o", "markersize": 3, "color": line.get_color(), "linewidth": 0.8}
        ax.errorbar(curve.payloads, curve.shares, yerr=curve.share_errors, **look)
        for mass, share in ((point.payload, point.share) for point in largest):
            ax.plot([0.0, mass, mass], [share, share, 0.0], color="0.3", linewidth=0.8, ls=":")
            ax.plot(mass, share, "o", markersize=4, mfc="white", color="0.3")
        ax.set(xlabel="payload [kg]", ylabel="share of the volume without payload")
        ax.set(xlim=(0.0, None), ylim=(0.0, None))
    return ax


def _circle(equilibria: "AllEquilibria", k: int) -> Array:
    """Where the tip of a ring of equilibria may be [m], shape (n, 3)."""
    assert equilibria.solver is not None
    pose, axis = equilibria.rod.pose, equilibria.solver.tables.axes[0]
    tip, angle = pose.to_base(equilibria.tips[k]), np.linspace(0.0, 2.0 * np.pi, 97)[:, None]
    along, across = (tip @ axis) * axis, np.cross(axis, tip)
    return pose.to_world(along + np.cos(angle) * (tip - along) + np.sin(angle) * across)


def _gravity_arrow(panel: Panel, equilibria: "AllEquilibria") -> None:
    if equilibria.solver is None:
        return
    tables = equilibria.solver.tables
    right, up = on_paper(equilibria.rod.pose.directions_to_world(tables.axes[0]), panel.view)
    if np.hypot(right, up) < _SHORTEST_ARROW:
        return
    word, tail = "g" if any(tables.loads.gravity) else "force", (-_ARROW * right, -_ARROW * up)
    place = {"xycoords": "axes fraction", "textcoords": "offset points", "zorder": 4}
    look = {"ha": "center", "va": "center", "fontsize": 8, **place}
    arrow = {"arrowstyle": "-|>", "color": "0.25", "linewidth": 1.0}
    panel.ax.annotate(word, (0.09, 0.86), tail, arrowprops=arrow, **look)
