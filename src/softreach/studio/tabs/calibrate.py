"""Measured poses: their markers over the arm, a fit to them, and the calibrated design."""

from __future__ import annotations

import io
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.calibration import Calibration
from softreach.calibration.measurements import read_measurements, read_table
from softreach.studio import markup
from softreach.studio.fields import attempt, bind_button
from softreach.studio.found import Bench
from softreach.studio.widgets import Line
from softreach.support.errors import InvalidInput, counted

if TYPE_CHECKING:
    from viser import GuiApi, UploadedFile

    from softreach.studio.session import Session

_ABOUT = {
    "load": "A table with a column for each input and three for each marker, each with its unit: "
    "tension1_N, tip_x_mm",
    "sample": "Moves the arm to the inputs of a sample. Large dots were measured, small ones are "
    "predicted",
    "free": "Lets the fit change this number",
    "fit": "Finds the numbers with which predicted markers come nearest to measured ones",
    "apply": "Makes the calibrated arm the design; can be undone",
}
_FREE = {
    "pose": "pose of the base",
    "taper": "taper φ",
    "revolution": "revolution Ω",
    "*.offset": "offsets of bundles",
    "*.young_modulus": "Young's moduli",
}
"""Numbers that a fit may change: name -> what the check box says."""


class CalibratePanel:
    """Measured poses of a tab, and the fit to them."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        self._session = session
        self._bench: Bench | None = None
        self._summarized: Calibration | None = None
        with tab, gui.add_folder("measured poses", expand_by_default=False):
            self._load = gui.add_upload_button("Load measured poses (CSV)", hint=_ABOUT["load"])
            self._text = Line(gui)
            self._samples = gui.add_folder("samples", visible=False)
            with self._samples:
                self._at = gui.add_slider("sample", 0, 1, 1, 0, hint=_ABOUT["sample"])
                self._residuals = Line(gui)
                self._free = {
                    name: gui.add_checkbox(label, name == "pose", hint=_ABOUT["free"])
                    for name, label in _FREE.items()
                }
                fit = gui.add_button("Fit", hint=_ABOUT["fit"])
                self._summary = Line(gui)
                self._apply = gui.add_button("Apply", hint=_ABOUT["apply"], visible=False)
        self._load.on_upload(lambda _: attempt(session, lambda: self._read(self._load.value)))
        self._at.on_update(self._moved)
        bind_button(fit, session, self._ask)
        bind_button(self._apply, session, self._applied)

    def show(self, session: Session) -> None:
        """Show the residuals of the sample, and what was fitted."""
        bench = session.found.bench
        if bench is None:
            return
        if bench is not self._bench:
            self._bench, data = bench, bench.data
            self._text.say(
                f"{data.source}: {counted(len(data), 'sample')} of {', '.join(data.marker_names)}; "
                f"inputs {', '.join(name or 'none' for name in data.input_names)}"
            )
            self._samples.visible = True
            self._at.max = max(len(data) - 1, 1)
            self._at.value = bench.number
        self._residuals.say(_residuals_text(bench, session))
        if bench.result is not self._summarized:
            self._summarized = bench.result
            self._summary.show("" if bench.result is None else _summary(bench.result))
        self._apply.visible = bench.fitted(session.state.design) is not None

    def _read(self, file: UploadedFile) -> None:
        arm = self._session.state.design
        data = read_measurements(arm, read_table(io.BytesIO(file.content), file.name))
        self._pose(Bench(data=replace(data, source=file.name), arm=arm))

    def _pose(self, bench: Bench) -> None:
        if not bench.fits(self._session.state.design):
            allowed = "one with the inputs and markers of the data"
            raise InvalidInput("design", "another one", allowed, "load the data again")
        self._session.update(bench.posed, goes_on=True)
        self._session.learn({"bench": bench})

    def _moved(self, event: Any) -> None:
        bench = self._session.found.bench
        if event.client_id is not None and bench is not None:
            number = min(int(self._at.value), len(bench.data) - 1)
            attempt(self._session, lambda: self._pose(replace(bench, number=number)))

    def _ask(self) -> None:
        bench = self._session.found.bench
        free = tuple(name for name, box in self._free.items() if box.value)
        if bench is not None:
            self._session.learn({"bench": replace(bench, free=free)})
            self._session.follow("fit")

    def _applied(self) -> None:
        bench, design = self._session.found.bench, self._session.state.design
        arm = None if bench is None else bench.fitted(design)
        if arm is None:
            raise InvalidInput("design", "changed since the fit", "the one that was fitted")
        self._session.update(lambda state: state.replace(design=arm))


def _residuals_text(bench: Bench, session: Session) -> str:
    sample, design = session.found.sample, session.state.design
    if sample is None:
        return "The arm is not at a measured pose: move the slider."
    known = zip(bench.data.marker_names, 1e3 * sample.distances, strict=True)
    each = [f"{name} {d:.3g} mm" if np.isfinite(d) else f"{name} unknown" for name, d in known]
    inputs = bench.data.inputs[bench.number]
    low, high = design.input_bounds.T
    beyond = bool(((inputs < low) | (inputs > high)).any())
    note = ". Its inputs are beyond the bounds, at which the arm is drawn" if beyond else ""
    return f"predicted − measured: {', '.join(each)}{note}."


def _summary(result: Calibration) -> str:
    report = result.report()
    parts, lines = [], []
    for part in report.sections:
        if part.rows and part.printed:
            parts.append(markup.table(part.head, [[(cell,) for cell in row] for row in part.rows]))
        lines += part.points
    lines.append(report.verdict)
    if not result.fit.converged:
        lines.append(f"The fit did not converge in {result.fit.evaluations} evaluations.")
    return "".join([*parts, *map(markup.paragraph, lines)])
