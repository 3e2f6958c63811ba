"""Five journeys through the page: what a person does there, and what is seen of it."""

import re

import numpy as np
import pytest

import softreach as sr
from softreach.arm import designs
from softreach.rod.kinematics import marker_positions
from softreach.studio.captions import size_text
from softreach.support import palette
from tests.calibration.arms import table
from tests.studio.tab import like
from tests.studio.test_goals import INPUTS, MARKED, MARKERS, NAMES, PLACES

ORANGE = (0.92, 0.35, 0.0)
"""Color of targets and of measured markers."""
TRUNK = designs.minimal_trunk()


def written(path, rows, head):
    """A CSV file."""
    np.savetxt(path, rows, "%.17g", ",", header=",".join(head), comments="")
    return path


def pulled(tab, activation):
    """Type the activation of each bundle."""
    for name, value in zip(("left", "right", "longitudinal"), activation, strict=True):
        tab.type(f"γ {name}", str(value))


def test_an_arm_is_designed_loaded_seen_to_shrink_and_exported(tab, tmp_path):
    page = tab.page
    tab.open("Design")
    tab.choose("start from", "lce_arm")
    arm = designs.lce_arm()
    page.get_by_text(size_text(tab.reach_of(arm).size, arm)).wait_for()
    arm = arm.replace(display_unit="in")
    tab.open("View")
    tab.choose("unit", "in")
    free = size_text(tab.reach_of(arm).size, arm)
    assert " in³" in free
    page.get_by_text(free).wait_for()
    tab.show_surface()
    before = tab.pixels()

    tab.open("Parts")
    tab.unfold("base and loads")
    tab.choose("gravity", "up")
    page.get_by_text(re.compile(r"under loads, \d+ % of [\d.]+ in³ without")).wait_for()
    page.get_by_text("every sample rests in a stable equilibrium").wait_for()
    assert tab.changed(before) > 0.02

    tab.type("payload [g]", "-5")
    alert = page.get_by_role("alert").filter(has_text="payload = ")
    alert.wait_for()
    tab.type("payload [g]", "2g")
    assert tab.field("base at [in]").count() == 1
    alert.wait_for(state="hidden")
    tab.wait(lambda: tab.field("payload [g]").input_value() == "2", "the payload is in grams")

    tab.open("Export")
    tab.choose("data", "design (.toml)")
    design = sr.Manipulator.load(tab.save("Save data", tmp_path))
    assert design.loads == sr.Loads(gravity=(0.0, 0.0, 9.81), payload=0.002)
    tab.choose("data", "exact surface (.ply)")
    mesh = pytest.importorskip("trimesh").load(tab.save("Save data", tmp_path))
    assert mesh.volume * 0.0254**3 == pytest.approx(tab.reach_of(design).volume, rel=5e-3)

    tab.open("Parts")
    tab.press("Take all loads off")
    page.get_by_text(free).wait_for()
    assert page.get_by_text("equilibrium").locator("visible=true").count() == 0


def test_the_tip_is_dragged_sent_to_a_target_with_ghosts_and_led_along_a_path(tab, tmp_path):
    page = tab.page
    tab.open("Move")
    start, end = (-0.7, -0.4, -0.9), (-0.6, -0.55, -0.8)
    pulled(tab, start)
    begin, goal = sr.tip_positions(TRUNK, [start, end])
    page.get_by_text(f"tip at ({begin[0]:.6f}, {begin[1]:.6f}, {begin[2]:.6f}) m").first.wait_for()
    tab.settle()
    tab.drag_tip(begin, goal)
    page.mouse.up()
    page.get_by_text(re.compile(r"\d activations? reach")).first.wait_for()
    tab.settle()
    here = sr.tip_positions(TRUNK, [tab.session.state.activation])[0]
    np.testing.assert_allclose(tab.screen(here), tab.screen(goal), atol=3)

    alone = tab.pixels()
    tab.type("target [m]", "0.2932, 0.0739, 0.0088")
    page.get_by_text(re.compile(r"[2-9] activations reach")).first.wait_for()
    assert tab.changed(alone) > 0.01  # the shapes of the others
    assert page.get_by_role("button", name="\N{CHECK MARK}").count() == 1
    tab.press("Clear the target")

    tab.choose("mouse", "sets the target")
    page.mouse.click(*tab.screen(goal))
    page.get_by_text(re.compile(r"\d activations? reach")).first.wait_for()
    tab.settle()
    aimed = tab.screen(np.array(tab.session.state.target))
    np.testing.assert_allclose(aimed, tab.screen(goal), atol=12)
    tab.press("Clear the target")
    tab.choose("mouse", "drags the tip")

    pulled(tab, (-1.0, -0.2, -0.5))
    around = np.linspace(0, 2 * np.pi, 33)
    offset = 0.05 * np.stack([np.cos(around) - 1, np.sin(around), 0 * around], axis=1)
    tip = sr.tip_positions(TRUNK, [tab.session.state.activation])[0]
    tab.upload("Load a path (CSV)", written(tmp_path / "circle.csv", tip + offset, "xyz"))
    page.get_by_text("All 33 points are followed").wait_for()
    saved = tab.save("Save the path (CSV)", tmp_path).read_text().splitlines()
    assert len(saved) == 1 + 33
    tab.press("Play")
    point = tab.slider("point")
    tab.wait(lambda: point.get_attribute("aria-valuenow") == "32", "the arm is at the end")


