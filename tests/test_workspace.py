"""The reachable set: known volumes, clouds inside it, and what is said of curves and surfaces."""

import numpy as np
import pytest

from softreach import sampling
from softreach.arm import designs
from softreach.arm.actuators import FiberArchitecture
from softreach.arm.manipulator import Manipulator
from softreach.cloud.clouds import compute_cloud
from softreach.geometry.hull import convex_hull
from softreach.inverse import solve_inverse
from softreach.rod import as_tip_map, tip_positions
from softreach.support.errors import InvalidInput, NotPossible, SoftreachWarning
from softreach.workspace import ReachableSet, Surface, reach, reachable_set
from softreach.workspace.image import Image
from softreach.workspace.reach import rasterized_set
from tests.laws import arm_of
from tests.sets import is_closed, solid, trunk_at


@pytest.fixture(scope="module")
def best(trunk: Manipulator) -> ReachableSet:
    return solid(trunk)


@pytest.fixture(scope="module")
def folded() -> ReachableSet:
    """A design whose image folds over itself."""
    return solid(trunk_at(75, 3))


def several(found: ReachableSet) -> float:
    """Volume reached by more than one activation."""
    return sum(volume for k, volume in found.multiplicity.items() if k > 1)


def test_the_best_design_reaches_0691_and_little_of_it_twice_and_without_taper_06325(best):
    assert best.volume == pytest.approx(0.691, abs=0.001)
    assert best.volume_error < 1e-4
    assert several(best) == pytest.approx(1e-4 * best.volume, rel=0.5)
    assert sum(best.multiplicity.values()) == pytest.approx(best.volume)
    assert reachable_set(trunk_at(108, 0)).volume == pytest.approx(0.6325, abs=5e-4)


@pytest.mark.large
def test_doubled_resolutions_agree_within_the_errors(best, folded):
    for coarse in (best, folded):
        cell = coarse.grid.attrs["cell"] / 2
        fine = rasterized_set(as_tip_map(coarse.arm), 2 * coarse.cells, cell, 3e-3)
        assert abs(fine.volume - coarse.volume) < fine.volume_error + coarse.volume_error
        assert abs(several(fine) - several(coarse)) < coarse.multiplicity_error
        assert abs(fine.fold_volume - coarse.fold_volume) < coarse.fold_volume_error
        assert abs(fine.convex_volume - coarse.convex_volume) < coarse.convex_volume_error
        assert abs(fine.unreachability - coarse.unreachability) < coarse.unreachability_error
        assert coarse.unreachability_error < 2e-3


def test_at_75_degrees_and_3_of_taper_some_percent_are_reached_twice(folded):
    assert 0.02 < several(folded) / folded.volume < 0.035
    assert folded.fold_volume == pytest.approx(several(folded), rel=0.1)


def test_volume_is_the_integral_of_det_j_minus_what_is_covered_again(folded):
    # An independent route: Sobol points instead of Gauss nodes, |det J| instead of signed.
    arm = folded.arm
    cube = sampling.sample_cube("sobol", 1 << 16, 3, seed=1)
    rod = as_tip_map(arm)
    _, slopes = rod.tips_and_slopes(rod.box.from_cube(cube))
    integral = np.abs(np.linalg.det(slopes)).mean() * rod.box.volume
    again = sum((k - 1) * volume for k, volume in folded.multiplicity.items())
    assert integral - again == pytest.approx(folded.volume, rel=2e-3)


def test_a_cloud_lies_inside_to_one_cell(folded):
    tips = compute_cloud(folded.arm, n=20_000).tip.values
    outside = tips[~folded.contains(tips)]
    assert len(outside) < 0.05 * len(tips)
    assert folded.distance(outside).max() < folded.grid.attrs["cell"]


def test_the_grid_and_single_points_agree(folded):
    grid = folded.grid
    axes = [grid[name].values for name in "xyz"]
    centers = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    some = np.random.default_rng(0).integers(0, len(centers), 5000)
    counted = folded.image.counts_at(centers[some])
    assert (counted == grid["count"].values.ravel()[some]).all()
    assert (folded.contains(centers[some]) == (counted > 0)).all()


