"""Pictures of hulls: a lit surface, and the volume of alpha shapes over their radius."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from softreach.geometry.surface import SurfaceMesh
from softreach.picture.projection import View
from softreach.picture.shading import draw_mesh
from softreach.plot.axes import Panel
from softreach.plot.lengths import Unit, unit_for
from softreach.plot.style import (
    LENGTH,
    a_surface,
    as_axes,
    figure_style,
    panel_arguments,
    small_axes,
)
from softreach.support.arguments import as_mapping, as_number
from softreach.support.arrays import as_floats
from softreach.support.errors import InvalidInput, Range
from softreach.support.palette import STEEL

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_VOLUMES = Range(0.0, unit="m³")


def _rgb(name: str, value: object) -> tuple[float, float, float]:
    rgb = as_floats(name, value)
    if rgb.shape != (3,) or not ((rgb >= 0) & (rgb <= 1)).all():
        raise InvalidInput(name, rgb, "three numbers from 0 to 1: red, green, blue")
    return float(rgb[0]), float(rgb[1]), float(rgb[2])


def plot_hull(
    hull: SurfaceMesh,
    *,
    ax: Axes | None = None,
    view: View = "front",
    length: float | None = None,
    color: tuple[float, float, float] = STEEL,
    box: ArrayLike | None = None,
    unit: Unit = None,
) -> Axes:
    """Draw the boundary of a hull in one view.

    Args:
        hull: A hull, the surface of a reachable set, or anything with vertices [m] and faces.
        ax: Axes to draw in; None for a new figure.
        view: As in `plot_cloud`.
        length: L [m], by which coordinates are divided unless `unit` says otherwise; None leaves
            them in meters.
        color: RGB from 0 to 1.
        box: What to show, lower and upper corner [m], shape (2, 3); None for all of it.
        unit: Of the axes: "m", "cm", "mm", or "L" with `length`; None for L if `length` is given,
            else m.

    Returns:
        The axes, in that unit.

    Raises:
        InvalidInput: Unknown view or unit, or no vertices.
        MissingExtra: matplotlib is not installed.
    """
    hull, color = a_surface("hull", hull), _rgb("color", color)
    length = None if length is None else as_number("length", length, LENGTH)
    ax, box = panel_arguments(ax, view, box)
    with figure_style(ax):
        counted = unit_for(length, unit)
        vertices = counted.of(hull.vertices)
        panel = Panel.opened(vertices, counted, ax, view, box)
        buffer = panel.buffer(oversample=3)
        draw_mesh(buffer, vertices, hull.faces, color, view)
        panel.show(buffer)
    return panel.ax


def plot_volume_curve(
    curves: Mapping[str, ArrayLike],
    alphas: ArrayLike,
    *,
    ax: Axes | None = None,
    length: float | None = None,
    exact: float | None = None,
    convex: float | None = None,
    unit: Unit = None,
) -> Axes:
    """Draw V(α) of clouds.

    Args:
        curves: Label -> volumes [m³] from `volume_curve`, shape (n,).
        alphas: Their radii [m], shape (n,).
        ax: Axes to draw in; None for a new figure.
        length: L [m], by which radii, and volumes by its cube, are divided; None leaves them in m.
        exact: Volume of the reachable set [m³], drawn as a line.
        convex: Volume of its convex hull [m³], likewise.
        unit: As in `plot_hull`; volumes in liters beside cm, in mL beside mm.

    Returns:
        The axes, in that unit.

    Raises:
        InvalidInput: Radii and volumes of different shapes.
        MissingExtra: matplotlib is not installed.
    """
    curves, radii = as_mapping("curves", curves, as_floats), as_floats("alphas", alphas)
    length = None if length is None else as_number("length", length, LENGTH)
    exact = None if exact is None else as_number("exact", exact, _VOLUMES)
    convex = None if convex is None else as_number("convex", convex, _VOLUMES)
    ax, counted = as_axes(ax), unit_for(length, unit)
    with figure_style(ax):
        ax = small_axes(3.4, 2.6) if ax is None else ax
        for label, volumes in curves.items():
            if np.shape(volumes) != radii.shape:
                raise InvalidInput(label, np.shape(volumes), f"volumes of {radii.shape} radii")
            ax.plot(counted.of(radii), counted.of(volumes, 3), linewidth=1.2, label=label)
        for value, name, style in ((exact, "exact", "-"), (convex, "convex hull", ":")):
            if value is not None:
                ax.axhline(float(counted.of(value, 3)), color="0.3", lw=0.8, ls=style, label=name)
        ax.set(xscale="log", xlabel=counted.label("radius α"), ylim=(0, None))
        ax.set_ylabel(counted.label("V", 3))
        ax.legend(loc="lower right")
    return ax
