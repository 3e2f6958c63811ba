"""Blocked force: the largest force of a tip that is kept at its place, and how it grows.

The bundles move so that the force with which the tip pushes grows most: a linear program in the
change of activations, of which none may be large, and of the force, under ∂r/∂γ δγ + ∂r/∂F δF = 0
and the bounds. Newton's method then puts the tip back to its place. A step counts only if the
force grew about as foreseen and the equilibrium is stable; otherwise it is tried at half its
length. So the bundles follow a path of stable equilibria along which the force grows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator
from softreach.inverse import solve_inverse
from softreach.inverse.request import checked_activations, checked_targets
from softreach.rod.activation_box import ActivationBox
from softreach.rod.loaded.pushing_tip import PushingTip, TipResponse
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.rods import tip_map
from softreach.rod.tip_map import TipMap
from softreach.schema import AXES, activation_attributes, bundle_coordinates, provenance
from softreach.stiffness import a_direction, unit_directions, yielding_rod
from softreach.support.arguments import checked, function, optional, whole
from softreach.support.arrays import as_floats
from softreach.support.errors import InvalidInput
from softreach.support.progress import Progress, silent

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Stop", "blocked_force"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_FIRST, _LONGEST, _SHORTEST = 0.05, 0.2, 1e-7  # largest change of an activation, of its range
_LOCAL = 1e-3  # below it the largest force is near, and bounds alone do not fix it
_TURNING = 1e-5  # the same on a curve, where the force then turns back
_REJECTED, _CURVED, _STRAIGHT = 0.1, 0.4, 0.8  # of the growth foreseen
_MOST_STEPS, _CORRECTIONS = 300, 8
_AT_BOUND = 1e-9  # of the range
_NO_GROWTH = 1e-6  # units of force per range of activation
_UNIT = 0.1  # L, by which the unit of force moves the tip
_FARTHEST = 0.5  # L, by which the force of one step may move it
_NEAR_LOSS = 0.1  # margin of stability below which what cannot be followed has lost it
_MULTIPLIER = 1e-4  # of the largest one, below which a bound does not count


class Stop(IntEnum):
    """Reason for which a force grows no further."""

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


class Held(NamedTuple):
    """A tip at its place, pushing."""

    gamma: Array
    """Activations [unit of each], shape (bundles,)."""
    force: float
    """[N]"""
    response: TipResponse


class Grown(NamedTuple):
    """The end of a growth."""

    held: Held
    stop: Stop
    limits: Mask
    """Which bundles are at a bound that keeps the force from growing, shape (bundles,)."""
    slope: float
    """By how much the force would change if the place moved [N/m]."""


class _Program(NamedTuple):
    """The solution of a linear program; rate and slope are NaN where the solver has none."""

    gamma: Array
    """Change of the activations [unit of each], shape (bundles,)."""
    force: float
    """Change of the force [N]."""
    rate: float
    """The same in units of force per range of activation."""
    multipliers: Array
    """Price of each bundle's bounds, shape (bundles,)."""
    slope: float
    """By how much the force would change if the place moved [N/m]."""


