"""Regions that arms reach in one plane, by Green's theorem, by pixels and by hand."""

import math

import numpy as np
import pytest

from softreach.arm import Chamber, Manipulator, Material, Ring, Tendon, designs
from softreach.arm.actuators import LengthTendon
from softreach.atlas.metrics import chosen_metrics
from softreach.cloud.clouds import compute_cloud
from softreach.cloud.volume import flat_areas, unreachability
from softreach.geometry.hull import alpha_area, convex_edges, enclosed_area, plane_of
from softreach.rod.rods import as_tip_map
from softreach.workspace import ReachableSet, reachable_set
from tests.made_arms import one_ring_arm
from tests.sets import tips_of_faces

SOFT = Material(young_modulus=2e5, poisson_ratio=0.45)


def planar(*, pairs: int = 2, chamber: bool = False, **base) -> Manipulator:
    """Tendons on both sides in one plane, for each of the segments."""
    tendons = []
    for k in range(pairs):
        ends = {"end_over_length": (k + 1) / pairs, "activation_bounds": (0.0, 8.0 / (k + 1))}
        right = Tendon(name=f"right {k}", distance=0.018, offset=0.4, **ends)
        tendons += [right, right.replace(name=f"left {k}", offset=0.4 + math.pi)]
    axial = [Chamber(name="c", distance=0.0, radius=0.004, activation_bounds=(0.0, 2e4))]
    rings = (Ring(inner_ratio=0.0, material=SOFT),)
    arm = one_ring_arm(*tendons, *axial * chamber, length=0.2, rings=rings)
    return arm.replace(base=arm.base.replace(**base)) if base else arm


@pytest.fixture(scope="module")
def region() -> ReachableSet:
    found = reachable_set(planar())
    assert found.outline is not None
    return found


def test_four_bundles_reach_as_much_as_pixels_count(region):
    tips = tips_of_faces(region.tip_map, 500_000, seed=0, at_bound=0.4)
    flat = tips @ np.array([[math.cos(0.4), 0.0], [math.sin(0.4), 0.0], [0.0, 1.0]])
    counts = []
    for pixels in (100, 200):  # those touched count in full, which the limit takes off
        side = np.ptp(flat[:, 0]) / pixels
        touched = np.unique(np.floor(flat / side).astype(int), axis=0)
        counts.append(len(touched) * side**2)
    assert 2.0 * counts[1] - counts[0] == pytest.approx(region.area, rel=0.03)
    assert region.area_error < 3e-3 * region.area
    hull = enclosed_area(padded := np.column_stack([flat, 0.0 * flat[:, 0]]), convex_edges(padded))
    assert hull < region.convex_area + region.convex_area_error
    assert hull == pytest.approx(region.convex_area, rel=2e-2)
    assert region.unreachability == pytest.approx(1.0 - region.area / region.convex_area)
    assert region.unreachability_error < 1e-2


def test_tips_lie_in_the_region_and_its_outline_around_them(region):
    rod = region.tip_map
    tips = rod.tips(rod.box.from_cube(np.random.default_rng(1).random((2000, 4))))
    assert region.distance(tips).max() < 2e-4
    outline = region.outline.vertices
    assert region.distance(outline).max() < 1e-9
    assert region.distance(outline + [0.0, 0.0, 1.0]).min() > 0.5
    mesh = region.surface()
    assert mesh.area == pytest.approx(region.area, rel=1e-3)
    assert region.volume == region.convex_volume == 0.0


def test_two_bundles_have_the_area_that_green_tells():
    arm = planar(pairs=1, chamber=True).with_bounds(((0.0, 8.0), (0.0, 0.0), (0.0, 2e4)))
    found = reachable_set(arm)
    assert found.outline is not None
    rod, edge = as_tip_map(arm), np.linspace(0.0, 1.0, 4001)
    low, high, back = 0 * edge, 1 + 0 * edge, edge[::-1]
    sides = ((edge, low), (high, edge), (back, high), (low, back))
    around = np.concatenate([np.stack(side, 1) for side in sides])
    x, y, z = rod.tips(rod.box.from_free_cube(around)).T
    s = x * math.cos(0.4) + y * math.sin(0.4)
    green = 0.5 * abs(float((s[:-1] * z[1:] - s[1:] * z[:-1]).sum()))
    assert found.area == pytest.approx(green, rel=1e-6)
    assert abs(found.area - green) < found.area_error + 1e-6 * green


@pytest.mark.parametrize(("pairs", "chamber"), [(1, True), (2, True), (3, False)])
def test_any_number_of_bundles_leaves_an_area_wherever_the_base_points(pairs, chamber):
    bases = {}, {"points": "-x", "turn": 0.3, "position": (1.0, 2.0, 3.0)}
    arms = [planar(pairs=pairs, chamber=chamber, **base) for base in bases]
    upright, leaning = (reachable_set(arm, accuracy=0.02) for arm in arms)
    assert None not in (upright.outline, leaning.outline)
    error = upright.area_error + leaning.area_error
    assert abs(upright.area - leaning.area) < error < 0.04 * upright.area
    assert 0.0 < upright.unreachability < 1.0


@pytest.mark.parametrize("count", [2, 3])
def test_tendons_on_the_axis_reach_a_line_without_a_share(count):
    axial = LengthTendon(name="t", distance_ratio=0.0, activation_bounds=(0.0, 0.01), bundles=count)
    text = repr(reachable_set(planar().replace(actuators=(axial,))))
    assert "in one line" in text
    assert "nan" not in text


def test_a_sheet_in_space_is_no_plane():
    assert reachable_set(designs.three_tendon_robot(), accuracy=0.1).dimension == 3


def test_clouds_in_a_plane_have_areas():
    square = np.random.default_rng(0).random((20_000, 2)) @ [[0.6, 0.8, 0.0], [0.0, 0.0, 1.0]]
    area, convex = flat_areas(square + 5.0, 0.05)
    assert area == pytest.approx(1.0, abs=0.01)
    assert area < convex < 1.0
    assert unreachability(square, 0.05) == pytest.approx(1.0 - area / convex)
    assert flat_areas(np.random.default_rng(0).random((100, 3)), 0.1) is None
    line = np.outer(np.linspace(0, 1, 50), [1.0, 2.0, 3.0])
    assert flat_areas(line, 0.1) == (0.0, 0.0)
    assert plane_of(square, 1e-9).sides[2] < 1e-12
    ring = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0.0]], float)
    assert alpha_area(ring, 0.6) == pytest.approx(1.0)
    assert alpha_area(ring, 0.4) == 0.0


def test_every_command_that_gives_a_volume_gives_the_area(folder, region, printed):
    region.arm.save("planar.toml")
    shown = printed("reach", "planar.toml", "--out", "region.stl")
    assert (folder / "region.stl").stat().st_size > 1000
    assert shown["unreachability"] == pytest.approx(region.unreachability)
    assert region.area == pytest.approx(shown["area_m2"])
    shown = printed("volume", "planar.toml", "--n", "4096", "--alpha", "10mm")
    assert 0.0 < shown["unreachability"] < 1.0
    assert shown["area_in_one_plane_m2"] < shown["convex_area_m2"]
    known = {metric.name: metric for metric in chosen_metrics(["exact", "concave", "convex"])}
    assert known["exact_area"].compute(region) == region.area
    assert known["exact_unreachability"].compute(region) == region.unreachability
    tips = compute_cloud(region.arm, n=4096).tip.values
    assert known["area"].compute(tips, 0.01) == flat_areas(tips, 0.01)[0]
    assert math.isnan(known["area"].compute(np.random.default_rng(0).random((9, 3)), 0.01))
