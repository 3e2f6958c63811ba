"""Predictor and corrector: how activations move when the tip moves straight to a point."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.inverse.problem import tips_and_slopes

__all__ = ["Continuation", "PathStatus", "Stop"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_LONGEST = 0.1  # predicted change of activation in one substep, in ranges
_SHORTEST = 1e-10  # substep at which a branch is at its end, in L
_STRAY = 0.25  # correction against prediction beyond which the branch may have been left
_AT_BOUND = 1e-9  # in ranges
_CORRECTIONS = 10
_SINGULAR = 1e-10  # singular values below this part of the largest do not count


class PathStatus(IntEnum):
    """How a point of the path fared."""

    FOLLOWED = 0
    """The tip is there, on the branch of the start."""
    FOLD = 1
    """Beyond a fold: the branch turns back before this point."""
    BOUND = 2
    """Beyond a bound: too few bundles could move on within theirs."""
    NO_START = 3
    """The first point cannot be reached, or not from the start given."""


class Stop(NamedTuple):
    """Where a branch was left."""

    status: PathStatus
    gamma: Array
    """The last activation on it [-], shape (m,)."""
    bundle: int = -1
    """The bundle at its bound."""
    upper: bool = False
    """Which bound that is."""


class _Try(NamedTuple):
    """A substep: where it led, or by how much to shorten it, or the end."""

    gamma: Array | None = None
    shorten: float = 1.0
    stop: Stop | None = None


class Continuation:
    """Following one branch of one design."""

    def __init__(self, arm: Manipulator, residual: float, tip_tol: float) -> None:
        """Set up for tips within `residual` [m] of their points, tips themselves to `tip_tol` L."""
        self.arm, self.residual, self.tip_tol = arm, residual, tip_tol
        self.low, self.high = arm.bounds.T
        self.width = np.where(self.high > self.low, self.high - self.low, 1.0)

    def begun(self, gamma: Array, point: Array) -> Array | None:
        """The activation corrected to a first point, if it can be within the bounds."""
        found = self._corrected(gamma, point, self.high > self.low)
        if found is None or (self._overstep(found) > _AT_BOUND).any():
            return None
        return np.clip(found, self.low, self.high)

    def follow(self, gamma: Array, begin: Array, goal: Array) -> Stop:
        """Move the tip from one point straight to another, as far as the branch goes."""
        done, part = 0.0, 1.0
        distance = float(np.linalg.norm(goal - begin))
        if distance == 0.0:
            return Stop(PathStatus.FOLLOWED, gamma)
        shortest = _SHORTEST * self.arm.length / distance
        while done < 1.0:
            part = min(part, 1.0 - done)
            last = part >= 1.0 - done
            attempt = self._substep(gamma, goal if last else begin + (done + part) * (goal - begin))
            if attempt.stop is not None:
                return attempt.stop
            if attempt.gamma is not None:
                gamma, done, part = attempt.gamma, 1.0 if last else done + part, 2 * part
            elif (part := part * attempt.shorten) < shortest:
                return Stop(PathStatus.FOLD, gamma)
        return Stop(PathStatus.FOLLOWED, gamma)

    def _substep(self, gamma: Array, aim: Array) -> _Try:
        """Predict and correct; bundles that would leave their bounds are held there."""
        tips, slopes = tips_and_slopes(self.arm, gamma[None], self.tip_tol)
        free, bundle, upper = self.high > self.low, -1, False
        while free.sum() >= 3:
            step = _least_norm(slopes[0], free) @ (aim - tips[0])
            size = np.abs(step / self.width).max()
            ahead = gamma + step
            blocked = free & self._at_bound(gamma) & (self._overstep(ahead) > _AT_BOUND)
            if not blocked.any():
                if size > _LONGEST:
                    return _Try(shorten=0.9 * _LONGEST / size)
                found = self._corrected(ahead, aim, free)
                if found is None or self._strayed(slopes[0], gamma, ahead, found):
                    return _Try(shorten=0.5)
                over = self._overstep(found) > _AT_BOUND
                if not over.any():
                    return _Try(gamma=np.clip(found, self.low, self.high))
                blocked = over & self._at_bound(gamma)
                if not blocked.any():
                    return _Try(shorten=self._room(gamma, found, over))
                ahead = found
            bundle = int(np.flatnonzero(blocked)[0])
            upper = bool(ahead[bundle] > self.high[bundle])
            free = free & ~blocked
        return _Try(stop=Stop(PathStatus.BOUND, gamma, bundle, upper))

    def _corrected(self, gamma: Array, aim: Array, free: Mask) -> Array | None:
        """Newton's method with the least-norm step of the free bundles; None if it fails."""
        least = np.inf
        for _ in range(_CORRECTIONS):
            tips, slopes = tips_and_slopes(self.arm, gamma[None], self.tip_tol)
            error = aim - tips[0]
            miss = float(np.linalg.norm(error))
            if miss <= 0.1 * self.residual:
                return gamma
            if miss > 2 * least:
                return None
            least = min(least, miss)
            gamma = gamma + _least_norm(slopes[0], free) @ error
            if (self._overstep(gamma) > 0.1).any():
                return None
        return None

    def _strayed(self, slope: Array, gamma: Array, ahead: Array, found: Array) -> bool:
        """Whether the correction was large, or passed a fold."""
        predicted = np.linalg.norm((ahead - gamma) / self.width)
        if np.linalg.norm((found - ahead) / self.width) > _STRAY * predicted + 1e-9:
            return True
        if slope.shape[1] > 3:
            return False
        after = tips_and_slopes(self.arm, found[None], self.tip_tol)[1][0]
        return bool(np.linalg.det(slope) * np.linalg.det(after) <= 0)

    def _overstep(self, gamma: Array) -> Array:
        """How far each bundle is outside its bounds, in ranges."""
        return np.maximum(self.low - gamma, gamma - self.high) / self.width

    def _at_bound(self, gamma: Array) -> Mask:
        return self._overstep(gamma) >= -2 * _AT_BOUND

    def _room(self, gamma: Array, found: Array, over: Mask) -> float:
        """The part of a substep that ends just inside the bounds."""
        bound = np.where(found > self.high, self.high, self.low)
        inside = 1.0 - 0.5 * _AT_BOUND * self.width / np.abs(found - gamma).clip(1e-300)
        part = (bound - gamma)[over] / (found - gamma)[over] * np.minimum(inside[over], 1 - 1e-6)
        return float(np.clip(part.min(), 1e-6, 0.9999))


def _least_norm(slope: Array, free: Mask) -> Array:
    """Pseudoinverse of the Jacobian of the free bundles, shape (m, 3)."""
    return np.asarray(np.linalg.pinv(slope * free, rcond=_SINGULAR), np.float64)
