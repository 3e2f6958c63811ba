"""Designs at the edges of what an arm can be: numbers that mean something, or a clear refusal."""

import json
import math

import numpy as np
import pytest

import softreach as sr
from softreach.arm.designs import minimal_trunk
from softreach.cli.app import run
from softreach.geometry.alpha_shape import local_dimension
from tests.abuse.refusals import raised_by
from tests.laws import arm_of

TRUNK = minimal_trunk()


def many(bundles: int, **changes: object) -> sr.Manipulator:
    fiber = sr.FiberArchitecture(
        revolution=1.0, extent=0.2, bundles=bundles, activation_bounds=(-1.0 / bundles, 0.0)
    )
    return arm_of(fiber, **{"activation_bounds": None, **changes})


def frozen(*held: int, at: float = -0.7) -> sr.Manipulator:
    bounds = TRUNK.bounds.copy()
    bounds[list(held)] = at
    return TRUNK.with_bounds(bounds)


def fiber(**changes: object) -> sr.FiberArchitecture:
    return sr.FiberArchitecture(**{"revolution": 1.0, "extent": 0.5, **changes})


DESIGNS: dict[str, sr.Manipulator] = {
    **{f"{n} bundles": many(n) for n in range(1, 13)},
    "every bundle frozen": frozen(0, 1, 2),
    "every bundle frozen at rest": frozen(0, 1, 2, at=0.0),
    "two bundles frozen": frozen(0, 1),
    "one bundle frozen": frozen(2),
    "bounds a rounding error wide": TRUNK.with_bounds((-1.0, -1.0 + 2e-16)),
    "positive activations": TRUNK.with_bounds((0.0, 2.0)),
    "activations of both signs": TRUNK.with_bounds((-0.5, 5.0)),
    "a revolution of 5000 degrees": minimal_trunk(math.radians(5000)),
    "a revolution of 100 turns": arm_of(fiber(revolution=200 * math.pi)),
    "no revolution": minimal_trunk(0.0),
    "a tip radius near zero": minimal_trunk(taper=math.atan(1 / 16) * (1 - 1e-9)),
    "a tip a thousand times wider": minimal_trunk(taper=-math.atan(1000 / 16)),
    "a compressible arm": arm_of(fiber(), poisson_ratio=0.0),
    "an incompressible arm": arm_of(fiber(), poisson_ratio=0.5),
    "extents all around": arm_of(fiber(extent=2 * math.pi), fiber(extent=2 * math.pi, offset=1.0)),
    "an extent of a millionth": arm_of(fiber(extent=1e-6)),
    "bundles upon each other": arm_of(fiber(name="a"), fiber(name="b"), fiber(name="c")),
    "a ring without a core": arm_of(fiber(), inner_radius=0.0),
    "a ring thin as a film": arm_of(fiber(), inner_radius=(1 - 1e-9) / 16),
    "an arm thick as it is long": arm_of(fiber(), outer_radius=1.0, inner_radius=0.5),
    "an arm thin as a hair": arm_of(
        fiber(), outer_radius=1e-3, inner_radius=5e-4, activation_bounds=(-0.01, 0.0)
    ),
    "no actuator at all": TRUNK.replace(actuators=()),
}


@pytest.mark.parametrize("arm", DESIGNS.values(), ids=DESIGNS.keys())
def test_a_degenerate_design_describes_itself_and_has_finite_tips_within_its_reach(arm):
    assert "L" in repr(arm)
    sr.describe(arm)
    cloud = sr.compute_cloud(arm, 64, sampler="boundary")
    longest = 1.0 + np.abs(arm.bounds).sum()
    assert np.isfinite(cloud.tip.values).all()
    assert (np.linalg.norm(cloud.tip.values, axis=1) <= longest * arm.length).all()


@pytest.mark.parametrize("length", [1e-6, 1e3])
@pytest.mark.parametrize("taper", [0.0, 2.0, -3.0])
def test_results_over_l_do_not_depend_on_l(length, taper):
    def results(size):
        arm = minimal_trunk(taper=math.radians(taper), length=size)
        tip = sr.compute_cloud(arm, 256).tip
        hulls = sr.convex_hull(tip), sr.concave_hull(tip, 0.5 * size)
        sets = *hulls, sr.reachable_set(arm, accuracy=0.05)
        return tip.values / size, [one.volume / size**3 for one in sets]

    (tips, volumes), (expected, known) = results(length), results(1.0)
    assert np.allclose(tips, expected, rtol=0.0, atol=1e-9)
    assert volumes == pytest.approx(known, rel=1e-9)


