"""Growth of a force while the tip stays where it is: linear programs, each corrected by Newton.

A linear program in small changes of activations and of the force, under ∂r/∂γ δγ + ∂r/∂F δF = 0 and
the bounds, has the most growth. A step counts only if the force grew about as foreseen and the rod
rests stably; otherwise it is tried at half its length. The tip then pushes along a direction, and
as much pushes back on it: every force has tables of its own, but only a column of them is new.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from typing import Any, NamedTuple, cast

import numpy as np

from softreach.rod.inputs import ActivationBox
from softreach.rod.loaded.postures import Postures
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.loaded.solver import Equilibria, Solver, turn_between
from softreach.rod.loaded.tables import LoadTables
from softreach.rod.tip_map import position_slopes
from softreach.support.arrays import Array, Mask
from softreach.support.lazy import lazy

_FINEST = 256
_LEAST_SHARE = 2.0**-12  # part of a force by which it is raised
_MOST_TURN = 0.2  # [rad], of what a node sees
_DOUBTFUL = 0.05  # margin of stability below which finer steps decide


class TipResponse(NamedTuple):
    """Place and derivatives of one tip."""

    tip: Array
    """r [m], shape (3,); NaN where there is no equilibrium."""
    slope: Array
    """∂r/∂γ [m], shape (3, bundles)."""
    retreat: Array
    """Retreat of the tip per unit of the force with which it pushes, -∂r/∂F [m/N], shape (3,)."""
    equilibrium: Equilibria
    """As the search found it."""

    @property
    def margin(self) -> float:
        """Margin of stability, from 1 to below 0 [-]."""
        return float(self.equilibrium.margin[0])


@dataclass(frozen=True, eq=False)
class PushingTip:
    """The tip of a rod that pushes along a direction, and on which as much pushes back."""

    rod: LoadedRod
    """The rod with its other loads."""
    direction: Array
    """Unit vector along which the tip pushes."""
    steps: int
    """Along the arm."""

    @lazy
    def _tables(self) -> LoadTables:
        return LoadTables(arm=self.rod.arm, direction=-self.direction)

    def _solver(self, force: float, steps: int) -> Solver:
        return Solver(self._tables.under(force), steps, self.rod.tol)

    def respond(self, gamma: Array, force: float, near: TipResponse | None = None) -> TipResponse:
        """The tip at activations (bundles,) that pushes by a force [N], and its derivatives.

        It is searched near another response, or is that of the posture.
        """
        solver, sample = self._solver(force, self.steps), gamma[None]
        if near is None:
            known = Postures(solver).find(sample)
        else:
            known = solver.near(sample, near.equilibrium)
        twists, compliance, _ = solver.respond(sample, known, compliance=True)
        slopes = np.empty_like(twists[:, :3])
        position_slopes(known.tips, twists, slopes)
        return TipResponse(known.tips[0], slopes[0], compliance[0] @ self.direction, known)

    def is_stable(self, gamma: Array, force: float, response: TipResponse) -> bool:
        """True if this equilibrium is stable; in doubt steps half as long decide."""
        if abs(response.margin) > _DOUBTFUL:
            return response.margin > 0
        return bool(self._judged(gamma, force, response).is_stable[0])

    def error(self, gamma: Array, force: float, response: TipResponse) -> float:
        """Movement of the tip when the steps are halved [m]."""
        fine = self._judged(gamma, force, response)
        return float(np.linalg.norm(fine.tips[0] - response.tip))

    def _judged(self, gamma: Array, force: float, response: TipResponse) -> Equilibria:
        return self._solver(force, 2 * self.steps).near(gamma[None], response.equilibrium)

    def settles(self, gamma: Array, force: float, response: TipResponse) -> bool:
        """True if the force alone, raised from the posture without it, leads there."""
        sample, share, step = gamma[None], 0.0, 0.25
        held = Postures(self._solver(0.0, self.steps)).find(sample)
        while share < 1.0 and step > _LEAST_SHARE:
            to = min(1.0, share + step)
            new = self._solver(to * force, self.steps).near(sample, held)
            turn = turn_between(new.frame, held.frame)[0]
            if new.is_stable[0] and turn < _MOST_TURN:
                held, share, step = new, to, 2.0 * step
            else:
                step *= 0.5
        apart = float(np.linalg.norm(held.tips[0] - response.tip))
        return share == 1.0 and apart <= self.rod.tol * self.rod.length

    @property
    def is_finest(self) -> bool:
        """True if steps are not made any shorter."""
        return self.steps >= _FINEST

    def finer(self) -> PushingTip:
        """The same with steps half as long."""
        return PushingTip(self.rod, self.direction, 2 * self.steps)


_FIRST, _LONGEST, _SHORTEST = 0.05, 0.2, 1e-7  # largest change of an activation, of its range
_AGAIN_FIRST = 0.01  # the same near the end
_LOCAL = 1e-3  # below it the largest force is near, and bounds alone do not fix it
_TURNING = 1e-5  # the same on a curve, where the force then turns back
_REJECTED, _CURVED, _STRAIGHT = 0.1, 0.4, 0.8  # of the growth foreseen
_MOST_STEPS, _CORRECTIONS = 300, 8
_AT_BOUND = 1e-9  # of the range
_NO_GROWTH = 1e-6  # units of force per range of activation
_OF_TOL = 1e-2  # what the search may use up of the tolerance
_UNIT = 0.1  # L, by which the unit of force moves the tip
_FARTHEST = 0.5  # L, by which the force of one step may move it
_OF_ROOM = 0.7  # of the growth that is left until stability is lost, as margins foretell it
_OF_SHORTEST = 0.3  # of the shortest step, to which steps shrink within that room
_AGAIN = 0.98  # of the force, up to which what other steps gave is kept
_NEAR_LOSS = 0.1  # margin of stability below which what cannot be followed has lost it
_MULTIPLIER = 1e-4  # of the largest one, below which a bound does not count


class Stop(IntEnum):
    """Reason why a force grows no further."""

    BOUND = 0
    """Bundles are at their bounds."""
    SINGULAR = 1
    """No change of activations lets it grow: the arm has a singular shape."""
    UNSTABLE = 2
    """The arm would lose its stability."""
    NO_START = 3
    """No stable activation that was found puts the tip at the place."""
    UNFINISHED = 4
    """The search took too many steps; the force is reached, and may grow further."""


class FixedTip(NamedTuple):
    """A tip at its place, pushing."""

    gamma: Array  # Activations [unit of each], shape (bundles,)
    force: float  # [N]
    response: TipResponse


class Grown(NamedTuple):
    """The end of a growth."""

    fixed: FixedTip
    stop: Stop
    limits: Mask  # Of the bundles at a bound that keeps the force from growing, shape (bundles,)
    slope: float  # By how much the force would change if the place moved [N/m]
    before: list[FixedTip]  # The tip on the way there, up to nearly as large a force


class _Program(NamedTuple):
    gamma: Array  # Change of the activations [unit of each], shape (bundles,)
    force: float  # Change of the force [N]
    rate: float  # The same in units of force per range of activation
    multipliers: Array  # Lagrange multiplier of each bundle's bounds, shape (bundles,)
    slope: float  # Change of the force if the place moved [N/m]; NaN if it was not solved


@dataclass(frozen=True, eq=False)
class Growth:
    """The growth of the force at one place [m] from a start near its activations without force.

    `allowed` is the largest error of the tip [m], of which its distance from the place is a part.
    """

    pushing: PushingTip
    place: Array
    start: Array
    allowed: float

    @property
    def residual(self) -> float:
        """Largest distance of the tip from its place [m]."""
        return _OF_TOL * self.allowed

    @property
    def box(self) -> ActivationBox:
        """The activations within bounds."""
        return self.pushing.rod.box

    @lazy
    def _begun(self) -> TipResponse:
        return self.pushing.respond(self.box.clip(self.start), 0.0)

    @lazy
    def first(self) -> FixedTip | None:
        """The tip at its place without force; None if it is not there or not stable."""
        if not np.isfinite(self._begun.tip).all():
            return None
        fixed = self._fixed(self.box.clip(self.start), 0.0, 0.0, self._begun)
        return fixed if fixed and self._is_stable(fixed) else None

    @lazy
    def unit(self) -> float:
        """A force that moves the tip by a fair part of the arm [N]."""
        return _UNIT * self.pushing.rod.length / float(np.linalg.norm(self._begun.retreat))

    def grown(self, begun: list[FixedTip] | None = None) -> Grown | None:
        """The end of the growth, from the last of those `begun` in other steps; None if none is."""
        if begun:  # in these steps, under the same force
            last = begun[-1]
            fixed = self._fixed(last.gamma, last.force, 0.0, last.response)
        else:
            fixed = self.first
        if fixed is None or (begun and not self._is_stable(fixed)):
            return None
        path = [*begun[-2:-1], fixed] if begun else [fixed]
        if end := self._followed(path, _AGAIN_FIRST if begun else _FIRST):
            return end
        if self.box.dimension > 3:
            path.append(self._polished(path[-1]))
        return self._end(path, self._program(path[-1], _LOCAL))

    def _followed(self, path: list[FixedTip], reach: float) -> Grown | None:
        """Extend a path until steps are too short; the end, where something else stops it.

        No activation changes by more than `reach` of its range in the first step.
        """
        for _ in range(_MOST_STEPS):
            best = self._program(path[-1], reach)
            if best.rate <= _NO_GROWTH:
                return self._end(path, best)
            share = _OF_ROOM * _room(path) / best.force
            if share < 1.0:
                best = best._replace(gamma=share * best.gamma, force=share * best.force)
                reach = float(np.abs(best.gamma / self.box.scales).max())
                if reach < _OF_SHORTEST * self._shortest:
                    return None
            share, unstable = self._step(path, best)
            near_loss = share > 0.0 and path[-1].response.margin <= _NEAR_LOSS
            may_err = near_loss and not self.pushing.is_finest
            if may_err and self.pushing.error(*path[-1]) > 0.5 * self.allowed:
                break
            reach *= 0.5 if share < _CURVED else 2.0 if share > _STRAIGHT else 1.0
            reach = min(reach, _LONGEST)
            if share == 0.0 and reach < (_SHORTEST if unstable else self._shortest):
                if unstable:
                    return self._end(path, self._program(path[-1], _LOCAL), Stop.UNSTABLE)
                return None
        return self._end(path, self._program(path[-1], _LOCAL), Stop.UNFINISHED)

    def _step(self, path: list[FixedTip], best: _Program) -> tuple[float, bool]:
        """Try a step: its share of the growth foreseen, 0 if not taken; was it for stability?"""
        fixed = path[-1]
        gamma, force = self.box.clip(fixed.gamma + best.gamma), fixed.force + best.force
        tried = self._fixed(gamma, force, self.unit, _ahead(path, force))
        if tried is None:
            return 0.0, fixed.response.margin <= _NEAR_LOSS
        share, stable = (tried.force - fixed.force) / best.force, self._is_stable(tried)
        if not stable or share < _REJECTED:
            return 0.0, not stable
        path.append(tried)
        return share, False

    @property
    def _shortest(self) -> float:
        return _LOCAL if self.box.dimension > 3 else _TURNING

    def _end(self, path: list[FixedTip], best: _Program, stop: Stop | None = None) -> Grown:
        """The end, by what stopped it; by default bounds if some cost force, else the shape."""
        fixed = path[-1]
        before = [each for each in path if each.force <= _AGAIN * fixed.force] or path
        cost = np.abs(best.multipliers)
        limits = self._at_bound(fixed.gamma) & (cost > _MULTIPLIER * cost.max(initial=1e-12))
        by_itself = Stop.BOUND if limits.any() else Stop.SINGULAR
        if stop is None:
            stop = Stop.UNFINISHED if np.isnan(best.slope) else by_itself
        return Grown(fixed, stop, limits & (stop == Stop.BOUND), best.slope, before)

    def _is_stable(self, fixed: FixedTip) -> bool:
        return self.pushing.is_stable(fixed.gamma, fixed.force, fixed.response)

    def _program(self, fixed: FixedTip, reach: float) -> _Program:
        """The most growth of the force where no activation changes by over `reach` of its range."""
        from scipy import optimize

        linprog = cast(Any, optimize.linprog)  # without types, whose inference takes seconds

        box, length = self.box, self.pushing.rod.length
        columns = self._columns(fixed.response, self.unit)
        lowest = np.maximum(-1.0, (box.low - fixed.gamma) / box.scales / reach)
        highest = np.minimum(1.0, (box.high - fixed.gamma) / box.scales / reach)
        most = _FARTHEST / max(float(np.linalg.norm(columns[:, -1])), 1e-12) / reach
        ends = [*zip(np.minimum(lowest, 0.0), np.maximum(highest, 0.0), strict=True), (0.0, most)]
        goal = np.zeros(box.bundles + 1)
        goal[-1] = -1.0
        for method in ("highs-ds", "highs-ipm"):
            solution = linprog(goal, A_eq=columns, b_eq=np.zeros(3), bounds=ends, method=method)
            if solution.x is not None:
                break
        else:
            return _Program(np.zeros(box.bundles), 0.0, 0.0, np.zeros(box.bundles), np.nan)
        change = reach * solution.x
        price = solution.lower.marginals + solution.upper.marginals
        slope = float(np.linalg.norm(solution.eqlin.marginals)) * self.unit / length
        gamma, force = change[:-1] * box.scales, float(change[-1]) * self.unit
        return _Program(gamma, force, float(solution.x[-1]), price[:-1], slope)

    def _columns(self, response: TipResponse, unit: float) -> Array:
        """Motion of the tip [L] by each activation over its range and by the unit of force."""
        moves = response.slope * np.where(self.box.is_free, self.box.scales, 0.0)
        columns = np.column_stack([moves, -unit * response.retreat])
        return columns / self.pushing.rod.length

    def _at_bound(self, gamma: Array) -> Mask:
        """Mask of the free bundles that are at a bound."""
        box = self.box
        room = np.minimum(gamma - box.low, box.high - gamma) / box.scales
        return box.is_free & (room <= _AT_BOUND)

    def _fixed(self, gamma: Array, force: float, unit: float, near: TipResponse) -> FixedTip | None:
        """The tip put to its place by Newton's method; None if it does not come there.

        Bundles that begin at a bound stay there, if enough others are left. The force [N] yields
        in steps of `unit` [N], or is kept where that is 0; `near` is an equilibrium near.
        """
        length = self.pushing.rod.length
        moves = self.box.is_free & ~self._at_bound(gamma)
        if moves.sum() + (unit > 0) < 3:
            moves = self.box.is_free.copy()
        for _ in range(_CORRECTIONS):
            response = self.pushing.respond(gamma, force, near)
            missing = self.place - response.tip
            if not np.isfinite(missing).all():
                return None
            if np.linalg.norm(missing) <= self.residual:
                return FixedTip(gamma, force, response) if force >= 0 else None
            columns, near = self._columns(response, unit), response
            step = self._bounded_step(gamma, moves, columns, missing / length)
            gamma = self.box.clip(gamma + step[:-1] * self.box.scales)
            force = force + float(step[-1]) * unit
        return None

    def _bounded_step(self, gamma: Array, moves: Mask, columns: Array, missing: Array) -> Array:
        """The shortest step that makes up what is missing; where it meets bounds it ends there."""
        box = self.box
        low = np.append((box.low - gamma) / box.scales, -np.inf)
        high = np.append((box.high - gamma) / box.scales, np.inf)
        step, open_ = np.zeros(len(low)), np.append(moves, True)
        for _ in range(len(low)):
            left = missing - columns[:, ~open_] @ step[~open_]
            step[open_] = np.linalg.lstsq(columns[:, open_], left, rcond=1e-12)[0]
            over = open_ & ((step < low) | (step > high))
            if not over.any():
                break
            step = np.clip(step, low, high)
            open_ = open_ & ~over
        return step

    def _polished(self, fixed: FixedTip) -> FixedTip:
        """The largest force near one that the bounds alone do not fix, by quadratic programs."""
        from scipy.optimize import minimize

        box, length = self.box, self.pushing.rod.length
        x = np.append(box.to_cube(fixed.gamma[None])[0], fixed.force / self.unit)

        @lru_cache(maxsize=1)  # values and slopes are asked in turn
        def respond(key: bytes) -> TipResponse:
            *gamma, force = np.frombuffer(key)
            gamma = box.low + np.array(gamma) * box.scales
            return self.pushing.respond(gamma, force * self.unit, fixed.response)

        def at(x: Array) -> TipResponse:
            return respond(x.tobytes())

        gradient = np.append(np.zeros(box.bundles), -1.0)
        held: Any = {"type": "eq", "fun": lambda x: (at(x).tip - self.place) / length}
        held["jac"] = lambda x: self._columns(at(x), self.unit)
        ends = [*((0.0, 1.0 if free else 0.0) for free in box.is_free), (0.0, None)]
        known: Any = {"constraints": held, "bounds": ends}
        known["options"] = {"ftol": 1e-10, "maxiter": 25}
        solution = minimize(lambda x: -x[-1], x, jac=lambda x: gradient, method="SLSQP", **known)
        gamma = box.clip(box.low + solution.x[:-1] * box.scales)
        force = float(solution.x[-1]) * self.unit
        better = self._fixed(gamma, force, self.unit, fixed.response)
        if better is None or better.force < fixed.force:
            return fixed
        return better if self._is_stable(better) else fixed


def _room(path: list[FixedTip]) -> float:
    """Growth of the force until the margin of stability is 0, were it to fall on evenly [N]."""
    if len(path) < 2:
        return np.inf
    past, fixed = path[-2:]
    lost = past.response.margin - fixed.response.margin
    if lost <= 0.0:
        return np.inf
    return max(0.0, fixed.response.margin * (fixed.force - past.force) / lost)


def _ahead(path: list[FixedTip], force: float) -> TipResponse:
    """Response near that under a larger force: what the tip sees turns on evenly.

    Close to the loss of stability there are two equilibria near each other, and from what the tip
    saw before the search may come to the wrong one.
    """
    response = path[-1].response
    if len(path) < 2:
        return response
    past, fixed = path[-2:]
    share = (force - fixed.force) / (fixed.force - past.force)
    before, now = (each.response.equilibrium.frame for each in (past, fixed))
    equilibrium = response.equilibrium._replace(frame=now + share * (now - before))
    return response._replace(equilibrium=equilibrium)
