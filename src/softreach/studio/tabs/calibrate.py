"""Calibration: measured markers over the arm, free numbers, and the calibrated design."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import parameters
from softreach.calibration.measurements import read_measurements, read_table
from softreach.studio.fields import attempt, bind_button
from softreach.studio.jobs.calibration import Bench, DrawSample, FitArm
from softreach.studio.widgets import Line, TextKind, TypedField
from softreach.support.errors import InvalidInput, counted

if TYPE_CHECKING:
    from viser import GuiApi, UploadedFile

    from softreach.studio.session import Session

_HINT = "Measured poses of the real arm tell the numbers of its design."
_FILE_SIZE = 20_000_000  # bytes of a table that is loaded
_POSE: tuple[str, ...] = ("pose", "pose.position", "pose.rotation")
_ADD = "choose a number"
_SHOWN = ("as designed", "as calibrated")
_ABOUT = {
    "load": "A table with a column for each input and three for each marker, each with its unit: "
    "tension1_N, tip_x_mm",
    "columns": "Where names do not tell: inputs and markers, and their columns, such as "
    "p1 = valve3_kPa, tip = disk3",
    "sample": "Moves the arm to the inputs of a sample. Large dots were measured, small ones are "
    "predicted",
    "markers": "Predictions of the design, or of the calibrated arm, which is drawn over it",
    "free": "Numbers that the fit may change, separated by commas: pose is where the base stands; "
    "* is any text; a = b ties two",
    "number": "A number of this design that the fit may change too",
    "hold out": "Share of the samples, by chance, that the fit does not see and is tested on",
    "fit": "Finds the numbers with which predicted markers come nearest to measured ones",
    "apply": "Makes the calibrated arm the design; can be undone",
}


def _columns_of(text: str) -> Mapping[str, str] | None:
    pairs = [part.split("=") for part in text.split(",") if part.strip()]
    if any(len(pair) != 2 for pair in pairs):
        return None
    return {name.strip(): column.strip() for name, column in pairs}


_COLUMNS = TextKind(
    "names and columns, such as tip = disk3",
    _columns_of,
    lambda columns: ", ".join(f"{name} = {column}" for name, column in columns.items()),
)


class CalibratePanel:
    """Measured poses of a tab, and the fit to them."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        self._session = session
        self._design: Manipulator | None = None
        """The design whose numbers are offered."""
        self._bench: Bench | None = None
        self._file: UploadedFile | None = None
        with tab, gui.add_folder("measured poses", expand_by_default=False):
            Line(gui, _HINT)
            self._load = gui.add_upload_button("Load measured poses (CSV)", hint=_ABOUT["load"])
            self._columns = TypedField(gui, "columns", {}, _ABOUT["columns"], _COLUMNS)
            self._text = Line(gui)
            self._samples = gui.add_folder("samples", visible=False)
            with self._samples:
                self._sample_widgets(gui)
            self._fits = gui.add_folder("fit", visible=False)
            with self._fits:
                self._fit_widgets(gui)
        self._listen()

    def _sample_widgets(self, gui: GuiApi) -> None:
        self._at = gui.add_slider("sample", 0, 1, 1, 0, hint=_ABOUT["sample"])
        self._residuals = Line(gui)
        self._shown = gui.add_dropdown("markers", _SHOWN, hint=_ABOUT["markers"], visible=False)
        self._clear = gui.add_button("Remove the data", hint="and what was fitted to them")

    def _fit_widgets(self, gui: GuiApi) -> None:
        self._free = gui.add_text("free", "pose", hint=_ABOUT["free"])
        self._number: Any = gui.add_dropdown("free also", (_ADD, *_POSE), hint=_ABOUT["number"])
        self._held = gui.add_number(
            "hold out", 0.0, min=0.0, max=0.9, step=0.05, hint=_ABOUT["hold out"]
        )
        self._fit = gui.add_button("Fit", hint=_ABOUT["fit"])
        self._summary = Line(gui)
        self._apply = gui.add_button("Apply", hint=_ABOUT["apply"], visible=False)

    def _listen(self) -> None:
        session = self._session
        self._load.on_upload(lambda _: attempt(session, lambda: self._read(self._load.value)))
        self._columns.on_update(lambda _: attempt(session, self._read_again))
        self._at.on_update(self._moved)
        self._shown.on_update(self._chosen)
        bind_button(self._clear, session, self._remove)
        self._number.on_update(lambda _: attempt(session, self._added))
        bind_button(self._fit, session, self._ask)
        bind_button(self._apply, session, self._applied)

    def show(self, session: Session) -> None:
        """Show the residuals of the sample, and what was fitted."""
        bench, design = session.bench, session.state.design
        if bench is not self._bench:
            self._bench = bench
            self._begin(bench)
        if bench is None:
            return
        if design is not self._design:
            self._design = design
            known = parameters(design).items()
            self._number.options = _ADD, *_POSE, *(name for name, p in known if not p.whole)
        self._residuals.say(_residuals_text(bench, session))
        result = bench.result
        self._summary.show(bench.summary)
        self._shown.visible = result is not None
        if self._shown.value != (shown := _SHOWN[bench.as_calibrated]):
            self._shown.value = shown
        self._apply.visible = result is not None and result.start == design

    def _begin(self, bench: Bench | None) -> None:
        """Show what was loaded."""
        self._samples.visible = self._fits.visible = bench is not None
        if bench is None:
            self._text.say()
            return
        data = bench.data
        self._text.say(
            f"{data.source}: {counted(len(data), 'sample')} of {', '.join(data.marker_names)}; "
            f"inputs {', '.join(name or 'none' for name in data.input_names)}"
        )
        self._at.max = max(len(data) - 1, 1)
        self._at.value = bench.sample

    def _read_again(self) -> None:
        if self._file is not None:
            self._read(self._file)

    def _read(self, file: UploadedFile) -> None:
        """Take the poses of a file, and move the arm to the first."""
        self._file = file
        if len(file.content) > _FILE_SIZE:
            size, most = len(file.content) / 1e6, _FILE_SIZE / 1e6
            raise InvalidInput(file.name, f"{size:.3g} MB", f"at most {most:g} MB")
        arm, columns = self._session.state.design, self._columns.value
        table = read_table(io.BytesIO(file.content), file.name)
        markers = {name for name in columns if name not in arm.input_names}
        data = read_measurements(
            arm,
            table,
            inputs={name: column for name, column in columns.items() if name not in markers},
            markers={name: columns[name] for name in markers},
        )
        self._session.bench = Bench(data=replace(data, source=file.name), arm=arm)
        self._pose()

    def _pose(self) -> None:
        """Move the arm to the inputs of the sample."""
        session, bench = self._session, self._session.bench
        if bench is None:
            return
        if not bench.fits(session.state.design):
            allowed = "one with the inputs and markers of the data"
            raise InvalidInput("design", "another one", allowed, "load the data again")
        session.update(bench.posed, goes_on=True)
        session.follow(DrawSample)

    def _moved(self, event: Any) -> None:
        bench = self._session.bench
        if event.client_id is not None and bench is not None:
            bench.sample = min(int(self._at.value), len(bench.data) - 1)
            attempt(self._session, self._pose)

    def _chosen(self, event: Any) -> None:
        bench = self._session.bench
        if event.client_id is not None and bench is not None:
            bench.as_calibrated = self._shown.value == _SHOWN[True]
            self._session.follow(DrawSample)

    def _remove(self) -> None:
        self._session.bench = self._file = None
        self._session.follow(DrawSample)
        self._session.show()

    def _added(self) -> None:
        name, self._number.value = self._number.value, _ADD
        if name != _ADD:
            self._free.value = ", ".join(dict.fromkeys([*self._names(), name]))

    def _names(self) -> tuple[str, ...]:
        return tuple(name.strip() for name in self._free.value.split(",") if name.strip())

    def _ask(self) -> None:
        fit = self._session.job(FitArm)
        fit.free, fit.hold_out = self._names(), float(self._held.value)
        fit.ask()

    def _applied(self) -> None:
        bench, design = self._session.bench, self._session.state.design
        if bench is None or bench.result is None or bench.result.start != design:
            raise InvalidInput("design", "changed since the fit", "the one that was fitted")
        arm = bench.result.arm
        self._session.update(lambda state: state.replace(design=arm))


def _residuals_text(bench: Bench, session: Session) -> str:
    """Distances of the markers of the sample in mm."""
    if bench.distances is None:
        return "The arm is not at a sample: move the slider."
    names, design = bench.data.marker_names, session.state.design
    known = zip(names, 1e3 * bench.distances, strict=True)
    each = [f"{name} {d:.3g} mm" if np.isfinite(d) else f"{name} unknown" for name, d in known]
    inputs = bench.data.inputs[bench.sample]
    low, high = design.input_bounds.T
    beyond = bool(((inputs < low) | (inputs > high)).any())
    note = ". Its inputs are beyond the bounds, at which the arm is drawn" if beyond else ""
    return f"predicted − measured: {', '.join(each)}{note}."
