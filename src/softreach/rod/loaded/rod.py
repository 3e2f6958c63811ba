"""The loaded rod: an arm under gravity, payload and forces, its steps, and tendons along it.

Steps, theory (72): the pilot of the free rod is solved with n and with 2n steps; n is the smallest
number, no smaller than the phase of the loads needs, whose largest difference, doubled for safety,
is within `tol`. Few of the pilot are solved first, all of them once these agree.

Near the loss of stability every error is magnified. Activations there are left out: those of small
margin, and the few that differ more than tenfold what 99 % of all do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.body import load_number
from softreach.arm.number import fields_of
from softreach.arm.tables import Works, quadrature
from softreach.arm.tensions import LengthLaw, PulledTendons
from softreach.rod.free import ArmRod, FreeRod, add_offset
from softreach.rod.loaded.held import held_over
from softreach.rod.loaded.postures import Postures
from softreach.rod.loaded.solver import Equilibria, LoadedShapes, Solver, turn_between
from softreach.rod.loaded.tables import LoadTables
from softreach.rod.response import NodeTables, linear_response, node_tables, rod_state, step_grid
from softreach.rod.steps import enough_for_all_breaks, pilot_activations
from softreach.rod.tip_map import (
    BLOCK,
    Frames,
    Held,
    InvalidLoads,
    Shapes,
    Status,
    TipOutputs,
    drop,
    position_slopes,
)
from softreach.support import parallel
from softreach.support.arrays import Array, Mask
from softreach.support.errors import InvalidInput
from softreach.support.lazy import lazy

Differences = Callable[[Solver, Array, Equilibria], Array]
"""Distances [m] between results of a solver and of its judge, near known equilibria, (n,)."""

_BLOCK = BLOCK // 8  # samples per task
_RESPONSE_STEPS = 48
_SIDES = 1e-3  # [rad], between postures of two sides
_SAFETY = 2.0
_FEWEST_STEPS, _MOST_STEPS = 4, 256
_FINER = 8  # times as many as let one end at every breakpoint are tried
_UNJUDGED = 0  # instead of a number of steps
_CRITICAL = 0.02
_BULK, _OUTLYING = 0.99, 10.0
_FEW = 64
_STATIONS = 9
_PIECES = 8  # of the arm, on which its strains are smooth
_DIFFERENCE = 1e-4  # of the widest range, for derivatives of works


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
    def tables(self) -> LoadTables:
        """Tables for the kernels.

        Raises:
            InvalidInput: Loads so heavy that no number of steps resolves what they do.
        """
        tables = LoadTables(arm=self.arm)
        if (steps := tables.phase.fewest_steps) > _MOST_STEPS:
            load = f"of load number {load_number(self.arm):.3g}"
            allowed = f"lighter: they need {steps:,} steps, at most {_MOST_STEPS} allowed"
            raise InvalidLoads("loads", load, allowed, "lighten the load or stiffen the arm")
        return tables

    @property
    def steps(self) -> int:
        """The number of steps that `tol` needs for tips; theory (72).

        Raises:
            InvalidInput: None is enough.
        """
        return self._checked(self._tip_steps)

    @lazy
    def _tip_steps(self) -> int | None:
        return self.fixed_steps or self._fewest(self.tables.phase.fewest_steps, tip_differences)

    @lazy
    def _shape_steps(self) -> int | None:
        return self.fixed_steps or self._fewest(self.steps, shape_differences)

    def _checked(self, steps: int | None) -> int:
        if steps is None:
            allowed = f"reachable within {_MOST_STEPS} steps"
            raise InvalidInput("tol", self._tip_tol, allowed, "enlarge it")
        return steps

    def _fewest(self, least: int, differences: Differences) -> int | None:
        """The fewest steps with which `tol` holds; None where the most are too few."""
        pilot, steps = pilot_activations(self.arm, self.box), max(least, _FEWEST_STEPS)
        others = pilot[_FEW:]  # behind the first, which are corners
        few = np.concatenate([pilot[:_FEW], others[:: max(1, len(others) // _FEW)]])
        enough = self._enough(few, steps, differences)
        if enough is not None:
            enough = self._enough(pilot, enough or steps, differences)
        return max(least, self.unloaded_steps) if enough == _UNJUDGED else enough

    def _enough(self, gamma: Array, steps: int, differences: Differences) -> int | None:
        """The same for some activations; `_UNJUDGED` where nothing judges any steps."""
        at_all, allowed = enough_for_all_breaks(self.arm), self._tip_tol * self.length / _SAFETY
        known = Postures(self._solver_of(steps)).find(gamma)
        gamma, known = gamma[known.is_found], known.of(known.is_found)
        while steps <= max(_MOST_STEPS, _FINER * at_all):
            solver = self._solver_of(steps)
            equilibria = solver.near(gamma, known)
            settled = equilibria.is_found & (np.abs(equilibria.margin) > _CRITICAL)
            errors = differences(solver, gamma[settled], equilibria.of(settled))
            errors = errors[np.isfinite(errors)]
            if not len(errors):
                return _UNJUDGED
            most = _OUTLYING * np.quantile(errors, _BULK, method="lower")
            error = float(errors[errors <= most].max())
            if error <= allowed:
                return steps
            steps = max(steps + 1, int(0.97 * steps * (error / allowed) ** (1 / 8)))
            if steps > _MOST_STEPS:
                steps = max(steps, at_all)
        return None

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
        return Postures(self.solver).with_flood()

    @lazy
    def _shape_solver(self) -> Solver:
        return self._solver_of(self._checked(self._shape_steps))

    @lazy
    def _mirrored(self) -> Postures:
        return self.postures.mirrored.with_flood()

    def _prepare(self) -> None:
        self.postures  # noqa: B018

    def continued_from(self, gamma: Array, frames: Array | None = None) -> LoadedRod:
        frame = self.equilibria(gamma).frame if frames is None else frames
        return self.with_postures(self.postures.continued_from(gamma, frame))

    def with_postures(self, postures: Postures) -> LoadedRod:
        """The same arm in postures that are found in another way."""
        rod = _ContinuedRod(self.arm, self.tol, self.fixed_steps)
        vars(rod).update({"origin": self, **vars(self), "postures": postures})
        return rod

    def equilibria(self, activations: ArrayLike) -> Equilibria:
        """Tips with their status, and the margin of stability."""
        self.prepare()
        gamma, lost = self.with_arms(self.box.check(activations))
        equilibria = self.postures.find(gamma)
        drop(lost, equilibria.status, equilibria.tips, equilibria.margin)
        return equilibria

    def fill(self, gamma: Array, out: TipOutputs) -> None:
        """Put tips, and what else is wanted, into place; each equilibrium is found once."""
        with parallel.undivided():
            known = self.postures.find(gamma)
        self._fill(gamma, known, out)

    def _fill(self, gamma: Array, known: Equilibria, out: TipOutputs) -> None:
        tips, slopes, twists, status, directions = out
        if status is not None:
            status[:] = known.status
        is_moving = slopes is not None or twists is not None
        has_directors = directions is not None or self.reach > 0.0
        if self.end < self.length:
            shapes = self._shape_solver.shapes(gamma, np.array([self.end]), known)
            tips[:], directors = shapes.position[:, 0], shapes.directors[:, 0]
            moved = self._section_twists(gamma) if is_moving else None
        else:
            tips[:], directors, moved = known.tips, None, None
            if is_moving or has_directors:
                moved, _, directors = self.solver.respond(gamma, known, directors=has_directors)
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
        return _tables_of_response(self, np.array([self.end]))

    def held(self, gamma: Array, sizes: tuple[int, ...]) -> Held:
        self.prepare()
        return held_over(self.postures, self._mirrored, gamma, sizes, self._points)

    def _points(self, gamma: Array, known: Equilibria) -> Array:
        """Places of the point that stands for the tip [m], shape (n, 3)."""
        points, stable = np.empty((len(gamma), 3)), np.zeros(len(gamma), np.int8)
        known = known._replace(status=stable)
        for rows in parallel.blocks(len(gamma), _BLOCK):
            self._fill(gamma[rows], known.of(rows), TipOutputs(points[rows]))
        return points

    def compliance(self, activations: ArrayLike) -> Array:
        """∂r/∂F [m/N]: how a tip yields to a small dead force on it, shape (n, 3, 3)."""
        self.prepare()
        gamma, solver = self.box.check(activations), self.solver
        known, compliance = self.postures.find(gamma), np.empty((len(gamma), 3, 3))

        def fill(rows: slice) -> None:
            compliance[rows] = solver.respond(gamma[rows], known.of(rows), compliance=True)[1]

        parallel.run(partial(fill, rows) for rows in parallel.blocks(len(gamma), _BLOCK))
        return compliance

    def leans(self, activations: ArrayLike) -> Mask:
        """Mask of activations at which the arm leans to one of two sides, shape (n,).

        With the other twist it leans to the other.
        """
        self.prepare()
        gamma = self.box.check(activations)
        here, there = (side.find(gamma) for side in (self.postures, self._mirrored))
        apart = turn_between(here.frame, there.frame) > _SIDES
        return here.is_found & there.is_found & apart

    def shapes(self, activations: ArrayLike, framed: ArrayLike, strained: ArrayLike) -> Shapes:
        """Frames, and (û + K⁻¹m) η/ζ and ζ = ζ̂ + η n3/K0.

        Curvature is per length as it is, stretched by loads too, so that dᵢ' = ζ u × dᵢ.
        """
        gamma = self.box.check(activations)
        z, at = np.asarray(framed, float), np.asarray(strained, float)
        known = self.equilibria(gamma)
        walked, status = self._walked(gamma, known, z)
        frames = walked[:2]
        if not np.array_equal(z, at):
            walked, status = self._walked(gamma, known._replace(status=status), at)
        return Shapes(*frames, *self._shape_solver.strains_under(gamma, at, walked), status)

    def with_moments(self, gamma: Array, z: Array) -> tuple[Frames, Array, Status]:
        walked, status = self._walked(gamma, self.equilibria(gamma), z)
        return Frames(*walked[:2]), walked.moment, status

    def _walked(self, gamma: Array, known: Equilibria, z: Array) -> tuple[LoadedShapes, Status]:
        """Shapes of known equilibria, undecided where steps that end at Z [m] do not find them."""
        shapes = self._shape_solver.shapes(gamma, z, known)
        gone = known.is_found & np.isnan(shapes.position[:, :1, 0]).any(axis=1)
        return shapes, known.only(~gone).status


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


def tip_differences(solver: Solver, gamma: Array, known: Equilibria) -> Array:
    """Between tips."""
    return np.linalg.norm(known.tips - solver.judge().near(gamma, known).tips, axis=1)


def shape_differences(solver: Solver, gamma: Array, known: Equilibria) -> Array:
    """Between centerlines, the largest along the arm."""
    z = np.linspace(0.0, solver.tables.arm.length, _STATIONS)
    here, there = (each.shapes(gamma, z, known).position for each in (solver, solver.judge()))
    return np.linalg.norm(here - there, axis=2).max(axis=1, initial=0.0)


def _tables_of_response(rod: ArmRod, stations: Array) -> NodeTables:
    grid = step_grid(rod.arm, stations, max(_RESPONSE_STEPS, rod.steps))
    return node_tables(rod.arm, stations, grid)


@dataclass(frozen=True)
class LoadedTendons(PulledTendons):
    """Works of tendons driven by length, or held by guides, on the strains of equilibria."""

    law: LengthLaw = field(compare=False)
    """That of the arm without loads."""
    rod: ArmRod
    """The map of the inner arm under loads, accurate enough for s."""

    def works(self, inner: Array, which: Works) -> Array:
        z, force, moment = self._known.get(which) or self._loads(which)
        known, works = np.isfinite(inner).all(axis=1), np.full((len(inner), force.shape[1]), np.nan)
        strains = self.rod.strains(inner[known], z)
        turn = (strains.curvature * strains.extension[..., None]).reshape(known.sum(), 1, -1)
        # One product for each sample, so that none depends on those beside it.
        work = np.matmul(strains.extension[:, None] - 1.0, force) + np.matmul(turn, moment)
        works[known] = work[:, 0]
        return works

    @lazy
    def _known(self) -> dict[Works, tuple[Array, Array, Array]]:
        return {}

    def _loads(self, which: Works) -> tuple[Array, Array, Array]:
        arm = self.law.arm
        turns = [
            abs(each.value_on("revolution", arm.profile, arm.section))
            for each in arm.actuators
            if "revolution" in fields_of(type(each))
        ]
        z, weights, _ = quadrature(arm, _PIECES + int(max(turns, default=0.0)))
        force, moment = which.loads_at(z, weights)
        self._known[which] = z, force, moment.reshape(3 * len(z), len(which.columns))
        return self._known[which]

    def continued_from(self, inner: Array, frames: Array | None = None) -> LoadedTendons:
        """Those of the arm in its posture at activations of the inner arm, shape (k, bundles)."""
        rod = self.rod.continued_from(inner, frames)
        assert isinstance(rod, ArmRod)
        return replace(self, rod=rod)

    def work_slopes(self, inner: Array, each: list[Works]) -> list[Array]:
        """Derivatives of works, (n, work, bundle) each; NaN where activations are."""
        counts = [len(which.columns) for which in each]
        slopes = np.full((len(inner), sum(counts), inner.shape[1]), np.nan)
        known = ~np.isnan(inner).any(axis=1)
        slopes[known] = self._slopes(inner[known], each)
        return np.split(slopes, np.cumsum(counts)[:-1], axis=1)

    def _slopes(self, inner: Array, each: list[Works]) -> Array:
        """Exact where loads have a linear response, else by central differences."""
        if self._table is not None:
            z = self._table.stations
            loads = [which.loads_at(z.ravel(), np.ones(z.size)) for which in each]
            unit = [np.concatenate([moment, force[:, None]], axis=1) for force, moment in loads]
            unit_loads = np.concatenate(unit, axis=2).reshape(*z.shape, 4, -1)
            state = rod_state(self.rod, inner, self._table)
            return linear_response(self._table, state, [], unit_loads).works
        widths = _DIFFERENCE * self.rod.box.widths
        slopes = np.zeros((len(inner), sum(len(which.columns) for which in each), len(widths)))
        for k in np.flatnonzero(widths > 0):
            ends = [inner.copy(), inner.copy()]
            ends[0][:, k] -= widths[k]
            ends[1][:, k] += widths[k]
            s = [np.hstack([self.works(end, which) for which in each]) for end in ends]
            slopes[..., k] = (s[1] - s[0]) / (2.0 * widths[k])
        return slopes

    @lazy
    def _table(self) -> NodeTables | None:
        """Tables for the linear response."""
        try:
            return _tables_of_response(self.rod, np.empty(0))
        except InvalidLoads:  # that it does not know
            return None
