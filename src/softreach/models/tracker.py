"""A control step: activations that bring the tip of an arm toward a target, in bounded time.

It takes two or three damped Gauss-Newton steps within the bounds and what the rate allows. What
brings the tip no nearer is not taken and raises the damping, which later steps inherit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator
from softreach.inverse.direction import angles_from
from softreach.inverse.request import as_rates
from softreach.kernels.box.bounded_descent import box_steps
from softreach.kernels.box.box_projection import project
from softreach.rod.loaded.postures import PosturesBeside
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.rods import ArmMap, all_inputs, as_tip_map
from softreach.rod.tip_map import TipMap, TipOutputs
from softreach.stiffness import tip_compliance
from softreach.support.arguments import POSITIVE, as_number
from softreach.support.arrays import Array, as_directions, as_points, as_rows
from softreach.support.errors import InvalidInput, NotPossible
from softreach.support.lazy import lazy

_TRIALS, _DIRECTED_TRIALS = 3, 2
_SHARE = 0.1  # of its range, by which a bundle moves in a step where no rate is given
_FIRST_DAMPING, _LEAST_DAMPING, _LARGEST_DAMPING = 1e-6, 1e-10, 1e6  # of the mean square slope
_EASE = 0.05  # of the way to the least activations, in a step, as far as the tip does not move
_ENOUGH = 0.5  # of the tolerance, at which a step ends
_AT_END = 1e-9  # of a range, from a limit on which a bundle is


@dataclass(frozen=True, eq=False, kw_only=True)
class TrackingStep:
    """Where a control step leads."""

    activations: Array
    """Inputs of the arm [unit of each], shape (bundles,)."""
    tip: Array
    """Its tip [m], shape (3,)."""
    jacobian: Array
    """∂r/∂γ of the tip [m per unit of each activation], shape (3, bundles)."""
    distance: float
    """|target - tip| [m]."""
    angle: float
    """Between the direction of the tip and the one wanted [rad]; 0 if none is."""
    reached: bool
    """True if the distance is at most `tol`, and the angle, in rad, too."""
    at_bound: tuple[str, ...]
    """Bundles at a bound."""
    at_rate: tuple[str, ...]
    """Bundles that moved as far as their rate allows."""
    snaps: bool
    """True if a way was not taken, since the arm loses its stability on it."""
    _map: ArmMap

    @lazy
    def compliance(self) -> Array | None:
        """∂r/∂F of the tip [m/N], shape (3, 3), computed when it is read.

        None where it is unknown: of an arm without moduli, or of a marker.
        """
        if self._map.arm.section.modulus_faults("") or self._map.point is not None:
            return None
        return tip_compliance(all_inputs(self._map), self.activations[None])[0]

    def __str__(self) -> str:
        angle = f" and {math.degrees(self.angle):.3g}°" if self.angle else ""
        where = "reached" if self.reached else f"{1e3 * self.distance:.3g} mm{angle} away"
        limits = {"at a bound: ": self.at_bound, "at the rate: ": self.at_rate}
        words = [word + ", ".join(names) for word, names in limits.items() if names]
        return "; ".join([where, *words, *["the arm would snap"] * self.snaps])


class Tracker:
    """Control steps of one arm, from the activations that it has to a place for its tip.

    A step continues from the last one: activations change by no more than the rate allows, stay
    within the bounds, and an arm under loads stays on its branch of stable postures. Out of reach
    the tip comes as near as it can. Of more bundles than it takes small activations are preferred.
    """

    def __init__(
        self,
        arm: Manipulator | TipMap,
        *,
        rate: ArrayLike | None = None,
        period: float = 0.01,
        bounds: ArrayLike | None = None,
        start: ArrayLike | None = None,
        tol: float = 1e-6,
        point: str | None = None,
    ) -> None:
        """Prepare for steps, and begin at `start`.

        Args:
            arm: The design, or its tip map.
            rate: Largest change of each activation per second, in its own unit, one number for all
                or shape (bundles,). By default a tenth of the range of each a step.
            period: Time between two steps [s].
            bounds: Bounds of the activations, (lower, upper) of each, shape (bundles, 2), within
                those of the arm, which are the default.
            start: Activations to begin with, shape (bundles,); by default 0, or the next bound.
            tol: Largest tip error, in L, and the distance at which a target counts as reached.
            point: Name of the marker that counts as the tip; by default that of the design.

        Raises:
            InvalidInput: An argument is out of its range or has another shape.
            InvalidDesign: Some activation within the bounds would shorten the arm to nothing.
            NotPossible: The arm has drives with dead zones, or no stable posture at the start.
        """
        known = all_inputs(as_tip_map(arm, tol, point=point))
        if any(drive.dead_zone for drive in known.arm.drives):
            raise NotPossible("drives with dead zones cannot be tracked: leave their zones out")
        own, self._scale = np.array(known.box.bounds), known.box.scales  # of each activation
        inputs = replace(known.inputs, scale=tuple(self._scale.tolist()))
        self._origin = replace(known, inputs=inputs)  # in ranges, as are all numbers here
        allowed = f"(lower, upper) of {len(own)} bundles within those of the arm"
        ends = own if bounds is None else as_rows("bounds", bounds, 2, allowed)
        inside = ends.shape == own.shape and (ends == ends.clip(own[:, :1], own[:, 1:])).all()
        if not inside or (ends[:, 0] > ends[:, 1]).any():
            raise InvalidInput("bounds", ends.tolist(), allowed)
        self._ends, (low, high) = ends.T, ends.T / self._scale
        margin = np.minimum(_AT_END, 0.5 * (high - low))  # where tendons are taut
        self._low, self._high = low + margin, high - margin
        self._most, self._least = np.full(len(own), _SHARE), np.clip(0.0, self._low, self._high)
        rates = as_rates(rate, len(own))
        period = as_number("period", period, POSITIVE)
        if rates is not None:
            self._most = rates * period / self._scale
        self.begin(np.clip(0.0, *ends.T) if start is None else start)

    def begin(self, activations: ArrayLike) -> None:
        """Go to activations (bundles,), such as measured ones, whatever the rate.

        An arm under loads is in the posture to which they lead from rest.

        Raises:
            InvalidInput: They have another shape or are out of the bounds.
            NotPossible: There is no stable posture.
        """
        allowed = f"{len(self._low)} numbers within the bounds"
        given = as_rows("activations", activations, len(self._low), allowed)
        x = np.clip(given / self._scale, self._low, self._high)
        if len(x) != 1 or np.abs(x - given / self._scale).max() > 2.0 * _AT_END:
            raise InvalidInput("activations", activations, allowed)
        self._origin.prepare()
        self._map, self._beside, rod = self._origin, None, self._origin.rod
        if isinstance(rod, LoadedRod):
            inner = self._origin.inputs.activations(x)
            known = rod.equilibria(inner)
            if not known.is_stable[0]:
                raise NotPossible("the arm has no stable posture at the start: lighten its loads")
            solver, side, frame = rod.postures.solver, rod.postures.side, known.frame
            self._beside = PosturesBeside(solver, side, frame=frame, found=frame.copy())
            inputs = self._origin.inputs.continued_from(inner, known.frame)
            self._map = replace(self._map, rod=rod.with_postures(self._beside), inputs=inputs)
        self._x, self._damping = x[0], _FIRST_DAMPING
        self._here = self._motion(self._x)

    @property
    def activations(self) -> Array:
        """Where the arm is [unit of each], shape (bundles,)."""
        return np.clip(self._x * self._scale, *self._ends)

    def step(self, target: ArrayLike, direction: ArrayLike | None = None) -> TrackingStep:
        """Move the tip toward a target [m] (3,) and a direction (3,), 1 rad of which counts as L.

        Raises:
            InvalidInput: The target or the direction is no vector of three finite numbers.
        """
        place = as_points("target", target)
        if place.shape != (1, 3):
            raise InvalidInput("target", target, "one place, shape (3,)")
        wanted = None if direction is None else as_directions("direction", direction, 1)[0]
        before, snaps = self._x, self._advance(place[0], wanted)
        x, here, rod, tip_map = self._x, self._here, self._map.rod, self._map
        distance, angle = float(np.linalg.norm(place - here.tips)), 0.0
        if wanted is not None and here.directions is not None:
            angle = float(angles_from(here.directions, wanted[None])[0][0])
        bound = (np.minimum(x - self._low, self._high - x) <= _AT_END) & (self._low < self._high)
        if self._beside is not None and isinstance(rod, LoadedRod):  # it will have moved on
            beside = replace(self._beside, frame=self._beside.frame.copy())
            tip_map = replace(tip_map, rod=rod.with_postures(beside))
        names = np.array(self._map.box.names, object)
        assert here.slopes is not None
        return TrackingStep(
            activations=self.activations,
            tip=here.tips[0],
            jacobian=here.slopes[0] / self._scale,
            distance=distance,
            angle=angle,
            reached=max(distance / self._map.length, angle) <= self._map.tol,
            at_bound=tuple(names[bound]),
            at_rate=tuple(names[np.abs(x - before) >= self._most - _AT_END]),
            snaps=snaps,
            _map=tip_map,
        )

    def _advance(self, target: Array, wanted: Array | None) -> bool:
        """Take the trials that lead nearer; whether one ended where the arm is not stable."""
        low = np.maximum(self._low, self._x - self._most)
        high = np.minimum(self._high, self._x + self._most)
        if wanted is not None and self._here.directions is None:
            self._here = self._motion(self._x, directed=True)
        error, slope = self._rows(self._here, target, wanted)
        size, snaps, stale = math.sqrt(error @ error), False, False
        for k in range(_TRIALS if wanted is None else _DIRECTED_TRIALS):
            ease = _EASE * (k == 0 and self._damping <= _FIRST_DAMPING)
            trial, motion = self._trial(error, slope, low, high, ease), self._here
            if size <= _ENOUGH * self._map.tol or (trial == self._x).all():
                break
            if wanted is None:
                there = self._broyden(trial, target, error, slope)
            else:
                motion = self._motion(trial, directed=True)
                there = self._rows(motion, target, wanted)
            ahead = math.sqrt(there[0] @ there[0])
            if ahead < size:
                self._x, self._here, stale = trial, motion, wanted is None
                (error, slope), size = there, ahead
                if self._beside is not None:
                    self._beside.frame[:] = self._beside.found
                self._damping = max(0.1 * self._damping, _LEAST_DAMPING)
            else:
                snaps |= (lost := not math.isfinite(ahead))
                self._damping *= 1e4 if lost else 10.0
                self._damping = min(max(self._damping, _FIRST_DAMPING), _LARGEST_DAMPING)
        if stale:
            self._here = self._motion(self._x)
        return snaps

    def _trial(self, error: Array, slope: Array, low: Array, high: Array, ease: float) -> Array:
        """The end of the best step of the linear map in a box; the rest eases to the least."""
        softness = self._damping * (slope * slope).sum() / 3.0 + 1e-300
        low, high = low - self._x, high - self._x
        aim = np.where(slope.any(axis=0), self._least, self._high)  # slack tendons are pulled in
        center, step = ease * (aim - self._x)[None], np.zeros((1, len(low)))
        if len(error) == 3:
            given = slope[None], error[None], np.array([softness])
            project(center, *given, low[None], high[None], step, np.zeros((1, 3)))
        else:
            hessian = slope.T @ slope + softness * np.eye(len(low))
            gradient = -(slope.T @ error)[None]
            box_steps(0.0 * center, gradient, hessian[None], np.zeros(1), low, high, step)
        return np.clip(self._x + step[0], self._x + low, self._x + high)

    def _broyden(self, x: Array, target: Array, error: Array, slope: Array) -> tuple[Array, Array]:
        """What is missing at a trial, and Broyden's derivatives: exact ones cost ten times that."""
        tips, step = np.empty((1, 3)), x - self._x
        self._map.fill(x[None], TipOutputs(tips))
        left = (target - tips[0]) / self._origin.length
        return left, slope + np.outer(error - left - slope @ step, step) / (step @ step)

    def _motion(self, x: Array, *, directed: bool = False) -> TipOutputs:
        """Tip and slopes at activations (bundles,), direction and twists if wanted."""
        out = TipOutputs(np.empty((1, 3)), np.empty((1, 3, len(x))))
        if directed:
            out = out._replace(twists=np.empty((1, 6, len(x))), directions=np.empty((1, 3)))
        self._map.fill(x[None], out)
        return out

    def _rows(self, motion: TipOutputs, target: Array, wanted: Array | None) -> tuple[Array, Array]:
        """What is missing, in L and in rad, and its derivatives by the activations."""
        assert motion.slopes is not None
        length = self._origin.length
        error, slope = (target - motion.tips[0]) / length, motion.slopes[0] / length
        if wanted is None or motion.twists is None or motion.directions is None:
            return error, slope
        d, turn = motion.directions[0], motion.twists[0, 3:]
        (angle,), (axis,) = angles_from(motion.directions, wanted[None])
        return np.append(error, -angle * axis), np.append(slope, turn - np.outer(d, d @ turn), 0)
