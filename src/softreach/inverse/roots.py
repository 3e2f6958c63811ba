"""Roots of tip(γ) = target, and how well the tip can be moved there."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach import parallel
from softreach.kernels import newton
from softreach.rod.tip_map import BLOCK, TipMap, TipStatus

__all__ = ["Roots", "conditions", "no_roots", "placed", "roots_at", "smallest_singular_values"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class Roots(NamedTuple):
    """Activations of the free bundles, each a root for one of the targets."""

    target: Index
    """Number of the target, shape (n,)."""
    gamma: Array
    """Activations [-], shape (n, m)."""
    slope: Array
    """∂r/∂γ there [m], shape (n, 3, m)."""
    residual: Array
    """|tip - target| [m], shape (n,)."""
    cell: Index
    """Cell of the mesh where the search began; -1 if in none, shape (n,)."""
    stable: NDArray[np.bool_]
    """Whether the arm can be there, shape (n,)."""

    def where(self, chosen: NDArray[np.bool_] | Index) -> Roots:
        """Those chosen by a mask or an index; themselves where a mask leaves none out."""
        if chosen.dtype == bool and chosen.all():
            return self
        return Roots(
            self.target[chosen],
            self.gamma[chosen],
            self.slope[chosen],
            self.residual[chosen],
            self.cell[chosen],
            self.stable[chosen],
        )

    def joined(self, other: Roots) -> Roots:
        """Both, sorted by target as each of them is."""
        return Roots.sorted_by_target([self, other]) if len(other.target) else self

    @staticmethod
    def sorted_by_target(parts: list[Roots]) -> Roots:
        """All of them, sorted by target."""
        everything = Roots(*map(np.concatenate, zip(*parts, strict=True)))
        return everything.where(np.argsort(everything.target, kind="stable"))

    def missing(self, targets: int) -> Index:
        """Which of so many targets have no stable root."""
        return np.flatnonzero(np.bincount(self.target[self.stable], minlength=targets) == 0)


def no_roots(rod: TipMap) -> Roots:
    """An empty set of roots."""
    none, m = np.empty(0, np.int64), rod.box.bundles
    stable = np.empty(0, bool)
    return Roots(none, np.empty((0, m)), np.empty((0, 3, m)), np.empty(0), none, stable)


def roots_at(rod: TipMap, targets: Array, target: Index, gamma: Array) -> Roots:
    """Activations (n, m) as roots for targets `target` (n,), whatever their residual.

    Args:
        rod: A tip map of stable equilibria.
        targets: Shape (t, 3) [m].
        target: Shape (n,).
        gamma: Shape (n, m).
    """
    tips, slopes = rod.tips_and_slopes(gamma)
    residual = np.linalg.norm(tips - targets[target], axis=1)
    nowhere, stable = np.full(len(target), -1), np.isfinite(residual)
    return Roots(target, gamma, slopes, residual, nowhere, stable)


def placed(rod: TipMap, gamma: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Tips to rounding [m], (n, 3), and whether the arm can be there, (n,).

    `TipMap.tips` of loaded arms ends the search for an equilibrium within a part of `tol` that is
    larger than the residual of a root.
    """
    if not rod.supports_unstable:
        return rod.tips(gamma), np.ones(len(gamma), bool)
    tips, slopes = np.empty((len(gamma), 3)), np.empty((len(gamma), 3, rod.box.bundles))
    status = np.empty(len(gamma), np.int8)
    parallel.run(
        partial(rod.fill_slopes_and_status, gamma[b], tips[b], slopes[b], status=status[b])
        for b in parallel.blocks(len(gamma), BLOCK // 8)
    )
    return tips, status == TipStatus.STABLE


def smallest_singular_values(slope: Array) -> Array:
    """Smallest singular values of 3x3 Jacobians [m], shape (n,)."""
    return _closed_form(slope)[0]


def conditions(slope: Array) -> Array:
    """Condition numbers of Jacobians (n, 3, m), infinite where singular; NaN for m = 0."""
    m = slope.shape[2]
    if m == 0:
        return np.full(len(slope), np.nan)
    if m == 3:
        return _closed_form(slope)[1]
    sigma = np.linalg.svd(slope, compute_uv=False)
    with np.errstate(divide="ignore"):
        return sigma[:, 0] / sigma[:, -1]


def _closed_form(slope: Array) -> tuple[Array, Array]:
    smallest, condition = np.empty(len(slope)), np.empty(len(slope))
    newton.conditions(slope, smallest, condition)
    return smallest, condition
