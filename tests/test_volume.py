"""The public hulls: what they state, what they warn of, what they refuse."""

import numpy as np
import pytest
import xarray as xr

from softreach.cloud.volume import concave_hull, convex_hull, unreachability, volume_curve
from softreach.geometry import alpha_shape
from softreach.support.errors import InvalidInput, SoftreachWarning
from tests.geometry.clouds import FLAT, arc_tips, random_points

BALL = 4.0 / 3.0 * np.pi


@pytest.fixture(scope="module")
def tips() -> xr.DataArray:
    """A labeled cloud of an arm of one meter."""
    return xr.DataArray(arc_tips(4000), dims=("sample", "axis"), attrs={"length": 1.0})


def in_ball(n: int, seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(n, 3))
    return x / np.linalg.norm(x, axis=1, keepdims=True) * np.cbrt(rng.random((n, 1)))


def test_a_hollow_ball_keeps_its_hollow():
    points = in_ball(20_000)
    shell = points[np.linalg.norm(points, axis=1) > 0.7]
    hull = concave_hull(shell, alpha=0.3, bias=True)
    assert hull.volume_corrected == pytest.approx(BALL * (1 - 0.7**3), rel=0.03)
    assert unreachability(shell, alpha=0.3) == pytest.approx(0.7**3, abs=0.03)


def test_the_corrected_volume_is_nearer_to_the_truth():
    hull = concave_hull(in_ball(20_000), alpha=0.3, bias=True)
    assert hull.volume_corrected is not None
    assert abs(hull.volume_corrected - BALL) < 0.5 * abs(hull.volume - BALL)
    assert hull.volume < hull.volume_corrected


def bridge(gap: float, alpha: float) -> float:
    """What the alpha shape of two unit balls adds between them: a cylinder without the two caps.

    Empty spheres that touch both balls have radii up to alpha as far out as that cylinder.
    """
    from_middle = 1 + gap / 2
    if from_middle >= 1 + alpha:
        return 0.0
    radius = np.sqrt(1 - (from_middle / (1 + alpha)) ** 2)
    half = from_middle * alpha / (1 + alpha)
    cap = half - gap / 2
    return np.pi * (2 * half * radius**2 - 2 * cap**2 * (1 - cap / 3))


@pytest.mark.parametrize(("gap", "alpha"), [(0.3, 0.3), (0.3, 0.45), (0.7, 0.3), (1.0, 0.45)])
def test_the_corrected_volume_holds_bridges_over_gaps_narrower_than_two_radii(gap, alpha):
    apart = np.array([2 + gap, 0.0, 0.0])
    points = np.concatenate([in_ball(20_000, seed=1), in_ball(20_000, seed=2) + apart])
    hull = concave_hull(points, alpha=alpha, bias=True)
    assert hull.volume_corrected == pytest.approx(2 * BALL + bridge(gap, alpha), rel=5e-3)
    assert (bridge(gap, alpha) > 0.03 * 2 * BALL) == (gap < 2 * alpha)


def test_a_hull_prints_its_numbers_and_what_it_was_made_of():
    hull = concave_hull(in_ball(3000), alpha=0.5)
    assert (hull.n, hull.alpha, hull.regions) == (3000, 0.5, 1)
    assert hull.spacing == pytest.approx((hull.volume / 3000) ** (1 / 3))
    assert hull.volume_corrected is None
    hull = concave_hull(in_ball(20_000), alpha=0.3, bias=True)
    size, origin = repr(hull).splitlines()
    assert size.startswith(f"Hull: volume {hull.volume:.5g} m³ (without sampling bias about 4.")
    assert "1 region, " in size
    assert origin == "  alpha shape, alpha = 0.3 m (5.1 mean spacings), of 20,000 points"
    assert "convex hull of 20,000 points" in repr(convex_hull(in_ball(20_000)))


def test_a_hull_as_a_dataset_encloses_the_volume_that_it_states():
    found = concave_hull(in_ball(20_000), alpha=0.3, bias=True).to_dataset()
    corners = found.vertices.values[found.faces.values]
    assert np.linalg.det(corners).sum() / 6 == pytest.approx(float(found.volume))
    assert found.volume.attrs["units"] == "m3"
    assert float(found.volume_corrected) > float(found.volume)
    assert set(found.attrs) == {"softreach_version", "schema_version"}


