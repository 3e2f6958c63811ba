"""The inverse problem: every branch, nearest points, least change."""

import re
from functools import partial

import numpy as np
import pytest
from scipy.optimize import least_squares

from softreach.arm import designs
from softreach.arm.manipulator import Base, Manipulator
from softreach.arm.stations import Marker
from softreach.inverse import Status, branches, prepared_map, solve_inverse
from softreach.inverse.path import PathStatus, track_path
from softreach.rod import as_tip_map
from softreach.rod.kinematics import marker_positions, tip_positions
from softreach.support.errors import InvalidInput
from softreach.workspace import reachable_set
from tests.laws import in_box, miss_of_original
from tests.sets import trunk_at

DESIGNS = [(108, 2), (75, 3), (36, 3), (0, 0)]


@pytest.fixture(scope="module")
def folded() -> Manipulator:
    """A design whose activations overlap: many tips have two of them."""
    return trunk_at(36, 3)


def test_one_place_or_activation_may_stand_alone(folded):
    gamma = [-0.9, -0.3, -0.6]
    np.testing.assert_array_equal(tip_positions(folded, gamma), tip_positions(folded, [gamma]))
    target = tip_positions(folded, gamma)[0]
    np.testing.assert_array_equal(
        solve_inverse(folded, target).activations, solve_inverse(folded, [target]).activations
    )
    solid = reachable_set(folded, accuracy=0.2)
    assert solid.distance(target).tolist() == solid.distance([target]).tolist()
    with pytest.raises(InvalidInput, match=r"targets.shape = \(2,\)"):
        solve_inverse(folded, target[:2])


@pytest.mark.parametrize(("revolution", "taper"), DESIGNS)
def test_every_random_tip_is_solved_back_within_bounds_by_the_public_map(revolution, taper):
    arm = trunk_at(revolution, taper)
    gamma = in_box(arm, 600, seed=0)
    targets = tip_positions(arm, gamma)
    solutions = solve_inverse(arm, targets)
    assert (solutions.statuses == Status.REACHED).all()
    assert miss_of_original(solutions, gamma).max() < 1e-6
    target = np.repeat(np.arange(len(targets)), solutions.counts)
    missed = np.linalg.norm(tip_positions(arm, solutions.activations) - targets[target], axis=1)
    assert missed.max() <= 1e-10
    assert np.allclose(missed, solutions.residuals, atol=1e-14)
    assert (solutions.margins >= 0).all()
    assert (solutions.activations >= arm.bounds[:, 0]).all()
    assert (solutions.activations <= arm.bounds[:, 1]).all()


