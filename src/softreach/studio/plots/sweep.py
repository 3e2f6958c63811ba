"""The volume of a design while one of its parameters changes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import changed
from softreach.studio.controls import Control, controls
from softreach.studio.reach import Quality, exact_set
from softreach.studio.state import solvable_rod
from softreach.studio.work import OverBudget, StaleCheck, all_cores
from softreach.support.errors import SoftreachError

__all__ = ["Sweep", "sweep", "swept_control"]

Array = NDArray[np.float64]

_VALUES = 9
_SECONDS = 10.0  # of each value


class Sweep(NamedTuple):
    """Volumes of designs that differ in one parameter."""

    arm: Manipulator
    """The design that is varied."""
    control: Control
    """The parameter."""
    value: Array
    """In the unit that is shown, ascending."""
    volume: Array
    """[L³]."""
    refused: int = 0
    """Values that make no design, or one that takes too long."""
    complete: bool = False

    def having(self, value: float, volume: float | None) -> Sweep:
        """With one more value; None for no volume there."""
        if volume is None:
            return self._replace(refused=self.refused + 1)
        at = int(np.searchsorted(self.value, value))
        return self._replace(
            value=np.insert(self.value, at, value), volume=np.insert(self.volume, at, volume)
        )


def swept_control(arm: Manipulator, name: str) -> Control | None:
    """The slider of a parameter, the first for an unknown name; None if there is none."""
    known = {control.name: control for control in controls(arm)}
    return known.get(name) or next(iter(known.values()), None)


def sweep(
    arm: Manipulator, control: Control, quality: Quality, check: StaleCheck
) -> Iterator[Sweep]:
    """Volumes over the range of a slider, from the design's own value outwards, one by one.

    Args:
        arm: The design.
        control: The slider.
        quality: How coarse, and how far off the tips may be.
        check: Called all the time; raises to stop.
    """
    found = Sweep(arm, control, np.empty(0), np.empty(0))
    for value in _values(control):
        check()
        with all_cores:
            volume = _volume(arm, control, value, quality, check)
        found = found.having(value, volume)
        yield found
    yield found._replace(complete=True)


def _values(control: Control) -> list[float]:
    """Steps of the slider over its range, and the present value; what is nearest to it first."""
    low, high = control.limits
    even = np.linspace(low, high, _VALUES)
    steps = np.clip(low + np.round((even - low) / control.step) * control.step, low, high)
    values = {round(float(value), 9) for value in steps} | {control.shown}
    return sorted(values, key=lambda value: abs(value - control.shown))


def _volume(
    arm: Manipulator, control: Control, value: float, quality: Quality, check: StaleCheck
) -> float | None:
    """In L³; None for no design, or one that takes too much time or memory."""
    try:
        made = changed(arm, {control.name: value * control.scale})
        solvable_rod(made)
        found = exact_set(made, quality.coarse_accuracy, quality.tol, check, _SECONDS)
    except (SoftreachError, OverBudget, MemoryError):
        return None
    return found.volume / made.length**3
