"""From space to paper: orthographic views, by name or by the direction of the eye."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.errors import InvalidInput

__all__ = ["OBLIQUE", "VIEWS", "View", "plane_of", "project", "view_axes"]

Array = NDArray[np.float64]
View = str | tuple[float, float]

VIEWS: dict[str, tuple[float, float]] = {
    "front": (-np.pi / 2, 0.0),
    "back": (np.pi / 2, 0.0),
    "right": (0.0, 0.0),
    "left": (np.pi, 0.0),
    "top": (-np.pi / 2, np.pi / 2),
}
"""Azimuth and elevation of the eye [rad]; the front is -y, where the longitudinal fiber lies."""

OBLIQUE: tuple[float, float] = (-np.pi / 3, np.pi / 9)
"""A view from the front, a little from the right and above [rad]."""

_PLANES = {
    "front": ("x", "z"),
    "back": ("x", "z"),
    "right": ("y", "z"),
    "left": ("y", "z"),
    "top": ("x", "y"),
}


def view_axes(view: View) -> Array:
    """Unit vectors to the right of the paper, up it, and out of it to the eye, shape (3, 3).

    Args:
        view: One of `VIEWS`, or azimuth (from x, about z) and elevation of the eye [rad].

    Raises:
        InvalidInput: Neither a known name nor two finite angles.
    """
    azimuth, elevation = _angles(view)
    sa, ca, se, ce = np.sin(azimuth), np.cos(azimuth), np.sin(elevation), np.cos(elevation)
    axes = np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])
    # a named view shows coordinates as they are, not turned by sin(π) = 1e-16
    return np.rint(axes) if isinstance(view, str) else axes


def project(points: ArrayLike, view: View) -> Array:
    """Right, up and toward the eye, in the units of the points, shape (n, 3).

    Raises:
        InvalidInput: An unknown view.
    """
    return np.asarray(points, float) @ view_axes(view).T


def plane_of(view: View) -> tuple[str, str] | None:
    """The coordinates to the right and up of a named view; None for any other."""
    return _PLANES.get(view) if isinstance(view, str) else None


def _angles(view: View) -> tuple[float, float]:
    known = ", ".join(VIEWS) + ", or (azimuth, elevation) in radians"
    if isinstance(view, str):
        if view not in VIEWS:
            raise InvalidInput("view", view, known)
        return VIEWS[view]
    if np.shape(view) != (2,) or not np.isfinite(view).all():
        raise InvalidInput("view", view, known)
    return view[0], view[1]
