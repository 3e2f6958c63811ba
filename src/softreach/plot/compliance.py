"""The picture of how an arm yields at its tip: where a force of one size can push it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arguments import POSITIVE, checked, flag, optional, within
from softreach.arrays import as_floats
from softreach.errors import InvalidInput
from softreach.picture.projection import View, is_mirrored, project
from softreach.plot.arguments import DRAWN, MANIPULATOR, SHAPE
from softreach.plot.arm import arm_points, plot_arm, shapes_of
from softreach.plot.frame import bounding_box
from softreach.plot.style import figure_style

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from softreach.arm.manipulator import Manipulator

__all__ = ["plot_compliance"]

Array = NDArray[np.float64]

_LARGEST = 0.2  # L, the longest half axis if the force is not given
_CORNERS = 120
_COLOR = "tab:orange"


@checked(
    **DRAWN,
    arm=MANIPULATOR,
    configuration=SHAPE,
    compliance=as_floats,
    force=optional(within(POSITIVE)),
    rest=flag,
)
def plot_compliance(
    arm: Manipulator,
    configuration: xr.Dataset,
    compliance: ArrayLike,
    *,
    ax: Axes | None = None,
    view: View = "front",
    force: float | None = None,
    rest: bool = False,
    box: ArrayLike | None = None,
) -> Axes:
    """Draw an arm with the ellipsoids over which a small force in any direction moves its tip.

    They are to scale, as far as the tip yields in proportion to the force.

    Args:
        arm: The design.
        configuration: One configuration of that arm or several along `sample`.
        compliance: That of each, from `tip_compliance` [m/N], shape (3, 3) or (n, 3, 3).
        ax: Axes to draw in; None for a new figure.
        view: As in `plot_cloud`.
        force: Size of the force [N]; None for a round one.
        rest: Whether to draw the arm at rest too.
        box: What to show, lower and upper corner [m], shape (2, 3); None for all that is drawn.

    Returns:
        The axes, in L.

    Raises:
        InvalidInput: Unknown view, a force that is not positive, or another number of compliances.
        MissingExtra: matplotlib is not installed.
    """
    shapes = shapes_of(configuration)
    given = np.asarray(compliance, float)
    matrices = given if given.ndim == 3 else given[None]
    if matrices.shape[1:] != (3, 3):
        raise InvalidInput("compliance.shape", np.shape(compliance), "(3, 3) or (n, 3, 3)")
    if len(matrices) != len(shapes):
        raise InvalidInput("compliance", f"{len(matrices)} of them", f"one each of {len(shapes)}")
    force = _round_force(matrices, arm.length) if force is None else force
    if not 0 < force < np.inf:
        raise InvalidInput("force", force, "> 0 N")
    tips = np.array([shape["position"].values[-1] for shape in shapes]) / arm.length
    axes = force * matrices / arm.length
    with figure_style(ax):
        if box is None:
            surfaces = [arm_points(arm, shape) for shape in shapes]
            box = arm.length * bounding_box(*surfaces, *_ends(tips, axes))
        ax = plot_arm(arm, configuration, ax=ax, view=view, rest=rest, box=box)
        for outline in _outlines(tips, axes, view):
            ax.fill(*outline, facecolor=_COLOR, alpha=0.3, zorder=3)
            ax.plot(*outline, color=_COLOR, linewidth=0.8, zorder=3)
        ax.set_title(f"tip under {force:g} N in any direction")
    return ax


def _ends(tips: Array, axes: Array) -> list[Array]:
    """The corners of the boxes around the ellipsoids."""
    half = np.linalg.norm(axes, axis=2)
    return [tips - half, tips + half]


def _outlines(tips: Array, axes: Array, view: View) -> list[Array]:
    """What one sees of the ellipsoids {tip + A f, |f| = 1}: ellipses, shape (2, corner) each."""
    turn = np.linspace(0.0, 2.0 * np.pi, _CORNERS)
    circle = np.array([np.cos(turn), np.sin(turn)])
    mirror = np.array([-1.0 if is_mirrored(view) else 1.0, 1.0])[:, None]
    centers = project(tips, view)[:, :2, None]
    outlines = []
    for center, matrix in zip(centers, axes, strict=True):
        left, half, _ = np.linalg.svd(project(matrix.T, view).T[:2], full_matrices=False)
        outlines.append(mirror * (center + (left * half) @ circle))
    return outlines


def _round_force(matrices: Array, length: float) -> float:
    """The largest of 1, 2, 5, 10, ... [N] that keeps the ellipsoids small."""
    softest = np.linalg.norm(matrices, ord=2, axis=(1, 2)).max()
    most = _LARGEST * length / softest
    power = 10.0 ** math.floor(math.log10(most))
    return max(power * digit for digit in (1.0, 2.0, 5.0) if power * digit <= most * (1 + 1e-9))
