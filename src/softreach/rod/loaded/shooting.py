"""Rods shot from the tip: the kernels of loaded rods, and their results by name."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softreach.arm.base import rotation_matrices
from softreach.kernels.loaded import shooting as kernels
from softreach.kernels.loaded.response import TRACE, respond
from softreach.rod.loaded.tables import LoadTables, StepTables
from softreach.rod.tip_map import Frames, Status, TipStatus, has_tip
from softreach.support.arrays import Array, Index, Mask

ALL_LOADS = np.ones(1)
_WIDEST = 1.2  # [rad], longest first step of Newton's method that is trusted
_SMALL = 2e-3  # [rad], step from which on chord steps do
_WALKS = 8, 12  # allowed, with tangents and without


class Equilibria(NamedTuple):
    """Equilibria of activations, one for each, and where the search for one ended."""

    tips: Array
    """r [m], shape (n, 3); NaN where there is no equilibrium on the branch."""
    status: Status
    """`TipStatus`, shape (n,)."""
    margin: Array
    """Margin of stability, from 1 to below 0 [-], shape (n,)."""
    frame: Array
    """First axis of the world at the nodes, tip first, as the base of the unloaded arm sees it,
    (n, 3 node); with loads of several directions also the second one, (n, 6 node)."""

    @property
    def is_found(self) -> Mask:
        """Mask of those that are equilibria, stable or not, shape (n,)."""
        return has_tip(self.status)

    @property
    def is_stable(self) -> Mask:
        """Mask of those that are stable equilibria, shape (n,)."""
        return np.asarray(self.status == TipStatus.STABLE)

    def of(self, rows: slice | Mask | Index) -> Equilibria:
        """Some of them; a slice shares memory."""
        tips, status, margin, frame = self
        return Equilibria(tips[rows], status[rows], margin[rows], frame[rows])

    def put(self, rows: slice | Index, others: Equilibria) -> None:
        """Replace some of them."""
        for values, new in zip(self, others, strict=True):
            values[rows] = new

    def only(self, good: Mask) -> Equilibria:
        """The same, undecided where they are not good."""
        return self._replace(status=np.where(good, self.status, np.int8(TipStatus.UNDECIDED)))


def shoot(
    gamma: Array,
    tables: LoadTables,
    guesses: Array | None,
    steps: StepTables,
    tiny: float,
    shares: Array = ALL_LOADS,
    *,
    margin_alone: bool = False,
) -> Equilibria:
    """Searches for equilibria; see `solve_directions`.

    Args:
        gamma: Activations, shape (n, bundles).
        tables: Of the arm.
        guesses: Frames as in `Equilibria`; None for those of the unloaded arm.
        steps: Its steps.
        tiny: Turn that may be left [rad].
        shares: Of the loads, shape (n,), or (1,) for all.
        margin_alone: Whether to walk along the guesses once, for their margins, as they are found.
    """
    size = tables.frame_size
    out = np.empty((len(gamma), 5 + size))
    solve = kernels.solve_directions if tables.one_direction else kernels.solve_frames
    given = np.zeros((0, size)) if guesses is None else np.ascontiguousarray(guesses)
    arm = _columns(gamma), tables.axes, tables.at_tip, given, tuple(steps)
    limits, walks = (_WIDEST, _SMALL, tiny), _WALKS
    if margin_alone:
        limits, walks = (np.inf, np.inf, tiny), (1, 0)
    solve(*arm, limits, walks, shares, out)
    margin = out[:, -2]
    status = np.where(margin > 0, TipStatus.STABLE, TipStatus.UNSTABLE).astype(np.int8)
    found = Equilibria(out[:, :3], status, margin, out[:, 3:-2])
    return found.only((out[:, -1] == kernels.FOUND) & np.isfinite(out[:, :-1]).all(axis=1))


def base_directions(
    gamma: Array, tables: LoadTables, directions: Array, steps: StepTables
) -> Array:
    """Directions of gravity at the base of one arm (1, bundles), for those at its tip, (n, 3)."""
    out = np.empty_like(directions)
    kernels.base_directions(_columns(gamma), tables.at_tip, directions, tuple(steps), out)
    return out


def walk(
    gamma: Array,
    tables: LoadTables,
    frames: Array,
    steps: StepTables,
    *,
    slopes: bool = False,
    compliance: bool = False,
    trace: bool = False,
) -> tuple[Array, Array, Array]:
    """One walk along arms in equilibrium; see `respond`.

    Returns:
        Where they are asked for, else of length 0: (v, ω) of the tips per activation, shape (n, 6,
        bundles); ∂r/∂F [m/N], shape (n, 3, 3); sections between steps, tip first, shape (n, step +
        1, `TRACE`).
    """
    n, columns = len(gamma), _columns(gamma)
    twists = np.zeros((n if slopes else 0, 6, columns.shape[1]))
    yields = np.zeros((n if compliance else 0, 3, 3))
    sections = np.zeros((n if trace else 0, len(steps.lengths) + 1, TRACE))
    walked = columns, tables.at_tip, np.ascontiguousarray(frames), tuple(steps)
    respond(*walked, twists, yields, sections)
    return twists[:, :, : gamma.shape[1]], yields, sections


def _columns(gamma: Array) -> Array:
    """Activations for kernels, which want one bundle at least."""
    return gamma if gamma.shape[1] else np.zeros((len(gamma), 1))


class Response(NamedTuple):
    """Derivatives of tips along activations and forces."""

    twists: Array
    """(v, ω) per activation, shape (n, 6, bundles)."""
    compliance: Array
    """∂r/∂F [m/N], shape (n, 3, 3), or (0, 3, 3)."""
    directors: Array
    """Directors of the tips as rows [-], shape (n, 3, 3), or (0, 3, 3)."""


def units(frames: Array) -> Array:
    """Frames whose directions have unit length."""
    axes = frames.reshape(len(frames), frames.shape[1] // 3, 3)
    size = np.linalg.norm(axes, axis=2, keepdims=True)
    return (axes / np.maximum(size, 1e-300)).reshape(frames.shape)


def turn_between(frames: Array, others: Array) -> Array:
    """The largest change of a direction [rad], shape (n,)."""
    change = (frames - others).reshape(len(frames), frames.shape[1] // 3, 3)
    return np.sqrt(np.einsum("nki,nki->nk", change, change).max(axis=1))


class LoadedShapes(NamedTuple):
    """Arms at stations."""

    frames: Frames
    moment: Array
    """m [N m] in the directors, shape (n, station, 3)."""
    force: Array
    """n [N] in the directors, shape (n, station, 3)."""

    @classmethod
    def empty(cls, n: int, stations: int) -> LoadedShapes:
        """Room for n."""
        position, moment, force = np.empty((3, n, stations, 3))
        return cls(Frames(position, np.empty((n, stations, 3, 3))), moment, force)

    def put(self, rows: slice, some: LoadedShapes) -> None:
        """Put some into place."""
        self.frames.position[rows], self.frames.directors[rows] = some.frames
        self.moment[rows], self.force[rows] = some.moment, some.force

    def on_base(self) -> LoadedShapes:
        """Moved and turned so that their last station stands on the base, and without it."""
        (position, directors), moment, force = self
        turn = np.swapaxes(directors[:, -1], -1, -2)
        position, directors = (position - position[:, -1:]) @ turn, directors @ turn[:, None]
        frames = Frames(position[:, :-1], directors[:, :-1])
        return LoadedShapes(frames, moment[:, :-1], force[:, :-1])


def shapes_of(
    tips: Array, trace: Array, rows: Index, force: Array, stations: Array
) -> LoadedShapes:
    """Shapes from what the kernel keeps of sections; NaN where a tip is.

    Args:
        tips: r [m], shape (n, 3).
        trace: Of all boundaries of steps, tip first, as `respond` fills it.
        rows: The boundary of each station.
        force: Dead force at the stations along the world's axes [N], shape (station, 3).
        stations: Z [m].
    """
    axes = _world(trace[:, -1])[:, None]
    trace = trace[:, rows]
    world, turn = _world(trace), rotation_matrices(trace[..., 12:16])
    directors = np.swapaxes(world, -1, -2) @ axes
    back = _rows(trace[..., 9:12], turn) @ np.swapaxes(world, -1, -2) @ axes
    position = tips[:, None] - back[..., 0, :]
    position[:, stations == 0.0] = 0.0
    directors[:, stations == 0.0] = np.eye(3)
    moment = _rows(trace[..., 6:9], turn)[..., 0, :]
    thrust = _rows(force + trace[..., 16:19], world)[..., 0, :]
    for values in (position, directors, moment, thrust):
        values[np.isnan(tips).any(axis=1)] = np.nan
    return LoadedShapes(Frames(position, directors), moment, thrust)


def _rows(vectors: Array, matrices: Array) -> Array:
    """Row vectors times matrices, shape (..., 1, 3)."""
    return vectors[..., None, :] @ matrices


def _world(trace: Array) -> Array:
    """Axes of the world in the directors of sections, as rows, shape (..., 3, 3)."""
    return _orthonormal(trace[..., 0:3], trace[..., 3:6]) @ rotation_matrices(trace[..., 12:16])


def _orthonormal(g: Array, h: Array) -> Array:
    """Axes of the world in the frame of the walk, without the errors of the steps."""
    g = g / np.linalg.norm(g, axis=-1, keepdims=True)
    h = h - (g * h).sum(axis=-1, keepdims=True) * g
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    return np.stack([g, h, np.cross(g, h)], axis=-2)
