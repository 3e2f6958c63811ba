"""The equilibria of a loaded rod at many activations."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from softreach.arm.base import rotation_matrices
from softreach.arm.tables import tables
from softreach.geometry.sphere_maps import Map
from softreach.kernels.loaded.response import TRACE
from softreach.rod.free import linear_strains
from softreach.rod.loaded.shooting import (
    ALL_LOADS,
    Equilibria,
    LoadedShapes,
    Response,
    base_directions,
    shapes_of,
    shoot,
    walk,
)
from softreach.rod.loaded.tables import LoadTables, StepTables
from softreach.rod.steps import enough_for_all_breaks
from softreach.rod.tip_map import TipStatus
from softreach.support import parallel
from softreach.support.arrays import Array, Index
from softreach.support.lazy import lazy

_OF_TOL = 1e-2  # what the search may use up of the tolerance
_TRACED = 1 << 20  # numbers kept of the sections of all arms in one task, 8 MB


@dataclass(frozen=True, eq=False)
class Solver:
    """Equilibria with a given number of steps.

    Args:
        tables: Of the arm and its loads.
        steps: Least number of steps; no fewer than the phase of the loads needs.
        tol: Largest tip error, in L, of which the search uses up a hundredth.
    """

    tables: LoadTables
    steps: int
    tol: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "steps", max(self.steps, self.tables.phase.fewest_steps))

    @lazy
    def _steps(self) -> StepTables:
        return self.tables.uniform(self.steps)

    def judge(self) -> Solver:
        """The same with twice the steps, or as many as let one end at every breakpoint."""
        steps = max(2 * self.steps, enough_for_all_breaks(self.tables.arm))
        return Solver(self.tables, steps, self.tol)

    def search(self, gamma: Array, guesses: Array | None, shares: Array = ALL_LOADS) -> Equilibria:
        """Searches under shares of the loads, from frames or from the unloaded arm."""
        tiny = max(_OF_TOL * self.tol, 1e-13)
        return shoot(gamma, self.tables, guesses, self._steps, tiny, shares)

    def empty(self, n: int) -> Equilibria:
        """Room for n equilibria."""
        tips, frame = np.full((n, 3), np.nan), np.zeros((n, self.tables.frame_size))
        return Equilibria(tips, np.full(n, TipStatus.UNDECIDED, np.int8), np.full(n, np.nan), frame)

    def near(self, gamma: Array, known: Equilibria) -> Equilibria:
        """Equilibria near known ones of other steps."""
        equilibria = self.empty(len(gamma))
        self.put(gamma, slice(None), self.search(gamma, known.frame), equilibria)
        return equilibria

    def put(
        self, gamma: Array, rows: slice | Index, found: Equilibria, equilibria: Equilibria
    ) -> None:
        """Put down what is found at some rows of all activations."""
        tips = np.where(found.is_found[:, None], found.tips, np.nan)
        equilibria.put(rows, found._replace(tips=tips))
        if self.tables.phase.squeeze >= 1.0:
            self._give_up_squeezed(gamma, np.arange(len(gamma))[rows], equilibria)

    def _give_up_squeezed(self, gamma: Array, rows: Index, equilibria: Equilibria) -> None:
        """No arm is where ζ = ζ̂ + η n3/K0 is not positive: it would be turned inside out."""
        edges = self.tables.edges(np.array([]), self.steps)[::-1]
        z = self.tables.arm.profile.station(edges)
        force = self.shapes(gamma[rows], z, equilibria.of(rows)).force[..., 2]
        _, extension, eta = linear_strains(tables(self.tables.arm, z), gamma[rows])
        extension = extension + eta * force * self.tables.body.compliance(z)[0]
        squeezed = rows[(extension <= 0.0).any(axis=1)]
        equilibria.tips[squeezed] = np.nan
        equilibria.status[squeezed] = TipStatus.NO_EQUILIBRIUM

    def base_map(self, gamma: Array) -> Map:
        """Map from directions of gravity at the tip of one arm (1, bundles) to those at its base.

        Both (n, 3) as the base of the unloaded arm sees them; loads along one direction only.
        """

        def image(points: Array) -> Array:  # steps do not keep the length
            directions = np.ascontiguousarray(points)
            images = base_directions(gamma, self.tables, directions, self._steps)
            return images / np.linalg.norm(images, axis=1, keepdims=True)

        return image

    def shapes_facing(
        self, gamma: Array, directions: Array, stations: Array
    ) -> tuple[LoadedShapes, Array]:
        """Shapes of arms whose tips see gravity along given directions, and their margins.

        Nothing is searched: the directions (n, 3), as in `base_map`, are those of equilibria
        of loads along one direction, of arms of one segment.
        """
        edges = self.tables.edges(stations, self.steps)
        z = self.tables.arm.profile.station(edges)
        is_uniform = len(edges) == len(self._steps.lengths) + 1  # stations at ends of steps alone
        table = self._steps if is_uniform else self.tables.of_edges(edges)
        rows = np.abs(z[None] - np.append(stations, 0.0)[:, None]).argmin(axis=1)
        trace = walk(gamma, self.tables, directions, table, trace=True)[2]
        margin = shoot(gamma, self.tables, directions, table, 0.0, margin_alone=True).margin
        at, nowhere = np.zeros((len(gamma), 3)), np.full(len(rows), np.nan)
        shapes = shapes_of(at, trace, rows, self._force_at(table, rows), nowhere)
        return shapes.on_base(), margin

    def frames_facing(self, gamma: Array, directions: Array) -> Array:
        """Frames, as in `Equilibria`, of arms whose tips see gravity along given directions."""
        whole = self._steps._replace(firsts=np.array([0, len(self._steps.lengths)]))
        trace = walk(gamma, self.tables.in_one_segment, directions, whole, trace=True)[2]
        seen = trace[:, self._steps.firsts[:-1], :3] @ rotation_matrices(trace[:, -1, 12:16])
        seen /= np.linalg.norm(seen, axis=2, keepdims=True)  # steps do not keep the length
        return seen.reshape(len(gamma), self.tables.frame_size)

    def respond(
        self,
        gamma: Array,
        known: Equilibria,
        *,
        compliance: bool = False,
        directors: bool = False,
    ) -> Response:
        """Derivatives of tips, theory (74); NaN where there is no equilibrium.

        Args:
            gamma: Activations (n, bundles).
            known: Their equilibria, with these steps.
            compliance: Whether to tell ∂r/∂F.
            directors: Whether to tell the directors of the tips.
        """
        lost = ~known.is_found
        rows = np.where(lost, lost.argmin(), np.arange(len(gamma)))  # none is walked in vain
        wanted = {"slopes": True, "compliance": compliance, "trace": directors}
        twists, yields, trace = walk(
            gamma[rows], self.tables, known.frame[rows], self._steps, **wanted
        )
        for values in (twists, yields):
            values[lost[: len(values)]] = np.nan
        if not directors:
            return Response(twists, yields, np.empty((0, 3, 3)))
        at, at_tip = np.zeros(1, int), np.array([self.tables.arm.length])
        shapes = shapes_of(known.tips, trace, at, self._force_at(self._steps, at), at_tip)
        return Response(twists, yields, shapes.frames.directors[:, 0])

    def shapes(self, gamma: Array, stations: Array, known: Equilibria) -> LoadedShapes:
        """Arms at ascending stations Z [m]; NaN where there is no equilibrium.

        Args:
            gamma: Activations (n, bundles).
            stations: Ascending Z [m].
            known: Their equilibria, with these steps or others.
        """
        edges = self.tables.edges(stations, self.steps)
        table, z = self.tables.of_edges(edges), self.tables.arm.profile.station(edges)
        rows = np.abs(z[None] - stations[:, None]).argmin(axis=1)
        force, shapes = self._force_at(table, rows), LoadedShapes.empty(len(gamma), len(stations))

        def fill(block: slice) -> None:
            tips, trace = self._traced(gamma[block], known.of(block), table)
            shapes.put(block, shapes_of(tips, trace, rows, force, stations))

        size = max(1, _TRACED // (len(edges) * TRACE))
        parallel.run(partial(fill, block) for block in parallel.blocks(len(gamma), size))
        return shapes

    def _traced(self, gamma: Array, known: Equilibria, table: StepTables) -> tuple[Array, Array]:
        """Tips and sections of arms near known ones on the steps of a table."""
        lost = ~known.is_found
        at = np.where(lost, lost.argmin(), np.arange(len(gamma)))
        found = shoot(gamma[at], self.tables, known.frame[at], table, 1e-12)
        trace = walk(gamma[at], self.tables, found.frame, table, trace=True)[2]
        return np.where((lost | ~found.is_found)[:, None], np.nan, found.tips), trace

    def _force_at(self, table: StepTables, rows: Index) -> Array:
        """Dead force at boundaries along the world's axes, as the step beyond has it, (row, 3)."""
        at_ends = np.concatenate([table.scalars[:1, 0, 3:], table.scalars[:, -1, 3:]])
        return at_ends[rows]
