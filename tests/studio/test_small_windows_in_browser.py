"""Everything can be reached and read in the window of a phone, and beside docked plots."""

import numpy as np
import pytest

import softreach as sr
from tests.studio.tab import Tab

SIZES = {"laptop": {"width": 1366, "height": 768}, "phone": {"width": 390, "height": 844}}


@pytest.fixture
def opened(tab):
    """The tab in a window of a kind, with everything in sight."""

    def told() -> bool:
        box = tab.page.locator("canvas").first.bounding_box()
        return np.isclose(tab.session.camera.aspect, box["width"] / box["height"], rtol=0.01)

    def opened(kind: str) -> Tab:
        tab.page.set_viewport_size(SIZES[kind])
        tab.wait(told, "the page has told how wide it is")
        tab.page.wait_for_timeout(500)  # the eye looks twice before it moves
        tab.settle()
        tab.session.look_from("oblique")
        tab.settle()
        return tab

    return opened


@pytest.mark.large
@pytest.mark.parametrize("kind", SIZES)
def test_all_seven_tabs_stand_in_one_line_within_the_window(opened, kind):
    tab = opened(kind)
    tab.page.get_by_role("tab", name="Export").wait_for()

    def fit() -> bool:
        places = [one.bounding_box() for one in tab.page.get_by_role("tab").all()]
        right = max(place["x"] + place["width"] for place in places)
        lines = len({round(place["y"]) for place in places})
        return len(places) == 7 and lines == 1 and right <= SIZES[kind]["width"] + 0.5

    tab.wait(fit, "the page is laid out, all tabs in one line")
    letters = "e => [parseFloat(getComputedStyle(e).fontSize), getComputedStyle(e).letterSpacing]"
    size, spacing = tab.page.get_by_role("tab", name="Export").evaluate(letters)
    assert size >= 11
    assert spacing == "normal"


LACKING = """() => {
    const lacking = [];
    const seen = e => e.checkVisibility({visibilityProperty: true, opacityProperty: true});
    for (const e of document.querySelectorAll("[role=slider], input, button, [role=tab]")) {
        const box = e.getBoundingClientRect();
        if (e.type === "hidden" || e.ariaHidden || !seen(e) || !box.width) continue;
        const label = [...(e.labels || [])].map(l => l.textContent).join("");
        if (!(e.ariaLabel || label || e.textContent).trim()) lacking.push(["name", e.outerHTML]);
        if (Math.min(box.width, box.height) < 23.9) lacking.push(["size", e.outerHTML]);
    }
    return lacking;
}"""
FAINT = """() => {
    const pixel = new OffscreenCanvas(1, 1).getContext("2d", {willReadFrequently: true});
    const color = text => {
        pixel.clearRect(0, 0, 1, 1);
        pixel.fillStyle = text;
        pixel.fillRect(0, 0, 1, 1);
        return [...pixel.getImageData(0, 0, 1, 1).data].map(value => value / 255);
    };
    const light = rgb => rgb.slice(0, 3)
        .map(c => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4)
        .reduce((sum, c, k) => sum + c * [0.2126, 0.7152, 0.0722][k], 0);
    const faint = [];
    const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
    for (let text = texts.nextNode(); text; text = texts.nextNode()) {
        const e = text.parentElement;
        if (!text.data.trim() || ["STYLE", "SCRIPT", "NOSCRIPT"].includes(e.tagName)) continue;
        if (!e.checkVisibility({visibilityProperty: true, opacityProperty: true})) continue;
        if (e.closest(":disabled, [data-disabled], .mantine-Notification-root")) continue;
        let ground = e;
        while (ground && color(getComputedStyle(ground).backgroundColor)[3] < 1)
            ground = ground.parentElement;
        const below = ground ? light(color(getComputedStyle(ground).backgroundColor)) : 1;
        const above = light(color(getComputedStyle(e).color));
        const ratio = (Math.max(above, below) + 0.05) / (Math.min(above, below) + 0.05);
        if (ratio < 4.5) faint.push([text.data, ratio]);
    }
    return faint;
}"""


def test_controls_of_a_phone_have_names_and_room_and_letters_stand_out(opened):
    tab = opened("phone")
    sheet = tab.page.locator("[style*='max-height: 60%']").bounding_box()["y"]
    places = np.array([tab.screen(point) for point in (np.zeros(3), np.array([0, 0, 1.0]))])
    assert ((places > 0) & (places < (390, sheet))).all()  # the arm is in sight above the sheet
    for name in [one.inner_text() for one in tab.page.get_by_role("tab").all()]:
        tab.open(name)
        tab.wait(lambda: not tab.page.evaluate(LACKING), f"controls of {name} are named")
    inside = sr.tip_positions(tab.session.state.design, [[-0.5, -0.4, -0.3]])[0]
    tab.session.aim(inside)
    for dark in (False, True):
        tab.session.update(lambda s, dark=dark: s.showing(dark=dark))
        tab.settle()
        for name in ("Design", "Move", "View", "Compare", "Goals"):
            tab.open(name)
            tab.wait(lambda: not tab.page.evaluate(FAINT), f"letters of {name} are seen")
    tab.session.update(lambda s: s.showing(dark=False).replace(target=None))
    tab.open("Design")
    assert tab.slider("taper φ [deg]").get_attribute("aria-label") == "taper φ [deg]"


@pytest.mark.large
def test_arm_and_numbers_stay_in_sight_where_the_scene_gets_narrow_and_wide_again(opened):
    tab = opened("laptop")
    wide = tab.page.locator("canvas").first.bounding_box()["width"]
    before = tab.session.camera.actual()

    def narrow(on: bool) -> None:
        tab.open("View")
        tab.page.get_by_label("section", exact=True).set_checked(on)

    def in_sight() -> bool:
        canvas = tab.page.locator("canvas").first.bounding_box()
        points = [(0, 0, 0), (0, 0, 1.0), *(one.position for one in tab.labels())]
        right = np.array([tab.projected(np.array(point))[0] for point in points]) * canvas["width"]
        return canvas["width"] < wide and bool(((right > 0) & (right < canvas["width"])).all())

    narrow(True)
    tab.wait(in_sight, "arm and numbers are in sight")
    narrow(False)
    tab.wait(
        lambda: np.allclose(tab.session.camera.actual().position, before.position, rtol=1e-2),
        "the eye steps forth again",
    )