@dataclass(frozen=True, eq=False)
class Growth:
    """The growth of the force at one place from one start.

    Args:
        pushing: The tip that pushes.
        place: Where it is held [m], shape (3,).
        start: Activations near those that put it there without force, shape (bundles,).
        residual: How far off its place the tip may be [m].
    """

    pushing: PushingTip
    place: Array
    start: Array
    residual: float

    @property
    def box(self) -> ActivationBox:
        """The activations within bounds."""
        return self.pushing.box

    @cached_property
    def _begun(self) -> TipResponse:
        """The tip near its place, without force."""
        return self.pushing.respond(self.box.clip(self.start), 0.0)

    @cached_property
    def first(self) -> Held | None:
        """The tip at its place without force; None if it is not there or not stable."""
        if not np.isfinite(self._begun.tip).all():
            return None
        held = self._corrected(self.box.clip(self.start), 0.0, 0.0, self._begun)
        return held if held and self._is_stable(held) else None

    @cached_property
    def unit(self) -> float:
        """A force that moves the tip by a fair part of the arm [N]."""
        return _UNIT * self.pushing.rod.length / float(np.linalg.norm(self._begun.retreat))

    def grown(self) -> Grown | None:
        """The end of the growth; None without a start."""
        held, reach, unstable = self.first, _FIRST, False
        if held is None:
            return None
        for _ in range(_MOST_STEPS):
            best = self._program(held, reach)
            if not best.rate > _NO_GROWTH:  # NaN too
                return self._end(held, best)
            tried = self._tried(held, best)
            share = (tried.force - held.force) / best.force if tried else 0.0
            stable = self._is_stable(tried) if tried else held.response.margin > _NEAR_LOSS
            if tried is None or not stable or share < _REJECTED:
                reach, unstable = 0.5 * reach, not stable
            else:
                held, unstable = tried, False
                reach *= 0.5 if share < _CURVED else 2.0 if share > _STRAIGHT else 1.0
                reach = min(reach, _LONGEST)
            if reach < (_SHORTEST if unstable else self._shortest):
                break
        else:
            return self._end(held, self._program(held, _LOCAL), Stop.UNFINISHED)
        if unstable:
            return self._end(held, self._program(held, _LOCAL), Stop.UNSTABLE)
        if self.box.dimension > 3:
            held = self._polished(held)
        return self._end(held, self._program(held, _LOCAL))

    @property
    def _shortest(self) -> float:
        """The step below which nothing is gained by further ones."""
        return _LOCAL if self.box.dimension > 3 else _TURNING

    def _end(self, held: Held, best: _Program, stop: Stop | None = None) -> Grown:
        """The end, by what stopped it; by default bounds if some cost force, else the shape."""
        cost = np.abs(best.multipliers)
        limits = self._at_bound(held.gamma) & (cost > _MULTIPLIER * cost.max(initial=1e-12))
        if np.isnan(best.rate):
            stop = Stop.UNFINISHED
        if stop is None:
            stop = Stop.BOUND if limits.any() else Stop.SINGULAR
        return Grown(held, stop, limits & (stop == Stop.BOUND), best.slope)

    def _tried(self, held: Held, best: _Program) -> Held | None:
        """The tip back at its place after a step, if it can be."""
        gamma, force = self.box.clip(held.gamma + best.gamma), held.force + best.force
        return self._corrected(gamma, force, self.unit, held.response)

    def _is_stable(self, held: Held) -> bool:
        return self.pushing.is_stable(held.gamma, held.force, held.response)

    def _program(self, held: Held, reach: float) -> _Program:
        """The change that lets the force grow most while no activation changes by more.

        Args:
            held: Where it begins.
            reach: Largest change of each activation, of its range.
        """
        from scipy.optimize import linprog

        box, length = self.box, self.pushing.rod.length
        columns = self._columns(held.response, self.unit)
        lowest = np.maximum(-1.0, (box.low - held.gamma) / box.scales / reach)
        highest = np.minimum(1.0, (box.high - held.gamma) / box.scales / reach)
        most = _FARTHEST / max(float(np.linalg.norm(columns[:, -1])), 1e-12) / reach
        ends = [*zip(np.minimum(lowest, 0.0), np.maximum(highest, 0.0), strict=True), (0.0, most)]
        goal = np.zeros(box.bundles + 1)
        goal[-1] = -1.0
        found = linprog(goal, A_eq=columns, b_eq=np.zeros(3), bounds=ends, method="highs-ds")
        if found.x is None:
            found = linprog(goal, A_eq=columns, b_eq=np.zeros(3), bounds=ends, method="highs-ipm")
        if found.x is None:  # nothing is known but that no change at all is allowed
            nothing = np.zeros(box.bundles)
            return _Program(nothing, 0.0, np.nan, nothing, np.nan)
        change = reach * found.x
        price = found.lower.marginals + found.upper.marginals
        return _Program(
            change[:-1] * box.scales,
            float(change[-1]) * self.unit,
            float(found.x[-1]),
            price[:-1],
            float(np.linalg.norm(found.eqlin.marginals)) * self.unit / length,
        )

    def _columns(self, response: TipResponse, unit: float) -> Array:
        """How the tip moves [L] with each activation over its range and with the unit of force."""
        moves = response.slope * np.where(self.box.is_free, self.box.scales, 0.0)
        columns = np.column_stack([moves, -unit * response.retreat])
        return columns / self.pushing.rod.length

    def _at_bound(self, gamma: Array) -> Mask:
        """Which free bundles are at a bound."""
        box = self.box
        room = np.minimum(gamma - box.low, box.high - gamma) / box.scales
        return box.is_free & (room <= _AT_BOUND)

    def _corrected(self, gamma: Array, force: float, unit: float, near: TipResponse) -> Held | None:
        """The tip put to its place by Newton's method; None if it does not come there.

        Bundles that begin at a bound stay there, if enough others are left.

        Args:
            gamma: Activations to begin with.
            force: Force to begin with [N].
            unit: Of the force, which yields too [N]; 0 to keep it.
            near: An equilibrium near to begin with.
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
                return Held(gamma, force, response) if force >= 0 else None
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
            rest = missing - columns[:, ~open_] @ step[~open_]
            step[open_] = np.linalg.lstsq(columns[:, open_], rest, rcond=1e-12)[0]
            over = open_ & ((step < low) | (step > high))
            if not over.any():
                break
            step = np.clip(step, low, high)
            open_ = open_ & ~over
        return step

    def _polished(self, held: Held) -> Held:
        """The largest force near one that the bounds alone do not fix, by quadratic programs."""
        from scipy.optimize import minimize

        box, length = self.box, self.pushing.rod.length
        x = np.append(box.to_cube(held.gamma[None])[0], held.force / self.unit)
        at = _remembered(
            lambda x: self.pushing.respond(
                box.low + x[:-1] * box.scales, x[-1] * self.unit, held.response
            )
        )
        gradient = np.append(np.zeros(box.bundles), -1.0)
        found: Any = minimize(
            lambda x: -x[-1],
            x,
            jac=lambda x: gradient,
            method="SLSQP",
            bounds=[*((0.0, 1.0 if free else 0.0) for free in box.is_free), (0.0, None)],
            constraints={
                "type": "eq",
                "fun": lambda x: (at(x).tip - self.place) / length,
                "jac": lambda x: self._columns(at(x), self.unit),
            },
            options={"ftol": 1e-10, "maxiter": 25},
        )
        gamma = box.clip(box.low + found.x[:-1] * box.scales)
        better = self._corrected(gamma, float(found.x[-1]) * self.unit, self.unit, held.response)
        if better is None or better.force < held.force:
            return held
        return better if self._is_stable(better) else held


def _remembered(respond: Callable[[Array], TipResponse]) -> Callable[[Array], TipResponse]:
    """The same function, which remembers its last value; values and slopes are asked in turn."""
    last: list[tuple[bytes, TipResponse]] = []

    def at(x: Array) -> TipResponse:
        key = x.tobytes()
        if not last or last[0][0] != key:
            last[:] = [(key, respond(x))]
        return last[0][1]

    return at


_MEANINGS = " ".join(f"{stop.value}={stop.name.lower()}" for stop in Stop)
_OF_TOL = 1e-2  # what the search may use up of the tolerance
_MOST_ALONG_ARM = 256  # along the arm


@checked(direction=a_direction, family=whole(1, 10_000), progress=optional(function))
def blocked_force(
    arm: Manipulator | TipMap,
    places: ArrayLike | None,
    direction: ArrayLike,
    *,
    start: ArrayLike | None = None,
    family: int = 1,
    tol: float = 1e-6,
    progress: Progress | None = None,
) -> xr.Dataset:
    """The largest force along a direction that the tip exerts while it is held at a place.

    What holds the tip pushes back against the direction alone, not sideways. The force begins at
    zero and grows along a path of stable equilibria until bounds of bundles, a singular shape or
    the loss of stability end it. With three free bundles the path is a curve, dγ/dF = J⁻¹C d with
    J = ∂r/∂γ and C = ∂r/∂F, and its end is exact. With more of them the force is the largest in
    the neighborhood of the path's end, where the conditions of an optimum hold; from another start
    it may be larger, and the largest over all starts is given. With fewer than three free bundles
    no change of activations keeps the tip in its place, and there is no such force.

    Args:
        arm: A design with three free bundles or more, or its tip map.
        places: Where the tip is held [m], shape (n, 3); None for the tips of `start`.
        direction: Along which the tip pushes, of any length, shape (3,) or (n, 3).
        start: Activations near which the force begins to grow [unit of each], shape (bundles,) or
            (n, bundles); by default all that `solve_inverse` finds for the places.
        family: With more than three free bundles: how many of these to start from.
        tol: Largest tip error, in L.
        progress: Called with the number of places done since its last call.

    Returns:
        Dataset over `place`: `force` [N] with `force_error` from the tip error, the `activation`
        and the `start_activation`, `tip_force`, which then acts on the tip [N], `status`, which
        says what ended the growth, and `limit` (place, bundle), true for bundles at the bounds that
        did. `settles` says whether the arm comes to rest in the end so if it is activated first and
        loaded slowly then, as the other functions have it; else only the way there, along which
        the tip was held, leads to that equilibrium. NaN where no stable start was found.

    Raises:
        InvalidInput: Arguments of another shape or not finite, or fewer than three free bundles.
        InvalidDesign: A material has no Young's modulus.
    """
    rod = tip_map(arm, tol)
    yielding = yielding_rod(rod)
    if rod.box.dimension < 3:
        allowed = "3 or more to keep the tip in its place"
        raise InvalidInput("free bundles", rod.box.dimension, allowed)
    targets, starts = _starts(rod, places, start, family)
    directions = unit_directions(direction, len(targets))
    done, best = progress or silent, []
    for target, along, choice in zip(targets, directions, starts, strict=True):
        found = [_grown(yielding, along, target, gamma) for gamma in choice]
        best.append(max((one for one in found if one), key=_force, default=None))
        done(1)
    return _dataset(yielding, targets, directions, best)


class _Best(NamedTuple):
    """A growth from one start."""

    start: Array
    end: Grown
    tip_error: float
    settles: bool


def _force(one: _Best) -> float:
    return one.end.held.force


def _starts(
    rod: TipMap, places: ArrayLike | None, start: ArrayLike | None, family: int
) -> tuple[Array, list[Array]]:
    """Places, and activations (k, bundles) to start from for each."""
    if start is None:
        if places is None:
            raise InvalidInput("places", None, "given, or `start`")
        targets = checked_targets("places", places)
        solutions = solve_inverse(rod, targets, family=family)
        return targets, [one.activations for one in solutions]
    if places is None:
        gamma = rod.box.check(np.atleast_2d(as_floats("start", start)))
        return rod.tips(gamma), list(gamma[:, None])
    targets = checked_targets("places", places)
    gamma = rod.box.with_fixed(checked_activations("start", start, rod.box, len(targets)))
    return targets, list(gamma[:, None])


def _grown(rod: LoadedRod, direction: Array, place: Array, start: Array) -> _Best | None:
    """The end of the growth from one start, with steps along the arm that `tol` needs there."""
    pushing, allowed = PushingTip(rod, direction, rod.steps), rod.tol * rod.length
    while True:
        growth = Growth(pushing, place, start, _OF_TOL * allowed)
        end = growth.grown()
        if end is None or growth.first is None:
            return None
        error = pushing.error(*end.held)
        if error <= 0.5 * allowed or pushing.steps >= _MOST_ALONG_ARM:
            settles = pushing.settles(*end.held)
            return _Best(growth.first.gamma, end, error + growth.residual, settles)
        pushing = pushing.finer()


def _rows(best: list[_Best | None]) -> Iterator[tuple[int, _Best]]:
    return ((k, one) for k, one in enumerate(best) if one is not None)


def _dataset(
    rod: LoadedRod, places: Array, directions: Array, best: list[_Best | None]
) -> xr.Dataset:
    import xarray as xr

    n, bundles = len(places), rod.box.bundles
    force, error = np.full((2, n), np.nan)
    activation, begun = np.full((2, n, bundles), np.nan)
    status, limit = np.full(n, Stop.NO_START, np.int8), np.zeros((n, bundles), bool)
    settles = np.zeros(n, bool)
    for k, one in _rows(best):
        force[k], status[k], limit[k] = one.end.held.force, one.end.stop, one.end.limits
        error[k] = one.end.slope * one.tip_error
        activation[k], begun[k], settles[k] = one.end.held.gamma, one.start, one.settles
    units = activation_attributes(rod.arm)
    acting = np.array(rod.loads.tip_force) - force[:, None] * directions
    return xr.Dataset(
        {
            "position": (("place", "axis"), places, {"units": "m"}),
            "direction": (("place", "axis"), directions, {"units": "1"}),
            "force": ("place", force, {"units": "N", "long_name": "blocked force"}),
            "force_error": ("place", error, {"units": "N", "long_name": "error of the force"}),
            "tip_force": (
                ("place", "axis"),
                acting,
                {"units": "N", "long_name": "force that acts on the tip in the end"},
            ),
            "activation": (("place", "bundle"), activation, units),
            "start_activation": (("place", "bundle"), begun, units),
            "status": ("place", status, {"units": "1", "meanings": _MEANINGS}),
            "settles": (
                "place",
                settles,
                {"units": "1", "long_name": "also at rest if activated first, then loaded"},
            ),
            "limit": (
                ("place", "bundle"),
                limit,
                {"units": "1", "long_name": "at a bound that keeps the force from growing"},
            ),
        },
        {"axis": list(AXES), **bundle_coordinates(rod.arm)},
        {**provenance(rod.arm), "tol": rod.tol},
    )
