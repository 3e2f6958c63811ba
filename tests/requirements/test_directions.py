"""Laws of targets that ask for a direction of the tip within a cone."""

import json

import numpy as np
import pytest

import softreach as sr
from softreach.arm.parameters import changed
from softreach.cli.app import run
from softreach.requirements import Keep, Requirements, Sphere, Target
from softreach.requirements.checks import checked
from softreach.rod.rods import as_tip_map
from softreach.support.errors import InvalidDesign, InvalidInput

TRUNK = sr.designs.minimal_trunk()
BASED = TRUNK.replace(base=sr.Base(points="x", position=(0.3, -2.0, 1.0)))
ARMS = {"three": TRUNK, "six": sr.designs.three_tendon_robot(segments=2), "based": BASED}


def poses_of(arm, count=6):
    """Places and directions of known activations, in the world."""
    rod = as_tip_map(arm)
    box, rng = rod.box, np.random.default_rng(3)
    gamma = box.low + box.widths * rng.uniform(0.05, 0.95, (count, box.bundles))
    return rod.tips(gamma), rod.tip_directions(gamma)


def judged(arm, *, quick=False, **target):
    return checked(arm, Requirements(targets=[Target(name="pose", **target)]), 0.05, quick=quick)


@pytest.mark.parametrize("quick", [False, True])
@pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS)
def test_poses_of_known_activations_meet_their_directions(arm, quick):
    places, ways = poses_of(arm)
    for cone, within in ((0.0, 0.0), (0.1, 0.0), (0.1, 1e-3 * arm.length)):
        target = {"places": places, "direction": 7.0 * ways, "cone": cone, "within": within}
        check = judged(arm, quick=quick, **target)
        assert check.met, check
        assert check.direction_errors.max() <= cone + 1e-6
        found = as_tip_map(arm).tip_directions(check.poses[0])
        cosines = np.einsum("ni,ni->n", found, ways)
        np.testing.assert_allclose(np.cos(check.direction_errors[0]), cosines, atol=1e-9)


def test_a_cone_of_half_a_turn_changes_nothing():
    places, ways = poses_of(TRUNK)
    places[0] *= 1.4  # out of reach
    for quick in (False, True):
        plain = judged(TRUNK, places=places, quick=quick)
        wide = judged(TRUNK, places=places, direction=-ways, cone=np.pi, quick=quick)
        for name in ("gaps", "poses", "effort", "nearest", "direction_errors"):
            np.testing.assert_array_equal(getattr(wide, name), getattr(plain, name))
        assert wide.findings == plain.findings
        assert np.isnan(wide.direction_errors).all()


def test_a_wrong_direction_is_missed_by_the_least_angle_of_all_activations_at_the_place():
    places, ways = poses_of(TRUNK)
    ways, cone = np.roll(ways, 1, axis=1), np.radians(3)
    check = judged(TRUNK, places=places, direction=ways, cone=cone)
    rod, least = as_tip_map(TRUNK), []
    for solution, way in zip(sr.solve_inverse(TRUNK, places), ways, strict=True):
        turned = rod.tip_directions(solution.activations)
        least.append(np.arctan2(np.linalg.norm(np.cross(turned, way), axis=1), turned @ way).min())
    assert min(least) > cone
    np.testing.assert_allclose(check.direction_errors, [least], atol=1e-6)
    assert check.gaps.max() <= 1e-6  # the places are reached
    assert not check.reached.any()
    (finding,) = check.findings
    assert finding.verdict == "missed"
    assert finding.excess == pytest.approx(max(least) - cone, abs=1e-6)
    worst = int(np.argmax(least))
    assert f"place {worst + 1} at" in finding.text
    assert f"is {np.degrees(least[worst]):.4g}° off the direction (3° allowed)" in finding.text
    data = check.to_dataset()["direction_error"]
    assert data.attrs["units"] == "rad"
    np.testing.assert_array_equal(data.values, check.direction_errors)


def test_a_redundant_arm_stays_at_the_place_with_a_direction_that_it_cannot_have():
    arm = ARMS["six"]
    places, ways = poses_of(arm, 3)
    check = judged(arm, places=places, direction=-ways)
    assert check.gaps.max() <= 1e-6 * arm.length
    assert (check.direction_errors > 0.1).all()


