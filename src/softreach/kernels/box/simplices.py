"""Simplices of a grid of boxes: the triangulation of Freudenthal and Kuhn, in any dimension.

A corner of the unit cube is a bit mask: bit j is its coordinate along axis j. A k-face of the
triangulation is a least vertex v of the grid and a chain of corners 0 = S0 < S1 < ... < Sk, each
contained in the next: its vertices are v + S0, ..., v + Sk.

References:
    Freudenthal (1942), Simplizialzerlegungen von beschränkter Flachheit, Ann. Math. 43, 580-582.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]


@lru_cache(maxsize=32)
def chains(m: int, k: int) -> Ints:
    """Chains of corners (count, k + 1) that give the k-faces of the m-cube with least vertex 0.

    A face is in a grid if v + Sk is: chains whose last corner leaves out axis j also start at the
    last vertices along j.
    """
    longer = [(0,)]
    for _ in range(k):
        longer = [
            (*chain, corner)
            for chain in longer
            for corner in range(1 << m)
            if corner != chain[-1] and corner & chain[-1] == chain[-1]
        ]
    table = np.array(longer, np.int64).reshape(-1, k + 1)
    table.setflags(write=False)
    return table


def kuhn_simplices(m: int) -> Ints:
    """The simplices (m!, m + 1) from corner 0 to the opposite one, along axes in every order."""
    return chains(m, m)


def corner_bits(m: int) -> Ints:
    """Coordinates 0 or 1 of every corner of the m-cube, shape (2^m, m)."""
    return np.arange(1 << m)[:, None] >> np.arange(m) & 1


def strides(cells: Sequence[int]) -> Ints:
    """Steps in the flat index of the vertices, in C order, of a grid of cells[j] cells along j."""
    vertices = np.array([*cells, 0], np.int64)[1:] + 1
    return np.cumprod(vertices[::-1])[::-1].copy()


def corner_steps(cells: Sequence[int]) -> Ints:
    """Step in the flat index of the vertices from corner 0 of a cell to each corner, (2^m,)."""
    return corner_bits(len(cells)) @ strides(cells)
