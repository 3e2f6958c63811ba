"""Jobs of measured poses: markers over the arm, and the fit of free numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np

from softreach.calibration import calibrate
from softreach.calibration.free_numbers import free_numbers
from softreach.calibration.model import MarkerModel
from softreach.studio.found import Found, Sample
from softreach.studio.job import Job, Learned, Page, Results, Tools
from softreach.studio.state import StudioState
from softreach.support.errors import no_warnings


def _predict(state: StudioState, found: Found, tools: Tools) -> Results:
    """Markers of the pose, while the arm has its inputs."""
    del tools
    bench, design = found.bench, state.design
    if bench is None:
        return
    if not bench.fits(design) or bench.posed(state).activation != state.activation:
        yield Learned({"sample": None})
        return
    arm = bench.fitted(design) or design
    pose = bench.data.of(np.array([bench.number]))
    # The inputs of a pose may be beyond the bounds of the design.
    predicted = MarkerModel.of(free_numbers(arm, ["pose"]), pose).of_arm(arm).places[0]
    yield Learned({"sample": Sample(pose.places[0], predicted, arm)})


def _draw_sample(page: Page, state: StudioState, found: Found) -> Mapping[str, Any]:
    sample, design = found.sample, state.design
    if sample is None:
        page.scene.remove("/sample")
        return {}
    page.scene.draw_sample(sample.measured / design.length, sample.predicted / design.length)
    if sample.arm == design:
        page.scene.remove("/sample/arm")
    else:
        same = state.replace(design=sample.arm).activation
        page.scene.draw_arm(sample.arm, same, "/sample/arm", design.length)
    return {}


DRAW_SAMPLE = Job(
    "sample",
    ("design", "activation", "found.bench"),
    _predict,
    _draw_sample,
    makes=("sample",),
    draws=("/sample",),
)
"""Measured and predicted markers of a pose, while the arm has its inputs."""


def _fit(state: StudioState, found: Found, tools: Tools) -> Results:
    bench = found.bench
    if bench is None:
        return
    steps = count(1)

    def progress(_: int) -> None:
        tools.check()
        tools.report(f"calibrating, step {next(steps)}")

    with no_warnings():
        result = calibrate(state.design, bench.data, free=bench.free, progress=progress)
    tools.check()
    yield Learned({"bench": replace(bench, result=result)})


FIT_ARM = Job("fit", (), _fit, doing="calibrating")
"""Fits free numbers of the design to all poses."""
