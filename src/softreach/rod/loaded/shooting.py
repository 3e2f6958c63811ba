"""Rods shot from the tip: the kernels of loaded rods, and their results by name."""

from __future__ import annotations

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.kernels.loaded import any_loads
from softreach.kernels.loaded import shooting as loaded
from softreach.rod.loaded.tables import LoadTables, OneDirection, StepTables
from softreach.rod.tip_map import TipStatus

Array = NDArray[np.float64]


class Shots(NamedTuple):
    """Ends of searches."""

    tips: Array
    """r [m], shape (n, 3)."""
    frame: Array
    """As in `Equilibria`, (n, 3) or (n, 6)."""
    margin: Array
    """Of stability [-], shape (n,)."""
    state: Array
    """0 not found, 1 found, 2 the branch has ended, 3 given up; shape (n,)."""


class Walked(NamedTuple):
    """Ends of searches under any loads, with derivatives and sections where these are wanted."""

    shots: Shots
    slopes: Array
    """(v, ω) of the tips per activation, shape (n, 6, bundles) or (0, 6, bundles)."""
    compliance: Array
    """∂r/∂F [m/N], shape (n, 3, 3) or (0, 3, 3)."""
    trace: Array
    """Sections between steps, tip first, shape (n, step + 1, `TRACE`) or (0, step + 1, `TRACE`)."""


def shoot_along_one(
    gamma: Array,
    tables: LoadTables,
    guesses: Array | None,
    coarse: OneDirection,
    fine: OneDirection,
    limits: tuple[float, ...],
    most: tuple[int, int],
) -> Shots:
    """Searches under loads along one direction; see `loaded.solve`."""
    out = np.empty((len(gamma), 8))
    loaded.solve(
        _columns(gamma),
        tables.axes[0],
        tables.at_tip,
        np.zeros((0, 3)) if guesses is None else guesses,
        coarse,
        fine,
        limits,
        most,
        out,
    )
    return Shots(out[:, :3], out[:, 3:6], out[:, 6], out[:, 7])


def shoot(
    gamma: Array,
    axes: Array,
    guesses: Array | None,
    coarse: StepTables,
    fine: StepTables,
    limits: tuple[float, ...],
    most: tuple[int, int],
    *,
    slopes: bool = False,
    compliance: bool = False,
    trace: bool = False,
) -> Walked:
    """Searches under any loads; see `any_loads.solve`."""
    n, columns = len(gamma), _columns(gamma)
    ends = np.empty((n, 11))
    answers = (
        np.zeros((n if slopes else 0, 6, columns.shape[1])),
        np.zeros((n if compliance else 0, 3, 3)),
        np.zeros((n if trace else 0, len(coarse.lengths) + 1, any_loads.TRACE)),
    )
    guessed = np.zeros((0, 6)) if guesses is None else guesses
    steps = tuple(coarse), tuple(fine)
    any_loads.solve(columns, axes, guessed, *steps, limits, most, ends, *answers)
    shots = Shots(ends[:, :3], ends[:, 3:9], ends[:, 9], ends[:, 10])
    return Walked(shots, answers[0][:, :, : gamma.shape[1]], *answers[1:])


def base_directions(
    gamma: Array, tables: LoadTables, directions: Array, fine: OneDirection
) -> Array:
    """Directions of gravity at the base of one arm (1, bundles), for those at its tip, (n, 3)."""
    out = np.empty_like(directions)
    loaded.base_directions(_columns(gamma), tables.at_tip, directions, fine, out)
    return out


def with_across(directions: Array) -> Array:
    """Directions (n, 3) with some unit vector normal to each: frames for `shoot`, (n, 6)."""
    rows, least = np.arange(len(directions)), np.abs(directions).argmin(axis=1)
    i, j = (least + 1) % 3, (least + 2) % 3
    a, b = directions[rows, i], directions[rows, j]
    size = np.sqrt(a * a + b * b)
    frames = np.zeros((len(directions), 6))
    frames[:, :3], frames[rows, 3 + i], frames[rows, 3 + j] = directions, b / size, -a / size
    return frames


def _columns(gamma: Array) -> Array:
    """Activations for kernels, which want one bundle at least."""
    return gamma if gamma.shape[1] else np.zeros((len(gamma), 1))


class Rung(IntEnum):
    """Search that found an equilibrium."""

    DIRECT = 0
    """Newton's method, all load at once."""
    CONTINUATION = 1
    """The load grown in steps along the branch."""
    PATIENT = 2
    """The same in steps an order smaller."""
    NONE = 3
    """Not found: the branch ends before all of the load is on, or was not followed so far."""


class Search(NamedTuple):
    """Settings of a search by the kernels."""

    increment: float
    """First share of the load to try."""
    widest: float
    """Longest first Newton step that is trusted [rad]."""
    walks: int
    """Walks allowed."""


# An arm that jumps to another branch on its way lands on an unstable one (design/loaded_rod.md);
# so whatever is not found stable is searched again, more patiently. Where an arm almost buckles to
# either side, only the last search follows it to the side to which it leans.
DIRECT = Search(1.0, 1.2, 7)
CONTINUATION = Search(0.25, 0.1, 400)
PATIENT = Search(1 / 64, 0.03, 2000)
# From a known equilibrium: only the rotation about gravity may be far off.
NEAR = Search(1.0, 4.0, 12)
# One walk from where it is.
ONE_WALK = Search(1.0, 4.0, 0)


class Equilibria(NamedTuple):
    """Equilibria of activations."""

    tips: Array
    """r [m], shape (n, 3); NaN where there is no equilibrium on the branch."""
    status: NDArray[np.int8]
    """`TipStatus`, shape (n,)."""
    margin: Array
    """Margin of stability, from 1 to below 0 [-], shape (n,)."""
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
    """Derivatives of tips along activations and forces."""

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
