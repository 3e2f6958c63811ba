"""What the picture of conventions says is so, and it is the picture that the script draws."""

import numpy as np
import pytest
from tools.conventions import CHAMBER, DPI, FIBER, PICTURE, STRAIGHT, TENDON, WINDING, arm_with

import softreach as sr
from softreach.arm import ObliqueMuscle, RadialMuscle

plt = pytest.importorskip("matplotlib.pyplot")


@pytest.mark.parametrize("words", STRAIGHT)
def test_straight_actuators_bend_the_way_the_picture_says(words):
    actuator, activation = STRAIGHT[words]
    (tip,) = sr.tip_positions(arm_with(actuator), [[activation]])
    away = "away" in words
    assert (tip[0] < -0.1) if away else (tip[0] > 0.1)
    assert tip[1] == pytest.approx(0, abs=1e-9)
    extension = sr.configuration(arm_with(actuator), [activation]).extension
    assert (extension > 1).all() == away


def test_positive_angles_turn_from_d1_to_d2_seen_from_the_tip():
    quarter = FIBER.replace(offset=np.pi / 2)
    (tip,) = sr.tip_positions(arm_with(quarter), [[-0.05]])
    assert tip[1] > 0.01
    outline = arm_with(WINDING).outline([0.0, 1.0])
    assert outline.center[1] - outline.center[0] == pytest.approx(WINDING.revolution)


@pytest.mark.parametrize(
    ("actuator", "activation", "sign"),
    [
        (WINDING, -0.1, -1),
        (ObliqueMuscle(helical_angle=0.4, extent=2 * np.pi), -0.1, -1),
        (TENDON.replace(revolution=3.0), 10.0, -1),
        (RadialMuscle(extent=2 * np.pi), -0.1, 0),
        (CHAMBER, 1e4, 0),
    ],
)
def test_what_is_right_handed_and_contracts_turns_the_tip_clockwise(actuator, activation, sign):
    twist = sr.configuration(arm_with(actuator), [activation]).sel(component="u3").curvature
    np.testing.assert_array_equal(np.sign(np.round(twist, 9)), sign)


def test_the_picture_in_the_documentation_is_the_one_that_is_drawn(tmp_path):
    from tools.conventions import conventions_figure

    conventions_figure().savefig(tmp_path / "new.png", dpi=DPI)
    old, new = plt.imread(PICTURE), plt.imread(tmp_path / "new.png")
    assert old.shape == new.shape, "run python -m tools.conventions"
    assert np.abs(old - new).mean() < 0.01, "run python -m tools.conventions"
