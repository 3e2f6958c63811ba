"""Loads are put on in the page: the cloud shrinks, unstable samples are marked, the arm hangs."""

from __future__ import annotations

import numpy as np
import pytest

import softreach as sr
from softreach.arm import designs
from softreach.rod.tip_map import TipStatus
from softreach.studio import StudioState
from softreach.studio.captions import size_text


@pytest.fixture
def loads_tab(tab):
    """An arm of a known stiffness."""
    state = StudioState(design=designs.lce_arm()).showing(level=12, cut="none")
    tab.session.update(lambda _: state)
    tab.settle()
    tab.open("Parts")
    tab.unfold("base and loads")
    return tab


def typed(tab, label, text):
    tab.settle()  # what follows from the change before shows in the fields too
    place = tab.field(label)
    place.fill(text)
    place.press("Enter")


def loads(tab):
    return tab.session.state.design.loads


def become(tab, condition, what, before=lambda: None):
    """Wait until the loads are as they should be, after doing something each time."""

    def done():
        before()
        return loads(tab) is not None and condition(loads(tab))

    tab.wait(done, what)
    tab.settle()


def enter(tab, label, text, condition, what):
    """Type a load, and again where the page put back the one before meanwhile."""

    def type_it():
        typed(tab, label, text)
        tab.page.wait_for_timeout(500)

    become(tab, condition, what, before=type_it)


def mirrored_unstable(arm):
    """An unstable activation of the arm that is its own mirror image."""
    gamma = np.random.default_rng(0).uniform(*arm.bounds.T, (1000, 3))
    gamma[:, 1] = gamma[:, 0]  # one that leans a little would fall to that side
    return gamma[sr.rod.tip_map(arm).status(gamma) == TipStatus.UNSTABLE][0]


def test_loads_are_put_on_shown_refused_saved_and_taken_off(loads_tab, tmp_path):
    tab, free = loads_tab, loads_tab.session.reach
    tab.choose("gravity", "up")
    become(tab, lambda one: one.gravity == (0.0, 0.0, 9.81), "gravity acts")
    loaded = tab.session.reach
    assert loaded.arm == tab.session.state.design
    share = loaded.volume / free.volume
    assert 0.7 < share < 0.85
    tab.page.get_by_text(
        f"{size_text(loaded.size, loaded.arm)} under loads, "
        f"{100 * share:.0f} % of {1e6 * free.volume:.4g} mL without"
    ).wait_for()
    assert tab.drawn("/free")
    tab.page.get_by_text("every sample rests in a stable equilibrium").wait_for()

    before = loads(tab)
    for text in ("-5", "1000000000"):
        typed(tab, "payload [g]", text)
        alert = tab.page.get_by_role("alert").filter(has_text="payload = ")
        alert.wait_for()
        assert loads(tab) == before
    enter(
        tab,
        "payload [g]",
        "2",
        lambda one: one.payload == pytest.approx(0.002),
        "a payload that can be",
    )
    alert.wait_for(state="hidden")

    tab.open("Export")
    tab.choose("data", "design (.toml)")
    design = sr.Manipulator.load(tab.save("Save data", tmp_path))
    assert design.loads == loads(tab)
    tab.open("Parts")

    tab.press("Take all loads off")
    tab.wait(lambda: loads(tab) is None, "nothing acts")
    tab.settle()
    assert not tab.drawn("/free")
    assert tab.session.reach.arm == designs.lce_arm()
    tab.wait(lambda: tab.field("gravity").input_value() == "none", "the fields are empty")
    told = tab.page.get_by_text("equilibrium")
    tab.wait(lambda: told.count() == 0, "nothing is said of equilibria")

    tab.session.update(lambda s: s.replace(design=designs.minimal_trunk()))
    tab.settle()
    tab.choose("gravity", "sideways")
    tab.page.get_by_role("alert").filter(has_text="on the tab Parts").wait_for()
    assert loads(tab) is None


@pytest.mark.large
def test_postures_under_loads_are_told(loads_tab):
    tab = loads_tab
    tab.choose("gravity", "up")
    become(tab, lambda one: one.gravity == (0.0, 0.0, 9.81), "gravity acts")
    enter(
        tab,
        "payload [g]",
        "30",
        lambda one: one.payload == pytest.approx(0.03),
        "the payload hangs",
    )
    reach = tab.session.reach
    assert reach.arm == tab.session.state.design
    share = f"{100 * reach.share(TipStatus.NO_EQUILIBRIUM):.2g}"
    tab.page.get_by_text(f"no equilibrium, not shown: {share} %").wait_for()

    tab.open("Move")  # it tells the posture
    tab.page.get_by_text("a stable equilibrium").locator("visible=true").wait_for()
    arm, cloud = tab.session.state.design, tab.session.reach.cloud
    pulled = cloud.activation.values[5]
    tab.session.update(lambda s: s.replace(activation=tuple(pulled)))
    tab.settle()
    np.testing.assert_allclose(
        tab.session.tip, sr.tip_positions(arm, [pulled])[0] / arm.length, atol=5e-5
    )
    folded = cloud.activation.values[reach.status == TipStatus.NO_EQUILIBRIUM][0]
    for lost, status, words in (
        (mirrored_unstable(arm), TipStatus.UNSTABLE, "an unstable equilibrium"),
        (folded, TipStatus.NO_EQUILIBRIUM, "no equilibrium: the arm is not drawn"),
    ):
        tab.session.update(lambda s, lost=lost: s.replace(activation=tuple(lost)))
        tab.settle()
        assert tab.session.posture == status
        tab.page.get_by_text(words).locator("visible=true").wait_for()
    assert not tab.drawn("/arm/0")
    tab.session.update(lambda s: s.replace(activation=()))
    tab.settle()
    assert tab.drawn("/arm/0")
