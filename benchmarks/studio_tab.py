"""Latencies of the studio in a real browser, from an event in the page to what answers it there."""

from __future__ import annotations

import time
from typing import Any, NamedTuple

import numpy as np
from tests.browser import CHROMIUM, FLAGS
from tests.studio.tab import Tab

from softreach import tip_positions
from softreach.arm import designs
from softreach.studio import Studio
from softreach.studio.captions import size_text
from softreach.studio.start import start_on_design

_WATCH = """() => new Promise(done => {
    const shown = () => document.body.innerText.match(/volume [^·]*/)?.[0];
    const old = shown(), begin = performance.now();
    const watch = new MutationObserver(() => {
        const now = shown();
        if (now === old || document.body.innerText.includes("of the design before")) return;
        watch.disconnect();
        done((performance.now() - begin) / 1000);
    });
    watch.observe(document.body, {subtree: true, childList: true, characterData: true});
})"""
"""Resolves when the page shows the volume of another design [s]; the first cloud is sent before."""

CURLED, NEXT = (-0.7, -0.4, -0.9), (-0.6, -0.55, -0.8)


def moved_slider(tab: Tab) -> float:
    """From a key on the slider of the taper to the volume of the new design in the page [s]."""
    _wait_for_numbers(tab)
    thumb = tab.slider("taper φ [deg]")
    thumb.focus()
    tab.page.evaluate(f"() => {{ window.waited = ({_WATCH})(); }}")
    tab.page.keyboard.press("ArrowRight")
    taken = tab.page.evaluate("() => window.waited")
    tab.settle()
    return float(taken)


def _wait_for_numbers(tab: Tab) -> None:
    """Until the page shows all that the server has found: the last of it may be on its way."""
    tab.settle()
    reach = tab.session.found.reach
    assert reach is not None and reach.size is not None, "the design has a volume"  # noqa: PT018
    tab.page.get_by_text(size_text(reach.size, reach.arm)).first.wait_for()


SCENES = {
    "the surface": {"surface": True, "cloud": False},
    "131,072 points": {"surface": False, "cloud": True},
    "only the arm": {"surface": False, "cloud": False},
}
"""What is drawn besides the arm; the surface is how a tab opens."""

_FRAMES = """milliseconds => new Promise(done => {
    const begin = performance.now();
    let count = 0;
    const next = now => {
        if (now - begin > milliseconds) { done(count / (now - begin) * 1000); return; }
        count += 1;
        requestAnimationFrame(next);
    };
    requestAnimationFrame(next);
})"""
"""Resolves with the pictures a second of the page."""


_MOVES = """([[left, top], [right, bottom], milliseconds]) => new Promise(done => {
    const canvas = document.querySelector("canvas"), begin = performance.now();
    let count = 0;
    const next = now => {
        if (now - begin > milliseconds) { done(count); return; }
        const share = 0.5 - 0.5 * Math.cos(2 * Math.PI * (now - begin) / 1000);
        canvas.dispatchEvent(new PointerEvent("pointermove", {
            clientX: left + share * (right - left), clientY: top + share * (bottom - top),
            pointerId: 1, buttons: 1, bubbles: true,
        }));
        count += 1;
        requestAnimationFrame(next);
    };
    requestAnimationFrame(next);
})"""
"""Moves the mouse to and fro, once for each picture, as browsers tell of it; resolves with how
often. Playwright's own mouse waits for the page several times between two moves."""


class Drag(NamedTuple):
    """What became of a drag of the tip."""

    moved: float
    """Places that the mouse was at [1/s]."""
    served: float
    """How often the arm followed [1/s]."""


