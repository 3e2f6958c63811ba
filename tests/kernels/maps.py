"""Quadratic maps of a box into space, with everything about them known, and their meshes."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.kernels.image.activation_mesh import (
    ActivationMesh,
    corner_bits,
    interpolation_errors,
    kuhn_simplices,
)

Array = NDArray[np.float64]
Index = NDArray[np.int64]

ROUNDING = 1e-9


class Quadratic(NamedTuple):
    """f(x) = a + Bx + ½ C[x, x]."""

    a: Array
    b: Array
    c: Array
    """Second derivatives, symmetric in the last two axes, shape (3, 3, 3)."""

    def values(self, x: Array) -> Array:
        return self.a + x @ self.b.T + 0.5 * np.einsum("ijk,nj,nk->ni", self.c, x, x)

    def slopes(self, x: Array) -> Array:
        return self.b + np.einsum("ijk,nk->nij", self.c, x)


def random_quadratic(rng: np.random.Generator, bend: float = 1.0) -> Quadratic:
    c = rng.normal(size=(3, 3, 3))
    return Quadratic(rng.normal(size=3), rng.normal(size=(3, 3)), bend * (c + c.swapaxes(1, 2)))


class Fold(NamedTuple):
    """f(x) = Q (½ κ y0², y1, y2) with y = Rx: folded along y0 = 0, Q and R rotations."""

    q: Array
    r: Array
    kappa: float

    def quadratic(self) -> Quadratic:
        b = self.q @ np.diag([0.0, 1.0, 1.0]) @ self.r
        c = self.kappa * np.einsum("i,j,k->ijk", self.q[:, 0], self.r[0], self.r[0])
        return Quadratic(np.zeros(3), b, c)

    def mirrored(self, x: Array) -> Array:
        """The other preimage of f(x)."""
        y = x @ self.r.T
        return (y * [-1.0, 1.0, 1.0]) @ self.r


def random_fold(rng: np.random.Generator, kappa: float = 0.7) -> Fold:
    q, r = np.linalg.qr(rng.normal(size=(2, 3, 3)))[0]
    return Fold(q, r, kappa)


def mesh_of(f: Quadratic, cells: int) -> ActivationMesh:
    """The mesh of a map of the box [-1, 1]³."""
    axis = np.linspace(-1.0, 1.0, cells + 1)
    gamma = (
        np.stack(np.meshgrid(axis, axis, axis, indexing="ij")).reshape(3, -1).T
    )  # as the library
    least = np.stack(np.meshgrid(*[np.arange(cells)] * 3, indexing="ij"), -1).reshape(-1, 1, 3)
    corner = (least + corner_bits(3)) @ np.array([(cells + 1) ** 2, cells + 1, 1])
    tip, slope = map(np.ascontiguousarray, (f.values(gamma), f.slopes(gamma)))
    error, remainder = np.empty((2, len(corner)))
    interpolation_errors(gamma, tip, slope, corner, error, remainder)
    change = np.abs(slope[corner] - slope[corner[:, :1]]).sum(axis=(1, 2, 3))
    error += ROUNDING
    return ActivationMesh(gamma, tip, slope, corner, error, remainder, change)


def sampled(
    mesh: ActivationMesh, n: int, rng: np.random.Generator
) -> tuple[Index, Array, Array, Array]:
    """Random places in random tetrahedra of a mesh.

    Returns:
        Number of the tetrahedron (6 times the cell plus which), its vertices (n, 4), barycentric
        coordinates (n, 4) and activations (n, 3).
    """
    tetrahedron = rng.integers(0, 6 * len(mesh.corner), n)
    cell, which = np.divmod(tetrahedron, 6)
    v = mesh.corner[cell[:, None], kuhn_simplices(3)[which]]
    weights = rng.dirichlet([0.7] * 4, n)  # edges and faces too
    return tetrahedron, v, weights, np.einsum("ni,nik->nk", weights, mesh.gamma[v])
