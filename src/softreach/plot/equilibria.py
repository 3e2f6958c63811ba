"""The picture of all equilibria of an arm: what it could do under its loads, and what it does."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arguments import as_given, checked
from softreach.errors import InvalidInput
from softreach.picture.projection import View, is_mirrored, project, view_axes
from softreach.plot.arguments import DRAWN
from softreach.plot.arm import arm_points, draw_arms, shapes_of
from softreach.plot.frame import Panel
from softreach.plot.lengths import in_lengths
from softreach.plot.style import figure_style
from softreach.rod.tip_map import TipStatus

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softreach.rod.all_equilibria import AllEquilibria

__all__ = ["plot_equilibria"]

Array = NDArray[np.float64]

_STATIONS = 121
_PALE = 0.7  # how far the colors of other stable arms go toward white
_FOLLOWED, _STABLE, _UNSTABLE = "0.05", "#1f4e9e", "0.55"
_BASE = 1.7  # radius of the disk that the arm stands on, in R2(0)
_ARROW = 26  # length of the arrow of gravity [points]
_ALONG_SIGHT = 0.1  # part of a direction in the paper, below which an arrow says nothing
_LEAST_WIDTH, _ENTRY = 2.6, 0.18  # of figures, and the height of an entry of the legend [inch]
_ABOVE = 4  # the order of lines over images


def _equilibria(name: str, value: Any) -> Any:
    """What `softreach.equilibria` returned, whose class need not be loaded."""
    if type(value).__name__ == "AllEquilibria":
        return value
    raise InvalidInput(name, as_given(value), "what `softreach.equilibria` returned")


@checked(**DRAWN, equilibria=_equilibria)
def plot_equilibria(
    equilibria: AllEquilibria,
    *,
    ax: Axes | None = None,
    view: View = "front",
    box: ArrayLike | None = None,
) -> Axes:
    """Draw every equilibrium of an arm: stable ones solid, unstable ones dashed.

    The one that follows from the unloaded arm, which the tip map reports, is drawn as a body with
    its bundles, other stable ones pale; of a ring one arm, and a dotted circle where its tip may
    be. An arrow shows the direction of gravity, or of the force that stands for it.

    Args:
        equilibria: What `softreach.equilibria` returned.
        ax: Axes to draw in; None for a new figure.
        view: As in `plot_cloud`.
        box: What to show, lower and upper corner [m], shape (2, 3); None for all that is drawn.

    Returns:
        The axes, in L.

    Raises:
        InvalidInput: Unknown view.
        MissingExtra: matplotlib is not installed.
    """
    arm = equilibria.rod.arm
    shapes = shapes_of(equilibria.configuration(_STATIONS))
    stable = equilibria.status == TipStatus.STABLE
    pale = [shapes[k] for k in np.flatnonzero(stable) if k != equilibria.followed]
    followed = [] if equilibria.followed is None else [shapes[equilibria.followed]]
    circles = {k: _circle(equilibria, k) for k, ring in enumerate(equilibria.is_ring) if ring}
    with figure_style(ax):
        rim = _rim(float(arm.profile.radius(0.0)) / arm.length)
        points = [rim, *(arm_points(arm, shape) for shape in shapes), *circles.values()]
        panel = Panel.opened(np.concatenate(points), in_lengths(arm.length), ax, view, box)
        draw_arms(panel, arm, pale, range(arm.bundles), _PALE)
        draw_arms(panel, arm, followed, range(arm.bundles))
        for k, circle in circles.items():
            color = _STABLE if stable[k] else _UNSTABLE
            _line(panel, circle, color=color, linestyle=":", linewidth=0.8)
        for k, shape in enumerate(shapes):
            _line(panel, shape["position"].values / arm.length, **_style(equilibria, k))
        _line(panel, rim, color="0.2", linewidth=2.0)
        _gravity_arrow(panel, equilibria)
        _add_legend(panel.ax, own_figure=ax is None)
    return panel.ax


def _style(equilibria: AllEquilibria, k: int) -> dict[str, Any]:
    """How the centerline of one is drawn."""
    stable = equilibria.status[k] == TipStatus.STABLE
    follows = k == equilibria.followed
    kind = ("stable" if stable else "unstable") + (" ring" if equilibria.is_ring[k] else "")
    return {
        "color": _FOLLOWED if follows else _STABLE if stable else _UNSTABLE,
        "linestyle": "-" if stable else "--",
        "linewidth": 1.4 if stable or follows else 1.0,
        "label": f"{kind}, from the unloaded arm" if follows else kind,
    }


def _line(panel: Panel, points: Array, **style: Any) -> None:
    """A curve in space, over the images."""
    right, up, _ = project(points, panel.view).T
    mirror = -1 if is_mirrored(panel.view) else 1
    panel.ax.plot(mirror * right, up, zorder=_ABOVE, solid_capstyle="round", **style)


def _circle(equilibria: AllEquilibria, k: int) -> Array:
    """Where the tip of a ring may be [L]."""
    assert equilibria.solver is not None
    axis, tip = equilibria.solver.tables.axes[0], equilibria.tips[k]
    angle = np.linspace(0.0, 2.0 * np.pi, 97)[:, None]
    along, across = (tip @ axis) * axis, np.cross(axis, tip)
    turned = along + np.cos(angle) * (tip - along) + np.sin(angle) * across
    return turned / equilibria.rod.length


def _rim(radius: float) -> Array:
    """Of the disk that an arm of this radius is clamped to."""
    angle = np.linspace(0.0, 2.0 * np.pi, 65)
    return _BASE * radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)


def _gravity_arrow(panel: Panel, equilibria: AllEquilibria) -> None:
    """Where gravity pulls, or along which line the forces act that there are."""
    if equilibria.solver is None:
        return
    tables = equilibria.solver.tables
    right, up, _ = view_axes(panel.view) @ tables.axes[0]
    if np.hypot(right, up) < _ALONG_SIGHT:
        return
    mirror = -1 if is_mirrored(panel.view) else 1
    panel.ax.annotate(
        "g" if any(tables.loads.gravity) else "force",
        xy=(0.09, 0.86),
        xycoords="axes fraction",
        xytext=(-_ARROW * mirror * right, -_ARROW * up),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=8,
        arrowprops={"arrowstyle": "-|>", "color": "0.25", "linewidth": 1.0},
        zorder=_ABOVE,
    )


def _add_legend(ax: Axes, *, own_figure: bool) -> None:
    """One entry for each kind: under the picture where the figure is ours."""
    handles, labels = ax.get_legend_handles_labels()
    kinds = dict(zip(labels, handles, strict=True))
    if not own_figure:
        ax.legend(kinds.values(), kinds.keys())
        return
    figure = ax.get_figure(root=True)
    assert figure is not None
    width, height = figure.get_size_inches()
    figure.set_size_inches(max(width, _LEAST_WIDTH), height + _ENTRY * len(kinds))
    figure.legend(kinds.values(), kinds.keys(), loc="outside lower center")
