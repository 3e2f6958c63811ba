"""Laws of the check of a design against requirements."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softreach as sr
from softreach.cli.app import run
from softreach.requirements import Box, HalfSpace, Keep, Limits, Requirements, Sphere, Target
from softreach.requirements.poses import Body
from softreach.rod.rods import as_tip_map
from tests.laws import arms

ARM = sr.designs.minimal_trunk()
GAMMA = np.random.default_rng(5).uniform(-1.6, 0.0, (5, 3))
TIPS = sr.tip_positions(ARM, GAMMA)
SOFT = sr.Material(young_modulus=1e6, density=1000.0)


def checked(arm=ARM, **parts):
    return sr.check(arm, Requirements(**parts))


def test_places_that_are_tips_are_met_with_no_more_effort_than_that_took():
    check = checked(targets=[Target(TIPS)])
    assert check.met
    assert check.gaps.shape == (1, 5)
    assert (check.gaps < 1e-9).all()
    np.testing.assert_allclose(sr.tip_positions(ARM, check.poses[0]), TIPS, atol=1e-9)
    largest = np.abs(ARM.bounds).max(axis=1)
    assert (check.effort[0] <= np.linalg.norm(GAMMA / largest, axis=1) + 1e-9).all()


def test_a_place_out_of_reach_is_missed_by_its_distance_from_the_reachable_set():
    away = TIPS * 1.5
    check = checked(targets=[Target(away, name="far")])
    distance = sr.reachable_set(ARM, accuracy=0.01).distance(away).clip(0.0)
    np.testing.assert_allclose(check.gaps[0], distance, atol=4e-3)
    (finding,) = check.findings
    assert not finding.met
    assert finding.excess == pytest.approx(check.gaps.max() / ARM.length)
    assert "of 5 places reached" in finding.text
    assert checked(targets=[Target(away, within=check.gaps.max() * 1.001)]).met
    assert not checked(targets=[Target(away, within=check.gaps.max() * 0.999)]).met


def test_a_finding_is_met_where_its_excess_is_zero_and_the_check_where_all_are():
    needs = dict(
        targets=[Target(TIPS, name="near"), Target([2.0, 0.0, 0.0], name="far")],
        keeps=[
            Keep(Box((-1, -1, 0), (2, 1, 0.8)), True, name="low", of="tip", when="always"),
            Keep(Sphere((0, 0, 3), 1.0), False, name="lamp"),
        ],
        limits=Limits(actuators=2, bending=2.0, shortening=0.01),
        measures={"exact_volume": (10.0, None), "reach_height": (None, 10.0)},
    )
    check = checked(**needs)
    for finding in check.findings:
        assert finding.verdict in ("met", "missed")
        assert finding.met == (finding.excess == 0.0)
        assert np.isfinite(finding.excess)
    met = [finding.name for finding in check.findings if finding.met]
    missed = [finding.name for finding in check.findings if not finding.met]
    assert met == ["near", "lamp", "bending κR2", "reach_height"]
    assert missed == ["far", "low", "actuators", "shortening", "exact_volume"]
    assert not check.met
    assert repr(check).startswith("Requirements of an arm of 1 m: missed, 5 of 9")
    data = check.to_dataset()
    assert data.met.values.tolist() == [finding.met for finding in check.findings]
    assert data.pose.dims == ("payload", "place", "input")
    assert data.reached.values.tolist() == [[True] * 5 + [False]]


TILTED = np.array([[0.1, 0.2, 1.0]])


def needs_of(places, factor=1.0, move=lambda x: x, turn=lambda x: x):
    center, point = move(factor * np.array([[0.3, 0.1, 0.5], [0, 0, 0.55]]))
    return Requirements(
        targets=[Target(move(factor * places))],
        keeps=[
            Keep(Sphere(center, 0.25 * factor), False),
            Keep(HalfSpace(point, turn(TILTED)[0]), True, clearance=0.01 * factor),
        ],
        limits=Limits(shortening=0.2, bending=0.3),
    )


PLACES = TIPS * np.array([1.0, 1.0, 0.7])


def same(one, other, factor=1.0):
    np.testing.assert_allclose(other.gaps, factor * one.gaps, atol=1e-7)
    excess = [[finding.excess for finding in check.findings] for check in (one, other)]
    np.testing.assert_allclose(*excess, atol=1e-5)


def test_an_arm_its_base_and_requirements_scale_and_turn_together():
    check, small = sr.check(ARM, needs_of(PLACES)), sr.designs.minimal_trunk(length=0.2)
    same(check, sr.check(small, needs_of(PLACES, 0.2)), 0.2)
    base = sr.Base(points="x", position=(0.3, -2.0, 1.0))
    moved = needs_of(PLACES, 1.0, base.to_world, base.directions_to_world)
    same(check, sr.check(ARM.replace(base=base), moved))


@pytest.mark.parametrize("inside", [True, False])
def test_the_whole_arm_keeps_to_a_region_as_its_skin_does(inside):
    """Against points all over the skin, of each pose; the stated error bounds what is between."""
    region = Sphere((0.1, 0.0, 0.4), 0.5) if inside else Sphere((0.35, 0.1, 0.4), 0.1)
    needs = Requirements(targets=[Target(TIPS, within=3.0)], keeps=[Keep(region, inside, of="arm")])
    # Places that the region forbids are no contradiction here: the tip need not come near.
    check = sr.check(ARM, needs, accuracy=1e-3)
    shapes = sr.configuration(ARM, check.poses[0], 1001)
    angle = np.linspace(0, 2 * np.pi, 60)[:, None, None, None]
    first, second = (shapes.directors.values[:, :, k] for k in (0, 1))
    radius = shapes.radius.values[:, None]
    skin = shapes.position.values + radius * (np.cos(angle) * first + np.sin(angle) * second)
    distance = region.distance(skin.reshape(-1, 3)) * (1 if inside else -1)
    finding = check.findings[-1]
    assert finding.excess == pytest.approx(max(distance.max(), 0.0), abs=2e-3)


def test_the_pose_that_keeps_to_a_region_is_chosen_where_there_are_several():
    arm = sr.designs.redundant_trunk()
    places = sr.tip_positions(arm, np.full((1, arm.bundles), -0.6))
    free = sr.check(arm, Requirements(targets=[Target(places)]))
    beside = sr.configuration(arm, free.poses[0, 0], [0.6 * arm.length]).position.values[0]
    others = sr.solve_inverse(arm, places, family=16).activations
    apart = sr.configuration(arm, others, [0.6 * arm.length]).position.values[:, 0] - beside
    room = np.linalg.norm(apart, axis=1).max() - float(arm.profile.radius(0.6 * arm.length))
    assert room > 0.0  # else no pose keeps away
    needs = Requirements(targets=[Target(places)], keeps=[Keep(Sphere(beside, 0.3 * room), False)])
    check = sr.check(arm, needs)
    assert check.effort[0, 0] > free.effort[0, 0]
    assert check.findings[0].met
    assert check.findings[1].excess < 0.3 * room / arm.length


def test_bounds_that_are_said_to_reach_a_place_reach_it():
    narrow = ARM.with_bounds(0.6 * ARM.bounds)
    wanted = sr.tip_positions(ARM, 0.9 * ARM.bounds[:, :1].T)
    text = sr.check(narrow, Requirements(targets=[Target(wanted)])).findings[0].text
    told = re.findall(r"a (lower|n upper) bound of ([\w ]+?) at (\S+) instead", text)
    assert told
    bounds = narrow.bounds.copy()
    for end, name, value in told:
        bounds[ARM.input_names.index(name), 0 if end == "lower" else 1] = float(value)
    gap = sr.check(narrow.with_bounds(bounds), Requirements(targets=[Target(wanted)])).gaps
    assert gap.max() < 1e-3


def test_the_worst_pose_is_found_among_all_within_the_bounds():
    keep = Keep(HalfSpace((0, 0, 0.4), (1.0, 0.0, 0.3)), True, of="tip", when="always")
    (finding,) = checked(keeps=[keep]).findings
    box = ARM.bounds
    samples = box[:, 0] + np.random.default_rng(0).random((20_000, 3)) * (box[:, 1] - box[:, 0])
    worst = keep.missed(sr.tip_positions(ARM, samples)).max()
    assert finding.excess >= worst
    assert finding.excess == pytest.approx(worst, rel=0.05)


def test_the_share_of_a_region_is_that_of_its_volume():
    reached = sr.reachable_set(ARM, accuracy=0.01)
    low, high = reached.surface().vertices.min(axis=0), reached.surface().vertices.max(axis=0)
    target = Target(region=Box(low, high), share=0.2)
    open_check = checked(targets=[target])
    share = reached.volume / target.region.volume
    (coverage,) = open_check.coverages
    assert abs(coverage.share - share) < 3 * coverage.error
    assert open_check.met == (coverage.share >= 0.2)
    # The same by single poses, which a limit that nothing breaks asks for.
    needs = Requirements(targets=[target], limits=Limits(bending=50.0))
    (coverage,) = sr.check(ARM, needs, accuracy=0.03).coverages
    assert abs(coverage.share - share) < 4 * coverage.error


def test_limits_without_targets_are_those_of_all_bounds():
    from softreach.rod.bending import sharpest_bending

    (finding,) = checked(limits=Limits(bending=0.1)).findings
    assert finding.excess == pytest.approx(sharpest_bending(ARM).value / 0.1 - 1.0)
    tendons = sr.designs.three_tendon_robot()
    most = np.abs(tendons.bounds).max()
    for name in ("force", "stroke"):
        (finding,) = checked(tendons, limits=Limits(**{name: 0.5 * most})).findings
        expected = 1.0 if tendons.bundle_units[0] == {"force": "N", "stroke": "m"}[name] else 0.0
        assert finding.excess == pytest.approx(expected)


def test_more_payloads_are_never_less_to_ask_for():
    arm = sr.designs.minimal_trunk(material=SOFT, length=0.3).replace(loads=sr.Loads())
    places = sr.tip_positions(arm, [[-0.4, -0.2, -0.1], [0.0, -0.3, -0.5]])
    checks = [
        checked(arm, targets=[Target(places)], payloads=payloads)
        for payloads in ((0.0,), (0.05,), (0.0, 0.05))
    ]
    assert min(check.excess for check in checks) >= 0.0
    empty, loaded, both = (check.gaps for check in checks)
    np.testing.assert_allclose(both, np.concatenate([empty, loaded]), atol=1e-12)


def test_a_payload_that_nothing_holds_is_missed_and_not_an_error():
    arm = sr.designs.minimal_trunk(material=sr.Material(young_modulus=1e3, density=1000.0))
    arm = arm.replace(loads=sr.Loads(gravity=(0, 0, -9.81)))
    check = sr.check(arm, Requirements(targets=[Target([0, 0, 1.0])], payloads=[100.0]))
    assert not check.met
    assert np.isfinite(check.excess)
    assert np.isfinite(check.gaps).all()


@given(arm=arms(), seed=st.integers(0, 1000))
def test_what_is_refused_at_once_is_missed_by_at_least_as_much(arm, seed):
    rng = np.random.default_rng(seed)
    places = rng.normal(size=(1, 3)) * arm.length * rng.uniform(0.5, 3.0)
    needs = Requirements(
        targets=[Target(places, name="near", within=0.05 * arm.length * rng.random())],
        limits=Limits(actuators=int(rng.integers(0, 4))),
    )
    refused = sr.requirements.quick_excess(arm, needs)
    if not refused:
        return
    found = {finding.name: finding for finding in sr.check(arm, needs).findings}
    for finding in refused:
        assert not found[finding.name].met
        assert finding.excess <= found[finding.name].excess + 1e-9


def test_many_places_are_met_in_blocks_that_change_nothing(monkeypatch):
    from softreach.requirements import poses

    tips = sr.tip_positions(ARM, np.random.default_rng(0).uniform(-1.6, 0, (64, 3)))
    needs = Requirements(targets=[Target(tips * 1.1)], limits=Limits(bending=0.3))
    done = []
    one = sr.check(ARM, needs, progress=done.append)
    assert sum(done) == 64
    monkeypatch.setattr(poses, "_PLACES", 10)
    other = sr.check(ARM, needs)
    np.testing.assert_array_equal(one.poses, other.poses)
    np.testing.assert_array_equal(one.gaps, other.gaps)


@pytest.mark.parametrize(
    "keep",
    [
        Keep(Sphere((0.1, 0.0, 0.4), 0.5), True),
        Keep(Box((-0.4, -0.3, 0.0), (0.3, 0.2, 0.9)), True),
        Keep(HalfSpace((0.0, 0.0, 0.7), (0.2, 0.1, 1.0)), False),
        Keep(Sphere((0.35, 0.1, 0.4), 0.1), False),
    ],
    ids=lambda keep: f"{keep.kind} {type(keep.region).__name__}",
)
def test_what_lies_between_the_stations_is_within_the_stated_error(keep):
    from softreach.requirements.poses import Body
    from softreach.rod.rods import as_tip_map

    rod, poses = as_tip_map(ARM), np.concatenate([GAMMA, [[-1.6, 0.0, 0.0], [-1.6, -1.6, -1.6]]])
    rows = np.arange(len(poses))
    fine = Body.of(rod, poses, 4800).missed(keep, rows)[0]
    for parts in (16, 48):
        seen, bound = Body.of(rod, poses, parts).missed(keep, rows)
        assert (seen <= fine + 1e-6).all()  # the error of places
        assert (fine <= bound + 1e-6).all()


def test_a_margin_smaller_than_its_own_error_is_undecided():
    reached = sr.reachable_set(ARM, accuracy=0.05)
    volume, error = reached.volume, reached.volume_error
    for shift, verdict in ((-2.0, "met"), (-0.5, "undecided"), (0.5, "undecided"), (2.0, "missed")):
        needs = Requirements(measures={"exact_volume": (volume + shift * error, None)})
        check = sr.check(ARM, needs, accuracy=0.05)
        assert check.findings[0].verdict == check.verdict == verdict
        assert check.met == (verdict == "met")
    # The whole of a region is covered where every place of it is that was tried.
    assert checked(targets=[Target(region=Sphere((0.3, 0.0, 0.6), 0.05))]).met
    half = Target(region=Sphere((0.3, 0.0, 0.6), 0.5))
    (coverage,) = checked(targets=[half]).coverages
    near = Target(region=half.region, share=coverage.share - 0.5 * coverage.error)
    assert checked(targets=[near]).verdict == "undecided"


def test_what_an_arm_may_touch_between_its_stations_is_undecided():
    ball, target = Sphere((0.4, 0.1, 0.4), 0.1), Target(TIPS[:1], within=3.0)

    def kept(clearance):
        return checked(targets=[target], keeps=[Keep(ball, False, clearance=clearance)]).findings[1]

    gap = 1.0 - ARM.length * kept(1.0).excess
    cases = ((0.5 * gap, "met"), (gap - 1e-6, "undecided"), (1.1 * gap, "missed"))
    for clearance, verdict in cases:
        assert kept(clearance).verdict == verdict
        assert (kept(clearance).excess > 0.0) == (verdict == "missed")


def test_an_arm_keeps_as_clear_as_the_disks_that_hold_its_tendons():
    wire = sr.designs.three_tendon_robot()
    (ratio,) = np.unique(wire.outline([0.0]).outer_ratio.round(9))
    disks = ratio * float(wire.profile.radius(0.0))
    assert disks > 10 * wire.profile.radius(0.0)
    at_rest = Target([[0.0, 0.0, wire.length]], within=1e-3 * wire.length)
    for spare in (0.3, -0.3):
        wall = HalfSpace(((1.0 + spare) * disks, 0.0, 0.0), (-1.0, 0.0, 0.0))
        finding = checked(wire, targets=[at_rest], keeps=[Keep(wall, False)]).findings[-1]
        assert finding.met == (spare > 0)
        assert finding.excess == pytest.approx(max(-spare, 0.0) * disks / wire.length, abs=2e-4)


def guided(distance=0.01, **changes):
    """A thin straight wire with four tendons that five disks hold."""
    tendons = sr.Tendon(
        bundles=4, distance=distance, guides=5, activation_bounds=(0.0, 40.0), **changes
    )
    return sr.Manipulator(
        profile=sr.LinearTaper(length=0.2, outer_radius=0.001),
        section=sr.Section(rings=(sr.Ring(inner_ratio=0.0, material=STEEL),)),
        actuators=(tendons,),
    )


STEEL = sr.Material(young_modulus=50e9)
PULLS = np.array([[0.0, 0.0, 0.0, 0.0], [40.0, 0.0, 0.0, 0.0], [20.0, 30.0, 0.0, 5.0]])


@pytest.mark.parametrize("disk_radius", [None, 0.013])
def test_clearance_counts_all_disks_and_tendons_that_pictures_show(disk_radius):
    """Tendons on the inner side of a bend are farther from the axis than their guides."""
    from softreach.arm.skin import arm_surface, bundle_skins
    from softreach.geometry.surface import joined

    arm = guided(disk_radius=disk_radius)
    shapes = sr.configuration(arm, PULLS, 201)
    body = Body.of(as_tip_map(arm), PULLS, 800)
    drawn = arm.length * np.array([1 / 300, 1 / 400])  # half of a disk, and of a line
    inner = [[0.09, 0.0, 0.08], [0.05, 0.0, 0.08]]  # sides of the second pose
    for place in [*inner, *np.random.default_rng(0).uniform(-0.15, 0.15, (20, 3))]:
        ball = Keep(Sphere(tuple(place), 0.001), False)
        free = 0.001 - body.missed(ball, np.arange(len(PULLS)))[0]
        for k, least in enumerate(free):
            shape = shapes.isel(sample=k)
            disks, lines = arm_surface(arm, shape, 96), joined(bundle_skins(arm, shape))
            away = [np.linalg.norm(x.vertices - place, axis=1).min() for x in (disks, lines)]
            assert least <= min(away + drawn) + 1e-5


@pytest.mark.parametrize("spare", [0.1, -0.1])
@pytest.mark.parametrize("guides", [0, 5])
def test_a_wall_must_be_as_far_away_as_the_width_of_disks_says(guides, spare):
    arm = guided(disk_radius=0.02)
    arm = arm.replace(actuators=(arm.actuators[0].replace(guides=guides),))
    wall = HalfSpace(((1.0 + spare) * 0.02, 0.0, 0.0), (-1.0, 0.0, 0.0))
    body = Body.of(as_tip_map(arm), np.zeros((1, arm.inputs)), 48)
    (missed,), _ = body.missed(Keep(wall, False), np.arange(1))
    assert missed == pytest.approx(-spare * 0.02, abs=1e-6)


def test_disks_that_do_not_reach_their_tendon_are_refused():
    with pytest.raises(sr.InvalidDesign, match=r"disk_radius = 0\.009: must be at least 0\.01 m"):
        guided(disk_radius=0.009)
    with pytest.raises(sr.InvalidDesign, match="disk_radius = 13: must be at most the length"):
        guided(disk_radius=13.0)
    arm = guided(disk_radius=0.013)
    assert sr.Manipulator.from_toml(arm.to_toml()) == arm


def test_a_measure_of_a_cloud_has_an_error_that_holds_the_exact_value():
    volume = sr.reachable_set(ARM, accuracy=0.01).convex_volume
    for ends, verdict in (((volume, None), "undecided"), ((1.05 * volume, None), "missed")):
        assert checked(measures={"convex_volume": ends}).verdict == verdict


def test_requirements_that_ask_for_nothing_are_refused():
    for needs in (Requirements(), Requirements(payloads=[0.1])):
        with pytest.raises(sr.NotPossible, match="the requirements are empty"):
            sr.check(ARM, needs)


def test_a_check_passes_on_what_sets_warn_of(monkeypatch):
    from softreach.requirements import checks
    from softreach.support.errors import SoftreachWarning, warn

    made = checks.reachable_set
    monkeypatch.setattr(checks, "reachable_set", lambda *a, **k: warn("rough") or made(*a, **k))
    needs = Requirements(measures={"exact_volume": (0.1, None)})
    with pytest.warns(SoftreachWarning, match="rough"):
        sr.check(ARM, needs, accuracy=0.1)
    checks.checked(ARM, needs, 0.1, quick=True)  # on the way of a search nothing is said


@pytest.fixture
def needs(folder):
    """A file of requirements that the trunk meets."""
    tip = sr.tip_positions(ARM, [[-0.5, -0.4, -0.3]])
    Requirements(targets=[Target(tip, name="shelf")]).save("needs.toml")
    return "needs.toml"


def test_the_exit_code_says_met_missed_undecided_or_wrong(needs, capsys):
    assert run(["check", "minimal_trunk", needs]) == 0
    assert "met     shelf  1 place reached" in capsys.readouterr().out
    Path("far.toml").write_text("[[reach]]\nplaces_m = [[2.0, 0, 0]]\n")
    assert run(["check", "minimal_trunk", "far.toml", "--unit", "mm"]) == 1
    assert "place 1 at (2000, 0, 0) mm is missed by" in capsys.readouterr().out
    Path("half.toml").write_text("[measures]\nconvex_volume = { at_least = 1.00477 }\n")
    assert run(["check", "minimal_trunk", "half.toml"]) == 3
    assert "UNDECIDED  convex_volume" in capsys.readouterr().out
    assert run(["check", "minimal_trunk", "none.toml"]) == 2
    Path("straight.toml").write_text('[[reach]]\nplaces = [["0L", "0L", "1L"]]\n')  # of the design
    assert run(["check", "lce_arm", "straight.toml"]) == 0
    Path("bad.toml").write_text("[[reach]]\nplaces = 3\n[limit]\n")
    assert run(["check", "minimal_trunk", "bad.toml"]) == 2
    assert "bad.toml: 2 problems" in capsys.readouterr().err
    assert run(["check", "minimal_trunk", needs, "--view", "front"]) == 2


def test_json_holds_every_finding_and_a_picture_is_written(needs, capsys):
    pytest.importorskip("matplotlib")
    assert run(["check", "minimal_trunk", needs, "--json", "--out", "check.png"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["met"] is True
    assert record["findings"][0]["kind"] == "reach"
    assert len(record["poses"][0][0]) == 3
    assert Path("check.png").read_bytes()[:4] == b"\x89PNG"


def test_the_report_holds_every_finding(tmp_path):
    pytest.importorskip("matplotlib")
    pytest.importorskip("jinja2")
    needs = Requirements(targets=[Target([[2.0, 0, 0]], name="<shelf>"), Target([[0, 0, 1.0]])])
    check = sr.check(ARM, needs)
    check.report().save(tmp_path / "check.html")
    page = (tmp_path / "check.html").read_text()
    assert '<td class="missed">MISSED</td><td>&lt;shelf&gt;</td>' in page
    assert all(finding.name in str(check) for finding in check.findings)
    assert page.count("<td>") == 2 * len(check.findings) + 1
    assert page.count("data:image/png") == 1


def test_reached_and_missed_places_differ_by_their_markers_and_gaps_are_lines():
    pytest.importorskip("matplotlib.pyplot")
    tips, ball = TIPS[:2], Keep(Sphere((0.6, 0, 0.6), 0.1), False)
    places = np.concatenate([tips, [[0.0, 0.0, 1.2]]])
    check = checked(targets=[Target(places)], keeps=[ball])
    lines = sr.plot.plot_check(check, view="front", unit="m").lines
    dots, crosses = (next(x for x in lines if x.get_marker() == m) for m in ("o", "X"))
    np.testing.assert_allclose(dots.get_xydata(), tips[:, [0, 2]], atol=1e-9)
    np.testing.assert_allclose(crosses.get_xydata(), [[0.0, 1.2]], atol=1e-12)
    (gap,) = [line for line in lines if line.get_label() == "gap"]
    ends = np.array([places[2], check.nearest[0, 2]])[:, [0, 2]]
    np.testing.assert_allclose(gap.get_xydata(), ends, atol=1e-12)
