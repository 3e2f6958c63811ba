"""What follows from a change of the state."""

from __future__ import annotations

from hypothesis import given

from softreach.arm import Loads, designs
from softreach.arm.parameters import changed
from softreach.studio.jobs import (
    JOBS,
    ComputeReach,
    DrawArm,
    DrawCloud,
    DrawFree,
    DrawMap,
    DrawReference,
    DrawSurfaces,
    FollowEye,
    KeepState,
    SetTheme,
    SolveInverse,
    what_follows,
)
from softreach.studio.state import Camera, MapView, Slice, StudioState
from tests.studio.test_state import states


@given(states())
def test_nothing_follows_from_no_change_and_all_from_a_first_state(state):
    assert what_follows(state, state) == frozenset()
    assert what_follows(None, state) == frozenset(JOBS)


def test_each_change_makes_stale_what_depends_on_it(trunk):
    state = StudioState(design=trunk)
    other = changed(trunk, {"taper": 0.01})
    changes = {
        state.replace(activation=(-1.0, 0.0, 0.0)): {DrawArm},
        state.showing(color="multiplicity"): {DrawCloud, DrawReference},
        state.showing(slice=Slice(axis="x")): {DrawCloud, DrawReference, DrawSurfaces},
        state.showing(map=MapView(metric="volume")): {DrawMap},
        state.showing(surface=True): {DrawSurfaces},
        state.replace(target=(0.1, 0.0, 0.8)): {SolveInverse, FollowEye},
        state.showing(cut="half"): {FollowEye},
        state.showing(orthographic=True): {FollowEye},
        state.showing(dark=True): {SetTheme},
        state.replace(reference=trunk): {DrawReference},
        state.replace(design=other): {ComputeReach, DrawArm, SolveInverse, DrawMap},
        state.replace(camera=Camera(position=(1, 1, 1), look_at=(0, 0, 0))): set(),
    }
    for new, jobs in changes.items():
        assert what_follows(state, new) == jobs | {KeepState}


def test_the_cloud_without_loads_follows_the_design_but_not_its_loads(trunk):
    arm = designs.lce_arm()
    bare = StudioState(design=arm)
    light, heavy = (
        bare.replace(design=arm.replace(loads=Loads(payload=payload))) for payload in (0.0, 0.001)
    )
    assert DrawFree in what_follows(bare, light)
    assert DrawFree not in what_follows(light, heavy)
    assert DrawFree in what_follows(heavy, heavy.showing(free=False))
    assert DrawFree in what_follows(heavy, bare)
    assert DrawFree not in what_follows(bare, bare.replace(design=trunk))
