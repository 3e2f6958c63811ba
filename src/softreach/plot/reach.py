"""Pictures of what an arm reaches: clouds, whole or in slabs; sets and hulls, lit or in slices."""

from collections.abc import Mapping, Sequence
from functools import partial
from textwrap import fill
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.cloud.clouds import design_of
from softreach.geometry.surface import SurfaceMesh
from softreach.picture.projection import View, is_mirrored, plane_of, sight_axis, view_angles
from softreach.picture.zbuffer import ZBuffer, draw_mesh
from softreach.plot import coloring, style
from softreach.plot.arm import arm_images, arm_points, draw_markers, plot_arm, shapes_of
from softreach.plot.axes import Panel, bounding_box
from softreach.plot.style import Unit
from softreach.rod.kinematics import rest_configuration
from softreach.schema import a_cloud, base_of
from softreach.support import parallel
from softreach.support.arguments import as_dataset, as_flag, as_mapping, as_number
from softreach.support.arrays import Array, as_floats
from softreach.support.errors import InvalidInput
from softreach.support.lazy import Axes, Dataset, Figure
from softreach.support.palette import STEEL
from softreach.support.units import LengthUnit

_LARGEST = 8.0  # pixels
_THICKNESS = 1 / 50  # of L, or of the cloud's extent
_VIEWS = ("front", "side", "top", "oblique")
_BESIDE = {True: (0.55, 0.12), False: (0.60, 0.22)}  # left and right of four views, in L or not
_ROOM, _GAP = 0.42, 0.60  # below them and for their key at least, and between them [inch]
_LETTERS = 90  # of titles side by side
_LOWER = 0.126  # of the oblique view, whose numbers stand outside of its box [inch]
_ROW = (9.6, 3.6)  # inches
_COLORS = ("white", "#cfe3f2", "#f2a65a", "#c8553d", "#6b2737")
_LABELS = ("out of reach", "one activation", "two", "three", "four or more")


def plot_cloud(
    cloud: Dataset,
    *,
    ax: Axes | None = None,
    view: View = "front",
    color: str | int | ArrayLike | None = None,
    size: float | None = None,
    key: bool = True,
    box: ArrayLike | None = None,
    unit: Unit = None,
) -> Axes:
    """Draw a cloud in one view.

    Args:
        cloud: tip(sample, axis) [m], with the attribute `length` [m] if known, and
            activation(sample, bundle), each in its unit.
        ax: Axes to draw in; None for a new figure.
        view: "front", "side", "top", "oblique", "back", "left", or azimuth and elevation [rad].
        color: "rgb", "strongest" (bundle), "effort", the name or index of a bundle, or an array;
            None for "rgb" of up to three bundles and "strongest" of more; see `color_samples`.
        size: Diameter of a point [pixels at 250 per inch]; None chooses by their number.
        key: Whether to explain the colors.
        box: What to show, lower and upper corner [m], shape (2, 3); None for all points.
        unit: Of the axes: "m", "cm", "mm" or "L"; None for L if the cloud knows it, else m.

    Raises:
        InvalidInput: Unknown view, bundle, color or unit, or no finite tip.
        MissingExtra: matplotlib is not installed.
    """
    cloud, key = a_cloud("cloud", cloud), as_flag("key", key)
    size = None if size is None else as_number("size", size, style.SIZE)
    counted = style.unit_of(cloud["tip"], unit)
    tips, colored = drawn_tips(cloud, counted), coloring.color_samples(cloud, color)
    with Panel.opened(tips, counted, ax, view, box) as panel:
        panel.show(cloud_image(panel, tips, colored.rgb, size))
        coloring.draw_key(panel.ax, colored.key if key else None)
    return panel.ax


def cloud_image(panel: Panel, tips: Array, rgb: NDArray[np.uint8], size: float | None) -> ZBuffer:
    """The image in a panel of tips in its unit, shape (n, 3), with RGB from 0 to 255, (n, 3)."""
    pixels = size or min(_LARGEST, point_size(len(tips), panel.box) * panel.pixels_per_unit)
    # small points gain nothing from smoothing; fine steps of color drown in their noise
    buffer = panel.buffer(oversample=1 if pixels < 3.5 else 2, color_step=8)
    buffer.draw_points(tips, rgb, pixels, view=panel.view)
    return buffer


