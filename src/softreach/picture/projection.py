"""Orthographic views of space on paper, by name or by the direction of the camera."""

import numpy as np
from numpy.typing import ArrayLike

from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput

View = str | tuple[float, float]

VIEWS = {
    "front": (-np.pi / 2, 0.0),
    "side": (0.0, 0.0),
    "top": (-np.pi / 2, np.pi / 2),
    "oblique": (-np.pi / 3, np.pi / 9),
    "back": (np.pi / 2, 0.0),
    "left": (np.pi, 0.0),
}
"""Azimuth and elevation of the camera [rad].

The front is at -y, where the longitudinal fiber lies; "side" is seen from the right, +x, and "left"
from -x. "oblique" is from the front, a little from the right and above.
"""

# right and up on the paper, and the axis of sight
_PLANES = {"front": "xzy", "back": "xzy", "side": "yzx", "left": "yzx", "top": "xyz"}


def view_axes(view: View) -> Array:
    """Unit vectors to the right of the paper, up it, and out of it to the camera, shape (3, 3)."""
    azimuth, elevation = view_angles(view)
    sa, ca, se, ce = np.sin(azimuth), np.cos(azimuth), np.sin(elevation), np.cos(elevation)
    axes = np.array([[-sa, ca, 0.0], [-se * ca, -se * sa, ce], [ce * ca, ce * sa, se]])
    # a view along an axis shows coordinates as they are, not turned by sin(π) = 1e-16
    return np.rint(axes) if plane_of(view) else axes


def project(points: ArrayLike, view: View) -> Array:
    """Right, up and toward the camera, in the units of the points, shape (n, 3)."""
    return np.asarray(points, float) @ view_axes(view).T


def on_paper(points: ArrayLike, view: View) -> Array:
    """Right and up on axes, where the coordinate of a mirrored view grows to the left, (n, 2)."""
    return project(points, view)[..., :2] * (-1 if is_mirrored(view) else 1, 1)


def plane_of(view: View) -> str | None:
    """The coordinates to the right and up of a view along an axis; None for any other."""
    return _PLANES[view][:2] if isinstance(view, str) and view in _PLANES else None


def sight_axis(view: View) -> str:
    """The coordinate that a view looks along, on which a slice or slab has its place."""
    if not isinstance(view, str) or view not in _PLANES:
        raise InvalidInput("view", view, f"one of {', '.join(_PLANES)}, for a plane across an axis")
    return _PLANES[view][2]


def is_mirrored(view: View) -> bool:
    """True if a coordinate grows to the left of the paper, as it does from the back."""
    return plane_of(view) is not None and bool(view_axes(view)[0].sum() < 0)


def view_angles(view: View) -> tuple[float, float]:
    """Azimuth (from x, about z) and elevation of the camera [rad]."""
    if isinstance(view, str) and view in VIEWS:
        return VIEWS[view]
    if isinstance(view, str) or np.shape(view) != (2,) or not np.isfinite(view).all():
        raise InvalidInput("view", view, f"{', '.join(VIEWS)}, or (azimuth, elevation) in radians")
    return view[0], view[1]
