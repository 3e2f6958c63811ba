"""What a search for equilibria finds, and how tips there answer to activations and forces."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.rod.search import Rung
from softreach.rod.tip_map import TipStatus

__all__ = ["Equilibria", "Response"]

Array = NDArray[np.float64]


class Equilibria(NamedTuple):
    """Where tips come to rest."""

    tips: Array
    """r [m], shape (n, 3); NaN where there is no equilibrium on the branch."""
    status: NDArray[np.int8]
    """`TipStatus`, shape (n,)."""
    margin: Array
    """How far from the loss of stability, from 1 to below 0 [-], shape (n,)."""
    rung: NDArray[np.int8]
    """`Rung`, shape (n,)."""
    frame: Array
    """First axis of the world at the tip, as the base of the unloaded arm sees it, (n, 3); with
    loads of several directions also the second one, (n, 6)."""

    @classmethod
    def empty(cls, n: int, components: int) -> Equilibria:
        """Room for n."""
        return cls(
            np.full((n, 3), np.nan),
            np.full(n, TipStatus.NO_EQUILIBRIUM, np.int8),
            np.full(n, np.nan),
            np.full(n, Rung.NONE, np.int8),
            np.zeros((n, components)),
        )

    def of(self, rows: slice | NDArray[np.bool_ | np.intp]) -> Equilibria:
        """Some of them; a slice shares memory."""
        tips, status, margin, rung, frame = self
        return Equilibria(tips[rows], status[rows], margin[rows], rung[rows], frame[rows])


class Response(NamedTuple):
    """How tips answer to activations and forces."""

    tips: Array
    """r [m], shape (n, 3)."""
    twists: Array
    """(v, ω) per activation, shape (n, 6, bundles)."""
    compliance: Array
    """∂r/∂F [m/N], shape (n, 3, 3), or (0, 3, 3)."""
    directions: Array
    """Tangents d3 of the tips [-], shape (n, 3), or (0, 3)."""
    status: NDArray[np.int8]
    """`TipStatus`, shape (n,)."""
