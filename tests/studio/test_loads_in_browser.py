"""Loads are put on in the page: the cloud shrinks, unstable samples are marked, the arm hangs."""

from __future__ import annotations

import numpy as np
import pytest

import softreach as sr
from softreach.arm import designs
from softreach.geometry.surface import plane_cut
from softreach.inverse import solve_inverse
from softreach.rod.tip_map import TipStatus
from softreach.studio import StudioState
from softreach.studio.plots.section import enclosed_area, plane_counts, section_curves, within
from softreach.studio.reach import stages
from softreach.studio.settings import PlotSettings
from softreach.studio.state import Slice
from tests.studio.conftest import SMALL


@pytest.fixture
def loads_tab(tab):
    """An arm of a known stiffness."""
    state = StudioState(design=designs.lce_arm()).showing(level=12, half=False)
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
    reach = tab.session.found.reach
    assert reach.arm == tab.session.state.design
    share = f"{100 * reach.share(TipStatus.NO_EQUILIBRIUM):.2g}"
    tab.page.get_by_text(f"no equilibrium, not shown: {share} %").wait_for()

    tab.open("Move")  # it tells the posture
    tab.page.get_by_text("a stable equilibrium").locator("visible=true").wait_for()
    arm, cloud = tab.session.state.design, tab.session.found.reach.cloud
    pulled = cloud.activation.values[5]
    tab.session.update(lambda s: s.replace(activation=tuple(pulled)))
    tab.settle()
    np.testing.assert_allclose(
        tab.session.found.tip, sr.tip_positions(arm, [pulled])[0] / arm.length, atol=5e-5
    )
    folded = cloud.activation.values[reach.status == TipStatus.NO_EQUILIBRIUM][0]
    for lost, status, words in (
        (mirrored_unstable(arm), TipStatus.UNSTABLE, "an unstable equilibrium"),
        (folded, TipStatus.NO_EQUILIBRIUM, "no equilibrium: the arm is not drawn"),
    ):
        tab.session.update(lambda s, lost=lost: s.replace(activation=tuple(lost)))
        tab.settle()
        assert tab.session.found.posture == status
        tab.page.get_by_text(words).locator("visible=true").wait_for()
    assert not tab.drawn("/arm/0")
    tab.session.update(lambda s: s.replace(activation=()))
    tab.settle()
    assert tab.drawn("/arm/0")


# End to end: two places, one of them missed, and a slider that changes that


# End to end: the reachable set in the plane of the slice


@pytest.mark.large
def test_the_section_is_that_of_the_exact_set(tab):
    tab.open("Plots")
    tab.page.get_by_label("section", exact=True).check()
    tab.page.get_by_text("y = 0 m: ").wait_for()
    picture = tab.page.locator("img").first
    assert picture.evaluate("image => image.naturalWidth") > 600
    reach = tab.session.found.reach
    curves = section_curves(reach, Slice())
    points = np.concatenate(curves)
    assert np.ptp(points[:, 1]) == 0.0
    assert all(np.array_equal(curve[0], curve[-1]) for curve in curves)
    onto = reach.exact.distance(points[::10] * reach.arm.length)
    assert np.abs(onto).max() < 2 * reach.exact.image.lattice.cell


@pytest.mark.large
def test_the_section_follows_the_slice_and_the_design(tab):
    tab.session.update(lambda s: s.showing(plots=PlotSettings(shown=("section",))))
    tab.settle()
    before = tab.page.locator("img").first.get_attribute("src")
    cut = Slice(axis="z", center=0.5, thickness=0.1)
    tab.session.update(lambda s: s.showing(slice=cut))
    tab.page.get_by_text("z = 0.5 m: ").wait_for()
    assert tab.page.locator("img").first.get_attribute("src") != before
    area = enclosed_area(section_curves(tab.session.found.reach, cut), 2)
    tab.page.get_by_text(f"{area:.4g} m²").wait_for()
    tab.open("Design")
    tab.drag("revolution Ω [deg]", 40)
    tab.settle()
    assert tab.session.found.section.arm == tab.session.state.design
    changed = enclosed_area(section_curves(tab.session.found.reach, cut), 2)
    assert changed != area
    tab.page.get_by_text(f"{changed:.4g} m²").wait_for()


@pytest.mark.large
def test_the_numbers_in_the_plane_are_those_of_the_inverse():
    arm = designs.minimal_trunk(revolution=np.radians(180), taper=np.radians(2))
    *_, reach = stages(arm, 14, SMALL, lambda: None)
    tips = reach.cloud.tip.values[:4000]
    folded = tips[solve_inverse(arm, tips).counts > 1] / arm.length
    cut = Slice(axis="x", center=float(np.median(folded[:, 0])))
    curves = section_curves(reach, cut)
    counts = plane_counts(reach, curves, 0)["count"].stack(place=("x", "y", "z"))
    rows = np.flatnonzero(counts.values)[::20]
    targets = np.array([counts.place.values[row] for row in rows])
    np.testing.assert_array_equal(counts.values[rows], solve_inverse(arm, targets).counts)
    assert counts.values.max() > 1  # this arm folds
    assert within(curves, targets / arm.length, 0).all()


@pytest.mark.large
def test_the_areas_of_sections_sum_up_to_the_volume(tab):
    reach = tab.session.found.reach
    surface, length = reach.exact.surface(), reach.arm.length
    low, high = surface.vertices[:, 2].min(), surface.vertices[:, 2].max()
    edges = np.linspace(low, high, 41)
    middles, width = (edges[1:] + edges[:-1]) / 2, edges[1] - edges[0]
    areas = [enclosed_area(plane_cut(surface, 2, at), 2) for at in middles]
    assert abs(sum(areas) * width / length**3 - reach.volume) < 0.02 * reach.volume
