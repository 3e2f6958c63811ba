"""What is asked: targets to reach within the bounds, and the Jacobian that leads there."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator
from softreach.errors import InvalidInput
from softreach.rod.tip_map import tip_map

__all__ = [
    "checked_direction",
    "checked_near",
    "checked_number",
    "checked_targets",
    "tips_and_slopes",
]

Array = NDArray[np.float64]


def checked_targets(name: str, targets: ArrayLike) -> Array:
    """The targets as a (t, 3) float array.

    Raises:
        InvalidInput: Another shape, or values that are not finite.
    """
    points = np.ascontiguousarray(targets, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3:
        raise InvalidInput(f"{name}.shape", points.shape, "of shape (t, 3), positions in m")
    if not np.isfinite(points).all():
        row = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise InvalidInput(f"{name}[{row}]", points[row], "finite numbers")
    return points


def checked_near(arm: Manipulator, near: ArrayLike | None, count: int) -> Array:
    """The activation to stay near to, for each target, shape (t, m); rest by default."""
    if near is None:
        return np.zeros((count, arm.bundles))
    rows = np.asarray(near, dtype=float)
    if rows.shape not in ((arm.bundles,), (count, arm.bundles)):
        allowed = f"of shape ({arm.bundles},), or (t, {arm.bundles}) for each target its own"
        raise InvalidInput("near.shape", rows.shape, allowed)
    if not np.isfinite(rows).all():
        raise InvalidInput("near", near, "finite numbers")
    return np.ascontiguousarray(np.broadcast_to(rows, (count, arm.bundles)))


def checked_direction(direction: ArrayLike, count: int) -> Array:
    """Unit vectors along the wanted tip tangents, shape (t, 3)."""
    rows = np.asarray(direction, dtype=float)
    if rows.shape not in ((3,), (count, 3)):
        raise InvalidInput("direction.shape", rows.shape, "of shape (3,) or (t, 3)")
    size = np.linalg.norm(rows, axis=-1, keepdims=True)
    if not (np.isfinite(size) & (size > 0)).all():
        raise InvalidInput("direction", direction, "finite vectors other than zero")
    return np.ascontiguousarray(np.broadcast_to(rows / size, (count, 3)))


def checked_number(name: str, value: float, low: float, high: float) -> float:
    """The number itself, if it lies within the limits."""
    if not low <= value <= high:
        raise InvalidInput(name, value, f"between {low:g} and {high:g}")
    return value


def tips_and_slopes(arm: Manipulator, gamma: Array, tol: float) -> tuple[Array, Array]:
    """Tips [m], shape (n, 3), and their derivatives ∂r/∂γ [m], shape (n, 3, bundles)."""
    return tip_map(arm, tol).tips_and_slopes(gamma)
