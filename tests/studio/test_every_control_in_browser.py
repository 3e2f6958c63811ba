"""Every control of the page is used in twelve journeys, and neither page nor server has an error.

`pytest -m large -s tests/studio/test_every_control_in_browser.py` prints the log: what was used,
in order, and what the page said to it.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import pytest

import softreach as sr
from softreach.arm import designs
from softreach.arm.edits import ring_label
from softreach.studio import Quality, Studio
from softreach.studio.shown_parameters import slider_parameters
from softreach.studio.start import start_on_design
from tests.studio.tab import Tab
from tests.studio.test_calibrate import ARM, file

COARSE = Quality(coarse_level=11, fine_level=12, coarse_accuracy=0.1, fine_accuracy=0.1)
TABS = ("Design", "Parts", "Move", "View", "Plots", "Compare", "Goals", "Export")
OF_VISER = ("close", "Cancel", "Compute what is missing")
"""Controls that are not ours, or come and go with work."""

WATCH = """() => {
    const tab = () => [...document.querySelectorAll("[role=tab][aria-selected=true]")]
        .map(e => e.textContent).find(name => TABS.includes(name));
    const above = e => {
        const tabs = [...document.querySelectorAll("[role=tab]")];
        const first = tabs.find(one => one.textContent === TABS[0]);
        return e.compareDocumentPosition(first) & Node.DOCUMENT_POSITION_FOLLOWING;
    };
    const isSeen = e => e.checkVisibility({visibilityProperty: true, opacityProperty: true})
        && e.getBoundingClientRect().width > 0 && e.type !== "hidden" && e.ariaHidden !== "true";
    const plain = e => {
        const kind = e.role === "slider" ? "slider" : e.tagName === "BUTTON" ? "button"
            : e.type === "checkbox" ? "check box"
            : e.getAttribute("aria-haspopup") ? "menu" : "field";
        const label = [...(e.labels || [])].map(one => one.textContent).join("");
        const name = (e.ariaLabel || label || e.textContent).trim().replace(/^\\u2713 /, "");
        const words = /^-?\\d/.test(name) ? "of a solution" : name;
        return `${above(e) ? "above" : tab()}: ${kind} ${words}`;
    };
    const controls = () => {
        const all = new Map(), times = {};
        for (const e of document.querySelectorAll("[role=slider], input, button:not([role=tab])")) {
            if (!isSeen(e) || UNNAMED.test(plain(e))) continue;
            const name = plain(e), count = times[name] = (times[name] || 0) + 1;
            all.set(e, count === 1 || name.endsWith("solution") ? name : `${name} (${count})`);
        }
        return all;
    };
    window.known = {};
    window.used = [];
    const look = () => { for (const name of controls().values()) window.known[name] ??= 1; };
    setInterval(look, 100);
    const note = event => {
        const e = event.target.closest && event.target.closest("[role=slider], input, button");
        const name = e && controls().get(e);
        if (!name) return;
        const how = {field: "input", slider: "keydown"}[name.split(": ")[1].split(" ")[0]];
        if (event.type === (how || "click") && used.at(-1) !== name) used.push(name);
    };
    for (const kind of ["click", "input", "keydown"]) addEventListener(kind, note, true);
}""".replace("TABS", str(list(TABS))).replace("UNNAMED", f"/: [a-z ]+ (|{'|'.join(OF_VISER)})$/")
"""Collects in the page the controls that were ever seen, and those that a person used."""


@pytest.mark.large
def test_every_control_is_used_in_twelve_journeys_without_an_error(
    browser, tmp_path, monkeypatch, capfd, caplog
):
    notes, log = [], []
    with Studio(start_on_design(designs.minimal_trunk(), COARSE)) as studio:
        tab = Tab(browser, studio, (1366, 768))
        say = tab.session.say
        monkeypatch.setattr(tab.session, "say", lambda note: notes.append(note) or say(note))
        tab.page.evaluate(WATCH)
        first = controls_at_first(tab)
        for number, journey in enumerate(JOURNEYS, 1):
            done, said = len(used(tab)), len(notes)
            journey(tab, tmp_path)
            tab.settle()
            log.append(f"{number}. {journey.__doc__}")
            log += [f"   {name}" for name in used(tab)[done:]]
            log += [f"   said: {note}" for note in notes[said:] if note]
        known, ever = set(tab.page.evaluate("() => Object.keys(window.known)")), set(used(tab))
        tab.close()
        assert tab.errors == []
    out, err = capfd.readouterr()
    counts = {name: sum(one.startswith(f"{name}: ") for one in first) for name in ("above", *TABS)}
    log.append(f"{len(ever)} controls were used; {len(first)} are there at first: {counts}")
    sys.stdout.write("\n".join(["", *log, ""]))
    assert "Traceback" not in out + err
    assert [one for one in caplog.records if one.levelname in ("ERROR", "CRITICAL")] == []
    assert [note for note in notes if ": must " in note] == []
    assert sorted(known - ever) == []
    assert 50 < len(first) < 70


def used(tab) -> list[str]:
    return tab.page.evaluate("() => window.used")


def controls_at_first(tab) -> set[str]:
    """Controls that a new page shows, tab by tab; a slider and its field are one."""
    for name in TABS:
        tab.open(name)
        tab.page.wait_for_timeout(400)
    seen = tab.page.evaluate("() => Object.keys(window.known)")
    return {re.sub(": (slider|field) ", ": ", one) for one in seen}


def field(tab, label: str, of: int = 0):
    found = tab.page.get_by_role("textbox", name=label, exact=True).locator("visible=true")
    return found.nth(of)


def typed(tab, label: str, text: str, of: int = 0) -> None:
    place = field(tab, label, of)
    place.fill(text)
    place.press("Enter")
    tab.page.wait_for_timeout(200)
    tab.settle()


def nudged(tab, label: str) -> None:
    """Moved by a key, whichever way there is room, and back by typing what was there."""
    before = field(tab, label).input_value()
    thumb = tab.slider(label)
    thumb.focus()
    ends = [thumb.get_attribute(f"aria-value{end}") for end in ("now", "max")]
    tab.page.keyboard.press("ArrowLeft" if ends[0] == ends[1] else "ArrowRight")
    tab.wait(lambda: field(tab, label).input_value() != before, f"{label} is moved")
    tab.settle()
    typed(tab, label, before)


def start_from(tab, name: str) -> None:
    tab.open("Design")
    tab.choose("start from", name)
    wanted = getattr(designs, name)()
    tab.wait(lambda: tab.session.state.design == wanted, f"{name} is the design")
    tab.settle()


def uploaded(tab, button: str, content: bytes, name: str, folder: Path) -> None:
    (folder / name).write_bytes(content)
    with tab.page.expect_file_chooser() as caught:
        tab.press(button)
    caught.value.set_files(folder / name)


def change_the_body(tab, folder) -> None:
    """Every number of the body, undo, redo and reset."""
    start_from(tab, "minimal_trunk")
    for slider in slider_parameters(tab.session.state.design):
        nudged(tab, slider.label)
    for label, text in (
        ("length [mm]", "1.1 m"), ("bore / outer radius", "0.1"), ("Poisson's ratio ν", "0.45"),
    ):  # fmt: skip
        typed(tab, label, text)
    assert tab.session.state.design.length == 1.1
    tab.press("Undo")
    tab.settle()
    tab.press("Redo")
    tab.settle()
    tab.press("Reset")
    tab.wait(lambda: tab.session.state.design == tab.session.start.state.design, "it is as opened")


def load_it(tab, folder) -> None:
    """Base, gravity, payload and force, the reach without them, and off again."""
    start_from(tab, "lce_arm")
    for slider in slider_parameters(tab.session.state.design):
        if slider.label.startswith("E of"):
            nudged(tab, slider.label)
    tab.open("Parts")
    tab.unfold("base and loads")
    tab.choose("base", "down (hanging)")
    tab.settle()
    typed(tab, "base at [mm]", "1 cm, 0, 0")
    typed(tab, "turn [deg]", "5")
    tab.choose("gravity", "down")
    tab.settle()
    for label, text in (
        ("g [m/s²]", "0, 0, -9.8"), ("payload [g]", "0.2"), ("lever arm [mm]", "0, 0, 1"),
        ("tip force [N]", "0, 0, -1e-4"),
    ):  # fmt: skip
        typed(tab, label, text)
    assert tab.session.state.design.loads.payload == pytest.approx(2e-4)
    tab.press("Take all loads off")
    tab.wait(lambda: tab.session.state.design.loads is None, "nothing acts")


def build_it(tab, folder) -> None:
    """Parts added, renamed, changed, every number of each, and removed."""
    start_from(tab, "minimal_trunk")
    tab.open("Parts")
    tab.unfold("add a part")
    tab.choose("kind", "tendon")
    tab.press("Add")
    tab.choose("made of", "dragon_skin_30")
    tab.press("Add")
    tab.wait(lambda: tab.session.state.design.bundles == 4, "a tendon is added")
    tab.settle()
    numbers(tab)
    tab.press("Remove")
    for kind in ("ring", "fiber"):
        tab.choose("kind", kind)
        before = tab.session.state.design
        tab.press("Add")
        tab.wait(lambda before=before: tab.session.state.design != before, f"a {kind} is added")
        tab.settle()
        if kind == "ring":
            tab.choose("material", "ecoflex_00_30")
        else:
            tab.choose("in ring", ring_label(tab.session.state.design, 1))
        tab.settle()
        typed(tab, "name", f"my {kind}")
        numbers(tab)
    tab.press("Remove")
    tab.settle()
    tab.choose("edit", ring_label(tab.session.state.design, 0))
    tab.settle()
    tab.choose("core", "ecoflex_00_30")
    numbers(tab)


def numbers(tab) -> None:
    """Type every number of the part that was not typed yet, again."""
    tab.settle()
    for label in tab.page.locator("label").locator("visible=true").all_inner_texts():
        place = field(tab, label)
        if label == "name" or f"Parts: field {label}" in used(tab) or not place.count():
            continue
        place.fill(f"{place.input_value()} ")
        place.press("Enter")
        tab.page.wait_for_timeout(250)


def move_it(tab, folder) -> None:
    """Every activation, the ball on the tip, each use of the mouse."""
    start_from(tab, "minimal_trunk")
    tab.open("Move")
    for label in ("γ left", "γ right", "γ longitudinal"):
        nudged(tab, label)
        typed(tab, label, "-0.5")
    for use in ("sets the target", "adds points to the path", "adds places to reach"):
        tab.choose("mouse", use)
        tab.settle()
        tab.click_at(np.asarray(tab.session.reach.cloud.tip.values[7]))
        tab.settle()
    tab.choose("mouse", "drags the tip")
    tab.press("Remove the path")
    tab.wait(lambda: tab.session.state.path is None, "the path is gone")
    tab.settle()  # what stood below it moves up
    tab.press("Rest")
    tab.wait(lambda: not any(tab.session.state.activation), "the arm is at rest")


def reach_a_place(tab, folder) -> None:
    """A target, the solutions as ghosts and as buttons, and away with it."""
    folded = designs.minimal_trunk(revolution=np.radians(36), taper=np.radians(3))
    tab.session.update(lambda s: s.replace(design=folded, activation=(-0.4, -0.65, -0.18)))
    tab.settle()
    tab.open("Move")
    typed(tab, "target [m]", ", ".join(f"{x:.5f}" for x in tab.session.tip))
    tab.wait(lambda: tab.session.answer and len(tab.session.answer) > 1, "two shapes reach it")
    tab.settle()
    before = tab.session.state.activation
    tab.page.get_by_role("button", name=re.compile(r"^-?\d\S*, ")).first.click()
    tab.wait(lambda: tab.session.state.activation != before, "it is taken")
    tab.press("Clear the target")


def follow_a_path(tab, folder) -> None:
    """A path from a file, played, walked along and saved."""
    tab.session.update(lambda s: s.replace(activation=(-1.0, -0.2, -0.5)))
    tab.open("Move")
    tip = sr.tip_positions(tab.session.state.design, [tab.session.state.activation])[0]
    rows = "\n".join(f"{x},{y},{z}" for x, y, z in np.linspace(tip, 0.95 * tip, 60))
    uploaded(tab, "Load a path (CSV)", f"x,y,z\n{rows}\n".encode(), "path.csv", folder)
    tab.wait(lambda: tab.session.figures.track is not None, "it is followed")
    tab.settle()
    tab.press("Play")
    tab.wait(lambda: tab.session.state.path.at > 2, "the arm moves")
    tab.press("Stop")
    tab.settle()
    tab.slider("point").focus()
    tab.page.keyboard.press("ArrowRight")
    field(tab, "point").fill("9")
    tab.settle()
    tab.save("Save the path (CSV)", folder)
    tab.press("Remove the path")


def look_at_it(tab, folder) -> None:
    """Colors, cuts, what is shown, the views and a slab."""
    tab.open("View")
    for menu, options in {
        "color by": (
            "multiplicity",
            "manipulability",
            "activation distance D\N{COMBINING MACRON}",
            "effort: mean |γ| / max |γ|",
        ),
        "cut away": ("nothing", "the half in front of the arm", "a window to the arm"),
        "slice across": ("y",),
    }.items():
        for option in options:
            tab.choose(menu, option)
            tab.settle()
    for name in ("arm", "exact surface", "cloud", "dark page"):
        for _ in range(2):
            tab.page.get_by_label(name, exact=True).click()
            tab.settle()
    for view in ("front", "side", "top", "oblique"):
        tab.press(view)
        tab.settle()
    nudged(tab, "center / L")
    tab.choose("slice across", "none")
    tab.page.keyboard.press("Escape")
    for key in ("?", "?", "f", "f", "3", "4"):
        tab.page.evaluate("document.activeElement.blur()")
        tab.page.keyboard.press(key)
        tab.page.wait_for_timeout(100)


def plot_it(tab, folder) -> None:
    """Both plots beside the scene."""
    tab.open("Plots")
    plots = "section", "V against parameter"
    for name in plots:
        tab.page.get_by_label(name, exact=True).check()
        tab.settle()
    tab.choose("parameter", "taper φ [deg]")
    tab.settle()
    for name in plots:
        tab.page.get_by_label(name, exact=True).uncheck()


def compare_it(tab, folder) -> None:
    """Two snapshots: drawn around and beside, restored, deleted."""
    tab.open("Compare")
    for taper in (0.02, 0.03):
        arm = designs.minimal_trunk(taper=taper)
        tab.session.update(lambda s, arm=arm: s.replace(design=arm))
        tab.settle()
        name = tab.session.snapshots.free_name()
        tab.press("Take snapshot")
        tab.wait(lambda name=name: tab.session.snapshots.named(name), "it is taken")
    tab.choose("snapshot", "design 1")
    for how in ("in gray around this design", "beside this design", "not drawn"):
        tab.choose("draw", how)
        tab.settle()
    tab.press("Restore")
    tab.settle()
    for _ in range(2):
        tab.press("Delete")
        tab.settle()


def say_what_for(tab, folder) -> None:
    """Needs added, saved, loaded, and away with all."""
    tab.session.update(lambda s: s.replace(needs=""))
    tab.open("Goals")
    tab.choose("add", "payload")
    tab.settle()
    tab.choose("add", "place to reach")
    tab.settle()
    for text in ("", "0.37, 0.15, 0.85"):
        field(tab, "numbers").fill(text)
        tab.settle()
        tab.press("Add to the needs")
        tab.settle()
    saved = tab.save("Save needs (TOML)", folder)
    uploaded(tab, "Load needs (TOML)", saved.read_bytes(), "needs.toml", folder)
    tab.settle()
    tab.choose("remove", "everything")
    tab.settle()
    tab.press("Remove")
    tab.wait(lambda: not tab.session.state.needs, "there are no needs")


def calibrate_it(tab, folder) -> None:
    """Measured poses, walked through, fitted to, and applied."""
    tab.session.update(lambda s: s.replace(design=ARM))
    tab.open("Goals")
    tab.unfold("measured poses")
    uploaded(tab, "Load measured poses (CSV)", file().content, "bench.csv", folder)
    tab.page.get_by_text("bench.csv: 20 samples of half, tool").wait_for()
    tab.slider("sample").focus()
    tab.page.keyboard.press("ArrowRight")
    field(tab, "sample").fill("5")
    tab.settle()
    field(tab, "free").fill("pose, taper")
    tab.settle()
    tab.press("Fit")
    tab.page.get_by_role("button", name="Apply", exact=True).wait_for()
    tab.settle()
    tab.press("Apply")
    tab.wait(lambda: tab.session.state.design != ARM, "it is the design")


def save_it(tab, folder) -> None:
    """Every kind of file, and this work loaded again."""
    start_from(tab, "minimal_trunk")
    tab.open("Export")
    state = tab.save("Save this work", folder)
    uploaded(tab, "Load state or design", state.read_bytes(), "work.json", folder)
    tab.settle()
    tab.field("data").click()
    kinds = tab.page.get_by_role("option").all_inner_texts()
    tab.page.keyboard.press("Escape")
    for kind in kinds:
        tab.choose("data", kind)
        tab.settle()
        assert tab.save("Save data", folder).stat().st_size > 100
        tab.settle()
    for kind in ("as it is seen (.png)", "four views (.png)", "web page (.html)"):
        tab.choose("picture", kind)
        tab.settle()
        assert tab.save("Save picture", folder).stat().st_size > 10_000
        tab.settle()


JOURNEYS = (
    change_the_body, load_it, build_it, move_it, reach_a_place, follow_a_path,
    look_at_it, plot_it, compare_it, say_what_for, calibrate_it, save_it,
)  # fmt: skip
