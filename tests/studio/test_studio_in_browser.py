"""End to end: what a person does in the page, and what the library says about it."""

import socket

import numpy as np
import pytest

from softreach.arm import designs
from softreach.arm.parameters import changed, find_parameter
from softreach.studio import Quality, Studio
from softreach.studio import reach as stages
from softreach.studio.captions import size_text
from softreach.studio.start import KeptWork
from softreach.studio.state import Slice
from softreach.studio.work import all_cores
from tests.studio.conftest import SMALL
from tests.studio.tab import CHEAP, Tab
from tests.studio.test_hostile_states import design_with, look_with, state_with


def test_nothing_leaves_the_machine_and_nothing_of_viser_is_seen(tab, studio):
    warning = tab.page.get_by_text("Software WebGL rendering")
    assert warning.locator("visible=true").count() == 0
    assert not tab.page.evaluate("flashed")
    assert tab.requests
    assert all(url.startswith((studio.url, f"blob:{studio.url}", "data:")) for url in tab.requests)


def test_every_control_has_a_tooltip_with_its_meaning(tab):
    controls = tab.page.locator("[role=slider], input:not([type=hidden]), button")
    assert controls.count() > 40
    tab.open("Design")
    thumb = tab.slider("extent σ [deg]")
    tab.center(thumb)
    thumb.hover()
    meaning = tab.page.get_by_text("angular extent of a bundle")
    meaning.wait_for()
    box, panel = meaning.bounding_box(), tab.page.locator("[data-softreach]").bounding_box()
    assert box["x"] + box["width"] < panel["x"]  # it covers no row
    assert "hull" in tab.page.get_by_text("UNR").first.get_attribute("title")


def test_a_change_is_undone_and_done_again_by_buttons_and_keys(tab):
    tab.open("Design")
    first = tab.session.state.design
    tab.type("taper φ [deg]", "1")
    second = tab.session.state.design

    def shows(design, degrees: str) -> None:
        tab.wait(lambda: tab.session.state.design == design, "the design is there")
        tab.settle()
        thumb = tab.slider("taper φ [deg]")
        tab.wait(lambda: thumb.get_attribute("aria-valuenow") == degrees, f"{degrees} is shown")

    tab.press("Undo")
    shows(first, "2")
    tab.press("Redo")
    shows(second, "1")
    tab.page.locator("canvas").first.focus()
    tab.page.keyboard.press("Control+z")
    shows(first, "2")
    tab.page.keyboard.press("Control+Shift+z")
    shows(second, "1")
    assert tab.session.found.reach.arm == second


def test_what_is_typed_may_have_a_unit_lie_beyond_the_slider_or_be_refused_below_it(tab):
    page, alerts = tab.page, tab.page.locator(".sr-alert").locator("visible=true")
    tab.open("Design")
    thumb = tab.slider("revolution Ω [deg]")

    def is_shown(text: str, value: float = 0.0) -> None:
        page.locator(f"input[value='{text}']").locator("visible=true").first.wait_for()
        near = pytest.approx(value or float(text), abs=1e-6)
        tab.wait(lambda: float(thumb.get_attribute("aria-valuenow")) == near, "the thumb follows")

    tab.type("revolution Ω [deg]", "400")
    is_shown("400")
    tab.type("revolution Ω [deg]", "0.5 rad")
    is_shown("28.648", np.degrees(0.5))
    page.locator("input[value='28.648']").locator("visible=true").first.press("Enter")
    page.wait_for_timeout(500)  # what a field shows rounded is held as it was
    design = tab.session.state.design
    assert find_parameter(design, "revolution").value(design) == pytest.approx(0.5)
    before = tab.session.state
    tab.type("taper φ [deg]", "50")
    assert "taper φ [deg] = 50" in alerts.first.inner_text()
    page.locator("input[value='50']").locator("visible=true").wait_for()
    tab.type("revolution Ω [deg]", "far")
    page.get_by_text("must be a number, without a unit or in deg").wait_for()
    assert tab.session.state == before
    tab.type("revolution Ω [deg]", "90")
    is_shown("90")
    tab.wait(lambda: alerts.count() == 0, "what was refused is given up")
    page.locator("input[value='2']").locator("visible=true").first.wait_for()
    tab.open("Parts")
    tab.type("name", "renamed")  # which makes the fields of the part anew
    assert tab.session.note == ""