def drawn_tips(cloud: Dataset, unit: LengthUnit) -> Array:
    """Tip positions in the unit of the axes, shape (sample, 3)."""
    return unit.of(cloud["tip"].transpose("sample", "axis").values)


def point_size(samples: int, box: Array) -> float:
    """A diameter that closes the surface of a cloud without blurring it, in units of the box."""
    return 0.45 * float(np.ptp(box, axis=0).max() / np.cbrt(max(samples, 1)))


def plot_slab(
    cloud: Dataset,
    *,
    ax: Axes | None = None,
    view: View = "front",
    at: float | None = None,
    thickness: float | None = None,
    color: str | int | ArrayLike | None = None,
    size: float | None = None,
    key: bool = True,
    box: ArrayLike | None = None,
    unit: Unit = None,
) -> Axes:
    """Draw the tips in a slab across the line of sight; a note in the axes says which.

    What is not described here is as in `plot_cloud`.

    Args:
        cloud: As in `plot_cloud`.
        ax: As in `plot_cloud`.
        view: A view along an axis: "front" for a slab in y, "side" in x, "top" in z.
        at: Where the middle of the slab is on that axis [m]; None for the base of the arm.
        thickness: Of the slab [m]; None for L / 50, or extent / 50 where L is not known.
        color: As in `plot_cloud`, for all samples of the cloud.
        size: As in `plot_cloud`.
        key: As in `plot_cloud`.
        box: As in `plot_cloud`.
        unit: As in `plot_cloud`.

    Raises:
        InvalidInput: Not a view along an axis, unknown color, or no tip in the slab.
        MissingExtra: matplotlib is not installed.
    """
    cloud, key = a_cloud("cloud", cloud), as_flag("key", key)
    size = None if size is None else as_number("size", size, style.SIZE)
    counted, axis = style.unit_of(cloud["tip"], unit), sight_axis(view)
    tips = drawn_tips(cloud, counted)
    along = "xyz".index(axis)
    at = float(base_of(cloud)[along]) if at is None else as_number("at", at, style.PLACE)
    if thickness is None:
        whole = _THICKNESS * (1.0 if counted.relative else float(np.nanmax(np.ptp(tips, axis=0))))
    else:
        whole = float(counted.of(as_number("thickness", thickness, style.LENGTH)))
    middle, half = float(counted.of(at)), whole / 2
    inside = np.abs(tips[:, along] - middle) <= half
    if not inside.any():
        allowed = f"such that a tip lies in the slab about {axis} = {at:.4g} m"
        raise InvalidInput("thickness", f"{2 * half * counted.size:.4g} m", allowed)
    colored = coloring.color_samples(cloud, color)
    with Panel.opened(tips, counted, ax, view, box) as panel:
        area = np.prod(panel.extent.size) / inside.sum()
        # about the mean spacing in the plane, which closes the slab
        spacing = float(np.clip(1.2 * np.sqrt(area) * panel.pixels_per_unit, 2.0, 8.0))
        panel.show(cloud_image(panel, tips[inside], colored.rgb[inside], size or spacing))
        distance = f"{axis} - {middle:.3g} {counted.name}" if middle else axis
        style.write_note(panel.ax, f"|{distance}| ≤ {half:.3g} {counted.name}", 0.03, 0.02)
        coloring.draw_key(panel.ax, colored.key if key else None)
    return panel.ax


