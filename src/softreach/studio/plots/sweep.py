"""Volume of a design against one of its parameters."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import changed
from softreach.studio.fields import Attribute, Fields
from softreach.studio.plots.plot import Chart, Curve, Plot
from softreach.studio.reach import Quality, exact_set
from softreach.studio.shown_parameters import ShownParameter, slider_parameters
from softreach.studio.state import StudioState, solvable_rod
from softreach.studio.work import OverBudget, StaleCheck, all_cores
from softreach.support.errors import InvalidDesign, SoftreachError

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.studio.session import Session

Array = NDArray[np.float64]

_VALUES = 9
_SECONDS = 10.0  # of each value
_VOLUME = Curve("V", "#2f6db5", points=True)


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


class SweepPlot(Plot):
    """Chart of volumes against the parameter that is chosen in the tab."""

    name = "sweep"
    label = "V against parameter"
    hint = "volume of designs that differ from this one in one parameter, computed while you look"
    depends_on = ("design", "appearance.plots.parameter")

    def __init__(self, gui: GuiApi, folder: Any) -> None:
        self._chart = Chart(gui, folder)

    @classmethod
    def add_settings(cls, fields: Fields) -> None:
        fields.dropdown(
            "parameter",
            _offered,
            Attribute(
                lambda state: parameter.name if (parameter := swept_parameter(state)) else "",
                lambda state, name: state.showing(
                    plots=state.appearance.plots.showing(cls.name).sweeping(name)
                ),
            ),
            "what changes in the plot of V against a parameter",
        )

    @staticmethod
    def compute(session: Session, check: StaleCheck) -> Iterator[Sweep]:
        state, latest = session.state, session.figures.plots.get(SweepPlot.name)
        parameter = swept_parameter(state)
        if parameter is None:
            return
        subject = state.design, parameter
        if latest is None or not latest.complete or (latest.arm, latest.parameter) != subject:
            yield from sweep(state.design, parameter, session.quality, check, latest)

    def show(self, result: Sweep) -> str:
        unit = result.arm.length_unit
        volumes = result.volume[result.value == result.parameter.shown]
        if len(result.value) > 1:
            label, here = result.parameter.label, result.parameter.shown
            known, y = unit.of(result.volume, 3), unit.label("V", 3)
            self._chart.show(label, result.value, (_VOLUME,), (known,), here, y=y)
        parts = [f"here V = {unit.rounded(v, 3)} at {result.parameter.shown:g}" for v in volumes]
        if result.refused:
            parts.append(f"{len(result.refused)} values make no design or take too long")
        return " · ".join([*parts, *([] if result.complete else ["computing ..."])])


def _offered(state: StudioState) -> dict[str, str]:
    sliders = slider_parameters(state.design)
    return {slider.name: slider.label for slider in sliders} or {"": ""}