def test_a_direction_is_met_anywhere_within_the_distance_that_is_allowed():
    (tip,), (way,) = poses_of(TRUNK, 1)
    place = tip + 5e-3 * np.array([0.6, 0.0, 0.8])
    for quick in (False, True):
        assert judged(TRUNK, places=place, direction=way, within=6e-3, quick=quick).met
        assert not judged(TRUNK, places=place, direction=way, within=1e-3, quick=quick).met
    options = {"direction": way, "cone": 1e-5}
    reached = sr.solve_inverse(TRUNK, place, within=6e-3, **options)[0]
    assert reached.status.name == "REACHED"
    assert reached.residuals[0] <= 6e-3
    assert sr.solve_inverse(TRUNK, place, within=1e-3, **options)[0].status.name == "NOT_FOUND"


def test_the_quick_excess_grows_with_the_angle_beyond_the_cone():
    places, ways = poses_of(TRUNK, 1)
    axis = np.cross(ways[0], [1.0, 0.0, 0.0])
    side = np.cross(axis / np.linalg.norm(axis), ways[0])
    turns = np.radians([0.0, 4.0, 10.0, 20.0, 40.0, 80.0])
    excess = [
        judged(
            TRUNK,
            places=places,
            direction=np.cos(turn) * ways[0] + np.sin(turn) * side,
            cone=np.radians(5),
            quick=True,
        ).excess
        for turn in turns
    ]
    assert excess[:2] == [0.0, 0.0]
    assert (np.diff(excess[1:]) > 0.0).all()


def test_targets_with_and_without_directions_are_judged_as_if_each_were_alone():
    places, ways = poses_of(TRUNK)
    given = [
        {"places": places[:2]},
        {"places": places[2:4], "direction": ways[2:4], "cone": 0.1},
        {"places": places[4:], "direction": (0, 0, 1), "within": 1e-3},
    ]
    every = checked(TRUNK, Requirements(targets=[Target(**each) for each in given]), 0.05)
    alone = [judged(TRUNK, **each) for each in given]
    for name in ("gaps", "poses", "direction_errors"):
        parts = np.concatenate([getattr(each, name) for each in alone], axis=1)
        np.testing.assert_allclose(getattr(every, name), parts, atol=1e-9)


def test_a_search_finds_a_design_whose_tip_points_the_way_that_is_asked_for():
    """Three bundles reach the place at any revolution, and point that way at few."""
    made = changed(TRUNK, {"left.revolution": 0.6})
    rod = as_tip_map(made)
    gamma = np.array([[-0.9, -0.3, -0.6]])
    place, way = rod.tips(gamma), rod.tip_directions(gamma)
    needs = Requirements(targets=[Target(place, direction=way, cone=np.radians(1), within=1e-3)])
    assert not sr.check(changed(TRUNK, {"left.revolution": 0.0}), needs).met
    free = {"left.revolution": (0.0, 1.2)}
    found = sr.search(TRUNK, free, requirements=needs, designs=24)
    assert found.met, found
    assert sr.check(found.arm, needs).met


def test_a_picture_has_a_line_along_every_direction():
    pytest.importorskip("matplotlib")
    places, ways = poses_of(TRUNK, 2)
    targets = [Target(places, direction=3 * ways, cone=0.1), Target(places)]
    check = sr.check(TRUNK, Requirements(targets=targets))
    lines = sr.plot.plot_check(check, view="front", unit="m").lines
    ends = [line.get_xydata() for line in lines if line.get_color() == "0.2"]
    np.testing.assert_allclose([end[0] for end in ends], places[:, [0, 2]], atol=1e-12)
    along = np.array([end[1] - end[0] for end in ends])
    np.testing.assert_allclose(along / along[0, 0], ways[:, [0, 2]] / ways[0, 0], rtol=1e-9)


FORBIDDEN = [
    ({"direction": (0, 0, 0)}, "direction = .*: must be finite vectors longer than 0"),
    ({"direction": (0, np.nan, 1)}, "direction = .*: must be finite numbers"),
    ({"direction": (0, 1)}, "direction.shape"),
    ({"direction": np.ones((3, 3))}, "direction.shape"),
    ({"direction": "up"}, "direction"),
    ({"direction": (0, 0, 1), "cone": -0.1}, "cone = -0.1"),
    ({"direction": (0, 0, 1), "cone": np.nan}, "cone = nan"),
    ({"direction": (0, 0, 1), "cone": 4.0}, "cone = 4"),
    ({"cone": 0.1}, "cone = 0.1: must be left out where there is no direction"),
]


