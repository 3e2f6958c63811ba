"""The equilibria of a loaded rod at many activations: a ladder of ever more patient searches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach import parallel
from softreach.kernels import loaded, loaded_general
from softreach.rod.activation_box import ActivationBox
from softreach.rod.load_tables import LoadTables, StepTables
from softreach.rod.start_grid import StartGrid, grid_sizes
from softreach.rod.tip_map import Frames, TipStatus

__all__ = ["Equilibria", "Response", "Rung", "Shapes", "Solver"]

Array = NDArray[np.float64]


class Rung(IntEnum):
    """How an equilibrium was found."""

    DIRECT = 0
    """Newton's method, all load at once."""
    CONTINUATION = 1
    """The load grown in steps along the branch."""
    PATIENT = 2
    """The same in steps an order smaller."""
    NONE = 3
    """Not found: the branch ends before all of the load is on."""


class _Search(NamedTuple):
    """How boldly the kernels search."""

    increment: float
    """First share of the load to try."""
    widest: float
    """Longest first Newton step that is trusted [rad]."""
    walks: int
    """Walks allowed."""


# An arm that jumps to another branch on its way lands on an unstable one (design/loaded_rod.md);
# so whatever is not found stable is searched again, more patiently. Where an arm almost buckles to
# either side, only the last search follows it to the side to which it leans.
_DIRECT = _Search(1.0, 1.2, 7)
_CONTINUATION = _Search(0.25, 0.1, 400)
_PATIENT = _Search(1 / 64, 0.03, 2000)
_COARSE_STEP = 0.05  # Newton step at which coarse steps have done their work
_DOUBTFUL = 0.02  # margin below which the tangents of coarse steps decide nothing
_OF_TOL = 1e-2  # what the search may use up of the tolerance
_FOUND = 1.0
_TRACED = 1 << 20  # numbers kept of the sections of all arms in one task, 8 MB


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

    def of(self, rows: slice | NDArray[np.bool_]) -> Equilibria:
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
    status: NDArray[np.int8]
    """`TipStatus`, shape (n,)."""

    @classmethod
    def empty(cls, n: int, bundles: int, *, compliance: bool) -> Response:
        """Room for n."""
        forces = n if compliance else 0
        twists, yields = np.empty((n, 6, bundles)), np.empty((forces, 3, 3))
        return cls(np.empty((n, 3)), twists, yields, np.empty(n, np.int8))


class Shapes(NamedTuple):
    """Arms at stations."""

    frames: Frames
    moment: Array
    """m [N m] in the directors, shape (n, station, 3)."""
    force: Array
    """n [N] in the directors, shape (n, station, 3)."""

    @classmethod
    def empty(cls, n: int, stations: int) -> Shapes:
        """Room for n."""
        position, moment, force = np.empty((3, n, stations, 3))
        return cls(Frames(position, np.empty((n, stations, 3, 3))), moment, force)

    def put(self, rows: slice, some: Shapes) -> None:
        """Put some into place."""
        self.frames.position[rows], self.frames.directors[rows] = some.frames
        self.moment[rows], self.force[rows] = some.moment, some.force