def test_labeled_tips_have_a_default_radius_and_their_axes_in_either_order(tips):
    with pytest.warns(SoftreachWarning, match="mean spacings"):
        labeled, plain = concave_hull(tips.T), concave_hull(tips.values, alpha=0.05)
    assert labeled.alpha == 0.05
    assert labeled.volume == plain.volume


def test_points_without_a_length_need_a_radius_and_other_radii_are_refused():
    with pytest.raises(InvalidInput, match=r"alpha = None: must be a radius \[m\].*length"):
        concave_hull(random_points(10))
    for alpha in (0.0, -1.0, np.nan, "optimal"):
        with pytest.raises(InvalidInput, match="a radius > 0"):
            concave_hull(random_points(10), alpha)


def test_a_radius_below_three_spacings_warns_with_both_numbers():
    points = random_points(1000)
    with pytest.warns(SoftreachWarning, match=r"alpha = 0.15 m is 1.\d+ mean spacings.*0.09"):
        concave_hull(points, alpha=0.15)


def test_threads_change_nothing(tips, monkeypatch):
    monkeypatch.setattr(alpha_shape, "FEWEST", 1000)
    hulls = []
    for threads in ("1", "2", "3"):
        monkeypatch.setenv("SOFTREACH_NUM_THREADS", threads)
        hulls.append(concave_hull(tips, 0.2, bias=True))
    for hull in hulls[1:]:
        assert hull.volume == hulls[0].volume
        assert hull.volume_corrected == hulls[0].volume_corrected
        np.testing.assert_array_equal(hull.vertices[hull.faces], hulls[0].vertices[hulls[0].faces])


@pytest.mark.parametrize(("n", "alpha", "said"), [(2000, 0.4, ".* of 500"), (15, 10.0, ": 3")])
def test_where_the_quarter_is_too_sparse_there_is_no_estimate_but_a_warning(n, alpha, said):
    with pytest.warns(SoftreachWarning, match=f"no estimate of the bias{said} points"):
        hull = concave_hull(in_ball(n), alpha=alpha, bias=True)
    assert hull.volume > 0.0
    assert hull.volume_corrected is None


def test_the_curve_equals_the_hulls(tips):
    alphas = np.array([[0.2, 0.3], [0.5, np.inf]])
    curve = volume_curve(tips, alphas)
    hulls = [concave_hull(tips, a).volume for a in alphas.flat]
    np.testing.assert_allclose(curve.ravel(), hulls, rtol=1e-12)


def test_unreachability_is_what_the_concave_hull_lacks_of_the_convex_one(tips):
    ratio = concave_hull(tips, 0.2).volume / convex_hull(tips).volume
    assert unreachability(tips, 0.2) == pytest.approx(1 - ratio, rel=1e-9)
    assert unreachability(tips, np.inf) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("name", FLAT)
def test_flat_clouds_have_volume_zero_and_no_faces(name):
    points = FLAT[name]
    concave = concave_hull(points, 0.5, bias=True), concave_hull(points, "critical")
    for hull in (*concave, convex_hull(points)):
        assert hull.volume == hull.area == 0.0
        assert hull.spacing == 0.0 if hull.n else np.isnan(hull.spacing)
        assert hull.faces.shape == hull.vertices.shape == (0, 3)
        assert f"of {hull.n:,} points" in repr(hull)
    if "plane" in name:  # a share of the area: a large ball sees no gap
        assert unreachability(points, 1e6) == pytest.approx(0.0, abs=1e-6)
    elif name != "three distinct":
        assert np.isnan(unreachability(points, 0.5))


@pytest.mark.parametrize("function", [concave_hull, unreachability, volume_curve])
def test_rows_that_are_not_finite_are_refused(function):
    points = random_points(30)
    points[7, 2] = np.nan
    with pytest.raises(InvalidInput, match=r"points\[7\] = .*nan.*finite"):
        function(points, np.array(0.5) if function is volume_curve else 0.5)
    with pytest.raises(InvalidInput, match=r"points\[7\]"):
        convex_hull(points)