@pytest.mark.parametrize(
    ("revolution_deg", "taper_deg"),
    [
        (75, 3),
        (0, 0),
        pytest.param(108, 2, marks=pytest.mark.large),
        pytest.param(36, 3, marks=pytest.mark.large),
    ],
)
def test_away_from_folds_and_faces_the_count_is_that_of_the_inverse(revolution_deg, taper_deg):
    arm = trunk_at(revolution_deg, taper_deg)
    found = solid(arm)
    assert isinstance(found.image, Image)
    tips = compute_cloud(arm, n=3000, seed=1).tip.values
    rough = found.image.critical_surface.distance(tips) < 0.25 * found.grid.attrs["cell"]
    away = tips[~rough]
    assert len(away) > 0.6 * len(tips)
    counted = found.image.counts_at(away)
    assert (counted == solve_inverse(arm, away).counts).all()
    # what is a fold's roughness is not told as a finding
    assert set(found.multiplicity) <= {1, 2}


def test_how_much_is_reached_twice_is_what_the_inverse_finds(folded):
    # The coarea formula: a place that c activations reach appears c times, |det J| wide in all.
    arm, rod = folded.arm, as_tip_map(folded.arm)
    gamma = rod.box.from_cube(sampling.sample_cube("sobol", 1 << 13, 3, seed=2))
    tips, slopes = rod.tips_and_slopes(gamma)
    times = solve_inverse(arm, tips).counts
    twice = np.where(times == 2, np.abs(np.linalg.det(slopes)) / 2, 0.0) * rod.box.volume
    scatter = 2 * twice.std() / np.sqrt(len(twice))
    assert twice.mean() == pytest.approx(several(folded), abs=scatter + folded.multiplicity_error)
    assert scatter < 0.1 * several(folded)


def test_the_image_of_a_part_of_the_box_lies_within(best, trunk):
    part = solid(trunk.with_bounds(((-1.2, -0.3), (-1.5, -0.2), (-1.0, 0.0))))
    assert part.volume < best.volume
    vertices = part.surface().vertices
    outside = vertices[~best.contains(vertices)]
    assert best.distance(outside).max(initial=0.0) < best.grid.attrs["cell"]


def test_the_surface_is_closed_outward_and_holds_the_volume(best, folded):
    for found in (best, folded):
        surface = found.surface()
        assert is_closed(surface.faces)
        assert surface.volume == pytest.approx(found.volume, rel=5e-4)


def test_the_surface_has_no_staircase(best):
    # A staircase has all its normals along the axes, and half as much area again.
    surface = best.surface()
    a, b, c = np.moveaxis(surface.vertices[surface.faces], 1, 0)
    normal = np.cross(b - a, c - a)
    share = np.abs(normal).sum() / np.linalg.norm(normal, axis=1).sum()
    assert share == pytest.approx(1.5, abs=0.1)
    # vertices lie on the image of the grid, not half a cell away
    off = np.abs(best.distance(surface.vertices + 1e-9))
    assert np.quantile(off, 0.99) < 0.1 * best.grid.attrs["cell"]


def test_distance_is_signed_and_grows_by_one(best):
    rng = np.random.default_rng(3)
    points = rng.uniform(-1.5, 1.5, (2000, 3))
    distance = best.distance(points)
    inside = best.contains(points)
    assert (np.sign(distance) == np.where(inside, -1, 1)).all()
    step = 0.05 * rng.normal(size=(2000, 3))
    change = np.abs(best.distance(points + step) - distance)
    assert (change < np.linalg.norm(step, axis=1) + best.grid.attrs["cell"]).all()


def test_a_tip_map_is_asked_as_its_arm_is(trunk):
    found = solid(as_tip_map(trunk, 1e-5), accuracy=0.1)
    assert found.arm == trunk
    assert found.volume == solid(trunk, accuracy=0.1, tol=1e-5).volume


def test_a_solid_prints_its_numbers_to_their_errors_and_what_it_was_made_of(folded):
    text = repr(folded)
    assert text.startswith("ReachableSet: volume 0.4768 ± 0.0004 m³")
    assert "33.7 ± 0.2 % are out of reach" in text
    assert "reached more than once 0.0131 ± 0.0004 m³" in text
    assert "L = 1 m, 3 free bundles; activation grid of 42³ cells" in text


def test_every_number_of_a_solid_is_in_its_dataset_with_an_error(folded):
    found = folded.to_dataset()
    for name in ("volume", "convex_volume", "fold_volume", "unreachability"):
        assert float(found[name]) == getattr(folded, name)
        assert float(found[f"{name}_error"]) == getattr(folded, f"{name}_error")
        assert found[name].attrs["units"] == ("1" if name == "unreachability" else "m3")
    assert float(found.multiplicity.sum()) == pytest.approx(folded.volume)
    assert Manipulator.from_toml(found.attrs["design"]) == folded.arm


@pytest.fixture(scope="module")
def redundant() -> ReachableSet:
    return solid(designs.redundant_trunk(), accuracy=1e-2)


