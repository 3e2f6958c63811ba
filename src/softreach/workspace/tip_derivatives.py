"""Derivatives by parameters of the design: of tips, and of all that is asked of its neighbors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from softreach.arm.driving import inner_arm
from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import Parameter, shifted
from softreach.arm.tables import check_extension
from softreach.rod.rods import in_steps
from softreach.rod.tip_map import TipMap
from softreach.support import parallel
from softreach.support.arrays import Array, Index, Mask
from softreach.support.errors import InvalidDesign, InvalidInput
from softreach.support.lazy import lazy
from softreach.support.progress import Progress, silent

_STEP = 1e-5  # of a parameter: tips in equal steps are smooth to rounding
_LOADED_STEP = 1e-3  # where they are as exact as an equilibrium is found
_TRIES = 16  # numbers of steps
_SAFETY = 10.0  # as an error of sixth order in the bending grows with the seventh power or so
_ROUNDING = 1e-14  # of a tip, in L
_ROOM = 100.0  # steps of a parameter, relative to it: with a larger ζ than that, neighbors have one


class TipDerivatives:
    """∂r/∂p of one design: from its two neighbors along each parameter, made once.

    All neighbors have as many steps along the arm, so that what these err by is differentiated too
    and does not become noise. At the end of a parameter's range both neighbors are on one side.
    Bounds of activations need no neighbors: they move γ at a place of the cube, and nothing else.
    """

    def __init__(
        self,
        tip_map: TipMap,
        parameters: Sequence[Parameter],
        tol: float = 0.0,
        progress: Progress = silent,
    ) -> None:
        """Make the neighbors; for a tolerance above the map's in fewer steps, theory (27).

        The progress is called with 0 before each parameter, from any thread.
        """
        self._progress, self._tip_map = progress, tip_map
        relative = _LOADED_STEP if tip_map.supports_unstable else _STEP
        steps = tip_map.steps
        if tol > tip_map.tol and not tip_map.supports_unstable:
            steps = math.ceil(steps * (tip_map.tol / tol) ** (1.0 / 6.0))
        self._moves = [_moves_of_bounds(tip_map, each) for each in parameters]
        self._rods = [
            _neighbors(tip_map, shifts_along(tip_map.arm, each, 1, relative), steps)
            if moves is None
            else []
            for each, moves in zip(parameters, self._moves, strict=True)
        ]
        # A parameter may change by as much as itself before it is another design.
        scales = np.array([_size(tip_map.arm, each) for each in parameters])
        noise = (tip_map.tol if tip_map.supports_unstable else _ROUNDING) / relative
        self.error = (_SAFETY * max(tip_map.tol, tol) + noise) * tip_map.length / scales
        """Error of a derivative by each parameter [m per unit], shape (parameters,)."""

    def at(self, cube: Array) -> Array:
        """Derivatives (n, 3, parameters) [m per unit] at places of the cube of the free bundles."""
        out, rod = np.zeros((len(cube), 3, len(self._rods))), self._tip_map
        by_bounds, slopes = [moves for moves in self._moves if moves is not None], np.empty(0)
        if by_bounds:
            _, slopes = rod.tips_and_slopes(rod.box.from_free_cube(cube))

        def task(k: int) -> None:
            self._progress(0)
            if (moves := self._moves[k]) is not None:
                (low, high), free = moves[:, rod.box.free], slopes[:, :, rod.box.free]
                out[:, :, k] = np.einsum("nij,nj->ni", free, low + cube * (high - low))
            for weight, tip_map in self._rods[k]:
                out[:, :, k] += weight * tip_map.tips(tip_map.box.from_free_cube(cube))

        parallel.run(partial(task, k) for k in range(len(self._rods)))
        return out


def _moves_of_bounds(tip_map: TipMap, parameter: Parameter) -> Array | None:
    """How far the bounds of each bundle move with a parameter, shape (2, bundles).

    None for a parameter of another kind, and where bounds are not those of the activations.
    """
    arm = tip_map.arm
    fields = [called.partition("[")[0] for _, called in parameter.places]
    if not {*fields} <= {"lower", "upper"} or not arm.is_direct or tip_map.supports_unstable:
        return None
    moves, bounds = np.zeros((2, arm.bundles)), list[float]()
    for ((_, *name), called), field in zip(parameter.places, fields, strict=True):
        own, side = [each.name for each in arm.bundle_actuators], int(field == "upper")
        rows = [k for k, each in enumerate(own) if [each] == name]
        rows = [rows[int(called[6:-1])]] if called != field else rows
        moves[side, rows] = 1.0
        bounds += arm.bounds[rows, side].tolist()
    if not bounds or tuple(bounds) != parameter.values(arm):
        return None
    _check_free(parameter, np.ptp(arm.bounds, axis=1)[moves.any(axis=0)] > 0)
    return moves


def _check_free(parameter: Parameter, stays: Mask) -> None:
    """Refuse a parameter whose change holds a bundle, or frees one that does not stay as it is."""
    if not stays.all():
        allowed = "one that neither holds a bundle nor frees one"
        raise InvalidInput("parameter", parameter.name, allowed)


def _neighbors(tip_map: TipMap, shifts: Shifts, fewest: int) -> list[tuple[float, TipMap]]:
    """Weights and tip maps of neighbors in one number of steps, that of breakpoints included."""
    used, rods = np.flatnonzero(shifts.weights), list[TipMap]()
    for steps in range(fewest, fewest + _TRIES):
        rods = [in_steps(shifts.arms[k], steps, tip_map, extends=shifts.extends) for k in used]
        if len({each.steps for each in rods}) == 1:
            break
    return list(zip(shifts.weights[used].tolist(), rods, strict=True))


@dataclass(frozen=True)
class Shifts:
    """Designs at offsets of a parameter, and the rules for its derivative."""

    offsets: Array  # change of the parameter in steps, whole numbers, (n,)
    step: float  # size of a step, in the unit of the parameter
    arms: tuple[Manipulator, ...]  # the designs, in the same order; the design itself at 0
    extends: bool  # true if ζ of the design is so large that no other's is 0

    @lazy
    def weights(self) -> Array:
        """The derivative is the sum of these times the values, to the highest order."""
        return self._weights(slice(None))

    @lazy
    def rough_weights(self) -> Array:
        """The same without the two offsets that are farthest, two orders lower."""
        return self._weights(np.sort(np.argsort(np.abs(self.offsets), kind="stable")[:-2]))

    def _weights(self, kept: Index | slice) -> Array:
        """Of the derivative at 0 by polynomials through some of the offsets."""
        powers = np.vander(self.offsets[kept], increasing=True).T
        weights = np.zeros_like(self.offsets)
        weights[kept] = np.linalg.solve(powers, np.eye(len(powers))[1]) / self.step
        return weights


def shifts_along(arm: Manipulator, parameter: Parameter, reach: int, relative: float) -> Shifts:
    """Neighbors of a design along a parameter: on both sides, or on one at the end of its range.

    `reach` is the number of steps to either side, twice as many to one side, and `relative` their
    size as a part of the parameter, of the smallest where parts differ; all move by the same.
    """
    values = parameter.values(arm)
    if parameter.whole:
        raise InvalidInput("parameter", parameter.name, "a number that can change continuously")
    if not np.isfinite(values).all():
        allowed = "a parameter that the design gives as one number"
        raise InvalidInput("parameter", parameter.name, allowed)
    step = relative * _size(arm, parameter)
    extends = min(map(check_extension, (arm, inner_arm(arm)))) > _ROOM * reach * relative
    ways = np.arange(-reach, reach + 1), np.arange(2 * reach + 1), -np.arange(2 * reach + 1)
    faults = list[InvalidDesign]()
    for offsets in ways:
        try:
            arms = [_shifted(arm, parameter, step * k) if k else arm for k in offsets]
            for made in () if extends else arms:
                check_extension(made)
            return Shifts(offsets.astype(float), step, tuple(arms), extends)
        except InvalidDesign as error:
            faults.append(error)
    raise faults[0]


def _size(arm: Manipulator, parameter: Parameter) -> float:
    """Size of a parameter, of the smallest where parts differ; of one that is 0, its scale."""
    if sizes := [abs(value) for value in parameter.values(arm) if value]:
        return min(sizes)
    if parameter.field.startswith(("lower", "upper")):
        return float(np.ptp(arm.input_bounds, axis=1).max()) or 1.0
    return {"m": 0.1 * arm.length, "rad": 0.1}.get(parameter.unit, 1.0)


def _shifted(arm: Manipulator, parameter: Parameter, amount: float) -> Manipulator:
    made = shifted(arm, parameter, float(amount))
    free, before = (bounds[:, 1] > bounds[:, 0] for bounds in (made.input_bounds, arm.input_bounds))
    _check_free(parameter, free == before)
    return made
