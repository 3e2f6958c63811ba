"""How the volume of an alpha shape depends on its radius, beside the exact volume."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from softreach.errors import InvalidInput
from softreach.plot.style import figure_style, pyplot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_volume_curve"]


def plot_volume_curve(
    alphas: ArrayLike,
    volumes: ArrayLike,
    ax: Axes | None = None,
    *,
    length: float = 1.0,
    exact: float | None = None,
    convex: float | None = None,
    label: str = "α-shape",
) -> Axes:
    """Draw V(α) of one cloud; call again with the axes to add another.

    Args:
        alphas: Radii [m], shape (n,).
        volumes: Volumes [m³] from `volume_curve`, shape (n,).
        ax: Axes to draw in; None for a new figure.
        length: L [m], the unit of the axes.
        exact: Volume of the reachable set [m³], drawn as a line.
        convex: Volume of its convex hull [m³], likewise.
        label: What the curve is called.

    Returns:
        The axes, in units of L.

    Raises:
        InvalidInput: Radii and volumes of different shapes.
        MissingExtra: matplotlib is not installed.
    """
    radii, found = np.asarray(alphas, float), np.asarray(volumes, float)
    if radii.shape != found.shape or radii.ndim != 1:
        raise InvalidInput("volumes.shape", found.shape, f"of the radii, {radii.shape}")
    with figure_style(ax):
        if ax is None:
            ax = pyplot().subplots(figsize=(3.4, 2.6), layout="constrained")[1]
            ax.set(xscale="log", xlabel="radius α / L", ylabel="$V/L^3$")
        ax.plot(radii / length, found / length**3, linewidth=1.2, label=label)
        for value, name, style in ((exact, "exact", "-"), (convex, "convex hull", ":")):
            if value is not None:
                ax.axhline(value / length**3, color="0.3", lw=0.8, ls=style, label=name)
        ax.legend()
    return ax
