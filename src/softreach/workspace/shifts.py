"""A design and its neighbors along one parameter, and derivatives from what is asked of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import Parameter
from softreach.arm.parameters.draft import Draft
from softreach.arm.tables import check_extension
from softreach.support.arrays import Array
from softreach.support.errors import InvalidDesign, InvalidInput
from softreach.support.lazy import lazy

_SCALES = {"m": 0.1, "rad": 0.1}
"""Of parameters that are 0, by their unit; lengths in L."""


@dataclass(frozen=True)
class Shifts:
    """Designs at offsets of a parameter, and the rules for its derivative."""

    offsets: Array
    """Change of the parameter in steps, whole numbers, shape (n,)."""
    step: float
    """Size of a step, in the unit of the parameter."""
    arms: tuple[Manipulator, ...]
    """The designs, in the same order; the design itself at 0."""

    @lazy
    def weights(self) -> Array:
        """The derivative is the sum of these times the values, to the highest order."""
        return _weights(self.offsets) / self.step

    @lazy
    def rough_weights(self) -> Array:
        """The same without the two offsets that are farthest, two orders lower."""
        kept = np.sort(np.argsort(np.abs(self.offsets), kind="stable")[:-2])
        weights = np.zeros(len(self.offsets))
        weights[kept] = _weights(self.offsets[kept]) / self.step
        return weights


def shifts_along(arm: Manipulator, parameter: Parameter, reach: int, relative: float) -> Shifts:
    """Neighbors of a design along a parameter: on both sides, or on one at the end of its range.

    Where several parts share the parameter, each moves from its own value by the same amount.

    Args:
        arm: The design.
        parameter: The parameter that changes.
        reach: Steps to either side; twice as many to one side.
        relative: Size of a step as a part of the parameter, of the smallest where parts differ.

    Raises:
        InvalidInput: The parameter counts something, or has no value.
        InvalidDesign: The design has no neighbors on either side.
    """
    values = parameter.values(arm)
    if parameter.whole:
        raise InvalidInput("parameter", parameter.name, "a number that can change continuously")
    if not np.isfinite(values).all():
        allowed = "a parameter that the design gives as one number"
        raise InvalidInput("parameter", parameter.name, allowed)
    sizes = [abs(value) for value in values if value]
    step = relative * min(sizes, default=_scale(arm, parameter))
    ways = np.arange(-reach, reach + 1), np.arange(2 * reach + 1), -np.arange(2 * reach + 1)
    fault: InvalidDesign | None = None
    for offsets in ways:
        try:
            arms = tuple(_shifted(arm, parameter, step * k) if k else arm for k in offsets)
        except InvalidDesign as error:
            fault = fault or error
        else:
            return Shifts(offsets.astype(float), step, arms)
    assert fault is not None
    raise fault


def _scale(arm: Manipulator, parameter: Parameter) -> float:
    """Scale of a parameter that is 0: an offset or a bound of another one."""
    if parameter.field.startswith(("lower", "upper")):
        return float(np.ptp(arm.input_bounds, axis=1).max()) or 1.0
    return _SCALES.get(parameter.unit, 1.0) * (arm.length if parameter.unit == "m" else 1.0)


def _shifted(arm: Manipulator, parameter: Parameter, amount: float) -> Manipulator:
    draft = Draft(arm)
    parameter.shift(draft, float(amount))
    made = draft.made()
    check_extension(made)
    free, before = (bounds[:, 1] > bounds[:, 0] for bounds in (made.input_bounds, arm.input_bounds))
    if not np.array_equal(free, before):
        allowed = "one that neither holds a bundle nor frees one"
        raise InvalidInput("parameter", parameter.name, allowed)
    return made


def _weights(offsets: Array) -> Array:
    """Of the derivative at 0 by polynomials through all offsets."""
    powers = np.vander(offsets, increasing=True).T
    return np.linalg.solve(powers, np.eye(len(offsets))[1])
