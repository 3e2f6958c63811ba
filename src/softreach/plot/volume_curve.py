"""How the volume of an alpha shape depends on its radius, beside the exact volume."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from softreach.errors import InvalidInput
from softreach.plot.style import figure_style, small_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_volume_curve"]


def plot_volume_curve(
    alphas: ArrayLike,
    curves: Mapping[str, ArrayLike],
    ax: Axes | None = None,
    *,
    length: float = 1.0,
    exact: float | None = None,
    convex: float | None = None,
) -> Axes:
    """Draw V(α) of clouds.

    Args:
        alphas: Radii [m], shape (n,).
        curves: Label -> volumes [m³] from `volume_curve`, shape (n,).
        ax: Axes to draw in; None for a new figure.
        length: L [m], the unit of the axes.
        exact: Volume of the reachable set [m³], drawn as a line.
        convex: Volume of its convex hull [m³], likewise.

    Returns:
        The axes, in units of L.

    Raises:
        InvalidInput: Radii and volumes of different shapes.
        MissingExtra: matplotlib is not installed.
    """
    radii = np.asarray(alphas, float)
    with figure_style(ax):
        ax = small_axes(3.4, 2.6) if ax is None else ax
        for label, volumes in curves.items():
            if np.shape(volumes) != radii.shape:
                raise InvalidInput(label, np.shape(volumes), f"volumes of {radii.shape} radii")
            ax.plot(radii / length, np.asarray(volumes) / length**3, linewidth=1.2, label=label)
        for value, name, style in ((exact, "exact", "-"), (convex, "convex hull", ":")):
            if value is not None:
                ax.axhline(value / length**3, color="0.3", lw=0.8, ls=style, label=name)
        ax.set(xscale="log", xlabel="radius α / L", ylabel="$V/L^3$", ylim=(0, None))
        ax.legend(loc="lower right")
    return ax
