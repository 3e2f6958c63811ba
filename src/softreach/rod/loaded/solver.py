"""The equilibria of a loaded rod at many activations: a ladder of ever more patient searches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from softreach.arm.tables import tables
from softreach.kernels.loaded.any_loads import TRACE
from softreach.kernels.loaded.grid_values import interpolate
from softreach.rod.activation_box import ActivationBox
from softreach.rod.free import linear_strains
from softreach.rod.loaded.shapes import Shapes, shapes_of
from softreach.rod.loaded.shooting import (
    CONTINUATION,
    DIRECT,
    NEAR,
    ONE_WALK,
    PATIENT,
    Equilibria,
    Response,
    Rung,
    Search,
    Shots,
    Walked,
    base_directions,
    shoot,
    shoot_along_one,
    with_across,
)
from softreach.rod.loaded.tables import LoadTables, OneDirection, StepTables
from softreach.rod.steps import enough_for_all_breaks
from softreach.rod.tip_map import TipStatus, has_tip
from softreach.support import parallel
from softreach.support.lazy import lazy

Array = NDArray[np.float64]

_COARSE_STEP = 0.05  # Newton step at which coarse steps have done their work
_CAREFUL_STEP = 1e-3  # the same of a continuation, on fine steps
_NEAR_STEP = 1e-7  # Newton step that may be taken linearly
_DOUBTFUL = 0.02  # margin below which the tangents of coarse steps decide nothing
_OF_TOL = 1e-2  # what the search may use up of the tolerance
_FOUND, _ENDED = 1.0, 2.0  # states of searches
LATER_RUNGS = {Rung.CONTINUATION: CONTINUATION, Rung.PATIENT: PATIENT}
"""Searches of what the first rung leaves in doubt, in this order."""
_TRACED = 1 << 20  # numbers kept of the sections of all arms in one task, 8 MB
_NODES = {1: 33, 2: 33, 3: 17, 4: 9}
"""Nodes per free bundle: at most a few thousand equilibria, some ten milliseconds."""


@dataclass(frozen=True, eq=False)
class Solver:
    """Equilibria with a given number of steps.

    Args:
        tables: Of the arm and its loads.
        steps: Least number of steps, coarse ones apart; no fewer than the phase of the loads needs.
        tol: Largest tip error, in L, of which the search uses up a hundredth.
    """

    tables: LoadTables
    steps: int
    tol: float
    starts: StartGrid | None = None
    """Grid of equilibria to begin from."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "steps", max(self.steps, self.tables.phase.fewest_steps))

    def with_starts(self, box: ActivationBox) -> Solver:
        """The same, beginning from equilibria on a grid over the box where that is worth it."""
        sizes = grid_sizes(box)
        if sizes is None:
            return self
        grid = StartGrid.over(box, sizes, lambda gamma: self.find(gamma).frame)
        return Solver(self.tables, self.steps, self.tol, grid)

    @lazy
    def _fine(self) -> StepTables:
        return self.tables.uniform(self.steps)

    @lazy
    def _coarse(self) -> StepTables:
        fewest = self.tables.phase.fewest_steps
        return self.tables.uniform(max(fewest, (self.steps + 1) // 2))

    @lazy
    def _fine_along_one(self) -> OneDirection:
        return self._fine.for_one_direction

    @lazy
    def _coarse_along_one(self) -> OneDirection:
        return self._coarse.for_one_direction

    def halved(self) -> Solver:
        """The same with twice the steps."""
        return Solver(self.tables, 2 * self.steps, self.tol)

    def judge(self) -> Solver:
        """The same with twice the steps, or as many as let one end at every breakpoint."""
        steps = max(2 * self.steps, enough_for_all_breaks(self.tables.arm))
        return Solver(self.tables, steps, self.tol)

    def empty(self, n: int) -> Equilibria:
        """Room for n equilibria."""
        return Equilibria.empty(n, 3 if self.tables.one_direction else 6)

    def find(self, gamma: Array, *, patient: bool = True) -> Equilibria:
        """The equilibria of activations (n, bundles), on the calling thread.

        Args:
            gamma: Activations.
            patient: Whether to climb the last rung too.
        """
        equilibria = self.empty(len(gamma))
        self.direct(gamma, equilibria)
        for rung in LATER_RUNGS if patient else [Rung.CONTINUATION]:
            rows = self.doubtful(equilibria, rung)
            if len(rows):
                self.again(gamma, rows, rung, equilibria)
        return equilibria

    def direct(self, gamma: Array, equilibria: Equilibria) -> None:
        """The first rung, for all of some activations (n, bundles), on the calling thread."""
        guesses = None if self.starts is None else self.starts.at(gamma)
        self._try(gamma, slice(None), DIRECT, Rung.DIRECT, equilibria, guesses)

    def doubtful(self, equilibria: Equilibria, rung: Rung) -> NDArray[np.intp]:
        """Rows that a later rung is to search again."""
        lost = ~has_tip(equilibria.status)
        least = 0.0 if rung == Rung.PATIENT else _DOUBTFUL
        return np.flatnonzero(lost | (equilibria.margin < least))

    def again(
        self, gamma: Array, rows: NDArray[np.intp], rung: Rung, equilibria: Equilibria
    ) -> None:
        """A later rung, for some rows of all activations, on the calling thread."""
        self._try(gamma, rows, LATER_RUNGS[rung], rung, equilibria)

    def near(self, gamma: Array, known: Equilibria) -> Equilibria:
        """Equilibria near known ones of other steps."""
        equilibria = self.empty(len(gamma))
        self._try(gamma, slice(None), DIRECT, Rung.DIRECT, equilibria, known.frame)
        return equilibria

    def _try(
        self,
        gamma: Array,
        rows: slice | NDArray[np.intp],
        search: Search,
        rung: Rung,
        equilibria: Equilibria,
        guesses: Array | None = None,
    ) -> None:
        """Search at some rows, and put down what is found."""
        tips, frame, margin, state = self._shoot(gamma[rows], search, guesses)
        good = (state == _FOUND) & np.isfinite(tips).all(axis=1) & ~np.isnan(margin)
        stable = np.where(margin > 0, TipStatus.STABLE, TipStatus.UNSTABLE)
        equilibria.tips[rows] = np.where(good[:, None], tips, np.nan)
        equilibria.frame[rows], equilibria.margin[rows] = frame, margin
        none = np.where(state == _ENDED, TipStatus.NO_EQUILIBRIUM, TipStatus.UNDECIDED)
        equilibria.status[rows] = np.where(good, stable, none)
        equilibria.rung[rows] = np.where(good, rung, Rung.NONE)
        if self.tables.phase.squeeze >= 1.0:
            self._give_up_squeezed(gamma, rows, equilibria)

    def _give_up_squeezed(
        self, gamma: Array, rows: slice | NDArray[np.intp], equilibria: Equilibria
    ) -> None:
        """No arm is where ζ = ζ̂ + η n3/K0 is not positive: it would be turned inside out."""
        squeezed = np.arange(len(gamma))[rows]
        edges = self.tables.edges(np.array([]), self.steps)[::-1]
        z = self.tables.arm.profile.station(edges)
        force = self.shapes(gamma[squeezed], z, equilibria.of(squeezed)).force[..., 2]
        _, extension, growth = linear_strains(tables(self.tables.arm, z), gamma[squeezed])
        extension = extension + growth * force * self.tables.body.compliance(z)[0]
        squeezed = squeezed[(extension <= 0.0).any(axis=1)]
        equilibria.tips[squeezed] = np.nan
        equilibria.status[squeezed] = TipStatus.NO_EQUILIBRIUM
        equilibria.rung[squeezed] = Rung.NONE

    def _shoot(self, gamma: Array, search: Search, guesses: Array | None) -> Shots:
        """One search for each activation (n, bundles)."""
        # Coarse steps do for the first of Newton's method, but not to follow a branch.
        small = _COARSE_STEP if search is DIRECT else _CAREFUL_STEP
        limits = (search.increment, search.widest, small, max(_OF_TOL * self.tol, 1e-13))
        most = (search.walks, 10)
        if self.tables.one_direction:
            fine = self._fine_along_one
            coarse = self._coarse_along_one if search is DIRECT else fine
            return shoot_along_one(gamma, self.tables, guesses, coarse, fine, limits, most)
        coarse, fine = self._coarse if search is DIRECT else self._fine, self._fine
        return shoot(gamma, self.tables.axes, guesses, coarse, fine, (*limits, 0.0), most).shots

    def base_directions(self, gamma: Array, directions: Array) -> Array:
        """Directions of gravity at the base of one arm (1, bundles), for those at its tip, (n, 3).

        Both as the base of the unloaded arm sees them; loads along one direction only.
        """
        return base_directions(gamma, self.tables, directions, self._fine_along_one)

    def shapes_facing(
        self, gamma: Array, directions: Array, stations: Array
    ) -> tuple[Shapes, Array]:
        """Shapes of arms whose tips see gravity along given directions, and their margins.

        Nothing is searched: the directions (n, 3), as in `base_directions`, are those of equilibria
        of loads along one direction.
        """
        edges = self.tables.edges(stations, self.steps)
        z = self.tables.arm.profile.station(edges)
        is_uniform = len(edges) == len(self._fine.lengths) + 1  # stations at ends of steps alone
        table = self._fine if is_uniform else self.tables.of_edges(edges)
        rows = np.abs(z[None] - np.append(stations, 0.0)[:, None]).argmin(axis=1)
        walked = self._walk(gamma, with_across(directions), table, ONE_WALK, trace=True)
        at, nowhere = np.zeros((len(gamma), 3)), np.full(len(rows), np.nan)
        shapes = shapes_of(at, walked.trace, rows, self._force_at(table, rows), nowhere)
        return shapes.on_base(), walked.shots.margin

    def _walk(
        self, gamma: Array, frames: Array, table: StepTables, search: Search, **outputs: bool
    ) -> Walked:
        """Newton steps from frames of tips (n, 6), with whatever more is asked for."""
        axial = float(self.tables.one_direction)
        limits = (search.increment, search.widest, _NEAR_STEP, 0.0, axial)
        return shoot(
            gamma, self.tables.axes, frames, table, table, limits, (search.walks, 0), **outputs
        )

    def _near(self, gamma: Array, known: Equilibria, table: StepTables, **outputs: bool) -> Walked:
        """The last walk again, from known equilibria, with whatever more is asked for."""
        lost, frame = ~has_tip(known.status), known.frame
        if lost.any():  # none waits for what is not there: a known one is walked in its place
            rows = np.where(lost, lost.argmin(), np.arange(len(gamma)))
            gamma, frame = gamma[rows], frame[rows]
        frames = with_across(frame) if self.tables.one_direction else frame
        walked = self._walk(gamma, frames, table, NEAR, **outputs)
        lost |= walked.shots.state != _FOUND
        for values in (walked.shots.tips, walked.slopes, walked.compliance):
            if len(values):
                values[lost] = np.nan
        return walked

    def respond(
        self,
        gamma: Array,
        *,
        compliance: bool = False,
        directions: bool = False,
        known: Equilibria | None = None,
    ) -> Response:
        """Tips with their derivatives, theory (74); NaN where there is no equilibrium."""
        known, fine = self.find(gamma) if known is None else known, self._fine
        walked = self._near(
            gamma, known, fine, slopes=True, compliance=compliance, trace=directions
        )
        tips, twists = walked.shots.tips.copy(), walked.slopes
        lost = np.isnan(tips[:, 0])
        # An equilibrium that was found and not found again is in doubt, not gone.
        status = np.where(lost & has_tip(known.status), TipStatus.UNDECIDED, known.status)
        d3 = np.empty((0, 3))
        if directions:
            rows, at_tip = np.zeros(1, np.intp), np.array([self.tables.arm.length])
            shapes = shapes_of(tips, walked.trace, rows, self._force_at(fine, rows), at_tip)
            d3 = shapes.frames.directors[:, 0, 2]
        return Response(tips, twists, walked.compliance, d3, status.astype(np.int8))

    def shapes(
        self,
        gamma: Array,
        stations: Array,
        known: Equilibria | None = None,
        *,
        status: NDArray[np.int8] | None = None,
    ) -> Shapes:
        """Arms at ascending stations Z [m]; NaN where there is no equilibrium.

        Args:
            gamma: Activations (n, bundles).
            stations: Ascending Z [m].
            known: Their equilibria, with these steps or others.
            status: Room for the `TipStatus` of each, shape (n,).
        """
        edges = self.tables.edges(stations, self.steps)
        table, z = self.tables.of_edges(edges), self.tables.arm.profile.station(edges)
        rows = np.abs(z[None] - stations[:, None]).argmin(axis=1)
        shapes = Shapes.empty(len(gamma), len(stations))

        def fill(block: slice) -> None:
            equilibria = self.find(gamma[block]) if known is None else known.of(block)
            walked = self._near(gamma[block], equilibria, table, trace=True)
            tips, force = walked.shots.tips, self._force_at(table, rows)
            shapes.put(block, shapes_of(tips, walked.trace, rows, force, stations))
            if status is not None:
                status[block] = equilibria.status

        size = max(1, _TRACED // (len(edges) * TRACE))
        parallel.run(partial(fill, block) for block in parallel.blocks(len(gamma), size))
        return shapes

    def _force_at(self, table: StepTables, rows: NDArray[np.intp]) -> Array:
        """Dead force at boundaries along the world's axes, as the step beyond has it, (row, 3)."""
        at_ends = np.concatenate([table.scalars[:1, 0, 3:], table.scalars[:, -1, 3:]])
        return at_ends[rows]


def grid_sizes(box: ActivationBox) -> tuple[int, ...] | None:
    """Nodes for every bundle, or None for more free bundles than a grid can hold."""
    nodes = _NODES.get(box.dimension)
    if nodes is None:
        return None
    return tuple(nodes if free else 1 for free in box.is_free)


@dataclass(frozen=True, eq=False)
class StartGrid:
    """Frames of the tip at the nodes of a grid."""

    box: ActivationBox
    sizes: tuple[int, ...]
    frames: Array
    """`Equilibria.frame` of the nodes."""

    @classmethod
    def over(
        cls, box: ActivationBox, sizes: tuple[int, ...], find: Callable[[Array], Array]
    ) -> StartGrid:
        """Solve at the nodes.

        Args:
            box: The activations within bounds.
            sizes: Nodes for every bundle.
            find: Frames of activations (n, bundles).
        """
        ends = zip(box.low, box.high, sizes, strict=True)
        axes = np.meshgrid(*(np.linspace(*end) for end in ends), indexing="ij")
        return cls(box, sizes, find(np.stack(axes, axis=-1).reshape(-1, box.bundles)))

    def at(self, gamma: Array) -> Array:
        """Frames to begin from."""
        sizes = np.array(self.sizes)
        frames = np.empty((len(gamma), self.frames.shape[1]))
        interpolate(self.frames, gamma, self.box.low, (sizes - 1) / self.box.scales, sizes, frames)
        return frames