def plot_views(
    cloud: Dataset,
    arm: Manipulator | None = None,
    configuration: Dataset | None = None,
    *,
    color: str | int | ArrayLike | None = None,
    unit: Unit = None,
) -> Figure:
    """Draw a cloud in three orthogonal views at one scale and an oblique one.

    Args:
        cloud: As in `plot_cloud`.
        arm: Drawn over the cloud; None for the cloud alone.
        configuration: Configurations of that arm to draw; None for the arm at rest.
        color: As in `plot_cloud`.
        unit: As in `plot_cloud`.

    Returns:
        The figure, with the axes front, side, top and oblique, and those of a color bar, if any.

    Raises:
        InvalidInput: As `plot_cloud`; an arm beside a cloud that does not know L, without a unit.
        MissingExtra: matplotlib is not installed.

    Examples:
        >>> cloud = sr.compute_cloud(sr.designs.minimal_trunk(), n=1000)
        >>> sr.plot.save_figure(sr.plot.plot_views(cloud), "cloud.png")
    """
    cloud = a_cloud("cloud", cloud)
    counted = style.unit_of(cloud["tip"], unit)
    tips = drawn_tips(cloud, counted)
    shown, shapes = [tips], shapes_of(configuration)
    if arm is not None:
        arm = a_manipulator("arm", arm)
        style.common_unit([counted, style.unit_for(arm.length, unit)])
        shapes = shapes or [rest_configuration(arm)]
        shown += [arm_points(arm, shape, counted) for shape in shapes]
    box = bounding_box(*shown)
    span = np.ptp(box, axis=0)
    slim = np.maximum(0.5 * span.max() - span, 0.0) / 2  # so that a thin arm fits a page
    box = box + [-slim, slim]
    colored = coloring.color_samples(cloud, color)
    with style.figure_style():
        x, y, z = np.ptp(box, axis=0)
        room = max(_ROOM, coloring.key_height(colored.key))
        around = (*_BESIDE[counted.relative], _ROOM, room)
        figure, axes = style.place_panels(style.PAGE, (x, y), (z, y), around, (_GAP, _GAP))
        low, height = axes[1, 1].get_position(), figure.get_size_inches()[1]
        axes[1, 1].set_position(low.translated(0.0, -_LOWER / height))
        pairs = zip(axes.ravel().tolist(), _VIEWS, strict=True)
        panels = [Panel(ax, box, view, counted) for ax, view in pairs]

        def images(panel: Panel) -> list[tuple[ZBuffer, ZBuffer | None]]:
            of_cloud = cloud_image(panel, tips, colored.rgb, None), None
            of_arm = [arm_images(panel, arm, shapes, range(arm.bundles))] if arm is not None else []
            return [of_cloud, *of_arm]

        tasks = (partial(images, panel) for panel in panels)
        for panel, drawn in zip(panels, parallel.in_order(tasks), strict=True):
            for image in drawn:
                panel.show(*image)
            if arm is not None:
                draw_markers(panel, arm, shapes, 0.0)
        coloring.draw_figure_key(figure, colored.key, room)
    return figure


def plot_opposite_sides(
    clouds: Mapping[str, Dataset],
    *,
    view: View = "oblique",
    box_over_length: ArrayLike | None = None,
    unit: Unit = None,
) -> Figure:
    """Clouds from two opposing sides, one column each, with their arms at rest (figure 2b).

    Args:
        clouds: Clouds by the title of their column; each says which arm it belongs to.
        view: Of the upper row, as in `plot_cloud`; the lower row is opposite.
        box_over_length: What is shown, lower and upper corner in L [-], shape (2, 3); None for all.
        unit: Of the axes, as in `plot_cloud`.

    Raises:
        InvalidInput: No clouds, clouds of different bundles, an unknown view, or no finite tip.
        MissingExtra: matplotlib is not installed.
    """
    clouds = as_mapping("clouds", clouds, a_cloud)
    around = None if box_over_length is None else style.as_box("box_over_length", box_over_length)
    bundles = {coloring.bundle_names(cloud) for cloud in clouds.values()}
    if len(bundles) != 1:
        raise InvalidInput("clouds", f"of bundles {sorted(bundles)}", "some of equal bundles")
    azimuth, elevation = view_angles(view)
    sides = ((azimuth, elevation), (azimuth + np.pi, elevation))
    if around is None:
        tips = (drawn_tips(cloud, style.unit_of(cloud["tip"])) for cloud in clouds.values())
        around = bounding_box(*tips)
    first = next(iter(clouds.values()))
    key = coloring.color_samples(first, "rgb").key
    room, columns = max(_ROOM, coloring.key_height(key)), [1.0] * len(clouds)
    beside, right = (0.58, 0.26) if style.unit_of(first["tip"], unit).relative else (0.75, 0.48)
    wide = round(_LETTERS / len(clouds))
    titles = [fill(f"({k})  {title}", wide) for k, title in enumerate(clouds, 1)]
    top = room + 0.16 * max(1 + title.count("\n") for title in titles)
    with style.figure_style():
        edges = (beside + 0.07, right, 0.45, top)
        figure, panels = style.place_panels(style.PAGE, columns, [1.1, 1.1], edges, (beside, 0.45))
        for k, cloud in enumerate(clouds.values()):
            arm = design_of(cloud)
            box = np.asarray(around) * arm.length
            panels[0, k].set_title(titles[k], pad=4)
            for ax, side in zip(panels[:, k], sides, strict=True):
                plot_cloud(cloud, ax=ax, view=side, color="rgb", key=False, box=box, unit=unit)
                plot_arm(arm, ax=ax, view=side, box=box, unit=unit)
        coloring.draw_figure_key(figure, key, room)
    return figure


