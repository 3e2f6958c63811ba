"""What follows from a change of the state."""

from __future__ import annotations

import threading

from hypothesis import given
from numba import njit

from softreach.arm import Loads, designs
from softreach.arm.parameters import changed
from softreach.requirements import Requirements
from softreach.studio.app import JOBS
from softreach.studio.jobs.beside import DrawFree, DrawReference
from softreach.studio.jobs.calibration import DrawSample
from softreach.studio.jobs.inverse import SolveInverse
from softreach.studio.jobs.needs import CheckNeeds
from softreach.studio.jobs.page import KeepState, SetTheme
from softreach.studio.jobs.plots import PLOT_JOBS
from softreach.studio.jobs.reach import (
    ComputeReach,
    DifferentiateVolume,
    DrawArm,
    DrawCloud,
    DrawSurface,
    FollowCamera,
)
from softreach.studio.plots import PLOTS
from softreach.studio.session import what_follows
from softreach.studio.settings import PlotSettings
from softreach.studio.state import Camera, Slice, StudioState
from softreach.studio.work import CompilationWatch, Latest
from tests.studio.test_state import states

_PLOT = {plot.name: job for plot, job in zip(PLOTS, PLOT_JOBS, strict=True)}
NEEDS = Requirements(payloads=(0.0,)).to_toml()
SWEEP, SECTION = _PLOT["sweep"], _PLOT["section"]


@given(states())
def test_nothing_follows_from_no_change_and_all_from_a_first_state(state):
    assert what_follows(JOBS, state, state) == frozenset()
    assert what_follows(JOBS, None, state) == frozenset(JOBS)


def test_each_change_makes_stale_what_depends_on_it(trunk):
    state = StudioState(design=trunk)
    other = changed(trunk, {"taper": 0.01})
    changes = {
        state.replace(activation=(-1.0, 0.0, 0.0)): {DrawArm, DrawSample},
        state.showing(color="multiplicity"): {DrawCloud, DrawSurface},
        state.showing(slice=Slice(axis="x")): {DrawCloud, DrawSurface},
        state.showing(surface=False): {DrawCloud, DrawSurface},
        state.showing(cloud=True): {DrawCloud, DrawSurface},
        state.replace(target=(0.1, 0.0, 0.8)): {SolveInverse},
        state.showing(half=False): {FollowCamera},
        state.showing(dark=True): {SetTheme, DrawSurface},
        state.replace(needs=NEEDS): {CheckNeeds},
        state.replace(reference=trunk): {DrawReference},
        state.replace(design=other): {
            ComputeReach,
            DifferentiateVolume,
            DrawArm,
            DrawSample,
        },
        state.replace(camera=Camera(position=(1, 1, 1), look_at=(0, 0, 0))): set(),
    }
    for new, jobs in changes.items():
        assert what_follows(JOBS, state, new) == jobs | {KeepState}


def test_what_is_not_shown_follows_nothing_and_what_is_taken_away_follows_once(trunk):
    plots = PlotSettings(shown=("sweep", "section"))
    bare = StudioState(design=trunk)
    full = bare.replace(target=(0.1, 0.0, 0.8), reference=trunk, needs=NEEDS)
    full = full.showing(plots=plots)
    other = changed(trunk, {"taper": 0.01})
    moves = {
        full.replace(design=other): {
            ComputeReach,
            DifferentiateVolume,
            DrawArm,
            DrawSample,
            SolveInverse,
            CheckNeeds,
            SWEEP,
        },
        full.showing(slice=Slice(axis="x")): {
            DrawCloud,
            DrawReference,
            DrawSurface,
            SECTION,
        },
        full.showing(color="rgb"): {DrawCloud, DrawSurface},
        full.showing(surface=False): {DrawCloud, DrawSurface},
        full.showing(plots=PlotSettings()): {SWEEP, SECTION},
        full.replace(target=None): {SolveInverse},
        full.replace(reference=None): {DrawReference},
        full.replace(needs=""): {CheckNeeds},
    }
    for new, jobs in moves.items():
        assert what_follows(JOBS, full, new) == jobs | {KeepState}


def test_the_cloud_without_loads_follows_the_design_but_not_its_loads(trunk):
    arm = designs.lce_arm()
    bare = StudioState(design=arm)
    light, heavy = (
        bare.replace(design=arm.replace(loads=Loads(payload=payload))) for payload in (0.0, 0.001)
    )
    assert DrawFree in what_follows(JOBS, bare, light)
    assert DrawFree not in what_follows(JOBS, light, heavy)
    assert DrawFree in what_follows(JOBS, heavy, bare)
    assert DrawFree not in what_follows(JOBS, bare, bare.replace(design=trunk))


# Laws of background work


def test_of_waiting_work_only_the_last_is_done():
    done, started, go = [], threading.Event(), threading.Event()
    latest = Latest(done.append)

    def first(check):
        started.set()
        go.wait(600)
        done.append("first")

    latest.submit(first)
    assert started.wait(600)
    for name in ("second", "third", "fourth"):
        latest.submit(lambda check, name=name: done.append(name))
    go.set()
    assert latest.join(600)
    assert done == ["first", "fourth"]


def test_stale_work_is_dropped_between_its_stages():
    done, coarse, go = [], threading.Event(), threading.Event()
    latest = Latest(done.append)

    def staged(check):
        done.append("coarse")
        coarse.set()
        go.wait(600)
        check()
        done.append("fine")

    latest.submit(staged)
    assert coarse.wait(600)
    latest.submit(lambda check: done.append("newer"))
    go.set()
    assert latest.join(600)
    assert done == ["coarse", "newer"]


def test_trouble_is_told_and_the_next_work_is_done():
    told, done = [], []
    latest = Latest(told.append)
    latest.submit(lambda check: 1 / 0)
    assert latest.join(600)
    latest.submit(lambda check: done.append("next"))
    assert latest.join(600)
    assert isinstance(told[0], ZeroDivisionError)
    assert done == ["next"]


def test_a_closed_worker_does_nothing_more():
    done = []
    latest = Latest(done.append)
    latest.close()
    latest.submit(lambda check: done.append("late"))
    assert latest.join(600)
    assert done == []


# Compilation is noticed while it lasts


def test_compilation_is_told_when_it_begins_and_when_all_of_it_has_ended():
    told = []
    watch = CompilationWatch(told.append)
    inner = njit(lambda x: x + 1)
    outer = njit(lambda x: 2 * inner(x))
    assert outer(1) == 4
    assert told == [True, False]
    assert outer(2) == 6
    assert told == [True, False]  # compiled already
    assert watch.done == 1
    watch.close()
    outer(1.5)
    assert told == [True, False]
