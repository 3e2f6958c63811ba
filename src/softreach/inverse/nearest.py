"""The reachable point nearest to a target, and the activation that leads there."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.inverse.minimizer import Minima, minimize
from softreach.inverse.objective import Objective
from softreach.inverse.prepared_map import PreparedMap
from softreach.inverse.request import Request
from softreach.inverse.roots import Roots, placed
from softreach.rod.tip_map import TipMap

__all__ = ["Nearest", "local_minima", "nearest", "nearest_from"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class Nearest(NamedTuple):
    """The nearest reachable points that were found."""

    gamma: Array
    """Activations [-], shape (t, m)."""
    tip: Array
    """The points [m], shape (t, 3)."""
    converged: NDArray[np.bool_]
    """Whether the search converged, shape (t,)."""

    @staticmethod
    def joined(parts: list[Nearest]) -> Nearest:
        """Those of consecutive blocks of targets."""
        return (
            parts[0] if len(parts) == 1 else Nearest(*map(np.concatenate, zip(*parts, strict=True)))
        )

    def of(self, rows: Index) -> Nearest:
        """Those of some of the targets."""
        return Nearest(self.gamma[rows], self.tip[rows], self.converged[rows])


def nearest(prepared: PreparedMap, request: Request, known: Roots | None = None) -> Nearest:
    """The best local minimum found from landmarks for each target: of distance, and of direction.

    Args:
        prepared: The tip map.
        request: Targets and, perhaps, directions to trade against distance.
        known: Roots to begin from as well.
    """
    rod, targets = prepared.rod, request.targets
    if not len(targets):
        return Nearest(request.near, targets, np.empty(0, bool))
    target, start = prepared.landmarks.starts(prepared.landmarks.nearest(targets))
    if known is not None:
        target = np.concatenate([target, known.target])
        start = np.concatenate([start, known.gamma])
    minima = local_minima(rod, request.of(target), start)
    order = np.lexsort((minima.value, target))
    best = order[np.searchsorted(target[order], np.arange(len(targets)))]
    gamma = minima.gamma[best]
    return Nearest(gamma, placed(rod, gamma)[0], minima.converged[best])


def nearest_from(rod: TipMap, request: Request, gamma: Array) -> Nearest:
    """The local minimum of distance from one activation for each target."""
    minima = local_minima(rod, replace(request, direction=None), gamma)
    return Nearest(minima.gamma, placed(rod, minima.gamma)[0], minima.converged)


def local_minima(rod: TipMap, request: Request, start: Array) -> Minima:
    """A local minimum of the distance to target i (and direction i) from start i, (n, m)."""
    objective = Objective(
        rod=rod,
        targets=request.targets,
        direction=request.direction,
        direction_weight=request.direction_weight,
    )
    return minimize(objective, start, rod.box)
