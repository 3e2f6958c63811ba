"""End to end: measured poses are loaded, walked through, fitted to, and the arm is calibrated."""

from __future__ import annotations

import numpy as np
import pytest

import softreach as sr
from tests.studio.test_calibrate import ARM, INPUTS, REAL, file


@pytest.mark.large
def test_an_arm_is_calibrated_on_measured_poses_and_saved(tab, tmp_path):
    poses = tmp_path / "<b>bench.csv"
    poses.write_bytes(file().content)
    tab.session.update(lambda state: state.replace(design=ARM))
    tab.open("Goals")
    tab.unfold("measured poses")
    with tab.page.expect_file_chooser() as caught:
        tab.press("Load measured poses (CSV)")
    caught.value.set_files(poses)
    tab.page.get_by_text("<b>bench.csv: 20 samples of half, tool").wait_for()
    tab.drag("sample", 60)
    tab.settle()
    sample = tab.session.bench.sample
    assert sample > 0
    assert tab.session.state.activation == tuple(INPUTS[sample])
    tab.page.get_by_text("predicted − measured: half").wait_for()

    free = tab.page.locator(
        "xpath=//label[normalize-space()='free']/following::input[1] >> visible=true >> nth=-1"
    )
    free.fill("pose")
    tab.choose("free also", "taper", of=-1)
    tab.wait(lambda: free.input_value() == "pose, taper", "the taper is free too")
    tab.press("Fit")
    tab.page.get_by_text("20 fitted").first.wait_for()
    tab.settle()
    assert np.nanmax(tab.session.bench.distances) < 2e-3
    assert tab.drawn("/sample/arm/0")
    tab.press("Apply")
    tab.wait(lambda: tab.session.state.design != ARM, "the calibrated arm is the design")
    tab.settle()
    tab.page.get_by_role("button", name="Apply", exact=True).wait_for(state="hidden")

    tab.open("Export")
    tab.choose("data", "design (.toml)")
    saved = sr.Manipulator.load(tab.save("Save data", tmp_path))
    assert saved.profile.taper == pytest.approx(REAL.profile.taper, abs=2e-4)
    np.testing.assert_allclose(saved.base.position, REAL.base.position, atol=3e-4)
    tab.press("Undo")
    tab.wait(lambda: tab.session.state.design == ARM, "the design is the one before")
    tab.open("Goals")
    tab.press("Remove the data")
    tab.wait(lambda: tab.session.bench is None, "the data are gone")
    tab.settle()
    assert not tab.drawn("/sample/measured")
