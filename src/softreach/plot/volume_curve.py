"""How the volume of an alpha shape depends on its radius, beside the exact volume."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from softreach.arguments import checked, mapping_of, optional, within
from softreach.arrays import as_floats
from softreach.errors import InvalidInput, Range
from softreach.plot.arguments import AX, LENGTH
from softreach.plot.lengths import in_lengths
from softreach.plot.style import figure_style, small_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_volume_curve"]


@checked(
    curves=mapping_of(as_floats),
    alphas=as_floats,
    ax=AX,
    length=optional(LENGTH),
    exact=optional(within(Range(0.0, unit="m³"))),
    convex=optional(within(Range(0.0, unit="m³"))),
)
def plot_volume_curve(
    curves: Mapping[str, ArrayLike],
    alphas: ArrayLike,
    *,
    ax: Axes | None = None,
    length: float | None = None,
    exact: float | None = None,
    convex: float | None = None,
) -> Axes:
    """Draw V(α) of clouds.

    Args:
        curves: Label -> volumes [m³] from `volume_curve`, shape (n,).
        alphas: Their radii [m], shape (n,).
        ax: Axes to draw in; None for a new figure.
        length: L [m], by which radii, and volumes by its cube, are divided; None leaves them in m.
        exact: Volume of the reachable set [m³], drawn as a line.
        convex: Volume of its convex hull [m³], likewise.

    Returns:
        The axes, in L if `length` is given, else in meters.

    Raises:
        InvalidInput: Radii and volumes of different shapes.
        MissingExtra: matplotlib is not installed.
    """
    radii, unit = np.asarray(alphas, float), in_lengths(length)
    with figure_style(ax):
        ax = small_axes(3.4, 2.6) if ax is None else ax
        for label, volumes in curves.items():
            if np.shape(volumes) != radii.shape:
                raise InvalidInput(label, np.shape(volumes), f"volumes of {radii.shape} radii")
            volume = np.asarray(volumes) / unit.size**3
            ax.plot(unit.of(radii), volume, linewidth=1.2, label=label)
        for value, name, style in ((exact, "exact", "-"), (convex, "convex hull", ":")):
            if value is not None:
                ax.axhline(value / unit.size**3, color="0.3", lw=0.8, ls=style, label=name)
        ax.set(xscale="log", xlabel=unit.label("radius α"), ylim=(0, None))
        ax.set_ylabel(unit.label("V", 3))
        ax.legend(loc="lower right")
    return ax