def test_a_slider_follows_others_but_is_not_set_back_while_it_is_in_the_hand(tab):
    thumb, mouse = tab.slider("taper φ [deg]"), tab.page.mouse
    tab.open("Design")
    tab.center(thumb)
    box = thumb.bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    mouse.move(x, y)
    mouse.down()
    mouse.move(x - 20, y, steps=4)
    tab.wait(lambda: thumb.get_attribute("aria-valuenow") != "2", "the thumb is moved")
    tab.settle()
    held = thumb.get_attribute("aria-valuenow")
    tab.session.update(lambda s: s.showing(color="rgb"), by_widget=True)
    tab.settle()
    assert thumb.get_attribute("aria-valuenow") == held
    mouse.up()
    tab.settle()
    taper = find_parameter(tab.session.state.design, "taper").value(tab.session.state.design)
    assert np.degrees(taper) == pytest.approx(float(held))
    tab.session.update(lambda s: s.replace(design=changed(s.design, {"taper": np.radians(1.25)})))
    tab.wait(lambda: thumb.get_attribute("aria-valuenow") == "1.25", "the thumb follows")


@pytest.mark.large
def test_a_page_with_a_token_that_is_reloaded_goes_on_where_it_was(browser, studio, tmp_path):
    with Studio(studio.start, token="secret", work=KeptWork(tmp_path)) as running:
        tab = Tab(browser, running)
        design = changed(tab.session.state.design, {"taper": 0.02})
        tab.session.update(lambda s: s.replace(design=design))
        tab.settle()
        known = set(running.sessions)
        tab.page.reload()
        tab.page.get_by_text("volume 0").first.wait_for()  # a page may connect twice
        tab.wait(lambda: set(running.sessions) - known, "the page connects again")
        tab.session = running.sessions[max(running.sessions)]
        reach = tab.reach_of(design)
        tab.page.get_by_text(size_text(reach.size, design)).wait_for()
        assert tab.errors == []
        tab.close()


@pytest.mark.large
def test_a_banner_says_that_the_server_is_gone_until_it_answers_again(browser, studio):
    with Studio(studio.start) as running:
        tab = Tab(browser, running)
    banner = tab.page.get_by_text("The server of this page is gone")
    banner.wait_for()
    with Studio(studio.start, port=running.server.get_port()):
        banner.wait_for(state="detached")
        tab.page.get_by_text("taper φ [deg]").wait_for()
    tab.context.close()


@pytest.mark.large
def test_a_browser_without_webgl_says_why_there_is_no_scene(browser, studio):
    page = browser.new_page()
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null;")
    page.goto(studio.url)
    page.get_by_text("switch WebGL on").wait_for()
    page.close()


@pytest.mark.large
def test_plots_follow_the_slice_and_the_design(tab):
    tab.open("View")
    tab.page.get_by_label("section", exact=True).check()
    tab.page.get_by_text("y = 0 m: ").wait_for()
    assert tab.page.locator("img[src^=blob]").first.evaluate("image => image.naturalWidth") > 600
    tab.session.update(lambda s: s.showing(slice=Slice(axis="z", center=0.5, thickness=0.1)))
    tab.choose("V against", "taper φ [deg]")
    images = tab.page.locator("img[src^=blob]")

    def sources() -> set[str]:
        return {image.get_attribute("src") for image in images.all()}

    tab.page.get_by_text("z = 0.5 m: ").wait_for()
    tab.page.get_by_text("values make no design").wait_for()
    pictures = sources()
    tab.open("Design")
    tab.drag("taper φ [deg]", -20)
    tab.settle()
    assert tab.session.found.sweep.arm == tab.session.found.section.arm == tab.session.state.design
    tab.wait(lambda: not sources() & pictures, "both pictures follow")


def test_a_bar_under_each_slider_says_how_the_volume_changes_and_fades_with_the_design(tab):
    bars = tab.page.locator("[role=img][title*='change of V']")
    tab.wait(lambda: tab.session.found.slopes and bars.count(), "the bars are there")
    slopes = tab.session.found.slopes
    assert bars.count() == len(slopes.slopes)
    first = bars.first
    box, thumb = first.bounding_box(), tab.slider("revolution Ω [deg]").bounding_box()
    assert 0 < box["y"] - thumb["y"] < 45
    old = tab.page.locator("[role=img][title^='of the design before']").first
    with all_cores:  # so that the new volume waits
        tab.drag("revolution Ω [deg]", 20)
        old.wait_for()
    tab.settle()
    assert tab.session.found.slopes.arm == tab.session.state.design
    old.wait_for(state="detached")

    last = tab.slider("offset of longitudinal [deg]")
    below = last.bounding_box()["y"] - first.bounding_box()["y"]
    tab.session.learn({"slopes": None})  # as in a tab that was opened a moment ago
    none = tab.page.locator("[role=img][title='not known yet']").first
    none.wait_for()
    assert last.bounding_box()["y"] - none.bounding_box()["y"] == pytest.approx(below, abs=1)


# No design and no failure takes the server or the tab away

ENDLESS = Quality(coarse_level=12, fine_level=12, fine_accuracy=1e-5, most_seconds=3600.0)