@pytest.mark.parametrize(("wrong", "said"), FORBIDDEN)
def test_directions_that_mean_nothing_are_refused_in_one_line(wrong, said):
    with pytest.raises(InvalidInput, match=said) as caught:
        Target([[0, 0, 1.0], [0, 0, 0.9]], **wrong)
    assert "\n" not in str(caught.value)


def test_a_region_has_no_direction():
    with pytest.raises(InvalidInput, match=r"direction = .*left out where there is a region"):
        Target(region=Sphere((0, 0, 1), 0.1), direction=(0, 0, 1))


def test_directions_of_a_file_read_back_equal():
    text = """
    [[reach]]
    places_mm = [[0, 0, 300], [0, 10, 290]]
    direction = [0, 0, 2]
    cone = "5 deg"
    [[reach]]
    places_mm = [[0, 0, 300], [0, 10, 290]]
    direction = [[0, 0, 1], [0, 0.3, 1]]
    cone_deg = 5
    [[reach]]
    places_mm = [[0, 0, 300]]
    """
    needs = Requirements.from_toml(text)
    again = Requirements.from_toml(needs.to_toml())
    assert again.to_toml() == needs.to_toml()
    for one, other in zip(needs.goals, again.goals, strict=True):
        np.testing.assert_array_equal(one, other)
    assert needs.goals.cones.tolist() == [np.radians(5)] * 4 + [np.pi]
    np.testing.assert_array_equal(needs.goals.directions[:2], [[0, 0, 1]] * 2)
    assert np.isnan(needs.goals.directions[4]).all()


def test_wrong_directions_of_a_file_are_told_at_once_in_its_own_words():
    text = """
    [[reach]]
    places_mm = [[0, 0, 300]]
    direction = [0, 0, 0]
    [[reach]]
    places_mm = [[0, 0, 300]]
    direction = 3
    cone = "5deg"
    [[reach]]
    places_mm = [[0, 0, 300]]
    direction = [0, 0, 1]
    cone = 5
    [[reach]]
    places_mm = [[0, 0, 300]]
    direction = [[0, 0, 1], [0, 1, 0]]
    [[reach]]
    sphere = { center_mm = [0, 0, 300], radius_mm = 30 }
    direction = [0, 0, 1]
    [[reach]]
    places_mm = "near"
    direction = [0, 0, 1]
    cone_deg = -5
    """
    with pytest.raises(InvalidDesign) as caught:
        Requirements.from_toml(text)
    assert [fault.path for fault in caught.value.faults] == [
        "reach[0].direction",
        "reach[1].direction",
        "reach[2].cone",
        "reach[3].direction",
        "reach[4].direction",
        "reach[5].places_mm",
    ]
    assert 'such as "5deg", or stand under cone_rad' in str(caught.value)


def test_the_command_line_reports_the_angle(folder, capsys):
    places, ways = poses_of(TRUNK, 1)
    target = Target(places, direction=ways, cone=np.radians(1), name="shelf")
    Requirements(targets=[target]).save("needs.toml")
    assert run(["check", "minimal_trunk", "needs.toml"]) == 0
    assert "1 place reached, up to 1° off the direction" in capsys.readouterr().out
    Requirements(targets=[Target(places, direction=-ways)]).save("wrong.toml")
    assert run(["check", "minimal_trunk", "wrong.toml", "--json"]) == 1
    record = json.loads(capsys.readouterr().out)
    assert record["direction_errors_deg"][0][0] > 90.0
    assert "° off the direction" in record["findings"][0]["text"]


def test_poses_that_keep_to_a_region_are_chosen_among_those_that_point_the_right_way():
    arm = ARMS["six"]
    places, ways = poses_of(arm, 1)
    free = judged(arm, places=places, direction=ways, cone=0.2)
    middle = sr.configuration(arm, free.poses[0, 0], [0.5 * arm.length]).position.values[0]
    lamp = Keep(Sphere(middle, 2e-3 * arm.length), False)
    needs = Requirements(targets=[Target(places, direction=ways, cone=0.2)], keeps=[lamp])
    check = sr.check(arm, needs)
    assert check.findings[0].met
    assert check.direction_errors.max() <= 0.2 + 1e-6
    assert check.findings[1].met
    assert check.effort[0, 0] > free.effort[0, 0]
