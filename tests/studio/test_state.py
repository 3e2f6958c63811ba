"""Laws of the state, without a server."""

import json
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach.arm import designs
from softreach.arm.actuators import FiberArchitecture
from softreach.arm.loads import Loads
from softreach.arm.parameters import changed
from softreach.requirements import Requirements, Target
from softreach.studio.state import MOUSE, Appearance, Camera, History, Slice, StudioState, TipPath
from softreach.support.errors import InvalidDesign
from tests.laws import arm_of, arms

numbers = st.floats(-3, 3)
vectors = st.tuples(numbers, numbers, numbers)
LOADED = designs.lce_arm().replace(loads=Loads(gravity=(0.0, 0.0, 9.81), payload=0.005))
PATH = TipPath.through([[0, 0, 1.0], [0.1, 0, 0.9]], (-0.5, 0.0, 0.0))
NEEDS = Requirements(targets=(Target([(0.1, 0.0, 0.8)]),), payloads=(0.2,)).to_toml()


@st.composite
def states(draw: st.DrawFn) -> StudioState:
    axis = draw(st.sampled_from(["none", "x", "y", "z"]))
    look = Appearance(
        level=draw(st.integers(12, 21)),
        color=draw(st.sampled_from(["rgb", "bundle 0", "multiplicity"])),
        slice=Slice(axis=axis, center=draw(numbers), thickness=draw(st.floats(0.01, 1))),
        surface=draw(st.booleans()),
        mouse=draw(st.sampled_from([*MOUSE])),
        section=draw(st.booleans()),
        sweep=draw(st.sampled_from(["", "taper"])),
    )
    return StudioState(
        design=draw(arms() | st.just(LOADED)),
        activation=tuple(draw(st.lists(numbers, max_size=4))),
        appearance=look,
        target=draw(st.none() | vectors),
        reference=draw(st.none() | st.just(designs.redundant_trunk())),
        camera=draw(st.none() | st.builds(Camera, position=vectors, look_at=vectors)),
        needs=draw(st.sampled_from(["", NEEDS])),
        path=draw(st.none() | st.just(PATH)),
    )


@given(states())
def test_a_state_comes_back_from_its_text(state):
    assert StudioState.from_json(state.to_json()) == state


@given(states())
def test_activations_stay_within_the_bounds_whatever_the_design(state):
    low, high = state.design.bounds.T
    gamma = np.array(state.activation)
    assert gamma.shape == (state.design.bundles,)
    assert ((low <= gamma) & (gamma <= high)).all()


def test_a_design_with_other_bundles_keeps_the_activations_that_it_can(trunk):
    state = StudioState(design=trunk, activation=(-1.0, -0.5, -0.2))
    more = state.replace(design=designs.redundant_trunk())
    assert more.activation == (-1.0, -0.5, -0.2, 0.0)
    narrow = state.replace(design=trunk.with_bounds((-0.4, -0.1)))
    assert narrow.activation == (-0.4, -0.4, -0.2)


def test_a_design_that_would_be_shortened_to_nothing_is_no_state(trunk):
    fiber = FiberArchitecture(name="all", revolution=0.0, extent=6.0)
    squeezed = arm_of(fiber, activation_bounds=(-4.0, 0.0))
    with pytest.raises(InvalidDesign, match="must keep ζ > 0: narrow the bounds"):
        StudioState(design=squeezed)
    with pytest.raises(InvalidDesign, match="must keep ζ > 0"):
        StudioState(design=trunk).replace(reference=squeezed)
    good = json.loads(StudioState(design=trunk).to_json())
    for key in ("design", "reference"):
        with pytest.raises(InvalidDesign, match=r"state file: 1 problem\n.*must keep ζ > 0"):
            StudioState.from_json(json.dumps(good | {key: squeezed.to_toml()}))


def test_the_unit_of_the_page_goes_with_every_design_and_is_saved(trunk):
    state = StudioState(design=trunk).showing(unit="in")
    other = state.replace(design=designs.lce_arm().replace(display_unit="mm"))
    for each in (state, other, StudioState.from_json(other.to_json())):
        assert each.design.length_unit.name == "in"


# Laws of going back and forth, without a server

START = StudioState(design=designs.minimal_trunk())


def tapered(state, taper):
    return state.replace(design=changed(state.design, {"taper": taper}))


def posed(state, first):
    return state.replace(activation=(first, 0.0, 0.0))


def walked(states):
    history = History()
    for k, (old, new) in enumerate(pairwise(states)):
        history = history.after(old, new, goes_on=True, now=10.0 * k)
    return history


STEPS = [START, tapered(START, 0.01), posed(tapered(START, 0.01), -0.5), tapered(START, 0.02)]


def test_steps_back_and_forth_lead_through_every_state():
    history, state, seen = walked(STEPS), STEPS[-1], []
    for _ in STEPS[1:]:
        history, state = history.step(state, back=True)
        seen.append(state)
    assert seen == STEPS[-2::-1]
    for following in STEPS[1:]:
        history, state = history.step(state, back=False)
        assert state == following
    for back in (True, False):  # where there is nothing to go to
        assert History().step(START, back=back) == (History(), START)


def test_a_change_after_a_step_back_forgets_what_was_undone():
    history, state = walked(STEPS).step(STEPS[-1], back=True)
    history = history.after(state, posed(state, -0.1), goes_on=True, now=0.0)
    assert history.future == ()
    assert history.step(posed(state, -0.1), back=True)[1] == state


def test_changes_in_short_order_that_go_on_are_one_step_if_they_are_of_one_kind():
    one, two = tapered(START, 0.01), tapered(START, 0.02)
    history = History().after(START, one, goes_on=True, now=0.0)

    def before(history, goes_on=True, now=0.1, to=two):
        return history.after(one, to, goes_on=goes_on, now=now).step(to, back=True)[1]

    assert before(history) == START
    assert before(history, goes_on=False) == one
    assert before(history, now=10.0) == one
    assert before(history, to=posed(one, -0.5)) == one
    assert before(replace(history, kind="")) == one


def test_the_view_is_not_undone():
    looked = STEPS[1].showing(color="manipulability")
    history = walked([*STEPS[:2], looked])
    back = history.step(looked, back=True)[1]
    assert back.design == START.design
    assert back.appearance == looked.appearance


def test_a_long_history_forgets_its_beginning():
    states = [posed(START, -0.001 * (k % 500)) for k in range(1, 400)]
    assert len(walked(states).past) == 200
