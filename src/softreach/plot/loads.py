"""Pictures of arms under loads: all equilibria, compliance of the tip, and payload curves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.picture.projection import View, on_paper
from softreach.plot.arm import arm_points, draw_arms, plot_arm, shapes_of
from softreach.plot.axes import Panel, bounding_box
from softreach.plot.style import Unit, a_result, figure_style, styled_axes, unit_for
from softreach.rod.tip_map import TipStatus
from softreach.schema import a_configuration
from softreach.support.arguments import POSITIVE, as_number
from softreach.support.arrays import Array, as_floats
from softreach.support.errors import InvalidInput
from softreach.support.quantity import round_below

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from softreach.rod.loaded.all_equilibria import AllEquilibria
    from softreach.workspace.payload import LargestPayload, PayloadCurve

_STATIONS = 121
_PALE = 0.7  # how far the colors of other stable arms go toward white
_FOLLOWED, _STABLE, _UNSTABLE = "0.05", "#1f4e9e", "0.55"
_BASE = 1.7  # radius of the disk that the arm stands on, in R2(0)
_ARROW = 26  # length of the arrow of gravity [points]
_SHORTEST_ARROW = 0.1  # part of a direction in the paper, below which an arrow says nothing
_LEAST_WIDTH, _ENTRY = 2.6, 0.18  # of figures, and the height of an entry of the legend [inch]
_LARGEST = 0.2  # L, the longest half axis if the force is not given
_CORNERS = 120
_COLOR = "tab:orange"


def plot_equilibria(
    equilibria: AllEquilibria,
    *,
    ax: Axes | None = None,
    view: View = "front",
    box: ArrayLike | None = None,
    unit: Unit = None,
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
    a_result("equilibria", equilibria, "AllEquilibria", "softreach.equilibria")
    arm = equilibria.rod.arm
    shapes = shapes_of(equilibria.configuration(_STATIONS))
    stable = equilibria.status == TipStatus.STABLE
    pale = [shapes[k] for k in np.flatnonzero(stable) if k != equilibria.followed]
    followed = [] if equilibria.followed is None else [shapes[equilibria.followed]]
    counted = unit_for(arm.length, unit)
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
            panel.plot(
                counted.of(shape["position"].values),
                color=_FOLLOWED if follows else _STABLE if stable[k] else _UNSTABLE,
                linestyle="-" if stable[k] else "--",
                linewidth=1.4 if stable[k] or follows else 1.0,
                solid_capstyle="round",
                label=f"{kind}, the posture" if follows else kind,
            )
        panel.plot(rim, color="0.2", linewidth=2.0, solid_capstyle="round")
        _gravity_arrow(panel, equilibria)
        _add_legend(panel.ax, own_figure=ax is None)
    return panel.ax


def plot_compliance(
    arm: Manipulator,
    configuration: xr.Dataset,
    compliance: ArrayLike,
    *,
    ax: Axes | None = None,
    view: View = "front",
    force: float | None = None,
    box: ArrayLike | None = None,
    unit: Unit = None,
) -> Axes:
    """Draw an arm with the ellipsoids over which a small force in any direction moves its tip.

    They are to scale where the tip yields in proportion to the force.

    Args:
        arm: The design.
        configuration: One configuration of that arm or several along `sample`.
        compliance: That of each, from `tip_compliance` [m/N], shape (3, 3) or (n, 3, 3).
        ax: Axes to draw in; None for a new figure.
        view: As in `plot_cloud`.
        force: Size of the force [N]; None for a round one.
        box: What to show, lower and upper corner [m], shape (2, 3); None for all that is drawn.
        unit: As in `plot_arm`.

    Raises:
        InvalidInput: Unknown view, a force that is not positive, or another number of compliances.
        MissingExtra: matplotlib is not installed.
    """
    arm = a_manipulator("arm", arm)
    shapes = shapes_of(a_configuration("configuration", configuration))
    values = as_floats("compliance", compliance)
    force = None if force is None else as_number("force", force, POSITIVE)
    matrices = values if values.ndim == 3 else values[None]
    if matrices.shape[1:] != (3, 3):
        raise InvalidInput("compliance.shape", np.shape(compliance), "(3, 3) or (n, 3, 3)")
    if len(matrices) != len(shapes):
        allowed = f"{len(shapes)}, one for each configuration"
        raise InvalidInput("compliance", f"{len(matrices)} matrices", allowed)
    if force is None:  # that keeps the ellipsoids small
        softest = float(np.linalg.norm(matrices, ord=2, axis=(1, 2)).max())
        if not 0 < softest < np.inf:
            raise InvalidInput("compliance", f"{softest:g} m/N at most", "finite, and not zero")
        force = round_below(_LARGEST * arm.length / softest)
    counted = unit_for(arm.length, unit)
    tips = counted.of([shape["position"].values[-1] for shape in shapes])
    axes = counted.of(force * matrices)
    with figure_style(ax):
        if box is None:
            surfaces = [arm_points(arm, shape, counted) for shape in shapes]
            half = np.linalg.norm(axes, axis=2)  # of the boxes around the ellipsoids
            box = counted.size * bounding_box(*surfaces, tips - half, tips + half)
        ax = plot_arm(arm, configuration, ax=ax, view=view, rest=False, box=box, unit=counted)
        for outline in _outlines(tips, axes, view):
            ax.fill(*outline, facecolor=_COLOR, alpha=0.3, zorder=3)
            ax.plot(*outline, color=_COLOR, linewidth=0.8, zorder=3)
        ax.set_title(f"tip under {force:g} N in any direction")
    return ax


def plot_payload_curve(
    curve: PayloadCurve, *, ax: Axes | None = None, largest: Sequence[LargestPayload] = ()
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
    with styled_axes(ax, 3.4, 2.6) as ax:
        (line,) = ax.plot(mass, share, linewidth=1.2)
        style = {"fmt": "o", "markersize": 3, "color": line.get_color(), "linewidth": 0.8}
        ax.errorbar(curve.payloads, curve.shares, yerr=curve.share_errors, **style)
        for point in largest:
            sides = [point.payload, point.payload, 0.0], [0.0, point.share, point.share]
            ax.plot(*sides, color="0.3", linewidth=0.8, linestyle=":")
            ax.plot(point.payload, point.share, "o", markersize=4, mfc="white", color="0.3")
        ax.set(xlabel="payload [kg]", ylabel="share of the volume without payload")
        ax.set(xlim=(0.0, None), ylim=(0.0, None))
    return ax


def _circle(equilibria: AllEquilibria, k: int) -> Array:
    """Where the tip of a ring of equilibria may be [m], shape (n, 3)."""
    assert equilibria.solver is not None
    pose, axis = equilibria.rod.pose, equilibria.solver.tables.axes[0]
    tip, angle = pose.to_base(equilibria.tips[k]), np.linspace(0.0, 2.0 * np.pi, 97)[:, None]
    along, across = (tip @ axis) * axis, np.cross(axis, tip)
    return pose.to_world(along + np.cos(angle) * (tip - along) + np.sin(angle) * across)


def _gravity_arrow(panel: Panel, equilibria: AllEquilibria) -> None:
    if equilibria.solver is None:
        return
    tables = equilibria.solver.tables
    right, up = on_paper(equilibria.rod.pose.directions_to_world(tables.axes[0]), panel.view)
    if np.hypot(right, up) < _SHORTEST_ARROW:
        return
    place = {"xycoords": "axes fraction", "textcoords": "offset points", "zorder": 4}
    panel.ax.annotate(
        "g" if any(tables.loads.gravity) else "force",
        (0.09, 0.86),
        (-_ARROW * right, -_ARROW * up),
        **{"ha": "center", "va": "center", "fontsize": 8, **place},
        arrowprops={"arrowstyle": "-|>", "color": "0.25", "linewidth": 1.0},
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


def _outlines(tips: Array, axes: Array, view: View) -> list[Array]:
    """Outlines of the ellipsoids {tip + A f, |f| = 1}: ellipses, shape (2, corner) each."""
    turn = np.linspace(0.0, 2.0 * np.pi, _CORNERS)
    circle = np.array([np.cos(turn), np.sin(turn)])
    outlines = []
    for tip, matrix in zip(tips, axes, strict=True):
        left, half, _ = np.linalg.svd(on_paper(matrix.T, view).T, full_matrices=False)
        outlines.append(on_paper(tip, view)[:, None] + (left * half) @ circle)
    return outlines
