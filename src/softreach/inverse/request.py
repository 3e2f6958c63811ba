"""What is asked of the inverse problem, checked."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.errors import InvalidInput
from softreach.rod.activation_box import ActivationBox

__all__ = [
    "Request",
    "checked_activations",
    "checked_direction",
    "checked_number",
    "checked_residual",
    "checked_targets",
    "checked_whole_number",
]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_RESIDUALS = (1e-13, 1e-2)  # in L; below, rounding of the tips decides


@dataclass(frozen=True, kw_only=True)
class Request:
    """Targets, and which activations to prefer where there is a choice."""

    targets: Array
    """Where the tip should be [m], shape (t, 3)."""
    residual: float
    """Largest |tip - target| of a solution [m]."""
    near: Array
    """Activations of the free bundles to stay near to [-], shape (t, dimension)."""
    direction: Array | None = None
    """Wanted tip tangents, unit vectors, shape (t, 3)."""
    direction_weight: float = 0.0
    """What |d3 - direction| counts for, against |γ - near| or a distance in L [-]."""
    family: int = 1
    """Activations wanted for each target where there are infinitely many."""
    seed: int = 0
    """Seed of the random activations that the others stay near to."""
    prove_least: bool = False
    """Whether to bound the change of all activations that reach a target from below."""

    def of(self, rows: slice | Index) -> Request:
        """The request for some of the targets."""
        direction = None if self.direction is None else self.direction[rows]
        return replace(self, targets=self.targets[rows], near=self.near[rows], direction=direction)


def checked_targets(name: str, targets: ArrayLike) -> Array:
    """The targets as a (t, 3) float array.

    Raises:
        InvalidInput: Another shape, or values that are not finite.
    """
    allowed = "of shape (t, 3), positions in m"
    points = np.ascontiguousarray(_numbers(name, targets, allowed))
    if points.ndim != 2 or points.shape[1] != 3:
        raise InvalidInput(f"{name}.shape", points.shape, allowed)
    if not np.isfinite(points).all():
        row = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise InvalidInput(f"{name}[{row}]", points[row], "finite numbers")
    return points


def checked_activations(name: str, activations: ArrayLike, box: ActivationBox, count: int) -> Array:
    """An activation for each target, of the free bundles only, shape (t, dimension).

    Args:
        name: What the argument is called.
        activations: Of all bundles [-], shape (bundles,) or (t, bundles).
        box: The bounds of all bundles.
        count: Number of targets t.

    Raises:
        InvalidInput: Another shape, or values that are not finite.
    """
    m = box.bundles
    rows = _numbers(name, activations, "numbers")
    if rows.shape not in ((m,), (count, m)):
        raise InvalidInput(f"{name}.shape", rows.shape, f"of shape ({m},), or ({count}, {m})")
    if not np.isfinite(rows).all():
        raise InvalidInput(name, activations, "finite numbers")
    return np.ascontiguousarray(np.broadcast_to(rows, (count, m))[:, box.free])


def checked_direction(direction: ArrayLike | None, count: int) -> Array | None:
    """Unit vectors along the wanted tip tangents, shape (t, 3); None if there are none."""
    if direction is None:
        return None
    rows = _numbers("direction", direction, "numbers")
    if rows.shape not in ((3,), (count, 3)):
        raise InvalidInput("direction.shape", rows.shape, "of shape (3,) or (t, 3)")
    size = np.linalg.norm(rows, axis=-1, keepdims=True)
    if not (np.isfinite(size) & (size > 0)).all():
        raise InvalidInput("direction", direction, "finite vectors other than zero")
    return np.ascontiguousarray(np.broadcast_to(rows / size, (count, 3)))


def checked_residual(residual_over_length: float) -> float:
    """The largest |tip - target| in L, if that can be asked for."""
    return checked_number("residual_over_length", residual_over_length, *_RESIDUALS)


def checked_number(name: str, value: float, low: float, high: float) -> float:
    """The number itself, if it lies within the limits."""
    if not low <= value <= high:
        raise InvalidInput(name, value, f"between {low:g} and {high:g}")
    return float(value)


def checked_whole_number(name: str, value: int, low: int, high: int) -> int:
    """The whole number itself, if it lies within the limits."""
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not whole or not low <= value <= high:
        raise InvalidInput(name, value, f"a whole number between {low:g} and {high:g}")
    return int(value)


def _numbers(name: str, values: ArrayLike, allowed: str) -> Array:
    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise InvalidInput(name, f"{values!r:.80}", allowed) from None
