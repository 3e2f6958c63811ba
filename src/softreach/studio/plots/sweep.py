"""Volume of a design against one of its parameters."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import changed
from softreach.studio.reach import Quality, exact_set
from softreach.studio.shown_parameters import ShownParameter, slider_parameters
from softreach.studio.state import StudioState, solvable_rod
from softreach.studio.work import OverBudget, StaleCheck, all_cores
from softreach.support.errors import InvalidDesign, SoftreachError

Array = NDArray[np.float64]

_VALUES = 9
_SECONDS = 10.0  # of each value


class Sweep(NamedTuple):
    """Volumes of designs that differ in one parameter."""

    arm: Manipulator
    """The design that is varied."""
    parameter: ShownParameter
    value: Array
    """In the unit that is shown, ascending."""
    volume: Array
    """[m³]."""
    refused: tuple[float, ...] = ()
    """Values that make no design, or one that takes too long."""
    complete: bool = False

    def having(self, value: float, volume: float | None) -> Sweep:
        """With one more value; None for no volume there."""
        if volume is None:
            return self._replace(refused=(*self.refused, value))
        at = int(np.searchsorted(self.value, value))
        return self._replace(
            value=np.insert(self.value, at, value), volume=np.insert(self.volume, at, volume)
        )

    def moved(self, arm: Manipulator, parameter: ShownParameter) -> Sweep | None:
        """As of another design on the same curve; None if it differs in anything else."""
        if parameter.name != self.parameter.name:
            return None
        here = {parameter.name: parameter.shown * parameter.scale}
        try:
            same = changed(self.arm, here) == changed(arm, here)
        except InvalidDesign:
            return None
        return self._replace(arm=arm, parameter=parameter, complete=False) if same else None


def swept_parameter(state: StudioState) -> ShownParameter | None:
    """The parameter that is chosen, the first for an unknown one; None if there is none."""
    sliders = {slider.name: slider for slider in slider_parameters(state.design)}
    return sliders.get(state.appearance.plots.parameter) or next(iter(sliders.values()), None)


def sweep(
    arm: Manipulator,
    parameter: ShownParameter,
    quality: Quality,
    check: StaleCheck,
    known: Sweep | None = None,
) -> Iterator[Sweep]:
    """Volumes over the range of a slider, from the design's own value outwards, one by one.

    Args:
        arm: The design.
        parameter: What the slider changes.
        quality: How coarse, and how far off the tips may be.
        check: Called all the time; raises to stop.
        known: Volumes of another design, which are kept where the slider alone tells them apart.
    """
    moved = known.moved(arm, parameter) if known is not None else None
    volumes = moved or Sweep(arm, parameter, np.empty(0), np.empty(0))
    if moved is not None:
        yield moved
    done = {*volumes.value.tolist(), *volumes.refused}
    for value in (value for value in _values(parameter) if value not in done):
        check()
        with all_cores:
            volume = _volume(arm, parameter, value, quality, check)
        volumes = volumes.having(value, volume)
        yield volumes
    yield volumes._replace(complete=True)


def _values(parameter: ShownParameter) -> list[float]:
    """Steps of the slider over its range, and the present value; what is nearest to it first."""
    low, high = parameter.limits
    even = np.linspace(low, high, _VALUES)
    steps = np.clip(low + np.round((even - low) / parameter.step) * parameter.step, low, high)
    values = {round(float(value), 9) for value in steps} | {parameter.shown}
    return sorted(values, key=lambda value: abs(value - parameter.shown))


def _volume(
    arm: Manipulator,
    parameter: ShownParameter,
    value: float,
    quality: Quality,
    check: StaleCheck,
) -> float | None:
    try:
        design = changed(arm, {parameter.name: value * parameter.scale})
        solvable_rod(design)
        exact = exact_set(design, quality.coarse_accuracy, quality.tol, check, _SECONDS)
    except (SoftreachError, OverBudget, MemoryError):
        return None
    return exact.volume
