"""Jobs of what an arm is for and of what was measured: live requirements, poses and their fit."""

from __future__ import annotations

from dataclasses import replace
from itertools import count

import numpy as np

from softreach.calibration import calibrate
from softreach.calibration.free_numbers import free_numbers
from softreach.calibration.model import MarkerModel
from softreach.requirements import check
from softreach.requirements.checks import quick_check
from softreach.studio.found import Sample
from softreach.studio.job import Given, Job, Learned, Results
from softreach.studio.scene.needs import draw_needs
from softreach.studio.state import requirements_of
from softreach.studio.work import rest
from softreach.support.errors import SoftreachError, no_warnings

_ACCURACY = 0.03  # of shares that are covered, and of distances between stations
_PAUSE = 0.4  # [s] without a change, before needs that are missed are looked at again
_POSES = ("reach", "cover", "stay_inside", "avoid")
"""Kinds of findings that other poses may change."""


def _check(given: Given) -> Results:
    """By poses that are found in some milliseconds; by every pose where these miss something."""
    state = given.state
    if not state.needs:
        yield Learned({"check": None, "check_refusal": ""})
        return
    try:
        with no_warnings():
            quick = quick_check(state.design, requirements_of(state.needs), _ACCURACY)
    except SoftreachError as error:
        yield Learned({"check": None, "check_refusal": str(error)})
        return
    yield Learned({"check": quick, "check_refusal": ""})
    if all(finding.met or finding.kind not in _POSES for finding in quick.findings):
        return
    rest(given.check, _PAUSE)
    progress = lambda _: given.check()
    with no_warnings():
        made = check(quick.arm, quick.requirements, accuracy=_ACCURACY, progress=progress)
    yield Learned({"check": made})


def _draw_needs(given: Given) -> None:
    draw_needs(given.scene, given.found.check)


CHECK_NEEDS = Job(
    "needs",
    ("design", "needs"),
    _check,
    _draw_needs,
    wanted=lambda state, _: state.needs,
    makes=("check",),
    draws=("/needs",),
)
"""The design against its needs."""


def _predict(given: Given) -> Results:
    """Markers of the pose, while the arm has its inputs."""
    bench, design = given.found.bench, given.state.design
    here = bench is not None and bench.posed(given.state).activation == given.state.activation
    if bench is None or not (here and bench.fits(design)):
        yield Learned({"sample": None})
        return
    arm = bench.fitted(design) or design
    pose = bench.data.of(np.array([bench.number]))
    # The inputs of a pose may be beyond the bounds of the design.
    predicted = MarkerModel.of(free_numbers(arm, ["pose"]), pose).of_arm(arm).places[0]
    yield Learned({"sample": Sample(pose.places[0], predicted, arm)})


def _draw_sample(given: Given) -> None:
    sample, design, scene = given.found.sample, given.state.design, given.scene
    if sample is None:
        scene.remove("/sample")
        return
    scene.draw_sample(sample.measured / design.length, sample.predicted / design.length)
    if sample.arm == design:
        scene.remove("/sample/arm")
    else:
        same = given.state.replace(design=sample.arm).activation
        scene.draw_arm(sample.arm, same, "/sample/arm", design.length)


DRAW_SAMPLE = Job(
    "sample",
    ("design", "activation", "found.bench"),
    _predict,
    _draw_sample,
    wanted=lambda _, found: found.bench is not None,
    makes=("sample",),
    draws=("/sample",),
)
"""Measured and predicted markers of a pose, while the arm has its inputs."""


def _fit(given: Given) -> Results:
    bench, steps = given.found.bench, count(1)
    if bench is None:
        return

    def progress(_: int) -> None:
        given.check()
        given.report(f"calibrating, step {next(steps)}")

    with no_warnings():
        result = calibrate(given.state.design, bench.data, free=bench.free, progress=progress)
    given.check()
    yield Learned({"bench": replace(bench, result=result)})


FIT_ARM = Job("fit", (), _fit, doing="calibrating")
"""Fits free numbers of the design to all poses."""
