"""Plots beside the scene follow the design and the slice, in the page and as numbers."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.geometry.surface import plane_cut
from softreach.studio.figures import enclosed_area, section_curves
from softreach.studio.state import Slice


@pytest.fixture(autouse=True)
def _nothing_beside_the_scene(tab):
    yield
    tab.session.update(lambda s: s.showing(section=False, sweep=False, slice=Slice()))
    tab.settle()


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
    tab.session.update(lambda s: s.showing(section=True))
    tab.settle()
    before = tab.page.locator("img").first.get_attribute("src")
    cut = Slice(axis="z", center=0.5, thickness=0.1)
    tab.session.update(lambda s: s.showing(slice=cut))
    tab.page.get_by_text("z = 0.5 m: ").wait_for()
    tab.wait(lambda: tab.page.locator("img").first.get_attribute("src") != before, "it follows")
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
def test_the_areas_of_sections_sum_up_to_the_volume(tab):
    reach = tab.session.found.reach
    surface, length = reach.exact.surface(), reach.arm.length
    low, high = surface.vertices[:, 2].min(), surface.vertices[:, 2].max()
    edges = np.linspace(low, high, 41)
    middles, width = (edges[1:] + edges[:-1]) / 2, edges[1] - edges[0]
    areas = [enclosed_area(plane_cut(surface, 2, at), 2) for at in middles]
    assert abs(sum(areas) * width / length**3 - reach.volume) < 0.02 * reach.volume


@pytest.mark.large
def test_the_volume_against_a_parameter_is_computed_while_one_looks(tab):
    tab.open("Plots")
    tab.page.get_by_label("V against parameter").check()
    tab.settle()
    tab.choose("parameter", "taper φ [deg]")
    tab.wait(lambda: tab.session.state.appearance.swept == "taper", "it is chosen")
    tab.page.get_by_text("values make no design").wait_for()
    before = tab.page.locator("img").first.get_attribute("src")
    tab.open("Design")
    tab.drag("taper φ [deg]", -20)
    tab.settle()
    assert tab.session.found.sweep.arm == tab.session.state.design
    tab.wait(lambda: tab.page.locator("img").first.get_attribute("src") != before, "it follows")