def test_a_design_is_kept_and_what_a_change_costs_is_read_beside_it(tab):
    page = tab.page
    tab.show_surface()
    tab.open("Compare")
    tab.press("Keep this design")
    page.get_by_role("cell", name="volume [m³]").wait_for()
    tab.open("Design")
    tab.type("taper φ [deg]", "1")
    tab.settle()
    tab.open("Compare")
    rows = page.locator("table tr")
    tab.wait(lambda: "taper φ [deg]" in rows.last.inner_text(), "the taper has a row")
    title, kept, now, change = rows.last.inner_text().split("\t")
    assert (title, kept, now, change) == ("taper φ [deg]", "2", "1", "\N{MINUS SIGN}1")
    both = tab.pixels()
    tab.press("Swap")
    tab.wait(lambda: rows.last.inner_text().split("\t")[1:3] == ["1", "2"], "they are swapped")
    tab.press("Undo")
    tab.settle()
    tab.press("Forget")
    rows.first.wait_for(state="detached")
    assert tab.changed(both) > 0.01  # the gray boundary


def test_requirements_are_seen_met_and_missed_and_follow_a_slider(tab):
    page = tab.page
    green, red = palette.MET, palette.MISSED
    tab.show_surface(False)
    page.get_by_label("arm", exact=True).uncheck()  # whose bundles are red and green, too
    tab.open("Goals")
    tab.press("Add to the needs")  # where the tip is
    page.get_by_text("place 1: reached").wait_for()
    tab.field("numbers").fill("0.37, 0.15, 0.85")
    tab.settle()
    tab.press("Add to the needs")
    page.get_by_text("place 2: missed by 0.0082").wait_for()
    assert like(tab.pixels(), red) > 5

    tab.open("Design")
    page.get_by_text("needs: 1 of 2 met · place 2 missed by").wait_for()
    tab.drag("taper φ [deg]", -85)
    page.get_by_text("needs: 2 of 2 met").wait_for()
    tab.wait(lambda: like(tab.pixels(), red) == 0, "the cross is a ball")
    assert like(tab.pixels(), green) > 5
    tab.open("Goals")
    page.get_by_text("place 2: reached").wait_for()
    tab.press("Undo")
    page.get_by_text("place 2: missed by").wait_for()


def test_measured_poses_are_stepped_through_fitted_to_and_the_fit_applied(tab, tmp_path):
    page = tab.page
    columns = table(PLACES, INPUTS, NAMES, MARKERS)
    rows = np.column_stack(list(columns.values()))
    bench = written(tmp_path / "bench.csv", rows, [key.removesuffix("_N") for key in columns])
    MARKED.save(tmp_path / "arm.toml")

    tab.show_surface(False)
    tab.open("Export")
    tab.upload("Load state or design", tmp_path / "arm.toml")
    tab.settle()
    tab.open("Goals")
    tab.unfold("measured poses")
    tab.upload("Load measured poses (CSV)", bench)
    page.get_by_text("bench.csv: 20 samples of half, tool").wait_for()
    assert like(tab.pixels(), ORANGE) > 20
    tab.slider("sample").press("ArrowRight")
    half, tool = 1e3 * np.linalg.norm(PLACES[1] - marker_positions(MARKED, INPUTS[1])[0], axis=1)
    page.get_by_text(f"half {half:.3g} mm, tool {tool:.3g} mm").wait_for()
    page.get_by_label("taper φ", exact=True).check()
    tab.press("Fit")
    page.get_by_text("20 fitted").first.wait_for()
    tab.press("Apply")
    tab.settle()
    assert tab.session.state.design.profile.taper == pytest.approx(0.012, abs=3e-4)
    tab.press("Undo")
    tab.settle()
    assert tab.session.state.design == MARKED
