"""What an arm is for and what was measured on it, in a tab without a browser."""

import dataclasses

import numpy as np
import pytest

import softreach as sr
from softreach.arm import Marker, designs
from softreach.arm.parameters import changed
from softreach.calibration.measurements import read_measurements
from softreach.requirements import Requirements, Target
from softreach.rod.kinematics import marker_positions, tip_positions
from softreach.studio.found import Bench
from softreach.studio.session import Session
from softreach.studio.state import requirements_of
from softreach.studio.tabs import click, goals
from softreach.support.errors import SoftreachError
from tests.calibration.arms import table

ARM = designs.minimal_trunk(length=0.4)
POSE = (-0.7, -0.4, -0.9)
REACHED = tip_positions(ARM, [POSE])[0]
FAR = (0.3, 0.1, 0.42)


@pytest.fixture
def session(opened) -> Session:
    opened.learn({"bench": None})
    opened.update(lambda state: state.replace(design=ARM, activation=POSE, needs="", target=None))
    opened.settle()
    opened.end_step()
    return opened


def added(session, kind, text="") -> None:
    goals.add_need(session, kind, text)
    session.settle()


def verdict(session) -> str:
    return goals.verdict(session.state, session.found)


def drawn(session, name):
    return session.client.scene.get_handle_by_name(name)


def test_a_place_is_a_ball_where_it_is_reached_and_a_cross_with_its_gap_where_it_is_not(session):
    added(session, "place to reach")  # where the tip is
    added(session, "place to reach", ", ".join(str(1e3 * x) for x in FAR))
    exact = sr.check(ARM, requirements_of(session.state.needs))
    np.testing.assert_allclose(exact.places, [REACHED, FAR], atol=1e-5)
    gap = exact.gaps.max()
    assert "place 1</b>: reached" in verdict(session)
    assert f"place 2</b>: missed by {1e3 * gap:.3g} mm" in verdict(session)
    np.testing.assert_allclose(drawn(session, "/needs/reached").points, [REACHED / 0.4], atol=1e-5)
    cross = drawn(session, "/needs/missed").points
    np.testing.assert_allclose(cross.mean(axis=(0, 1)), np.array(FAR) / 0.4, atol=1e-6)
    ((place, nearest),) = drawn(session, "/needs/gaps").points
    np.testing.assert_allclose(np.linalg.norm(place - nearest), gap / 0.4, rtol=1e-3)
    assert drawn(session, "/needs/label 1").text == f"{1e3 * gap:.3g} mm"
    session.step(back=True)
    session.settle()
    assert "place 2" not in verdict(session)
    assert drawn(session, "/needs/missed") is None


def test_a_place_that_is_reached_the_wrong_way_shows_the_angle(session):
    needs = Requirements(targets=(Target(REACHED, direction=(0, 0, -1), name="drill"),))
    goals.read_needs(session, "needs.toml", needs.to_toml().encode())
    session.settle()
    angle = np.degrees(session.found.check.direction_errors[0, 0])
    assert f"drill</b>: {angle:.4g}° off the direction" in verdict(session)
    assert drawn(session, "/needs/label 0").text == f"{angle:.3g}°"


def test_a_place_can_be_the_target(session):
    with pytest.raises(sr.InvalidInput, match="tab Move"):
        added(session, "place at the target")
    session.update(lambda state: state.replace(target=(0.05, 0.0, 0.3)))
    added(session, "place at the target")
    assert requirements_of(session.state.needs).places.tolist() == [[0.05, 0.0, 0.3]]


def test_a_box_is_red_where_the_arm_breaks_it_and_empty_means_around_what_is_drawn(session):
    added(session, "place to reach")
    added(session, "box to stay inside")
    added(session, "box to avoid", "-20, -20, 90, 20, 20, 140")
    inside, avoid = drawn(session, "/needs/region 0"), drawn(session, "/needs/region 1")
    corners = inside.points.min(axis=(0, 1)), inside.points.max(axis=(0, 1))
    np.testing.assert_allclose(corners, session.scene.axes.corners, atol=1e-5)
    colors = [tuple(np.asarray(node.colors).ravel()[:3]) for node in (inside, avoid)]
    assert [color == goals.VERDICTS["missed"] for color in colors] == [False, True]
    assert "the arm has a margin of" in verdict(session)
    assert "inside or too near" in verdict(session)


def test_what_quick_poses_miss_is_looked_at_again(session, monkeypatch):
    plain = goals.checked

    def blind(*arguments, **options):
        made = plain(*arguments, **options)
        wrong = tuple(dataclasses.replace(each, verdict="missed") for each in made.findings)
        return dataclasses.replace(made, findings=wrong, gaps=made.gaps + 0.1)

    monkeypatch.setattr(goals, "checked", blind)
    added(session, "place to reach")
    assert session.found.check.met
    assert "place 1</b>: reached" in verdict(session)


def test_a_payload_without_a_modulus_is_refused_below_the_needs(session):
    added(session, "payload", "50")
    assert requirements_of(session.state.needs).payloads == (0.05,)
    added(session, "place to reach")
    assert "modulus" in session.found.check_refusal
    assert session.found.check is None


BAD_FILES = (
    (b"\xff\xfe", "UTF-8"), (b"#" * 8_000_001, "at most 8 MB"), (b"[[reech]]", "reech"),
    (b'[[reach]]\nfile = "/etc/passwd"', "not sent along"),
)  # fmt: skip