def plot_hull(
    hull: SurfaceMesh,
    *,
    ax: Axes | None = None,
    view: View = "front",
    length: float | None = None,
    box: ArrayLike | None = None,
    unit: Unit = None,
) -> Axes:
    """Draw the boundary of a hull in one view.

    Args:
        hull: A hull, the surface of a reachable set, or anything with vertices [m] and faces.
        ax: Axes to draw in; None for a new figure.
        view: As in `plot_cloud`.
        length: L [m], which divides coordinates unless `unit` says otherwise; None leaves meters.
        box: What to show, lower and upper corner [m], shape (2, 3); None for all of it.
        unit: Of the axes: "m", "cm", "mm", or "L" with `length`; None for L with it, else m.

    Raises:
        InvalidInput: Unknown view or unit, or no vertices.
        MissingExtra: matplotlib is not installed.
    """
    hull = style.a_surface("hull", hull)
    length = None if length is None else as_number("length", length, style.LENGTH)
    counted = style.unit_for(length, unit)
    vertices = counted.of(hull.vertices)
    with Panel.opened(vertices, counted, ax, view, box) as panel:
        buffer = panel.buffer(oversample=3)
        draw_mesh(buffer, vertices, hull.faces, STEEL, view)
        panel.show(buffer)
    return panel.ax


def plot_slice(
    grid: Dataset,
    *,
    ax: Axes | None = None,
    view: View = "front",
    at: float | None = None,
    key: bool = True,
    unit: Unit = None,
) -> Axes:
    """Draw one plane of a reachable set: the number of activations that reach each place.

    A black line surrounds the places that the map reaches with both orientations: they lie behind a
    fold. A set of more than three bundles has no such numbers and shows what is reachable.

    Args:
        grid: `ReachableSet.grid`: `count` and `degree`, or `occupied`, over x, y, z [m].
        ax: Axes to draw in; None for a new figure.
        view: A view along an axis: "front" for a plane y = at, "side" for x = at, "top" for z = at.
        at: Where the plane cuts that axis [m], to the nearest layer of cells; None for the middle.
        key: Whether to explain the colors.
        unit: Of the axes: "m", "cm", "mm" or "L"; None for L by the attribute `length`, else m.

    Raises:
        InvalidInput: Not a view along an axis, or a plane that misses the grid.
        MissingExtra: matplotlib is not installed.
    """
    grid = as_dataset("grid", grid, "x", "y", "z")
    axis, counted, key = sight_axis(view), style.unit_of(grid, unit), as_flag("key", key)
    at = _middle(grid, axis) if at is None else as_number("at", at, style.PLACE)
    centers, half = grid[axis].values, grid.attrs["cell"] / 2
    if not centers[0] - half <= at <= centers[-1] + half:
        allowed = f"between {centers[0]:.4g} and {centers[-1]:.4g} m along {axis}"
        raise InvalidInput("at", at, allowed)
    layer = grid.sel({axis: at}, method="nearest")
    with style.styled_axes(ax, 3.4, 4.2) as ax:
        highest = _draw_slice(ax, layer, view, counted)
        place = at if abs(at) > 1e-6 * half else 0.0  # no -0, nor what rounding left of 0
        ax.set_title(f"{axis} = {counted.of(place):.3g} {counted.name}")
        if key:
            below = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "borderaxespad": 4.5}
            _explain_slice(ax, highest, "count" in layer, **below)
    return ax


