"""The section of the reachable set in the plane of the slice, in the page and as numbers."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.arm import designs
from softreach.geometry.surface import plane_cut
from softreach.inverse import solve_inverse
from softreach.studio.plots.section import enclosed_area, plane_counts, section_curves, within
from softreach.studio.reach import stages
from softreach.studio.state import PlotSettings, Slice
from tests.studio.conftest import SMALL


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