def dragged_tip(tab: Tab, seconds: float = 2.0) -> Drag:
    """Drag the tip to and fro."""
    tab.session.update(lambda state: state.replace(activation=CURLED))
    tab.settle()
    tab.page.wait_for_timeout(500)
    arm = tab.session.state.design
    ends = [np.array(place(tab, tip)) for tip in np.asarray(tip_positions(arm, [CURLED, NEXT]))]
    served = _count_pulls(tab)
    mouse = tab.page.mouse
    mouse.move(*ends[0])
    tab.page.wait_for_timeout(200)
    mouse.down()
    mouse.move(*(ends[0] + 0.1 * (ends[1] - ends[0])))  # the first pull prepares the arm
    tab.page.wait_for_timeout(300)
    first, begin = len(served), time.perf_counter()
    events = tab.page.evaluate(_MOVES, [*map(list, ends), 1000 * seconds])
    spent = time.perf_counter() - begin
    count = len(served) - first
    mouse.up()
    tab.settle()
    del tab.session.learn  # counts no more
    return Drag(events / spent, count / spent)


class Latencies(NamedTuple):
    """What was measured with one scene, turn by turn."""

    slider: list[float]
    """From the slider to the volume in the page [s]."""
    drags: list[Drag]
    turning: list[float]
    """Pictures of the scene while it is turned [1/s]."""


def measured(tab: Tab, repeat: int, scene: dict[str, bool]) -> Latencies:
    """Slider, drags of the tip, and turning, with this in the scene."""
    tab.session.update(lambda state: state.showing(**scene))
    tab.open("Design")
    slider = [moved_slider(tab) for _ in range(repeat)]
    tab.open("Move")
    drags = [dragged_tip(tab) for _ in range(repeat)]
    return Latencies(slider, drags, [turned_scene(tab) for _ in range(repeat)])


def turned_scene(tab: Tab, seconds: float = 2.0) -> float:
    """Pictures a second while the mouse turns the scene."""
    box, mouse = tab.page.locator("canvas").first.bounding_box(), tab.page.mouse
    x, y = box["x"] + 0.1 * box["width"], box["y"] + 0.85 * box["height"]
    mouse.move(x, y)
    mouse.down()
    tab.page.evaluate(f"() => {{ window.frames_seen = ({_FRAMES})({1000 * seconds}); }}")
    begin = time.perf_counter()
    while (spent := time.perf_counter() - begin) < seconds:
        mouse.move(x + 60 * np.sin(4 * spent), y)
    mouse.up()
    return float(tab.page.evaluate("() => window.frames_seen"))


def _count_pulls(tab: Tab) -> list[float]:
    """Times at which a pull of this tab was done; grows while the tip is dragged."""
    done, learn = [], tab.session.learn

    def counted(found: Any, **options: Any) -> None:
        if isinstance(found, dict) and "lag" in found:
            done.append(time.perf_counter())
        learn(found, **options)

    tab.session.learn = counted
    return done


def place(tab: Tab, point: np.ndarray) -> tuple[float, float]:
    """Pixels of a point of the scene [L] in the page."""
    canvas = tab.page.locator("canvas").first.bounding_box()
    right, down = tab.projected(point)
    return canvas["x"] + right * canvas["width"], canvas["y"] + down * canvas["height"]


def print_latencies(repeat: int = 5) -> None:
    """Rows of the table; a line that says so where there is no browser."""
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        sync_playwright = None
    if sync_playwright is None or CHROMIUM is None:
        print("No browser was found on this machine to measure in.\n")
        return
    with sync_playwright() as playwright, Studio(start_on_design(designs.minimal_trunk())) as run:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        tab = Tab(browser, run, (1366, 768), drawing="")
        moved_slider(tab)  # compile
        found = {name: measured(tab, repeat, scene) for name, scene in SCENES.items()}
        tab.close()
        browser.close()
    print("### In a browser without a graphics card, medians\n")
    print("| drawn besides the arm | slider to volume | tip dragged | scene turned |")
    print("|---|--:|--:|--:|")
    for name, runs in found.items():
        served = np.median([drag.served for drag in runs.drags])
        shown = (
            f"{np.median(runs.slider):.2f} s | {served:.1f} /s | {np.median(runs.turning):.1f} /s"
        )
        print(f"| {name} | {shown} |")
    moved = [f"{max(drag.moved for drag in runs.drags):.0f}" for runs in found.values()]
    print(f"\nThe page reports the mouse {', '.join(moved)} times a second.\n")


if __name__ == "__main__":
    print_latencies()
