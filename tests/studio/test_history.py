"""Laws of going back and forth, without a server."""

from __future__ import annotations

from itertools import pairwise

import pytest

from softreach.arm import designs
from softreach.arm.parameters import changed
from softreach.studio.state import History, StudioState

START = StudioState(design=designs.minimal_trunk())


def tapered(state, taper):
    return state.replace(design=changed(state.design, {"taper": taper}))


def posed(state, first):
    return state.replace(activation=(first, 0.0, 0.0))


def walked(states, times=None):
    history = History()
    for k, (old, new) in enumerate(pairwise(states)):
        now = 10.0 * k if times is None else times[k]
        history = history.after(old, new, goes_on=True, clock=lambda now=now: now)
    return history


STEPS = [START, tapered(START, 0.01), posed(tapered(START, 0.01), -0.5), tapered(START, 0.02)]


def test_steps_back_and_forth_lead_through_every_state():
    history, state, seen = walked(STEPS), STEPS[-1], []
    for _ in STEPS[1:]:
        history, state = history.back(state)
        seen.append(state)
    assert seen == STEPS[-2::-1]
    for following in STEPS[1:]:
        history, state = history.forth(state)
        assert state == following


@pytest.mark.parametrize("step", ["back", "forth"])
def test_where_there_is_nothing_to_go_to_the_state_stays(step):
    assert getattr(History(), step)(START) == (History(), START)


def test_a_change_after_a_step_back_forgets_what_was_undone():
    history, state = walked(STEPS).back(STEPS[-1])
    history = history.after(state, posed(state, -0.1), goes_on=True)
    assert history.future == ()
    assert history.back(posed(state, -0.1))[1] == state


def test_changes_of_one_kind_in_short_order_are_one_step():
    states = [START, *(tapered(START, 0.001 * k) for k in range(1, 6))]
    history = walked(states, times=[0.1 * k for k in range(5)])
    assert history.back(states[-1])[1] == START


def test_a_change_that_does_not_go_on_is_a_step_of_its_own():
    one, two = tapered(START, 0.01), tapered(START, 0.02)
    history = History().after(START, one, goes_on=True)
    assert history.after(one, two, goes_on=False).back(two)[1] == one
    assert history.after(one, two, goes_on=True).back(two)[1] == START
    assert history.at_rest().after(one, two, goes_on=True).back(two)[1] == one


def test_changes_of_different_kinds_are_steps_of_their_own():
    states = [START, tapered(START, 0.01), posed(tapered(START, 0.01), -0.5)]
    history = walked(states, times=[0.0, 0.1])
    assert history.back(states[-1])[1] == states[1]


def test_the_view_is_not_undone():
    looked = tapered(START, 0.01).showing(color="manipulability")
    history = walked([START, tapered(START, 0.01), looked])
    back = history.back(looked)[1]
    assert back.design == START.design
    assert back.appearance == looked.appearance


def test_a_long_history_forgets_its_beginning():
    states = [posed(START, -0.001 * (k % 500)) for k in range(1, 400)]
    assert len(walked(states).past) == 200
