"""The tip is dragged in the page: the arm follows on its branch, as far as that leads."""

import io

import numpy as np
import pytest

import softreach as sr
from softreach.rod import as_tip_map


@pytest.fixture
def tab(tab):
    tab.open("Move")
    return tab


def pose(tab, activation):
    tab.session.update(lambda s: s.replace(activation=activation, target=None))
    tab.settle()
    tip = sr.tip_positions(tab.session.state.design, [activation])[0]
    tab.wait(lambda: np.allclose(tab.drawn("/grip").position, tip, atol=1e-4), "the ball is there")
    tab.page.wait_for_timeout(200)  # until the page has drawn it
    return tip


def around(tab, point):
    """What the page shows where a point of the scene [L] is, RGB from 0 to 1."""
    from matplotlib.image import imread

    x, y = tab.screen(point)
    clip = {"x": x - 4, "y": y - 4, "width": 8, "height": 8}
    return imread(io.BytesIO(tab.page.screenshot(clip=clip)))[..., :3]


@pytest.mark.large
def test_a_click_on_a_ghost_takes_that_solution(tab):
    arm, scene = tab.session.state.design, tab.session.scene
    tab.session.aim(np.array([0.2932, 0.0739, 0.0088]))
    tab.settle()
    shapes, eye = tab.session.found.answer.activations, tab.session.client.camera.position
    changes = np.abs(shapes - tab.session.state.activation).max(axis=1)
    here, other = changes.argmin(), changes.argmax()
    assert here != other
    places = as_tip_map(arm).frames(shapes[[other]], np.linspace(0.3, 0.9, 31)).position[0]
    place = next(p for p in places if scene.ghost_under(eye, p - eye) == other)
    tab.page.mouse.click(*tab.screen(place))
    there = tuple(shapes[other])
    tab.wait(lambda: tab.session.state.activation == there, "the arm is in the other shape")
    tab.settle()
    pointing = sr.configuration(arm, there, 2).directors.values[-1, 2]
    assert scene.pointing @ pointing > 1 - 1e-9


@pytest.mark.large
def test_beyond_the_boundary_the_arm_stays_near_and_a_line_shows_the_gap(tab):
    begin = pose(tab, (-0.2, -0.1, -0.1))
    tab.drag_tip(begin, begin + [0.0, 0.0, 0.35])
    tab.wait(lambda: tab.session.found.lag and tab.session.found.lag.dragged.gap > 0.02, "a gap")
    tab.settle()
    pull = tab.session.found.lag
    assert tab.drawn("/lag/label").text == f"{pull.dragged.gap:.3g} m short"
    tab.page.get_by_text(f"This branch ends {pull.dragged.gap:.3g} m short").wait_for()
    answer = sr.solve_inverse(tab.session.state.design, [pull.wanted])[0]
    assert len(answer) == 0
    assert pull.dragged.gap == pytest.approx(answer.gap, abs=1e-5)
    tab.page.mouse.up()
    tab.wait(lambda: tab.drawn("/lag") is None, "the drag rests")
    tab.settle()
    assert tab.drawn("/gap")


@pytest.mark.large
def test_a_handle_behind_the_arm_is_seen_through_it_and_can_be_grabbed(tab):
    tab.session.look_from("oblique")
    pose(tab, (-0.7, -0.4, -0.9))
    tab.wait(lambda: tab.drawn("/arm/0").opacity is None, "an arm beside its tip is solid")
    begin = pose(tab, (-0.48, -0.16, -1.23))  # the tip behind the body
    tab.wait(lambda: tab.drawn("/arm/0").opacity == 0.6, "an arm before its tip is not")
    tab.wait(lambda: around(tab, begin).min() < 0.45, "the ball is seen")  # the body is lighter
    tab.drag_tip(begin, begin + [0.0, 0.0, 0.02])
    tab.wait(lambda: tab.session.found.lag, "the arm follows")
    tab.page.mouse.up()
    tab.wait(lambda: tab.session.state.target is not None, "the drag rests")
    tab.settle()