def test_files_and_numbers_of_no_needs_are_refused_and_the_needs_before_stay(opened):
    before = opened.state
    for content, words in BAD_FILES:
        with pytest.raises(SoftreachError, match=words) as caught:
            goals.read_needs(opened, "<b>.toml", content)
        assert "root" not in str(caught.value)
        assert opened.state == before
    for kind, text in (("place to reach", "1, b"), ("box to avoid", ""), ("payload", "-1")):
        with pytest.raises(SoftreachError, match=r"three numbers|six numbers|payloads"):
            added(opened, kind, text)
        assert opened.state == before


def test_a_click_adds_a_place_to_reach_only_while_the_mouse_is_for_that(session):
    session.update(lambda state: state.showing(half=False, cloud=True))
    assert session.settle()
    point = session.found.reach.cloud.tip.values[3] / ARM.length
    origin = 3.0 * point
    click(session, origin, point - origin)
    assert session.state.needs == ""
    session.update(lambda state: state.showing(mouse="place"))
    click(session, origin, point - origin)
    session.settle()
    (place,) = requirements_of(session.state.needs).places
    assert np.linalg.norm(np.cross(place, point) / np.linalg.norm(point)) < 0.02 * ARM.length
    assert session.found.check.met


def test_needs_of_many_places_are_drawn_with_few_labels(session):
    places = [(0.3, 0.002 * k, 0.6) for k in range(60)]
    needs = Requirements(targets=(Target(places, name="row"),))
    session.update(lambda state: state.replace(needs=needs.to_toml()))
    session.settle()
    assert "row</b>: 0 of 60 places reached, missed by" in verdict(session)
    assert drawn(session, "/needs/label 19") is not None
    assert drawn(session, "/needs/label 20") is None


# Measured poses: their markers over the arm, and a fit to them

MARKED = designs.minimal_trunk().replace(
    markers=(Marker(name="half", station=0.5, offset=(0.07, 0.0, 0.0)), Marker(name="tool"))
)
REAL = changed(MARKED, {"taper": 0.012}).replace(base=sr.Base(position=(0.05, -0.02, 0.1)))
INPUTS = MARKED.bounds[:, 0] * np.random.default_rng(3).random((20, 3))
NAMES, MARKERS = ("a", "b", "c"), ("half", "tool")
NOISE = 2e-4 * np.random.default_rng(4).standard_normal((20, 2, 3))
PLACES = marker_positions(REAL, INPUTS) + NOISE


def shown(session, number=0, inputs=INPUTS) -> None:
    """Load measured poses, and bring the arm to one of them."""
    columns = table(PLACES, inputs, NAMES, MARKERS).items()
    data = read_measurements(MARKED, {name.removesuffix("_N"): [*row] for name, row in columns})
    bench = Bench(data=data, arm=MARKED, number=number, free=("pose", "taper"))
    session.update(lambda state: bench.posed(state.replace(design=MARKED)))
    session.learn({"bench": bench})
    session.settle()


def test_dots_stand_where_the_markers_of_a_pose_are_and_were_measured(session):
    for number in (0, 7):
        shown(session, number)
        predicted = marker_positions(MARKED, INPUTS[number])[0]
        for name, places in (("measured", PLACES[number]), ("predicted", predicted)):
            dots = drawn(session, f"/sample/{name}").points
            np.testing.assert_allclose(dots, places / MARKED.length, atol=1e-5)
        lines = drawn(session, "/sample/residuals").points
        np.testing.assert_allclose(lines[:, 0], PLACES[number] / MARKED.length, atol=1e-5)
        distances = np.linalg.norm(PLACES[number] - predicted, axis=1)
        np.testing.assert_allclose(session.found.sample.distances, distances, atol=1e-9)
    markers = drawn(session, "/arm/markers").points
    np.testing.assert_allclose(markers, predicted / MARKED.length, atol=1e-3)


def test_a_pose_is_shown_only_while_the_arm_has_its_inputs_and_its_markers(session):
    shown(session)
    session.update(lambda state: state.replace(activation=()))
    session.settle()
    assert drawn(session, "/sample/measured") is None
    session.step(back=True)
    session.settle()
    assert drawn(session, "/sample/measured") is not None
    session.update(lambda state: state.replace(design=MARKED.replace(markers=())))
    session.settle()
    assert drawn(session, "/sample/measured") is None


def test_inputs_beyond_the_bounds_have_their_markers_predicted_as_they_are(session):
    far = INPUTS.copy()
    far[0] = (0.5, 0.0, 0.0)
    shown(session, inputs=far)
    assert session.state.activation == (0.0, 0.0, 0.0)
    straight = marker_positions(MARKED, (0.0, 0.0, 0.0))[0] / MARKED.length
    assert np.abs(drawn(session, "/sample/predicted").points - straight).max() > 0.01


def test_a_calibrated_arm_belongs_to_the_design_that_the_fit_began_with(session):
    shown(session)
    session.follow("fit")
    session.settle()
    fit = session.found.bench
    assert fit.fitted(MARKED) == fit.result.arm
    assert fit.fitted(changed(MARKED, {"taper": 0.02})) is None
    assert np.nanmax(session.found.sample.distances) < 2e-3
    assert drawn(session, "/sample/arm/0") is not None