@pytest.mark.large
def test_a_running_computation_is_canceled_and_taken_up_again(tab):
    tab.session.quality = ENDLESS
    five = changed(designs.minimal_trunk(), {"longitudinal.bundles": 3})
    tab.session.update(lambda s: s.replace(design=five))
    tab.page.get_by_text("computing the exact set").first.wait_for()
    tab.press("Cancel")
    tab.settle()
    tab.page.get_by_text("Canceled").first.wait_for()
    tab.session.quality = SMALL
    tab.press("Compute what is missing")
    tab.wait(lambda: tab.session.found.reach.fine, "the rest is computed")
    tab.settle()
    reach = tab.session.found.reach
    tab.page.get_by_text(size_text(reach.size, reach.arm)).first.wait_for()


@pytest.mark.large
def test_what_runs_out_of_memory_says_so_and_the_next_change_is_computed(tab, monkeypatch):
    def fails(*_, **__):
        raise MemoryError

    monkeypatch.setattr(stages, "compute_cloud", fails)
    tab.session.update(lambda s: s.replace(design=changed(s.design, {"taper": 0.02})))
    tab.page.get_by_text("there is not enough free memory").first.wait_for()
    tab.settle()
    assert tab.page.get_by_text("computing").count() == 0
    monkeypatch.undo()
    tab.session.update(lambda s: s.replace(design=changed(s.design, {"taper": 0.03})))
    tab.settle()
    reach = tab.session.found.reach
    tab.page.get_by_text(size_text(reach.size, reach.arm)).first.wait_for()


@pytest.mark.large
def test_a_hundred_bundles_show_a_cloud_and_say_what_is_left_out(tab):
    changes = {"longitudinal.bundles": 98, "extent": 0.02}
    tab.session.update(lambda s: s.replace(design=changed(designs.minimal_trunk(), changes)))
    tab.wait(lambda: tab.session.found.reach.arm == tab.session.state.design, "a cloud is there")
    tab.open("Move")
    tab.page.get_by_text("60 more bundles have no slider here").wait_for()
    tab.session.cancel()
    tab.settle()


# Nothing that came from elsewhere is rendered, and the page talks to its own server alone

STRIKE = '<img src=x onerror="document.title=1"><b class=struck>struck</b><iframe srcdoc=struck>'
QUOTED = STRIKE.replace('"', '\\"')


NAMED = design_with('name = "left"', f'name = "{QUOTED}"')
RING = design_with(
    "inner_ratio", f'name = "{QUOTED}"\nmaterial = {{ name = "{QUOTED}" }}\ninner_ratio'
)
FILES = {
    "level.json": look_with(level=STRIKE),
    "color.json": look_with(level=12, color=STRIKE),
    "reference.json": state_with(design=RING, reference=NAMED),
    "kind.toml": design_with('kind = "fiber"', f'kind = "{QUOTED}"'),
    f"{STRIKE.replace('/', '')}.toml": "=",
}
"""One of each kind of place: a value, a choice, the names of parts, a key, the name of the file."""


def assert_nothing_struck(page):
    assert page.locator(".struck").count() == 0
    assert page.locator("iframe").count() == 0
    assert page.locator("img[src=x]").count() == 0
    assert page.title() != "1"


def test_no_text_of_a_file_or_its_name_is_markup(tab, tmp_path):
    """What is taken is on many panels; what is refused, in one message, as the text that it is."""
    tab.open("Export")
    taken, session = set(), tab.session
    for name, text in FILES.items():
        before, revision, session.note = session.state, session.revision, ""
        (tmp_path / name).write_text(text)
        tab.upload("Load state or design", tmp_path / name)
        tab.wait(lambda r=revision: session.note or session.revision != r, "it is read or refused")
        tab.settle()
        tab.page.wait_for_timeout(100)
        assert_nothing_struck(tab.page)
        if session.state != before:
            taken.add(name)
            for panel in ("Design", "Parts", "Move", "View", "Compare", "Export"):
                tab.open(panel)
                assert_nothing_struck(tab.page)
        if name == "level.json":
            tab.page.get_by_text(STRIKE).first.wait_for()
    assert "color.json" in taken


@pytest.mark.large
def test_the_page_talks_to_no_other_server_whatever_its_address_asks_for(browser, studio):
    with socket.create_server(("127.0.0.1", 0)) as elsewhere:
        elsewhere.setblocking(False)
        page = browser.new_page()
        page.add_init_script(CHEAP)
        page.goto(f"{studio.url}/?playbackPath=http://127.0.0.1:{elsewhere.getsockname()[1]}/x")
        page.locator("canvas").first.wait_for()
        page.wait_for_timeout(2000)  # it would have called by then
        with pytest.raises(BlockingIOError):
            elsewhere.accept()
        page.close()
