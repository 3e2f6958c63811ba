"""The loaded rod: an arm under gravity, payload and forces, and the stability of its equilibria."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.loads import Loads
from softreach.kernels.lanes import LANES
from softreach.rod.free import (
    ArmRod,
    FreeRod,
    add_offset,
    linear_strains,
    per_length,
    tables_at,
)
from softreach.rod.loaded.held import held_over
from softreach.rod.loaded.postures import Postures
from softreach.rod.loaded.shapes import LoadedShapes
from softreach.rod.loaded.shooting import Equilibria, Shots, turn_between
from softreach.rod.loaded.solver import Solver
from softreach.rod.loaded.steps import (
    UNJUDGED,
    Differences,
    check_steps,
    checked,
    fewest_steps,
    shape_differences,
    tip_differences,
)
from softreach.rod.loaded.tables import ArmBody, Body, LoadTables
from softreach.rod.response import (
    NodeTables,
    linear_response,
    node_tables,
    rod_state,
    step_grid,
)
from softreach.rod.steps import pilot_activations
from softreach.rod.tip_map import (
    BLOCK,
    Frames,
    Held,
    Shapes,
    Status,
    Strains,
    TipStatus,
    drop,
    has_tip,
    position_slopes,
)
from softreach.support import parallel
from softreach.support.lazy import lazy

__all__ = ["LoadedRod"]

Array = NDArray[np.float64]

_BLOCK = BLOCK // 8  # samples per task
_RESPONSE_STEPS = 48
_OF_LINES = 32 * LANES  # samples per task that follows branches
_SIDES = 1e-3  # [rad], between postures of two sides


@dataclass(frozen=True, repr=False)
class LoadedRod(ArmRod):
    """r' = ζ d3, dᵢ' = η u × dᵢ with u = û + K⁻¹m, ζ = ζ̂ + η n3/K0, theory (57), (58).

    It is shot from the tip.
    The equilibrium is the posture that the arm comes to when it hangs first and is then activated.
    """

    @lazy
    def supports_unstable(self) -> bool:
        return True

    @lazy
    def loads(self) -> Loads:
        """Loads on the arm beside its actuators, in the frame of the base."""
        loads = self.arm.loads or Loads(gravity=(0.0, 0.0, 0.0))
        return loads.seen_from(self.arm.base)

    @property
    def body(self) -> Body:
        """Compliance and weight of the arm."""
        return ArmBody(self.arm)

    @lazy
    def tables(self) -> LoadTables:
        """Tables for the kernels.

        Raises:
            InvalidInput: Loads so heavy that no number of steps resolves what they do.
        """
        tables = LoadTables(self.arm, self.loads, self.body)
        check_steps(self.arm, tables.phase)
        return tables

    @property
    def steps(self) -> int:
        """The number of steps that `tol` needs for tips; see `rod.loaded.steps` for the rule.

        Raises:
            InvalidInput: None is enough.
        """
        return checked(self._tip_steps, self._tip_tol)

    @lazy
    def _tip_steps(self) -> int | None:
        """Steps with which `tol` holds for tips, if any are enough, theory (72)."""
        fewest = self.tables.phase.fewest_steps
        return self.fixed_steps or self._fewest(fewest, tip_differences)

    @lazy
    def _shape_steps(self) -> int | None:
        """Steps with which `tol` holds all along the arm, if any are enough."""
        return self.fixed_steps or self._fewest(self.steps, shape_differences)

    def _fewest(self, steps: int, differences: Differences) -> int | None:
        gamma = pilot_activations(self.arm, self.box)
        enough = fewest_steps(self._solver_of, gamma, steps, differences)
        return max(steps, self.unloaded_steps) if enough == UNJUDGED else enough

    @lazy
    def unloaded_steps(self) -> int:
        """Steps that `tol` needs without loads."""
        return FreeRod(self.arm, self._tip_tol).steps

    def _solver_of(self, steps: int) -> Solver:
        return Solver(self.tables, steps, self._tip_tol)

    @lazy
    def solver(self) -> Solver:
        """Solver with the steps that `tol` needs for tips."""
        return self._solver_of(self.steps)

    @lazy
    def postures(self) -> Postures:
        """Postures, with starts on a grid over the box where that is worth it."""
        return Postures.of(self.solver).with_flood()

    @lazy
    def _shape_solver(self) -> Solver:
        return self._solver_of(checked(self._shape_steps, self._tip_tol))

    @lazy
    def _mirrored(self) -> Postures:
        return self.postures.mirrored.with_flood()

    def _prepare(self) -> None:
        self.postures  # noqa: B018

    def continued_from(self, gamma: Array, frames: Array | None = None) -> LoadedRod:
        frame = self.equilibria(gamma).frame if frames is None else frames
        postures = self.postures.continued_from(gamma, frame)
        rod = _ContinuedRod(self.arm, self.tol, self.fixed_steps)
        vars(rod).update({"origin": self, **vars(self), "postures": postures})
        return rod

    def equilibria(self, activations: ArrayLike) -> Equilibria:
        """Tips with their status, the margin of stability, and how each was found.

        What is to be searched again is gathered from all samples, so that kernels get whole blocks.
        """
        self.prepare()
        gamma, lost = self.with_arms(self.box.check(activations))
        postures, equilibria = self.postures, self.solver.empty(len(gamma))
        blocks = parallel.blocks(len(gamma), _BLOCK)
        parallel.run(partial(postures.direct, gamma, b, equilibria) for b in blocks)
        rows = np.flatnonzero(equilibria.status != TipStatus.STABLE)
        blocks = parallel.blocks(len(rows), _OF_LINES)
        parallel.run(partial(postures.by_line, gamma, rows[b], equilibria) for b in blocks)
        drop(lost, equilibria.status, equilibria.tips, equilibria.margin)
        return equilibria

    def fill(
        self,
        gamma: Array,
        tips: Array,
        slopes: Array | None = None,
        *,
        twists: Array | None = None,
        status: Status | None = None,
        directions: Array | None = None,
    ) -> None:
        """Put tips, and what else is asked for, into place; each equilibrium is found once."""
        known = self.postures.find(gamma)
        if status is not None:
            status[:] = known.status
        self._fill(gamma, known, tips, slopes, twists, directions)

    def _fill(
        self,
        gamma: Array,
        known: Equilibria,
        tips: Array,
        slopes: Array | None = None,
        twists: Array | None = None,
        directions: Array | None = None,
    ) -> None:
        is_moving = slopes is not None or twists is not None
        if self.end < self.length:
            shapes = self._shape_solver.shapes(gamma, np.array([self.end]), known)
            tips[:], directors = shapes.frames.position[:, 0], shapes.frames.directors[:, 0]
            moved = self._section_twists(gamma) if is_moving else None
        else:
            tips[:], directors, moved = known.tips, None, None
            if is_moving or directions is not None or self.reach > 0.0:
                has_directors = directions is not None or self.reach > 0.0
                response = self.solver.respond(gamma, known, directors=has_directors)
                directors, moved = response.directors, response.twists
        if directors is not None and len(directors):
            add_offset(tips, self.offset, directors)
            if directions is not None:
                directions[:] = directors[:, 2]
        if slopes is not None and moved is not None:
            position_slopes(tips, moved, slopes)
        if twists is not None and moved is not None:
            twists[:] = moved

    def _section_twists(self, gamma: Array) -> Array:
        """(v, ω) of the section of a marker per unit of each activation, shape (n, 6, bundles)."""
        state = rod_state(self, gamma, self._node_tables)
        response = linear_response(self._node_tables, state, [])
        turns = response.turns[:, 0]
        velocities = response.moves[:, 0] - np.cross(turns, state.position[:, 0, :, None], axis=1)
        return np.concatenate([velocities, turns], axis=1)

    @lazy
    def _node_tables(self) -> NodeTables:
        z = np.array([self.end])
        grid = step_grid(self.arm, z, max(_RESPONSE_STEPS, self.steps))
        return node_tables(self.arm, z, grid)

    def held(self, gamma: Array, sizes: tuple[int, ...]) -> Held:
        self.prepare()
        return held_over(self.postures, self._mirrored, gamma, sizes, self._points)

    def _points(self, gamma: Array, shots: Shots) -> Array:
        """Places of the point that stands for the tip [m], shape (n, 3)."""
        stable, points = np.zeros(len(gamma), np.int8), np.empty((len(gamma), 3))
        for rows in parallel.blocks(len(gamma), _BLOCK):
            some = Equilibria(shots.tips[rows], stable[rows], shots.margin[rows], shots.frame[rows])
            self._fill(gamma[rows], some, points[rows])
        return points

    def compliance(self, activations: ArrayLike) -> Array:
        """∂r/∂F [m/N]: how a tip yields to a small dead force on it, shape (n, 3, 3)."""
        self.prepare()
        gamma, solver = self.box.check(activations), self.solver
        compliance = np.empty((len(gamma), 3, 3))

        def fill(block: slice) -> None:
            known = self.postures.find(gamma[block])
            compliance[block] = solver.respond(gamma[block], known, compliance=True).compliance

        parallel.run(partial(fill, block) for block in parallel.blocks(len(gamma), _BLOCK))
        return compliance

    def leans(self, activations: ArrayLike) -> NDArray[np.bool_]:
        """Mask of activations at which the arm leans to one of two sides, shape (n,).

        With the other twist it leans to the other.
        """
        self.prepare()
        gamma, sides = self.box.check(activations), (self.postures, self._mirrored)
        leans = np.empty(len(gamma), bool)

        def fill(block: slice) -> None:
            here, there = (side.find(gamma[block]) for side in sides)
            leans[block] = has_tip(here.status) & has_tip(there.status)
            leans[block] &= turn_between(here.frame, there.frame) > _SIDES

        parallel.run(partial(fill, block) for block in parallel.blocks(len(gamma), _BLOCK))
        return leans

    def shapes(
        self,
        activations: ArrayLike,
        framed: ArrayLike,
        strained: ArrayLike,
        status: Status | None = None,
    ) -> Shapes:
        """Frames, and (û + K⁻¹m) η/ζ and ζ = ζ̂ + η n3/K0.

        Curvature is per length as it is, stretched by loads too, so that dᵢ' = ζ u × dᵢ.
        """
        gamma = self.box.check(activations)
        z, at, found = np.asarray(framed, float), np.asarray(strained, float), self._found(gamma)
        framed_shapes = strained_shapes = self._walked(found, z, status)
        if not np.array_equal(z, at):
            strained_shapes = self._walked(found, at, status)
        return Shapes(*framed_shapes.frames, *self.strains_under(gamma, at, strained_shapes))

    def with_moments(self, gamma: Array, z: Array, status: Status) -> tuple[Frames, Array]:
        shapes = self._walked(self._found(gamma), z, status)
        return shapes.frames, shapes.moment

    def _found(self, gamma: Array) -> tuple[Array, NDArray[np.intp], Equilibria]:
        gamma, lost = self.with_arms(gamma)
        return gamma, lost, self.equilibria(gamma)

    def _walked(
        self, found: tuple[Array, NDArray[np.intp], Equilibria], z: Array, status: Status | None
    ) -> LoadedShapes:
        gamma, lost, known = found
        if not len(z):
            return LoadedShapes.empty(len(gamma), 0)
        shapes = self._shape_solver.shapes(gamma, z, known, status=status)
        if status is not None:
            gone = np.isnan(shapes.frames.position[:, 0, 0])
            status[gone & has_tip(status)] = TipStatus.UNDECIDED
        drop(lost, status, *shapes.frames, shapes.moment, shapes.force)
        return shapes

    def strains_under(self, gamma: Array, z: Array, shapes: LoadedShapes) -> Strains:
        """The strains at stations Z [m], from m and n in the directors of the shapes there."""
        axial, bending, torsion = _compliance_at(self.body, z.tobytes())
        u, extension, growth = linear_strains(tables_at(self.arm, z), gamma)
        extension = extension + growth * shapes.force[..., 2] * axial
        yielded = np.stack([bending, bending, torsion], axis=1)
        return per_length(u + shapes.moment * yielded, extension, growth)


@lru_cache(maxsize=64)
def _compliance_at(body: Body, stations: bytes) -> tuple[Array, Array, Array]:
    return body.compliance(np.frombuffer(stations))


class _ContinuedRod(LoadedRod):
    """The same arm with other postures; equal to itself alone, since these count."""

    origin: LoadedRod

    def __eq__(self, other: object) -> bool:
        return self is other

    def __hash__(self) -> int:
        return id(self)

    def held(self, gamma: Array, sizes: tuple[int, ...]) -> Held:
        return self.origin.held(gamma, sizes)

    @lazy
    def _shape_solver(self) -> Solver:
        return self.origin._shape_solver
