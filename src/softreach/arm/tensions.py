"""Tensions of tendons that are driven by length, from what is pulled in: theory (95) to (97).

A unit of tension loads the sections by N and M, and does work on their strains: it shortens the
path of its tendon by s = ∫ N (ζ - 1) + M·ω dZ, with ω = η u. This is exact for tendons parallel to
the axis of an arm that is not twisted, and consistent with the loads of `Tendon` for all others.
Without loads s is linear in the tensions, and its slopes C are symmetric and positive semidefinite;
so tensions solve a linear complementarity problem. As every tension shortens the axis, it has a
solution for all displacements.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.actuators import LengthTendon
from softreach.arm.body import Body, RestStrains
from softreach.arm.tables import quadrature, tables
from softreach.support.arrays import Array, Mask
from softreach.support.lazy import lazy


class Tensions(NamedTuple):
    """Tensions of the tendons that are driven by length."""

    tension: Array
    """τ >= 0 [N], shape (n, tendon)."""
    is_taut: Mask
    """Tendons whose tension follows the displacements, shape (n, tendon)."""


@dataclass(frozen=True, eq=False)
class LengthLaw:
    """Shortening of the paths of tendons that are driven by length, and the tensions it takes.

    Activations have tensions [N] in the columns of these tendons where they are called inner, else
    displacements [m].
    """

    arm: Body
    """With its rest shape as a bundle: see `body_of`."""

    @lazy
    def columns(self) -> NDArray[np.intp]:
        """Bundles of the arm that are tendons driven by length."""
        kinds = [isinstance(each, LengthTendon) for each in self.arm.bundle_actuators]
        return np.flatnonzero(kinds)

    @lazy
    def compliance(self) -> Array:
        """1/k of each [m/N]."""
        return np.array([tendon.compliance for tendon in self._tendons])

    @lazy
    def taut_from(self) -> Array:
        """Displacement from which each is taut while the arm keeps its shape [m]."""
        tendons = (each for each in self.arm.actuators if isinstance(each, LengthTendon))
        return np.concatenate([np.empty(0), *(tendon.taut_from for tendon in tendons)])

    @lazy
    def _tendons(self) -> list[LengthTendon]:
        each = (self.arm.bundle_actuators[k] for k in self.columns)
        return [tendon for tendon in each if isinstance(tendon, LengthTendon)]

    @property
    def changes_rest_length(self) -> bool:
        """True if bundles change the length of matter, so that s is not linear in γ."""
        return len(self._growing) > 0

    @lazy
    def _growing(self) -> NDArray[np.intp]:
        return np.flatnonzero([not each.is_force for each in self.arm.bundle_actuators])

    def loads_at(self, z: Array, weights: Array) -> tuple[Array, Array]:
        """N and M of one unit of each tension at nodes, times their weights.

        Returns:
            Shapes (node, tendon) and (node, 3, tendon).
        """
        table = tables(self.arm, z)
        stiffness = self.arm.section.stiffness_at(self.arm.profile, z)
        resistance = np.stack([stiffness.bending, stiffness.bending, stiffness.torsion], axis=1)
        force = table.extension[:, self.columns] * (weights * stiffness.axial)[:, None]
        moment = table.curvature[..., self.columns] * (weights[:, None] * resistance)[..., None]
        return force, moment

    @lazy
    def _slopes(self) -> tuple[Array, Array]:
        """Work of one unit of tension on the strains of one unit of each activation.

        Returns:
            ∫ N z + M·U dZ, shape (tendon, bundle), and ∫ M·U dη/dγ dZ, which counts once more for
            each bundle that changes the length of matter, shape (tendon, bundle, such).
        """
        z, weights, _ = quadrature(self.arm)
        force, moment = self.loads_at(z, weights)
        table = tables(self.arm, z)
        bent = np.einsum("sct,scb->stb", moment, table.curvature)
        axial = np.einsum("st,sb->tb", force, table.extension)
        eta = table.rest_length_factor[:, self._growing]
        return axial + bent.sum(axis=0), np.einsum("stb,sg->tbg", bent, eta)

    def shortening(self, inner: Array) -> Array:
        """s of the path of each tendon [m] at activations with tensions, shape (n, tendon)."""
        return self._from_straight(inner) - self.at_rest

    @lazy
    def at_rest(self) -> Array:
        """s of the arm at rest from the straight one [m], shape (1, tendon)."""
        shape = [[float(isinstance(each, RestStrains)) for each in self.arm.bundle_actuators]]
        return self._from_straight(np.array(shape))

    def _from_straight(self, inner: Array) -> Array:
        return self._sum(self._work(inner), inner)

    def shortening_slopes(self, inner: Array) -> Array:
        """∂s/∂γ of activations with tensions [m per unit], shape (n or 1, tendon, bundle)."""
        work = self._work(inner)
        for k, column in enumerate(self._growing):
            work[..., column] += self._sum(self._slopes[1][None, ..., k], inner)
        return work

    def _work(self, inner: Array) -> Array:
        """∫ N z + η M·U dZ, shape (n or 1, tendon, bundle)."""
        linear, growing = self._slopes
        work = linear[None].copy()
        for k, column in enumerate(self._growing):
            work = work + inner[:, column, None, None] * growing[..., k]
        return work

    def _sum(self, rates: Array, inner: Array) -> Array:
        """Σ rates γ over the bundles in their order, whatever BLAS and its threads would do."""
        total = np.zeros((len(inner), len(self.columns)))
        for j in range(inner.shape[1]):
            total += rates[..., j] * inner[:, j, None]
        return total

    def tensions(self, activations: Array) -> Tensions:
        """Tensions at activations with displacements, shape (n, bundles)."""
        inner = activations.copy()
        inner[:, self.columns] = 0.0
        excess = activations[:, self.columns] - self.taut_from - self.shortening(inner)
        matrix = self._work(inner)[..., self.columns] + np.diag(self.compliance)
        return self.complementary(matrix, excess)

    def complementary(self, matrix: Array, excess: Array) -> Tensions:
        """Tensions τ >= 0 with w = matrix τ - excess >= 0 and τ·w = 0.

        Args:
            matrix: ∂s/∂τ + 1/k [m/N], shape (n or 1, tendon, tendon).
            excess: By how much they are pulled in beyond their paths without tension [m], (n,
                tendon).
        """
        from softreach.kernels.box.complementarity import complementary  # loads Numba

        tension, taut = np.empty_like(excess), np.empty(excess.shape, np.int8)
        solved = np.empty(len(excess), np.int8)
        matrix, excess = np.ascontiguousarray(matrix), np.ascontiguousarray(excess)
        complementary(matrix, excess, tension, taut, solved)
        tension[solved == 0] = np.nan
        return Tensions(tension, taut == 1)

    def inner(self, activations: Array, tension: Array) -> Array:
        """Activations with tensions in place of displacements, shape (n, bundles)."""
        inner = activations.copy()
        inner[:, self.columns] = tension
        return inner

    def slopes(self, inner: Array, is_taut: Mask, of_strains: Array) -> Array:
        """∂(activations with tensions)/∂(activations with displacements), on the taut tendons.

        Args:
            inner: Activations with tensions, shape (n, bundles).
            is_taut: Shape (n, tendon).
            of_strains: ∂s/∂γ at `inner`, shape (n or 1, tendon, bundle).

        Returns:
            Shape (n, bundles, bundles).
        """
        n, columns = len(inner), self.columns
        matrix = of_strains[..., columns] + np.diag(self.compliance)
        both = is_taut[:, :, None] & is_taut[:, None, :]
        matrix = np.where(both, matrix, np.eye(len(columns)))
        wanted = np.tile(-of_strains, (1 if len(of_strains) == n else n, 1, 1))
        wanted[..., columns] = np.eye(len(columns))
        wanted *= is_taut[..., None]
        slopes = np.tile(np.eye(inner.shape[1]), (n, 1, 1))
        slopes[:, columns] = np.linalg.solve(matrix, wanted)
        return slopes
