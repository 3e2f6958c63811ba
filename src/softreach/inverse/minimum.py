"""The least value of many smooth functions of the activations inside the bounds."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.kernels.box_newton import box_steps

__all__ = ["Minimum", "minimum"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Evaluate = Callable[[Index, Array], tuple[Array, Array]]
"""(which functions, activations (n, m)) -> values (n,), gradients (n, m)."""

_ROUNDS = 80
_PROBE = 1e-6  # step of the differences of gradients, in ranges
_STILL = 1e-10  # a step that is none, in ranges
_ROUNDING = 1e-14  # relative change of a value that says nothing
_STIFFEST = 1e8  # damping at which a search gives up


class Minimum(NamedTuple):
    """Local minima."""

    gamma: Array
    """Where [-], shape (n, m)."""
    value: Array
    """The functions there, shape (n,)."""
    settled: NDArray[np.bool_]
    """Whether the search came to rest, shape (n,)."""


def minimum(evaluate: Evaluate, start: Array, low: Array, high: Array) -> Minimum:
    """Minimize function i from start i, by damped Newton with bounds.

    Second derivatives are differences of the exact gradients, so that the search ends fast also
    where the target is far from everything reachable.

    Args:
        evaluate: Values and gradients of some of the functions.
        start: Inside the bounds [-], shape (n, m).
        low: Lower bounds, shape (m,).
        high: Upper bounds, shape (m,).
    """
    width = np.where(high > low, high - low, 1.0)
    gamma, damping = start.copy(), np.zeros(len(start))
    value, gradient, hessian = _expanded(evaluate, np.arange(len(start)), gamma, width)
    active, settled = np.arange(len(start)), np.zeros(len(start), bool)
    for _ in range(_ROUNDS):
        if not len(active):
            break
        trial = np.empty((len(active), start.shape[1]))
        stiff = damping[active]
        box_steps(gamma[active], gradient[active], hessian[active], stiff, low, high, trial)
        moved = (np.abs(trial - gamma[active]) / width).max(axis=1)
        ahead = _expanded(evaluate, active, trial, width)
        accepted = ahead[0] <= value[active] + _ROUNDING * np.abs(value[active])
        taken = active[accepted]
        gamma[taken] = trial[accepted]
        value[taken], gradient[taken], hessian[taken] = (part[accepted] for part in ahead)
        damping[active] = _next_damping(stiff, accepted)
        settled[active] = moved <= _STILL
        active = active[~settled[active] & (damping[active] < _STIFFEST)]
    return Minimum(gamma, value, settled)


def _next_damping(damping: Array, accepted: NDArray[np.bool_]) -> Array:
    eased = np.where(damping > 1e-6, 0.1 * damping, 0.0)
    return np.where(accepted, eased, np.maximum(10 * damping, 1e-3))


def _expanded(
    evaluate: Evaluate, which: Index, gamma: Array, width: Array
) -> tuple[Array, Array, Array]:
    """Values, gradients and Hessians, the latter from gradients a probe away along each axis."""
    n, m = gamma.shape
    probes = np.repeat(gamma[:, None], m + 1, axis=1)
    probes[:, np.arange(1, m + 1), np.arange(m)] += _PROBE * width
    value, gradient = evaluate(np.repeat(which, m + 1), probes.reshape(-1, m))
    value, gradient = value.reshape(n, m + 1), gradient.reshape(n, m + 1, m)
    hessian = (gradient[:, 1:] - gradient[:, :1]) / (_PROBE * width)[:, None]
    return value[:, 0], gradient[:, 0], hessian