def fold_points(arm: Manipulator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Activations where det J = 0, by bisection, and the null directions there."""
    gamma = in_box(arm, 4000, seed=2)
    positive = np.linalg.det(as_tip_map(arm).tips_and_slopes(gamma)[1]) > 0
    count = min(n, int(positive.sum()), int((~positive).sum()))
    a, b = gamma[positive][:count], gamma[~positive][:count]
    for _ in range(60):
        middle = 0.5 * (a + b)
        up = np.linalg.det(as_tip_map(arm).tips_and_slopes(middle)[1]) > 0
        a, b = np.where(up[:, None], middle, a), np.where(up[:, None], b, middle)
    return a, np.linalg.svd(as_tip_map(arm).tips_and_slopes(a)[1])[2][:, 2]


@pytest.mark.parametrize("distance", [1e-2, 1e-3, 1e-4])
def test_both_preimages_near_a_fold_are_found(folded, distance):
    fold, null = fold_points(folded, 200)
    gamma = fold + distance * null
    inside = ((gamma > folded.bounds[:, 0]) & (gamma < folded.bounds[:, 1])).all(axis=1)
    mirror = fold - 3 * distance * null
    inside &= ((mirror > folded.bounds[:, 0]) & (mirror < folded.bounds[:, 1])).all(axis=1)
    assert inside.sum() > 100
    solutions = solve_inverse(folded, tip_positions(folded, gamma[inside]))
    assert miss_of_original(solutions, gamma[inside]).max() < 1e-6
    # Nearly all: where two folds meet, the other preimage lies elsewhere or nowhere.
    assert (solutions.counts >= 2).mean() > 0.95


def test_a_target_on_a_fold_is_solved_to_the_root_of_the_tolerance(folded):
    fold, _ = fold_points(folded, 200)
    solutions = solve_inverse(folded, tip_positions(folded, fold))
    assert (solutions.statuses == Status.REACHED).all()
    assert miss_of_original(solutions, fold).max() < 10 * np.sqrt(1e-10)


def test_a_finer_search_finds_the_same_number_of_solutions(folded):
    targets = tip_positions(folded, in_box(folded, 2000, seed=3))
    fine = solve_inverse(prepared_map(folded, cells=48), targets)
    coarse = solve_inverse(folded, targets)
    assert (coarse.counts != fine.counts).mean() < 1e-3
    assert (coarse.counts > 1).mean() > 0.1


def test_no_point_of_a_dense_cloud_is_nearer_than_the_nearest_point():
    from scipy.spatial import KDTree

    arm = trunk_at(108, 2)
    targets = np.random.default_rng(0).uniform(-1.3, 1.3, (500, 3))
    solutions = solve_inverse(arm, targets)
    out = solutions.statuses == Status.UNREACHABLE
    assert out.sum() > 300
    assert not (solutions.statuses == Status.NOT_FOUND).any()
    cloud = KDTree(tip_positions(arm, in_box(arm, 200_000, seed=0)))
    apart = cloud.query(targets)[0]
    assert (solutions.gaps[out] <= apart[out]).all()
    assert np.median(apart[out] - solutions.gaps[out]) < 0.01
    tips = tip_positions(arm, solutions.nearest_activations)
    assert np.allclose(np.linalg.norm(tips - targets, axis=1), solutions.gaps, atol=1e-12)
    assert np.allclose(tips[out], solutions.nearest[out], atol=1e-12)


def test_just_outside_the_surface_the_gap_is_the_distance(trunk):
    gamma = in_box(trunk, 300, seed=0)
    gamma[:, 0] = 0.0
    tips, slopes = as_tip_map(trunk).tips_and_slopes(gamma)
    normal = np.cross(slopes[:, :, 1], slopes[:, :, 2])
    normal *= np.sign((normal * slopes[:, :, 0]).sum(axis=1))[:, None]
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    solutions = solve_inverse(trunk, tips + 1e-5 * normal)
    out = solutions.statuses == Status.UNREACHABLE
    assert out.mean() > 0.5  # elsewhere the face lies inside the set
    assert (solutions.gaps[out] <= 1e-5 + 1e-12).all()
    assert np.quantile(solutions.gaps[out], 0.1) > 0.999e-5


def test_solutions_read_like_a_list_and_as_a_dataset(folded):
    targets = tip_positions(folded, in_box(folded, 50, seed=0))
    solutions = solve_inverse(folded, np.concatenate([targets, [[0.0, 0.0, 2.0]]]))
    assert len(solutions) == len(list(solutions)) == 51
    assert solutions[-1].status is Status.UNREACHABLE
    assert len(solutions[-1]) == 0
    part = solutions[10:20]
    assert len(part) == 10
    assert np.array_equal(part[3].activations, solutions[13].activations)
    dataset = solutions.to_dataset()
    assert dataset.sizes["target"] == 51
    assert dataset.activation.shape == (int(solutions.counts.sum()), 3)
    assert Manipulator.from_toml(dataset.attrs["design"]) == folded
    assert {"softreach_version", "schema_version"} <= set(dataset.attrs)
    with pytest.raises(IndexError):
        solutions[51]


def test_solutions_print_how_many_targets_were_reached_and_how_well(folded):
    gamma = in_box(folded, 3, seed=0)
    targets = np.concatenate([tip_positions(folded, gamma), [[0.0, 0.0, 2.0]]])
    solutions = solve_inverse(folded, targets)
    number, worst = len(solutions.activations), solutions.residuals.max()
    assert repr(solutions) == (
        f"<Solutions for 4 targets: 3 reached, 1 unreachable, {number} activations, "
        f"largest residual {worst:.1e} m>"
    )
    assert repr(solutions[-1]) == (
        f"<Solution for (0, 0, 2) m: unreachable, nearest point {solutions[-1].gap:.3g} m away>"
    )
    assert repr(solutions[0]).endswith(f"largest residual {solutions[0].residuals.max():.1e} m>")
    page = solutions._repr_html_()
    assert page.startswith(f"<p>{repr(solutions)[1:-1]}</p>")
    assert "target_of" in page


def test_blocks_and_threads_change_no_solution(folded, monkeypatch):
    targets = tip_positions(folded, in_box(folded, 200, seed=0))
    targets[::10] += [0.0, 0.0, 2.0]
    whole = solve_inverse(folded, targets)
    monkeypatch.setattr("softreach.inverse.solve._BLOCK", 7)
    monkeypatch.setenv("SOFTREACH_NUM_THREADS", "3")
    monkeypatch.setattr(branches, "_SMALLEST", 20)
    parts = solve_inverse(folded, targets)
    assert (whole.statuses == Status.UNREACHABLE).any()
    assert whole.to_dataset().identical(parts.to_dataset())


@pytest.mark.parametrize("design", [designs.minimal_trunk, designs.redundant_trunk])
def test_no_targets_give_no_solutions(design):
    arm = design()
    solutions = solve_inverse(arm, np.empty((0, 3)))
    assert len(solutions) == 0
    assert solutions.activations.shape == (0, arm.bundles)
    assert repr(solutions) == "<Solutions for 0 targets>"


def test_an_arm_its_tip_map_and_what_was_prepared_of_it_give_equal_answers(folded):
    targets = tip_positions(folded, in_box(folded, 20, seed=0))
    answers = [
        solve_inverse(arm, targets).to_dataset()
        for arm in (folded, as_tip_map(folded), prepared_map(folded))
    ]
    assert all(answer.identical(answers[0]) for answer in answers)


WRONG = {"residual_over_length": 0.0, "tol": 0.0, "family": 0, "near": [0.0]}
WRONG |= {"direction": [0.0, 0.0, 0.0], "direction_weight": -1.0}


@pytest.mark.parametrize("wish", WRONG)
def test_wishes_out_of_range_are_refused(trunk, wish):
    with pytest.raises(InvalidInput, match=wish):
        solve_inverse(trunk, [[0.0, 0.0, 1.0]], **{wish: WRONG[wish]})


def test_members_of_a_family_reach_their_target_apart_and_are_fewer_where_there_are_no_more():
    arm = designs.redundant_trunk()
    corner = arm.bounds[:, 0]  # the tip of a corner is that of a single activation
    gamma = np.stack([corner, [-0.5, -1.0, 0.0, -1.6], *in_box(arm, 6, seed=0)])
    solutions = solve_inverse(arm, tip_positions(arm, gamma), family=8)
    assert solutions.counts.tolist() == [1] + [8] * 7
    assert solutions.residuals.max() <= 1e-10
    for solution in solutions[1:]:
        members = solution.activations
        assert np.linalg.norm(members, axis=1).argmin() == 0
        apart = np.abs(members[:, None] - members).max(axis=2) + np.eye(8)
        assert apart.min() > 1e-3
        assert apart.max() > 0.01


@pytest.mark.parametrize("kept", [1, 2])
def test_fewer_bundles_come_as_near_as_a_dense_cloud(trunk, kept):
    from scipy.spatial import KDTree

    arm = trunk.replace(actuators=trunk.actuators[:kept])
    targets = np.random.default_rng(1).uniform(-1, 1, (40, 3))
    solutions = solve_inverse(arm, targets)
    cloud = KDTree(tip_positions(arm, in_box(arm, 40_000, seed=0)))
    assert (solutions.gaps <= cloud.query(targets)[0] + 1e-12).all()
    back = solve_inverse(arm, tip_positions(arm, in_box(arm, 20, seed=0)))
    assert (back.statuses == Status.REACHED).all()


def direction_of(arm: Manipulator, gamma: np.ndarray) -> np.ndarray:
    return as_tip_map(arm).tip_directions(gamma[None])[0]


def test_a_direction_trades_against_the_position_of_three_bundles_unless_it_is_met(trunk):
    gamma = in_box(trunk, 1, seed=0)[0]
    target = tip_positions(trunk, gamma[None])
    wanted = np.array([1.0, 0.0, 0.0])
    errors, gaps = [], []
    for weight in (1e-3, 0.1, 10.0):
        solution = solve_inverse(trunk, target, direction=wanted, direction_weight=weight)[0]
        assert solution.status is Status.NOT_FOUND
        d3 = direction_of(trunk, solution.nearest_activation)
        assert solution.direction_gap == pytest.approx(np.arccos(d3 @ wanted), abs=1e-6)
        errors.append(solution.direction_gap)
        gaps.append(solution.gap)
    assert errors[0] > errors[1] > errors[2]
    assert gaps[0] < gaps[1] < gaps[2]
    met = direction_of(trunk, gamma)
    solution = solve_inverse(trunk, target, direction=3 * met)[0]
    assert solution.status is Status.REACHED
    assert np.abs(solution.activations - gamma).max() < 1e-6


@pytest.mark.parametrize("cone", [0.0, 0.2])
def test_a_pose_that_some_activation_has_is_met_exactly_with_no_more_change(cone):
    """Five rows and six tendons: places and directions of known activations, half of them slack."""
    arm = designs.three_tendon_robot(segments=2)
    known = in_box(arm, 20, seed=3)
    known[:, [0, 3]] = arm.input_bounds[[0, 3], 0]
    rod, ranges = as_tip_map(arm), np.ptp(arm.input_bounds, axis=1)
    given = {"direction": rod.tip_directions(known), "cone": cone}
    solutions = solve_inverse(arm, rod.tips(known), **given)
    assert (solutions.statuses == Status.REACHED).all()
    assert solutions.residuals.max() <= 1e-10 * arm.length
    reached = np.einsum("ni,ni->n", rod.tip_directions(solutions.activations), given["direction"])
    assert np.arccos(reached.clip(-1, 1)).max() <= cone + 2e-7  # as far as arccos can tell
    assert np.degrees(solutions.direction_errors - cone).max() <= 1e-6
    change, of_known = (np.linalg.norm(x / ranges, axis=1) for x in (solutions.activations, known))
    assert (change <= of_known + 1e-6).all()


def test_a_frame_that_some_activation_has_is_met_exactly():
    """Six rows and six tendons, in the base frame and for a marker alike."""
    arm = designs.three_tendon_robot(segments=2)
    arm = arm.replace(base=Base(points="down"))
    known = in_box(arm, 12, seed=3)
    tip_map = as_tip_map(arm)
    frames = tip_map.tip_frames(known)
    solutions = solve_inverse(arm, tip_map.tips(known), orientation=frames)
    assert (solutions.statuses == Status.REACHED).all()
    assert solutions.residuals.max() <= 1e-10 * arm.length
    assert solutions.direction_errors.max() <= 1e-7
    assert np.abs(tip_map.tip_frames(solutions.activations) - frames).max() <= 1e-7


def test_a_frame_is_a_direction_and_a_turn_around_it():
    """Tendons cannot turn a section in place: a turned frame is off by that angle or less."""
    from scipy.spatial.transform import Rotation

    arm = designs.three_tendon_robot(segments=2)
    tip_map, known = as_tip_map(arm), in_box(arm, 6, seed=5)
    turned = tip_map.tip_frames(known) @ Rotation.from_rotvec([0.0, 0.0, 0.3]).as_matrix()
    target = tip_map.tips(known)
    by_frame = solve_inverse(arm, target, orientation=turned)
    by_direction = solve_inverse(arm, target, direction=turned[:, :, 2])
    assert (by_direction.statuses == Status.REACHED).all()
    assert (by_frame.statuses == Status.NOT_FOUND).all()
    assert (by_frame.direction_gaps <= 0.3 + 1e-6).all()
    allowed = solve_inverse(arm, target, orientation=turned, cone=0.3 + 1e-6)
    assert (allowed.statuses == Status.REACHED).all()


@pytest.mark.parametrize(
    ("wrong", "name"),
    [(np.eye(2), "orientation.shape"), (-np.eye(3), "orientation"), (2 * np.eye(3), "orientation")],
)
def test_an_orientation_is_a_rotation_matrix(trunk, wrong, name):
    with pytest.raises(InvalidInput, match=re.escape(name)):
        solve_inverse(trunk, [[0.0, 0.0, 0.5]], orientation=wrong)


ELBOW = Marker(name="elbow", station_over_length=0.5)
SIDE = Marker(name="side", station_over_length=0.8, offset=(0.02, 0.01, 0.03))
HANGING = designs.three_tendon_robot(segments=2).replace(base=Base(points="down"))


@pytest.mark.parametrize("arm", [HANGING, trunk_at(108, 2)])
def test_markers_that_fix_the_activation_lead_back_to_it(arm):
    arm = arm.replace(markers=(ELBOW, SIDE))
    known = in_box(arm, 8, seed=3)
    markers = {name: as_tip_map(arm, point=name).tips(known) for name in ("elbow", "side")}
    solutions = solve_inverse(arm, tip_positions(arm, known), markers=markers)
    assert (solutions.statuses == Status.REACHED).all()
    assert max(solutions.residuals.max(), solutions.marker_errors.max()) < 1e-9 * arm.length
    np.testing.assert_allclose(solutions.activations, known, rtol=0, atol=1e-7)
    places = marker_positions(arm, solutions.activations)
    np.testing.assert_allclose(places, np.stack([*markers.values()], axis=1), atol=1e-6)


def test_out_of_reach_all_distances_are_least_as_scipy_finds_them():
    arm = HANGING.replace(markers=(ELBOW,))
    maps, known = [as_tip_map(arm), as_tip_map(arm, point="elbow")], in_box(arm, 4, seed=1)
    tips, elbows = (each.tips(known) + [0.0, 0.06, 0.03] for each in maps)
    solutions = solve_inverse(arm, tips, markers={"elbow": elbows})
    assert (solutions.statuses == Status.NOT_FOUND).all()
    wanted = np.concatenate([tips, elbows], axis=1)
    for start, goal, one in zip(known, wanted, solutions, strict=True):
        rows = lambda x, goal=goal: np.ravel([m.tips(x[None]) for m in maps]) - goal  # noqa: E731
        tight = {"xtol": 1e-12, "gtol": 1e-12}
        best = least_squares(rows, start, bounds=arm.bounds.T, jac="3-point", **tight)
        assert np.hypot(one.gap, *one.marker_gaps) == pytest.approx(np.sqrt(2 * best.cost))


def test_a_target_is_reached_if_every_marker_is_within_its_own_distance(trunk):
    arm = trunk.replace(markers=(ELBOW,))
    known = in_box(arm, 1, seed=0)
    target, elbow = tip_positions(arm, known), as_tip_map(arm, point="elbow").tips(known)
    ask = partial(solve_inverse, arm, target, markers={"elbow": elbow + [0.0, 0.03, 0.0]})
    for within, reached in ((0.031, True), ({"elbow": 0.031}, True), (0.02, False), (0.0, False)):
        solution = ask(marker_within=within)[0]
        assert (solution.status is Status.REACHED) == reached
        assert ("elbow 30 mm off" in solution.text("mm")) == reached
    shape = {"elbow": np.zeros((2, 3))}
    wrong = {"markers": 3, "point": {"knee": elbow}, r"\['elbow'\].shape": shape}
    for name, markers in wrong.items():
        with pytest.raises(InvalidInput, match=name):
            ask(markers=markers)


def test_a_family_of_poses_meets_the_direction_each():
    arm = designs.three_tendon_robot(segments=2)
    known = in_box(arm, 4, seed=1)
    rod = as_tip_map(arm)
    wanted = rod.tip_directions(known)
    solutions = solve_inverse(arm, rod.tips(known), direction=wanted, family=5)
    assert solutions.counts.max() > 1
    owner = np.repeat(np.arange(4), solutions.counts)
    assert solutions.residuals.max() <= 1e-10 * arm.length
    off = np.linalg.norm(np.cross(rod.tip_directions(solutions.activations), wanted[owner]), axis=1)
    assert off.max() <= 1e-8


def test_a_direction_that_no_pose_has_is_not_reached():
    arm = designs.redundant_trunk()
    target = tip_positions(arm, in_box(arm, 1, seed=8))
    solution = solve_inverse(arm, target, direction=(0.0, 0.6, 0.8))[0]
    assert solution.status is Status.NOT_FOUND
    assert len(solution) == 0
    assert solution.direction_gap > 0.1
    assert "° off" in str(solution)
    wide = solve_inverse(arm, target, direction=(0.0, 0.6, 0.8), cone=np.pi)[0]
    free = solve_inverse(arm, target)[0]
    assert np.allclose(wide.activations, free.activations, atol=1e-6)


# Following paths on one branch of solutions


BEGIN, END = np.array([-0.3, -0.9, -0.4]), np.array([-1.2, -0.2, -1.1])


@pytest.fixture(scope="module")
def images(trunk):
    gamma = BEGIN + np.linspace(0, 1, 12)[:, None] * (END - BEGIN)
    return gamma, tip_positions(trunk, gamma)


def test_the_image_of_a_line_is_followed_forth_and_back(trunk, images):
    gamma, path = (np.concatenate([one, one[::-1]]) for one in images)
    track = track_path(trunk, path, start=BEGIN)
    assert track.attrs["end"] == "end"
    assert (track.status == PathStatus.FOLLOWED).all()
    assert float(track.tip_error.max()) <= 1e-10
    assert np.abs(track.activation.values - gamma).max() < 1e-6


def test_a_branch_ends_where_a_bundle_reaches_its_bound(trunk, images):
    begin = images[1][0]
    path = np.linspace(begin, begin + [0.0, 0.0, 2.0], 20)
    track = track_path(trunk, path)
    assert track.attrs["end"] == "bound"
    bundle = list(track.bundle.values).index(track.attrs["end_bundle"])
    bound = trunk.bounds[bundle, 1 if track.attrs["end_bound"] == "upper" else 0]
    assert track.end_activation.values[bundle] == pytest.approx(bound, abs=1e-7)
    followed = track.status.values == PathStatus.FOLLOWED
    assert 0 < followed.sum() < 20
    assert np.isnan(track.activation.values[~followed]).all()
    beyond = track.end_position.values + [0.0, 0.0, 1e-4]
    assert solve_inverse(trunk, beyond[None])[0].status is Status.UNREACHABLE


def test_a_branch_ends_at_a_fold():
    arm = designs.minimal_trunk(np.radians(36), np.radians(3))
    rng, ends = np.random.default_rng(0), []
    for _ in range(12):
        gamma, way = rng.uniform(-5 / 3, 0, 3), rng.normal(size=3)
        begin = tip_positions(arm, gamma[None])[0]
        path = np.linspace(begin, begin + 0.5 * way / np.linalg.norm(way), 4)
        track = track_path(arm, path, start=gamma)
        ends.append(track.attrs["end"])
        if ends[-1] == "fold":
            slopes = as_tip_map(arm).tips_and_slopes(track.end_activation.values[None])[1][0]
            first = as_tip_map(arm).tips_and_slopes(gamma[None])[1][0]
            assert abs(np.linalg.det(slopes)) < 0.05 * abs(np.linalg.det(first))
    assert "fold" in ends
    assert "bound" in ends


def test_four_bundles_follow_where_three_would_stop(trunk, images):
    arm = designs.redundant_trunk()
    begin = images[1][0]
    path = np.linspace(begin, begin + [0.1, 0.0, 0.1], 5)
    track = track_path(arm, path)
    followed = track.status.values == PathStatus.FOLLOWED
    assert followed.sum() >= 2
    assert np.nanmax(track.tip_error.values) <= 1e-10
    gamma = track.activation.values[followed]
    assert (gamma >= arm.bounds[:, 0]).all()
    assert (gamma <= arm.bounds[:, 1]).all()


def test_a_first_point_out_of_reach_is_said(trunk):
    track = track_path(trunk, [[0.0, 0.0, 3.0], [0.0, 0.0, 1.0]])
    assert (track.status == PathStatus.NO_START).all()
    assert track.attrs["end"] == "no_start"


@pytest.mark.parametrize("path", [np.empty((0, 3)), [[0.0, 0.0, np.inf]], [0.0, 1.0]])
def test_what_is_no_path_is_refused(trunk, path):
    with pytest.raises(InvalidInput, match="path"):
        track_path(trunk, path)


def test_a_path_says_how_it_was_made(trunk):
    track = track_path(trunk, [[0.0, 0.0, trunk.length]], tol=1e-5, residual_over_length=1e-8)
    assert type(trunk).from_toml(track.attrs["design"]) == trunk
    assert (track.attrs["tol"], track.attrs["residual_over_length"]) == (1e-5, 1e-8)
    assert track.attrs["softreach_version"]