def plot_slices(grid: Dataset, *, at: Sequence[float] | None = None, unit: Unit = None) -> Figure:
    """Draw the three planes of a reachable set that meet at a point: from the side, front and top.

    Args:
        grid: As in `plot_slice`.
        at: The point [m]; None for the middle of the set.
        unit: As in `plot_slice`.

    Raises:
        InvalidInput: Not a point, or one outside the grid.
        MissingExtra: matplotlib is not installed.
    """
    grid = as_dataset("grid", grid, "x", "y", "z")
    point = as_floats("at", [_middle(grid, axis) for axis in "xyz"] if at is None else at)
    if point.shape != (3,):
        raise InvalidInput("at.shape", point.shape, "a point (x, y, z) [m]")
    with style.figure_style():
        figure = style.new_figure(figsize=_ROW, layout="constrained")
        axes = figure.subplots(1, 3)
        for ax, view, place in zip(axes, ("side", "front", "top"), point.tolist(), strict=True):
            plot_slice(grid, ax=ax, view=view, at=place, unit=unit, key=False)
        highest = max(int(ax.images[0].get_array().max()) for ax in axes)
        _explain_slice(figure, highest, "count" in grid, loc="outside lower center")
    return figure


def _middle(grid: Dataset, axis: str) -> float:
    """Middle of what is reached along an axis, to a tenth of a cell [m]."""
    reached = grid["count" if "count" in grid else "occupied"] > 0
    extent = grid[axis].values[reached.any([other for other in "xyz" if other != axis]).values]
    middle = (extent[0] + extent[-1]) / 2 if len(extent) else grid[axis].values.mean()
    tenth = grid.attrs["cell"] / 10
    return float(np.rint(middle / tenth) * tenth) + 0.0  # no -0


def _draw_slice(ax: Axes, layer: Dataset, view: View, unit: LengthUnit) -> int:
    from matplotlib.colors import ListedColormap

    across, up = plane_of(view) or "xz"  # the view is along an axis
    name = "count" if "count" in layer else "occupied"
    shown = np.minimum(layer[name].transpose(up, across).values.astype(int), len(_COLORS) - 1)
    x, y = unit.of(layer[across].values), unit.of(layer[up].values)
    half = float(unit.of(layer.attrs["cell"])) / 2
    extent = (x[0] - half, x[-1] + half, y[0] - half, y[-1] + half)
    scale = {"cmap": ListedColormap(_COLORS), "vmin": -0.5, "vmax": len(_COLORS) - 0.5}
    ax.imshow(shown, origin="lower", extent=extent, interpolation="nearest", **scale)
    if "degree" in layer:
        folded = (layer["count"] > abs(layer["degree"])).transpose(up, across).values
        if folded.any():
            ax.contour(x, y, folded.astype(float), levels=[0.5], colors="black", linewidths=0.6)
    ax.set(xlabel=unit.label(across), ylabel=unit.label(up), aspect="equal")
    if is_mirrored(view) and not ax.xaxis_inverted():
        ax.invert_xaxis()
    return int(shown.max())


def _explain_slice(owner: Axes | Figure, highest: int, counted: bool, **place: Any) -> None:
    labels = _LABELS[1 : highest + 1] if counted else ("reachable",)
    entries = zip(labels, _COLORS[1:], strict=False)
    coloring.draw_entries(owner, entries, title="reached by" if counted else None, ncols=2, **place)
