"""Minima of many smooth functions of the activations inside the bounds."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.kernels.box_newton import box_steps
from softreach.rod.activation_box import ActivationBox

__all__ = ["Evaluate", "Minima", "minimize"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Mask = NDArray[np.bool_]
Evaluate = Callable[[Index, Array], tuple[Array, Array]]
"""(which functions, activations (n, m)) -> values (n,), gradients (n, m)."""

_MOST_ITERATIONS = 80
_DIFFERENCE = 1e-6  # step of the differences of gradients, in ranges
_STEP_TOL = 1e-10  # step at which a search has converged, in ranges
_VALUE_TOL = 1e-14  # relative increase of a value that is rounding
_LARGEST_DAMPING = 1e8  # at which a search stagnates


class Minima(NamedTuple):
    """Local minima."""

    gamma: Array
    """Where [-], shape (n, m)."""
    value: Array
    """The functions there, shape (n,)."""
    converged: Mask
    """Whether the last step was negligible, shape (n,)."""


class _Expansion(NamedTuple):
    """Functions to second order about a point each."""

    value: Array
    gradient: Array
    hessian: Array
    """NaN where it was not asked for."""


def minimize(evaluate: Evaluate, start: Array, box: ActivationBox) -> Minima:
    """Minimize function i from start i, by damped Newton within the bounds.

    Second derivatives are differences of the exact gradients, so that the search ends fast also
    where the target is far from everything reachable.

    Args:
        evaluate: Values and gradients of some of the functions.
        start: Inside the bounds [-], shape (n, m).
        box: The bounds.
    """
    low, high, scales = box.low.copy(), box.high.copy(), box.scales
    gamma, damping = start.copy(), np.zeros(len(start))
    active, converged = np.arange(len(start)), np.zeros(len(start), bool)
    value, gradient, hessian = _expanded(evaluate, active, gamma, scales, ~converged)
    active = active[np.isfinite(value)]
    for _ in range(_MOST_ITERATIONS):
        if not len(active):
            break
        trial, damped = np.empty((len(active), start.shape[1])), damping[active]
        box_steps(gamma[active], gradient[active], hessian[active], damped, low, high, trial)
        still = (np.abs(trial - gamma[active]) / scales).max(axis=1, initial=0.0) <= _STEP_TOL
        ahead = _expanded(evaluate, active, trial, scales, ~still)
        accepted = ahead.value <= value[active] + _VALUE_TOL * np.abs(value[active])
        taken = active[accepted]
        gamma[taken] = trial[accepted]
        value[taken], gradient[taken], hessian[taken] = (part[accepted] for part in ahead)
        damping[active] = _next_damping(damped, accepted)
        converged[active] = still
        active = active[~still & (damping[active] < _LARGEST_DAMPING)]
    return Minima(gamma, value, converged)


def _next_damping(damping: Array, accepted: Mask) -> Array:
    eased = np.where(damping > 1e-6, 0.1 * damping, 0.0)
    return np.where(accepted, eased, np.maximum(10 * damping, 1e-3))


def _expanded(
    evaluate: Evaluate, which: Index, gamma: Array, scales: Array, curved: Mask
) -> _Expansion:
    """Values, gradients and, where `curved`, Hessians: gradients a step away along each axis.

    One call evaluates all: rods are computed in blocks that cost the same full or not.
    """
    n, m = gamma.shape
    k = int(curved.sum())
    displaced = np.repeat(gamma[curved, None], m, axis=1)
    displaced[:, np.arange(m), np.arange(m)] += _DIFFERENCE * scales
    value, gradient = evaluate(
        np.concatenate([which, np.repeat(which[curved], m)]),
        np.concatenate([gamma, displaced.reshape(k * m, m)]),
    )
    change = gradient[n:].reshape(k, m, m) - gradient[:n][curved, None]
    hessian = np.full((n, m, m), np.nan)
    hessian[curved] = change / (_DIFFERENCE * scales)[:, None]
    torn = np.isfinite(value[:n]) & curved & np.isnan(hessian).any(axis=(1, 2))
    hessian[torn] = _cautious(gradient[:n][torn], scales)
    return _Expansion(value[:n], gradient[:n], hessian)


def _cautious(gradient: Array, scales: Array) -> Array:
    """In place of a Hessian, next to where a function ends: steps down of a tenth of the ranges."""
    size = np.abs(gradient * scales).max(axis=1, initial=0.0)
    return (10.0 * size / scales[:, None] ** 2).T[:, :, None] * np.eye(len(scales))