def test_four_bundles_reach_at_least_what_three_of_them_do(redundant):
    for held in range(4):
        for end in (0, 1):
            bounds = redundant.arm.bounds.copy()
            bounds[held] = bounds[held, end]
            face = redundant.arm.with_bounds(bounds)
            part = reachable_set(face, accuracy=1e-2)
            assert part.dimension == 3
            assert part.volume < redundant.volume + redundant.volume_error
    assert redundant.multiplicity == {}


def test_two_free_bundles_sweep_an_area(trunk):
    arm = trunk.with_bounds(((-1.0, 0.0), (-1.0, 0.0), (-0.5, -0.5)))
    sheet = reachable_set(arm)
    assert (sheet.dimension, sheet.volume, sheet.unreachability) == (2, 0.0, 1.0)
    assert sheet.surface().area == pytest.approx(sheet.area, rel=1e-3)
    grid = np.indices((200, 200)).reshape(2, -1).T / 199
    finer = convex_hull(tip_positions(arm, as_tip_map(arm).box.from_free_cube(grid)))
    assert 0 < finer.volume - sheet.convex_volume < sheet.convex_volume_error < 1e-3
    assert repr(sheet).startswith(f"ReachableSet: area {sheet.area:.3f}"[:-1])
    assert float(sheet.to_dataset().area_error) == sheet.area_error < 1e-5
    gamma = np.column_stack([-np.random.default_rng(0).random((100, 2)), np.full(100, -0.5)])
    assert sheet.distance(tip_positions(arm, gamma)).max() < 1e-4


def test_one_free_bundle_draws_a_curve():
    # A straight fiber that bends the arm: the tip's path, chord by chord.
    fiber = FiberArchitecture(helical_angle=0.0, offset=0.0, extent=0.8)
    arm = arm_of(fiber, activation_bounds=(-5 / 3, 0.0))
    curve = reachable_set(arm)
    path = tip_positions(arm, np.linspace(-5 / 3, 0, 4001)[:, None])
    chords = np.linalg.norm(np.diff(path, axis=0), axis=1).sum()
    assert (curve.dimension, curve.volume) == (1, 0.0)
    assert curve.curve_length == pytest.approx(chords, rel=1e-6)
    assert repr(curve).startswith(f"ReachableSet: length {curve.curve_length:.3f}"[:-1])
    assert curve.distance(path).max() < 1e-5
    with pytest.raises(NotPossible, match="dimension 1 has no surface"):
        curve.surface()


def test_no_free_bundle_leaves_a_point(trunk):
    point = reachable_set(trunk.with_bounds((-0.5, -0.5)))
    assert (point.dimension, point.volume, point.convex_volume) == (0, 0.0, 0.0)
    assert np.isnan([point.unreachability, point.unreachability_error]).all()
    assert repr(point).startswith("ReachableSet: (")
    tip = tip_positions(trunk, np.full((1, 3), -0.5))
    assert point.distance(tip + [[0.0, 0.3, 0.4]]) == pytest.approx(0.5)


def test_progress_counts_every_vertex(trunk):
    done: list[int] = []
    reachable_set(trunk, accuracy=0.1, progress=done.append)
    assert sum(done) == 9**3


def test_a_grid_that_is_too_coarse_is_warned_of(monkeypatch):
    monkeypatch.setattr(reach, "_MOST_VERTICES", 5**3)
    with pytest.warns(SoftreachWarning, match="grid above 4"):
        reachable_set(trunk_at(75, 3))


@pytest.mark.parametrize(
    ("argument", "value", "allowed"),
    [("accuracy", 0.0, ">= 1e-06"), ("cell", 1e-9, "at least"), ("cell", np.nan, "> 0")],
)
def test_a_wrong_argument_is_named(trunk, argument, value, allowed):
    with pytest.raises(InvalidInput, match=f"^{argument} = .*{allowed}"):
        reachable_set(trunk, **{argument: value})


def test_distance_to_a_slab_is_its_height_and_beyond_it_to_its_edges():
    corners = np.array([[0.0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]])
    slab = Surface(vertices=corners, faces=np.array([[0, 1, 2], [0, 2, 3]]))
    points = np.random.default_rng(5).uniform(-3, 7, (500, 3))
    beyond = np.maximum(np.maximum(-points[:, :2], points[:, :2] - 4), 0)
    expected = np.hypot(np.linalg.norm(beyond, axis=1), points[:, 2])
    assert slab.distance(points) == pytest.approx(expected)
