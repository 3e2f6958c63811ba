"""Ten numbers as a person reads them in the page, and as the library computes them."""

import re

import numpy as np
import pytest

import softreach as sr
from softreach.arm import designs
from softreach.arm.parameters import changed, parameters
from softreach.geometry.surface import plane_cut, section_area
from softreach.studio.shown_parameters import slider_parameters
from softreach.workspace import volume_gradient

ARM = changed(designs.minimal_trunk(), {"length": 0.3, "outer_radius": 0.02})
ARM = ARM.replace(display_unit="cm")
HANGING = designs.lce_arm().replace(loads=sr.Loads(gravity=(0.0, 0.0, 9.81), payload=0.002))
FAR = np.array([0.15, 0.05, 0.28])  # out of reach


def show(tab, arm, **fields) -> None:
    tab.session.update(lambda state: state.replace(design=arm, **fields))
    tab.reach_of(arm)


def read(tab, text: str) -> list[float]:
    """The numbers where a text of the page has a #."""
    form = re.compile(re.escape(text).replace(r"\#", r"(-?[\d.]+)").replace(r"\ ", r"\s+"))
    tab.wait(lambda: form.search(tab.page.inner_text("body")), f"the page says {text}")
    return [float(number) for number in form.search(tab.page.inner_text("body")).groups()]


def sizes_agree(tab) -> None:
    """Volume, unreachability and area of a section; length of what one bundle reaches."""
    tab.session.update(lambda state: state.showing(section=True))
    show(tab, ARM)
    exact = sr.reachable_set(ARM, accuracy=0.005)
    volume, error = read(tab, "volume # ± # liters")
    assert volume == pytest.approx(1e3 * exact.volume, abs=error + 1e3 * exact.volume_error)
    assert read(tab, "UNR # %") == pytest.approx([100 * exact.unreachability], abs=0.01)
    area = 1e4 * section_area(plane_cut(exact.surface(), 1, 0.0), 1)
    assert read(tab, "y = 0 cm: one closed curve, # cm²") == pytest.approx([area], rel=2e-3)
    one = ARM.replace(actuators=ARM.actuators[2:])
    show(tab, one)
    length, error = read(tab, "length # ± # cm")
    tips = 100 * sr.tip_positions(one, np.linspace(*one.bounds[0], 4001)[:, None])
    chords = np.linalg.norm(np.diff(tips, axis=0), axis=1).sum()
    assert length == pytest.approx(chords, abs=error + 1e-5)


def bars_agree(tab) -> None:
    """The change of the volume by every number that a slider moves continuously."""
    show(tab, ARM)
    form = re.compile(r"∂V/∂\((.+)\) = \(?(-?[\d.]+) ± ([\d.]+)\)?(e-\d+|) liters")
    bars = tab.page.locator("[role=img][title*='change of V']")
    tab.wait(bars.count, "the bars are there")
    found = [form.search(bar.get_attribute("title")).groups() for bar in bars.all()]
    rows = {name: (float(value + ten), float(error + ten)) for name, value, error, ten in found}
    scales = {one.name: 1e3 * one.scale for one in slider_parameters(ARM)}
    assert set(rows) == {name for name in scales if not parameters(ARM)[name].whole}
    theirs = volume_gradient(ARM, list(rows), accuracy=0.01)
    for name, *of_library in zip(rows, theirs.volume, theirs.volume_error, strict=True):
        value, error = (scales[name] * number for number in of_library)
        assert rows[name][0] == pytest.approx(value, abs=rows[name][1] + error), name


def motion_agrees(tab) -> None:
    """Activations of a tip that was dragged, and the distance to a place that is not reached."""
    tab.open("Move")
    start, end = (-0.7, -0.4, -0.9), (-0.6, -0.55, -0.8)
    show(tab, ARM, activation=start)
    tab.settle()
    begin, goal = sr.tip_positions(ARM, [start, end]) / ARM.length
    tab.drag_tip(begin, goal)
    tab.page.mouse.up()
    tab.wait(lambda: tab.session.state.target is not None, "the drag rests")
    tab.settle()
    target = np.array(tab.field("target [cm]").input_value().split(","), float) / 100
    beside = "xpath=//label[normalize-space()='γ {}']/following::form[1]//input"
    fields = [tab.page.locator(beside.format(name)).first for name in ARM.input_names]
    pulls = [float(field.input_value()) for field in fields]
    others = sr.solve_inverse(ARM, [target])[0].activations
    assert np.abs(others - pulls).max(axis=1).min() < 1e-3
    assert read(tab, "# activation") == [len(others)]

    tab.open("Goals")
    tab.field("numbers").fill(", ".join(map(str, 100 * FAR)))
    tab.settle()
    tab.press("Add to the needs")
    gap = 100 * sr.solve_inverse(ARM, [FAR])[0].gap
    assert read(tab, "missed by # cm") == pytest.approx([gap], rel=5e-3)


def loads_agree(tab) -> None:
    """What a payload leaves of the volume, and where the tip sags to."""
    show(tab, HANGING, activation=(-1.0, -0.5, -2.0), needs="")
    sets = [sr.reachable_set(arm, accuracy=0.01) for arm in (HANGING, designs.lce_arm())]
    volume, error, share, whole = read(tab, "volume # ± # mL under loads, # % of # mL without")
    assert volume == pytest.approx(1e6 * sets[0].volume, abs=error + 1e6 * sets[0].volume_error)
    assert whole == pytest.approx(1e6 * sets[1].volume, rel=1e-3)
    assert share == pytest.approx(100 * sets[0].volume / sets[1].volume, abs=0.6)
    tab.open("Move")
    tip = 1e3 * sr.configuration(HANGING, (-1.0, -0.5, -2.0), 3).position.values[-1]
    assert read(tab, "tip at (#, #, #) mm") == pytest.approx(tip.tolist(), abs=1e-3)


def test_ten_numbers_in_the_page_are_those_of_the_library(tab):
    for agree in (sizes_agree, bars_agree, motion_agrees, loads_agree):
        tab.open("Design")
        agree(tab)
