"""Derivatives of tips by parameters of the design, at fixed places of the activation box."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from softreach.arm.parameters import Parameter
from softreach.rod.rods import in_steps
from softreach.rod.tip_map import TipMap
from softreach.rod.view import stable_tips
from softreach.support import parallel
from softreach.support.arrays import Array
from softreach.support.progress import Progress, silent
from softreach.workspace.shifts import Shifts, shifts_along

_STEP = 1e-5  # of a parameter: tips in equal steps are smooth to rounding
_LOADED_STEP = 1e-3  # where they are as exact as an equilibrium is found
_TRIES = 16  # numbers of steps
_SAFETY = 10.0  # as an error of sixth order in the bending grows with the seventh power or so
_ROUNDING = 1e-14  # of a tip, in L


class TipDerivatives:
    """∂r/∂p of one design: from its two neighbors along each parameter, made once.

    All neighbors have as many steps along the arm, so that what these err by is differentiated too
    and does not become noise. At the end of a parameter's range both neighbors are on one side.
    """

    def __init__(
        self,
        rod: TipMap,
        parameters: Sequence[Parameter],
        tol: float = 0.0,
        progress: Progress = silent,
    ) -> None:
        """Make the neighbors.

        Args:
            rod: The tip map of the design: its tolerance is that of the derivatives as well, per
                change of a parameter by itself.
            parameters: The parameters.
            tol: A larger tolerance of a free arm, for which fewer steps are made: theory (27).
            progress: Called with 0 before each parameter, from any thread; it may raise to stop.

        Raises:
            InvalidInput: A parameter counts something, has no value, or its change holds or frees a
                bundle.
            InvalidDesign: The design has no neighbors with other values of a parameter.
        """
        self._progress = progress
        relative = _LOADED_STEP if rod.supports_unstable else _STEP
        self._shifts = [shifts_along(rod.arm, each, 1, relative) for each in parameters]
        steps = rod.steps
        if tol > rod.tol and not rod.supports_unstable:
            steps = math.ceil(steps * (rod.tol / tol) ** (1.0 / 6.0))
        self._rods = [_neighbors(rod, each, steps) for each in self._shifts]
        # A parameter may change by as much as itself before it is another design.
        scales = np.array([each.step for each in self._shifts]) / relative
        noise = (rod.tol if rod.supports_unstable else _ROUNDING) / relative
        self.error = (_SAFETY * max(rod.tol, tol) + noise) * rod.length / scales
        """Error of a derivative by each parameter [m per unit], shape (parameters,)."""

    def at(self, cube: Array) -> Array:
        """Derivatives at places of the unit cube of the free bundles: bounds move as they do.

        Args:
            cube: Places in [0, 1], shape (n, dimension).

        Returns:
            [m per unit], shape (n, 3, parameters); NaN without a stable equilibrium.
        """
        out = np.zeros((len(cube), 3, len(self._shifts)))

        def task(k: int) -> None:
            self._progress(0)
            for weight, rod in self._rods[k]:
                out[:, :, k] += weight * stable_tips(rod).tips(rod.box.from_free_cube(cube))

        parallel.run(partial(task, k) for k in range(len(self._shifts)))
        return out


def _neighbors(rod: TipMap, shifts: Shifts, fewest: int) -> list[tuple[float, TipMap]]:
    """Weights and tip maps of neighbors in one number of steps, that of breakpoints included."""
    used, rods = np.flatnonzero(shifts.weights), list[TipMap]()
    for steps in range(fewest, fewest + _TRIES):
        rods = [in_steps(shifts.arms[k], steps, rod) for k in used]
        if len({each.steps for each in rods}) == 1:
            break
    return list(zip(shifts.weights[used].tolist(), rods, strict=True))
