"""The box of activations: its grids, and integrals over it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.rod.kinematics import tip_positions
from softreach.rod.tip_map import tip_map

__all__ = ["ActivationBox"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class ActivationBox:
    """The activations within the bounds of an arm; bundles with equal bounds span no axis."""

    arm: Manipulator
    tol: float
    """Largest tip error, in L."""

    @cached_property
    def axes(self) -> NDArray[np.intp]:
        """Bundles whose bounds differ, shape (m,)."""
        return np.flatnonzero(self.widths > 0)

    @property
    def widths(self) -> Array:
        """Upper minus lower bound of every bundle [-], shape (bundles,)."""
        return np.diff(self.arm.bounds, axis=1)[:, 0]

    @property
    def m(self) -> int:
        """Number of dimensions of the box."""
        return len(self.axes)

    def activations(self, cube: Array) -> Array:
        """Activations [-] of points of the unit m-cube, shape (n, bundles)."""
        gamma = np.tile(self.arm.bounds[:, 0], (len(cube), 1))
        gamma[:, self.axes] += cube * self.widths[self.axes]
        return gamma

    def grid_tips(self, cells: int) -> Array:
        """Tips [m] of the grid of cells^m boxes, in C order, shape ((cells + 1)^m, 3)."""
        ticks = [np.linspace(0.0, 1.0, cells + 1)] * self.m
        return tip_positions(self.arm, self.activations(_product(ticks)), self.tol)

    def measure(self, nodes: int) -> float:
        """Length, area or signed volume of the map, ∫ √det(JᵀJ) dγ or ∫ det J dγ; for m <= 3.

        By Gauss and Legendre's rule, as the map is smooth: its error falls faster than any power of
        the number of nodes. Places reached more than once count as often.

        Args:
            nodes: Nodes along each axis.
        """
        x, w = np.polynomial.legendre.leggauss(nodes)
        cube = _product([(1.0 + x) / 2.0] * self.m)
        weights = np.prod(_product([w / 2.0] * self.m), axis=1) * np.prod(self.widths[self.axes])
        # Not a BLAS product, whose rounding would depend on its threads.
        return float((weights * self._stretch(self.activations(cube))).sum())

    def _stretch(self, gamma: Array) -> Array:
        """The change of measure of the map at each activation: det J where J is square."""
        # Far fewer evaluations than on the grids: their steps may be short.
        _, slopes = tip_map(self.arm, min(self.tol, 1e-9)).tips_and_slopes(gamma)
        velocity = slopes[:, :, self.axes]
        if self.m == 3:
            return np.linalg.det(velocity)
        return np.sqrt(np.linalg.det(np.swapaxes(velocity, 1, 2) @ velocity).clip(0.0))


def _product(ticks: list[Array]) -> Array:
    """All combinations of the values, the last varying fastest, shape (n, len(ticks))."""
    if not ticks:
        return np.zeros((1, 0))
    return np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, len(ticks))
