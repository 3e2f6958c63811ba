"""Rods shot from the tip: the kernels of loaded rods, and their results by name."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.kernels.loaded import shooting as kernels
from softreach.kernels.loaded.response import TRACE, respond
from softreach.rod.loaded.tables import LoadTables, StepTables
from softreach.rod.tip_map import TipStatus

Array = NDArray[np.float64]


ALL_LOADS = np.ones(1)


class Shots(NamedTuple):
    """Ends of searches."""

    tips: Array
    """r [m], shape (n, 3)."""
    frame: Array
    """As in `Equilibria`."""
    margin: Array
    """Of stability [-], shape (n,)."""
    is_found: NDArray[np.bool_]
    """Mask of those that are equilibria, shape (n,)."""

    def of(self, rows: NDArray[np.bool_ | np.intp]) -> Shots:
        """Some of them."""
        return Shots(self.tips[rows], self.frame[rows], self.margin[rows], self.is_found[rows])

    def put(self, rows: NDArray[np.intp], others: Shots) -> None:
        """Replace some of them."""
        for values, new in zip(self, others, strict=True):
            values[rows] = new


class Search(NamedTuple):
    """Settings of a search by the kernels."""

    widest: float
    """Longest first Newton step that is trusted [rad]."""
    small: float
    """Newton step from which on chord steps do [rad]."""
    walks: tuple[int, int]
    """Walks allowed, with tangents and without."""


QUICK = Search(1.2, 5e-3, (5, 12))
"""From a start that is near."""
CAREFUL = Search(1.2, 1e-3, (8, 12))
"""To follow a branch, also where it is about to end."""
MARGIN_ALONE = Search(np.inf, np.inf, (1, 0))
"""One walk from where it is."""


class Walked(NamedTuple):
    """What arms in equilibrium say, where it is asked for."""

    slopes: Array
    """(v, ω) of the tips per activation, shape (n, 6, bundles) or (0, 6, bundles)."""
    compliance: Array
    """∂r/∂F [m/N], shape (n, 3, 3) or (0, 3, 3)."""
    trace: Array
    """Sections between steps, tip first, shape (n, step + 1, `TRACE`) or (0, step + 1, `TRACE`)."""


def shoot(
    gamma: Array,
    tables: LoadTables,
    guesses: Array | None,
    steps: StepTables,
    tiny: float,
    search: Search = CAREFUL,
    shares: Array = ALL_LOADS,
) -> Shots:
    """Searches for equilibria; see `solve_directions`.

    Args:
        gamma: Activations, shape (n, bundles).
        tables: Of the arm.
        guesses: Frames as in `Equilibria`; None for those of the unloaded arm.
        steps: Its steps.
        tiny: Turn that may be left [rad].
        search: Settings.
        shares: Of the loads, shape (n,), or (1,) for all.
    """
    size = tables.frame_size
    out = np.empty((len(gamma), 5 + size))
    solve = kernels.solve_directions if tables.one_direction else kernels.solve_frames
    given = np.zeros((0, size)) if guesses is None else np.ascontiguousarray(guesses)
    arm = _columns(gamma), tables.axes, tables.at_tip, given, tuple(steps)
    solve(
        *arm,
        (search.widest, search.small, tiny),
        search.walks,
        shares,
        out,
    )
    found = (out[:, -1] == kernels.FOUND) & np.isfinite(out[:, :-1]).all(axis=1)
    return Shots(out[:, :3], out[:, 3:-2], out[:, -2], found)


def walk(
    gamma: Array,
    tables: LoadTables,
    frames: Array,
    steps: StepTables,
    *,
    slopes: bool = False,
    compliance: bool = False,
    trace: bool = False,
) -> Walked:
    """One walk along arms in equilibrium; see `respond`."""
    n, columns = len(gamma), _columns(gamma)
    answers = (
        np.zeros((n if slopes else 0, 6, columns.shape[1])),
        np.zeros((n if compliance else 0, 3, 3)),
        np.zeros((n if trace else 0, len(steps.lengths) + 1, TRACE)),
    )
    respond(columns, tables.at_tip, np.ascontiguousarray(frames), tuple(steps), *answers)
    return Walked(answers[0][:, :, : gamma.shape[1]], *answers[1:])


def base_directions(
    gamma: Array, tables: LoadTables, directions: Array, steps: StepTables
) -> Array:
    """Directions of gravity at the base of one arm (1, bundles), for those at its tip, (n, 3)."""
    out = np.empty_like(directions)
    kernels.base_directions(_columns(gamma), tables.at_tip, directions, tuple(steps), out)
    return out


def _columns(gamma: Array) -> Array:
    """Activations for kernels, which want one bundle at least."""
    return gamma if gamma.shape[1] else np.zeros((len(gamma), 1))


class Equilibria(NamedTuple):
    """Equilibria of activations."""

    tips: Array
    """r [m], shape (n, 3); NaN where there is no equilibrium on the branch."""
    status: NDArray[np.int8]
    """`TipStatus`, shape (n,)."""
    margin: Array
    """Margin of stability, from 1 to below 0 [-], shape (n,)."""
    frame: Array
    """First axis of the world at the nodes, tip first, as the base of the unloaded arm sees it,
    (n, 3 node); with loads of several directions also the second one, (n, 6 node)."""

    @classmethod
    def empty(cls, n: int, components: int) -> Equilibria:
        """Room for n."""
        return cls(
            np.full((n, 3), np.nan),
            np.full(n, TipStatus.UNDECIDED, np.int8),
            np.full(n, np.nan),
            np.zeros((n, components)),
        )

    def of(self, rows: slice | NDArray[np.bool_ | np.intp]) -> Equilibria:
        """Some of them; a slice shares memory."""
        tips, status, margin, frame = self
        return Equilibria(tips[rows], status[rows], margin[rows], frame[rows])


class Response(NamedTuple):
    """Derivatives of tips along activations and forces."""

    tips: Array
    """r [m], shape (n, 3)."""
    twists: Array
    """(v, ω) per activation, shape (n, 6, bundles)."""
    compliance: Array
    """∂r/∂F [m/N], shape (n, 3, 3), or (0, 3, 3)."""
    directors: Array
    """Directors of the tips as rows [-], shape (n, 3, 3), or (0, 3, 3)."""
    status: NDArray[np.int8]
    """`TipStatus`, shape (n,)."""


def units(frames: Array) -> Array:
    """Frames whose directions have unit length."""
    axes = frames.reshape(len(frames), frames.shape[1] // 3, 3)
    size = np.linalg.norm(axes, axis=2, keepdims=True)
    return (axes / np.maximum(size, 1e-300)).reshape(frames.shape)


def turn_between(frames: Array, others: Array) -> Array:
    """The largest change of a direction [rad], shape (n,)."""
    change = (frames - others).reshape(len(frames), frames.shape[1] // 3, 3)
    return np.sqrt(np.einsum("nki,nki->nk", change, change).max(axis=1))