@pytest.mark.parametrize("arm", [frozen(0, 1), frozen(1, 2), frozen(0, 2), many(1)])
@pytest.mark.parametrize("sampler", ["uniform", "boundary"])
def test_the_tips_of_one_bundle_lie_on_a_curve_that_has_no_volume(arm, sampler):
    tip = sr.compute_cloud(arm, 2_000, sampler=sampler).tip
    hull = sr.concave_hull(tip)
    assert (hull.volume, len(hull.faces), hull.regions) == (0.0, 0, 0)


@pytest.mark.parametrize("options", [[], ["--json"]], ids=["text", "JSON"])
def test_a_straight_line_has_no_critical_radius_and_none_is_printed(options, tmp_path, capsys):
    straight = TRUNK.replace(actuators=(fiber(revolution=0.0, extent=2 * math.pi),))
    straight.save(tmp_path / "arm.toml")
    asked = ["volume", str(tmp_path / "arm.toml"), "--n", "500", "--alpha", "critical", *options]
    assert run(asked) == 0
    printed = capsys.readouterr().out
    assert "inf" not in printed.lower()
    if options:
        assert json.loads(printed)["alpha_L"] is None


@pytest.mark.parametrize(
    ("arm", "dimension"),
    [(frozen(0, 1), 1.0), (frozen(0), 2.0), (frozen(2), 2.0), (TRUNK, 3.0)],
    ids=["one bundle", "two helical bundles", "two bundles of one side", "three bundles"],
)
def test_a_cloud_fills_as_many_dimensions_as_it_has_free_bundles(arm, dimension):
    points = sr.compute_cloud(arm, 100_000).tip.values
    assert local_dimension(points) == pytest.approx(dimension, rel=0.12)


@pytest.mark.parametrize("jitter", [0.0, pytest.param(1e-15, marks=pytest.mark.large), 1e-9])
@pytest.mark.parametrize("curve", ["circle", "helix", "moment curve"])
def test_points_near_any_curve_are_triangulated_within_the_budget_or_not_at_all(curve, jitter):
    t = np.random.default_rng(0).random(2_000)
    angle = 12.0 * t if curve == "helix" else 2 * np.pi * t
    points = {
        "circle": np.stack([np.cos(angle), np.sin(angle), 0.3 * np.cos(angle)], axis=1),
        "helix": np.stack([np.cos(angle), np.sin(angle), t], axis=1),
        "moment curve": np.stack([t, t**2, t**3], axis=1),
    }[curve]
    points = points + jitter * np.random.default_rng(1).standard_normal(points.shape)
    assert sr.concave_hull(points, 0.01).volume == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("jitter", [1e-8, 1e-9, pytest.param(1e-12, marks=pytest.mark.large)])
def test_many_points_that_crowd_near_a_curve_are_told_before_they_cost(jitter):
    tip = sr.compute_cloud(frozen(1, 2), 20_000).tip.values
    points = tip + jitter * np.random.default_rng(1).standard_normal(tip.shape)
    assert sr.concave_hull(points, 0.05).volume == pytest.approx(0.0, abs=1e-15)


def test_a_hundred_copies_of_each_tip_but_for_rounding_have_its_volume():
    tip = sr.compute_cloud(TRUNK, 200).tip.values
    crowd = np.repeat(tip, 100, axis=0)
    crowd = crowd + 1e-12 * np.random.default_rng(1).standard_normal(crowd.shape)
    alone = sr.concave_hull(tip, 0.5).volume
    assert sr.concave_hull(crowd, 0.5).volume == pytest.approx(alone, rel=1e-6)


def test_a_single_station_is_a_row_of_its_own_and_one_number_of_them_too_few():
    for station in (0.0, 0.5, 1.0):
        shape = sr.configuration(TRUNK, [-0.5, -0.5, -0.5], [station])
        assert shape.position.shape == (1, 3)
    assert "2 or more" in str(raised_by(lambda: sr.configuration(TRUNK, [0, 0, 0], 1)))


def test_a_shape_shortened_to_nothing_is_not_drawn():
    shape, cloud = sr.configuration(TRUNK, [-1.0, -1.0, -1.0]), sr.compute_cloud(TRUNK, 16)
    shape["extension"] -= 1.0
    assert "extension ζ" in str(raised_by(lambda: sr.plot.plot_arm(TRUNK, shape)))
    assert "extension ζ" in str(raised_by(lambda: sr.plot.plot_views(cloud, TRUNK, shape)))