@dataclass(frozen=True, eq=False)
class Solver:
    """Equilibria with a given number of steps.

    Args:
        tables: Of the arm and its loads.
        steps: Least number of steps.
        tol: Largest tip error, in L, of which the search uses up a hundredth.
    """

    tables: LoadTables
    steps: int
    tol: float
    starts: StartGrid | None = None
    """Where to begin."""

    def with_starts(self, box: ActivationBox) -> Solver:
        """The same, beginning from equilibria on a grid over the box where that is worth it."""
        sizes = grid_sizes(box)
        if sizes is None:
            return self
        grid = StartGrid.over(box, sizes, lambda gamma: self.find(gamma).frame)
        return Solver(self.tables, self.steps, self.tol, grid)

    @cached_property
    def _fine(self) -> StepTables:
        return self.tables.uniform(self.steps)

    @cached_property
    def _coarse(self) -> StepTables:
        return self.tables.uniform(max(2, (self.steps + 1) // 2))

    def halved(self) -> Solver:
        """The same with twice the steps."""
        return Solver(self.tables, 2 * self.steps, self.tol)

    def task(self, gamma: Array, found: Equilibria) -> Callable[[], None]:
        """The work of filling `found`, to be run on any thread."""
        return partial(self._fill, gamma, found)

    def empty(self, n: int) -> Equilibria:
        """Room for n equilibria."""
        return Equilibria.empty(n, 3 if self.tables.one_direction else 6)

    def find(self, gamma: Array) -> Equilibria:
        """The equilibria of activations (n, bundles), on the calling thread."""
        found = self.empty(len(gamma))
        self._fill(gamma, found)
        return found

    def near(self, gamma: Array, known: Equilibria) -> Equilibria:
        """Equilibria near known ones of other steps."""
        found = self.empty(len(gamma))
        self._try(gamma, slice(None), _DIRECT, Rung.DIRECT, found, known.frame)
        return found

    def slowly(self, gamma: Array) -> Equilibria:
        """Equilibria found by the most patient continuation alone."""
        found = self.empty(len(gamma))
        self._try(gamma, slice(None), _PATIENT, Rung.PATIENT, found)
        return found

    def _fill(self, gamma: Array, found: Equilibria) -> None:
        guesses = None if self.starts is None else self.starts.at(gamma)
        self._try(gamma, slice(None), _DIRECT, Rung.DIRECT, found, guesses)
        for search, rung in ((_CONTINUATION, Rung.CONTINUATION), (_PATIENT, Rung.PATIENT)):
            lost = found.status == TipStatus.NO_EQUILIBRIUM
            least = 0.0 if rung == Rung.PATIENT else _DOUBTFUL
            rest = np.flatnonzero(lost | (found.margin < least))
            if len(rest):
                self._try(gamma, rest, search, rung, found)

    def _try(
        self,
        gamma: Array,
        rows: slice | NDArray[np.intp],
        search: _Search,
        rung: Rung,
        found: Equilibria,
        guesses: Array | None = None,
    ) -> None:
        """Search at some rows, and put down what is found."""
        of_kind = self._along_one if self.tables.one_direction else self._in_general
        self._put(found, rows, rung, *of_kind(_columns(gamma[rows]), search, guesses))

    def _put(
        self,
        found: Equilibria,
        rows: slice | NDArray[np.intp],
        rung: Rung,
        tips: Array,
        frame: Array,
        margin: Array,
        state: Array,
    ) -> None:
        """Put down what a search found at some rows."""
        good = state == _FOUND
        stable = np.where(margin > 0, TipStatus.STABLE, TipStatus.UNSTABLE)
        found.tips[rows] = np.where(good[:, None], tips, np.nan)
        found.frame[rows], found.margin[rows] = frame, margin
        found.status[rows] = np.where(good, stable, TipStatus.NO_EQUILIBRIUM)
        found.rung[rows] = np.where(good, rung, Rung.NONE)

    def _along_one(self, gamma: Array, search: _Search, guesses: Array | None):
        return self._one(gamma, search, guesses)[:4]

    def _one(self, gamma: Array, search: _Search, guesses: Array | None):
        fine = self._fine.for_one_direction
        direct = search is _DIRECT
        coarse = self._coarse.for_one_direction if direct else fine
        tiny = max(_OF_TOL * self.tol, 1e-13)
        small = _COARSE_STEP if direct else min(_COARSE_STEP, 1e-3)
        out = np.empty((len(gamma), 10))
        loaded.solve(
            gamma,
            self.tables.axes[0],
            self.tables.at_tip,
            np.zeros((0, 3)) if guesses is None else guesses,
            coarse,
            fine,
            (search.increment, search.widest, small, tiny),
            (search.walks, 10),
            out,
        )
        return out[:, :3], out[:, 3:6], out[:, 6], out[:, 7], out[:, 9]

    def base_directions(self, gamma: Array, directions: Array) -> Array:
        """What the base of one arm (1, bundles) must see of gravity, for what its tip sees, (n, 3).

        Both as the base of the unloaded arm sees them; loads along one direction only.
        """
        out = np.empty_like(directions)
        fine = self._fine.for_one_direction
        loaded.base_directions(_columns(gamma), self.tables.at_tip, directions, fine, out)
        return out

    def polished(self, gamma: Array, directions: Array) -> tuple[Equilibria, Array]:
        """Equilibria of one arm near directions G(L), and the sign of each: -1 to its index."""
        found = self.empty(len(directions))
        many = np.repeat(_columns(gamma), len(directions), axis=0)
        tips, frame, margin, state, sign = self._one(many, _POLISH, directions)
        self._put(found, slice(None), Rung.DIRECT, tips, frame, margin, state)
        return found, np.sign(sign)

    def _whole(self, frame: Array) -> Array:
        """Both axes; the second is turned as the first one is, by the shortest way."""
        if frame.shape[1] == 6:
            return frame
        first = frame
        g, h = self.tables.axes[0], self.tables.axes[1]
        axis, cosine = np.cross(g, first), first @ g
        along = axis @ h
        safe = np.maximum(1.0 + cosine, 1e-6)
        turned = cosine[:, None] * h + np.cross(axis, h) + (along / safe)[:, None] * axis
        turned -= (turned * first).sum(axis=1, keepdims=True) * first
        turned /= np.maximum(np.linalg.norm(turned, axis=1, keepdims=True), 1e-12)
        return np.concatenate([first, turned], axis=1)

    def _in_general(self, gamma: Array, search: _Search, guesses: Array | None):
        found = self._general(gamma, self._fine, search, guesses)[0]
        return found[:, :3], found[:, 3:9], found[:, 9], found[:, 10]

    def _general(
        self,
        gamma: Array,
        table: StepTables,
        search: _Search,
        guesses: Array | None,
        *,
        slopes: bool = False,
        compliance: bool = False,
        trace: bool = False,
    ) -> tuple[Array, Array, Array, Array]:
        n, steps = len(gamma), len(table.lengths)
        found = np.empty((n, 12))
        twists = np.zeros((n if slopes else 0, 6, gamma.shape[1]))
        yields = np.zeros((n if compliance else 0, 3, 3))
        traced = np.zeros((n if trace else 0, steps + 1, loaded_general.TRACE))
        loaded_general.solve(
            gamma,
            self.tables.axes,
            table.jumps,
            np.zeros((0, 6)) if guesses is None else guesses,
            (table.pieces, table.lengths, table.scalars, table.bends),
            (search.increment, search.widest, 1e-5),
            search.walks,
            found,
            twists,
            yields,
            traced,
        )
        return found, twists, yields, traced

    def respond(self, gamma: Array, *, compliance: bool = False) -> Response:
        """Tips with their derivatives; NaN where there is no equilibrium."""
        known = self.find(gamma)
        found, twists, yields, _ = self._general(
            _columns(gamma),
            self._fine,
            _NEAR,
            self._whole(known.frame),
            slopes=True,
            compliance=compliance,
        )
        lost = (known.status == TipStatus.NO_EQUILIBRIUM) | (found[:, 10] != _FOUND)
        tips = found[:, :3].copy()
        for values in (tips, twists, yields):
            if len(values):
                values[lost] = np.nan
        in_base = yields @ self.tables.axes if compliance else yields
        status = np.where(lost, TipStatus.NO_EQUILIBRIUM, known.status).astype(np.int8)
        return Response(tips, twists[:, :, : gamma.shape[1]], in_base, status)

    def shapes(self, gamma: Array, stations: Array) -> Shapes:
        """Arms at ascending stations Z [m]; NaN where there is no equilibrium."""
        edges = self.tables.edges(stations, self.steps)
        table, z = self.tables.of_edges(edges), self.tables.arm.profile.station(edges)
        rows = np.abs(z[None] - stations[:, None]).argmin(axis=1)
        shapes = Shapes.empty(len(gamma), len(stations))

        def fill(block: slice) -> None:
            shapes.put(block, self._shapes_of(gamma[block], stations, table, rows))

        size = max(1, _TRACED // (len(edges) * loaded_general.TRACE))
        parallel.run(partial(fill, block) for block in parallel.blocks(len(gamma), size))
        return shapes

    def _shapes_of(
        self, gamma: Array, stations: Array, table: StepTables, rows: NDArray[np.intp]
    ) -> Shapes:
        """Arms at stations, which are these boundaries of the steps; on the calling thread."""
        known = self.find(gamma)
        found, _, _, trace = self._general(
            _columns(gamma), table, _NEAR, self._whole(known.frame), trace=True
        )
        lost = (known.status == TipStatus.NO_EQUILIBRIUM) | (found[:, 10] != _FOUND)
        return _shapes(
            found[:, :3], trace[:, rows], self._force_at(table, rows), stations, lost, self.tables
        )

    def _force_at(self, table: StepTables, rows: NDArray[np.intp]) -> Array:
        """Dead force at boundaries along the world's axes, as the step beyond has it, (row, 3)."""
        at_ends = np.concatenate([table.scalars[:1, 0, 3:], table.scalars[:, -1, 3:]])
        return at_ends[rows]


# From a known equilibrium: only the rotation about gravity may be far off.
_NEAR = _Search(1.0, 4.0, 12)
_POLISH = _Search(1.0, 0.3, 10)


def _columns(gamma: Array) -> Array:
    """Activations for kernels, which want one bundle at least."""
    return gamma if gamma.shape[1] else np.zeros((len(gamma), 1))


def _shapes(
    tips: Array,
    trace: Array,
    force: Array,
    stations: Array,
    lost: NDArray[np.bool_],
    tables: LoadTables,
) -> Shapes:
    """Shapes from what the kernel keeps of sections: axes, moment and tip as each sees them."""
    seen = _orthonormal(trace[..., 0:3], trace[..., 3:6])
    turn = _matrix(trace[..., 12:16])
    world = seen @ turn  # axes of the world in the directors
    directors = np.swapaxes(world, -1, -2) @ tables.axes
    back = np.einsum("nsac,nsc->nsa", seen, trace[..., 9:12]) @ tables.axes
    position = tips[:, None] - back
    position[:, stations == 0.0] = 0.0
    directors[:, stations == 0.0] = np.eye(3)
    moment = np.einsum("nsc,nscd->nsd", trace[..., 6:9], turn)
    follower = np.einsum("nsc,nscd->nsd", trace[..., 16:19], turn)
    thrust = np.einsum("sa,nsad->nsd", force, world) + follower
    for values in (position, directors, moment, thrust):
        values[lost] = np.nan
    return Shapes(Frames(position, directors), moment, thrust)


def _orthonormal(g: Array, h: Array) -> Array:
    """Axes of the world in the frame of the walk, without the errors of the steps."""
    g = g / np.linalg.norm(g, axis=-1, keepdims=True)
    h = h - (g * h).sum(axis=-1, keepdims=True) * g
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    return np.stack([g, h, np.cross(g, h)], axis=-2)


def _matrix(q: Array) -> Array:
    """Rotation matrices of unit quaternions, shape (..., 3, 3)."""
    w, x, y, z = np.moveaxis(q, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
