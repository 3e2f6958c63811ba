"""Samplers: points of the unit cube that depend on their four arguments alone."""

import csv
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softreach as sr
from softreach.arm import Loads, designs
from softreach.cloud.clouds import compute_cloud, design_of, open_cloud, save_cloud
from softreach.cloud.curvature import curvature_statistics
from softreach.cloud.dexterity import dexterity, solution_measure
from softreach.cloud.redundancy import activation_distance, redundancy_summary, tip_density
from softreach.cloud.volume import concave_hull, convex_hull, unreachability
from softreach.export import export_cloud
from softreach.plot.coloring import color_samples
from softreach.rod import as_tip_map, configuration
from softreach.rod.rods import free_bundles
from softreach.sampling import SAMPLERS, cube_blocks, sample_cube
from softreach.support.errors import InvalidInput


@given(sampler=st.sampled_from(sorted(SAMPLERS)), dim=st.integers(1, 5), size=st.integers(1, 300))
def test_blocks_only_cut_the_sequence(sampler, dim, size):
    n = 4**dim if dim < 5 else 1024
    whole = sample_cube(sampler, n, dim, seed=3)
    pieces = np.concatenate(list(cube_blocks(sampler, n, dim, 3, size)))
    np.testing.assert_array_equal(pieces, whole)
    assert whole.shape == (n, dim)
    assert whole.min() >= 0
    assert whole.max() <= 1


@pytest.mark.parametrize("sampler", ["uniform", "boundary", "counter", "sobol"])
def test_seeds_make_sequences(sampler):
    first, again, other = (sample_cube(sampler, 256, 3, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("dim", [1, 2, 3, 4])
def test_a_fifth_of_the_boundary_points_lie_on_faces_each_face_alike(dim):
    n = 10 * dim * 40
    points = sample_cube("boundary", n, dim, seed=0)
    on_face = (points == 0) | (points == 1)
    assert (on_face.sum(axis=1) <= 1).all()
    assert on_face.sum() == n / 5
    for axis in range(dim):
        assert (points[:, axis] == 0).sum() == (points[:, axis] == 1).sum() == n / (10 * dim)


def test_uniform_points_are_uniform():
    points = sample_cube("uniform", 100_000, 3, seed=0)
    counts = np.histogramdd(points, bins=4, range=[(0, 1)] * 3)[0]
    expected = 100_000 / 64
    chi_square = ((counts - expected) ** 2 / expected).sum()
    assert chi_square < 63 + 5 * np.sqrt(2 * 63)


def test_every_power_of_two_prefix_of_sobol_is_balanced():
    points = sample_cube("sobol", 1024, 2, seed=5)
    for n in (64, 256, 1024):
        cells = np.histogram2d(*points[:n].T, bins=8, range=[(0, 1)] * 2)[0]
        np.testing.assert_array_equal(cells, n / 64)


def test_the_grid_holds_both_ends_and_every_combination():
    points = sample_cube("grid", 27, 3, seed=0)
    assert {tuple(2 * p) for p in points} == {*np.ndindex(3, 3, 3)}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("halton", 10, 3, 0),
            "sampler = 'halton': must be one of uniform, boundary, counter, sobol, grid",
        ),
        (("sobol", 400_000, 3, 0), "262144 or 524288"),
        (("grid", 400_000, 3, 0), r"73\^3 = 389017 or 74\^3 = 405224"),
        (("uniform", 0, 3, 0), "n = 0: must be a whole number, 1 or more"),
        (("uniform", 10, 3, -1), "seed = -1"),
    ],
)
def test_what_a_sampler_cannot_do_is_refused_with_what_it_can(arguments, message):
    with pytest.raises(InvalidInput, match=message):
        sample_cube(*arguments)


# Clouds: the same for the same arguments, complete, and whole on disk or not there


@pytest.fixture(scope="module")
def cloud(trunk):
    return sr.compute_cloud(trunk, n=40_000, seed=3)


def test_the_tips_are_those_of_the_activations(cloud, trunk):
    np.testing.assert_array_equal(cloud.tip, sr.tip_positions(trunk, cloud.activation.values))


def test_the_activations_fill_the_box(cloud, trunk):
    gamma = cloud.activation.values
    width = np.ptp(trunk.bounds, axis=1)
    assert (gamma >= trunk.bounds[:, 0]).all()
    assert (gamma <= trunk.bounds[:, 1]).all()
    assert (np.ptp(gamma, axis=0) > 0.999 * width).all()


@pytest.mark.parametrize("sampler", ["uniform", "boundary", "counter", "sobol", "grid"])
def test_a_cloud_depends_on_its_arguments_alone(trunk, sampler, monkeypatch):
    first = sr.compute_cloud(trunk, n=32**3, seed=1, sampler=sampler)
    monkeypatch.setenv("SOFTREACH_NUM_THREADS", "1")
    monkeypatch.setattr("softreach.rod.tip_map.BLOCK", 1_000)
    assert sr.compute_cloud(trunk, n=32**3, seed=1, sampler=sampler).identical(first)


def test_a_cloud_knows_where_it_comes_from(cloud, trunk):
    assert sr.cloud.design_of(cloud) == trunk
    drawn = {"seed": 3, "sampler": "uniform", "tol": 1e-6}
    assert {name: cloud.attrs[name] for name in drawn} == drawn
    assert cloud.tip.attrs["units"] == "m"
    assert cloud.tip.attrs["length"] == trunk.length
    assert list(cloud.bundle.values) == ["left", "right", "longitudinal"]
    again = sr.compute_cloud(sr.cloud.design_of(cloud), n=40_000, seed=cloud.attrs["seed"])
    assert again.identical(cloud)


def test_a_cloud_survives_the_disk(cloud, tmp_path):
    path = tmp_path / "cloud.zarr"
    sr.save_cloud(cloud, path)
    sr.save_cloud(cloud, path, overwrite=True)
    assert sr.open_cloud(path).identical(cloud)
    assert list(tmp_path.iterdir()) == [path]


def test_progress_adds_up(trunk):
    done = []
    sr.compute_cloud(trunk, n=50_001, progress=done.append)
    assert sum(done) == 50_001


_PEAKS = """
import sys, tracemalloc
import softreach as sr
arm, store = sr.designs.minimal_trunk(), sys.argv[1]
sr.save_cloud(sr.compute_cloud(arm, 100), store)  # what is loaded once
tracemalloc.start()
cloud = sr.compute_cloud(arm, 1_500_000)
print(cloud.nbytes, tracemalloc.get_traced_memory()[1])
sr.save_cloud(cloud, store, overwrite=True)
print(cloud.nbytes, tracemalloc.get_traced_memory()[1])
size = cloud.nbytes
del cloud
sr.open_cloud(store)
print(size, tracemalloc.get_traced_memory()[1])
"""


def test_making_and_keeping_a_cloud_takes_little_more_memory_than_it(tmp_path, monkeypatch):
    monkeypatch.setenv("SOFTREACH_NUM_THREADS", "1")
    # A process of its own: here, threads of other tests' servers would be counted, too.
    command = [sys.executable, "-c", _PEAKS, str(tmp_path / "cloud.zarr")]
    printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    sizes, peaks = np.array(printed.split(), float).reshape(3, 2).T
    chunk = 24 << 19  # bytes, of which Zarr holds three copies, and one that comes next
    assert (peaks <= sizes + 4 * chunk).all()


# Clouds of loaded arms: what asks where the arm can be counts its stable equilibria only


SAMPLES = 3000
LOADS = Loads(gravity=(9.81, 0.0, 0.0), payload=0.005)  # under which a few samples snap


@pytest.fixture(scope="module")
def loaded():
    return compute_cloud(designs.lce_arm().replace(loads=LOADS), SAMPLES)


@pytest.fixture(scope="module")
def lossy(loaded):
    """A cloud whose first samples are unstable, or without an equilibrium."""
    tip, status = loaded.tip.values.copy(), loaded.status.values.copy()
    status[:40], status[40:60] = 1, 2
    tip[:40], tip[40:60] = 10.0, np.nan  # far away, so that none can be counted unseen
    return loaded.assign(tip=loaded.tip.copy(data=tip)).assign_coords(status=("sample", status))


def kept(lossy):
    return lossy.isel(sample=np.flatnonzero(lossy.status.values == 0))


def test_hulls_are_those_of_the_stable_tips(lossy):
    stable = kept(lossy).tip.values
    assert concave_hull(lossy.tip, 0.02).volume == concave_hull(stable, 0.02).volume
    assert convex_hull(lossy.tip).volume == convex_hull(stable).volume
    assert convex_hull(lossy.tip.transpose("axis", "sample")).volume == convex_hull(stable).volume
    assert unreachability(lossy.tip, 0.02) == unreachability(stable, 0.02)


def test_neighbors_are_stable_tips(lossy):
    radius, stable = 0.01, lossy.status.values == 0
    found = activation_distance(lossy, radius)
    assert np.isnan(found.values[~stable]).all()
    assert (found.neighbors.values[~stable] == 0).all()
    tip, gamma = lossy.tip.values[stable], lossy.activation.values[stable]
    for i in range(0, len(tip), 500):
        near = np.linalg.norm(tip - tip[i], axis=1) <= radius
        near[i] = False
        expected = np.linalg.norm(gamma[near] - gamma[i], axis=1).mean()
        assert found.values[stable][i] == pytest.approx(expected, rel=1e-12)
    some = activation_distance(lossy, radius, queries=[5, 1000])
    assert np.isnan(some.values[0])
    assert some.values[1] == found.values[1000]


def test_summaries_of_redundancy_and_densities_leave_out_what_is_not_stable(lossy):
    whole = redundancy_summary(lossy, activation_distance(lossy, 0.01))
    part = redundancy_summary(kept(lossy), activation_distance(kept(lossy), 0.01))
    assert whole == part
    found = tip_density(lossy)
    stable = int((lossy.status == 0).sum())
    assert float(found.density.sum()) * found.attrs["cell"] ** 3 == pytest.approx(stable)


def test_dexterity_is_nan_where_the_arm_cannot_be(loaded):
    arm, found = designs.lce_arm().replace(loads=LOADS), dexterity(loaded)
    lost = loaded.status.values != 0
    assert lost.any()
    assert np.array_equal(np.isnan(found.manipulability.values), lost)
    assert np.array_equal(found.orientation.values == 0, lost)
    _, slope = as_tip_map(arm).tips_and_slopes(loaded.activation.values[:50])
    expected = np.abs(np.linalg.det(slope))
    good = ~lost[:50]
    assert np.allclose(found.manipulability.values[:50][good], expected[good], rtol=1e-9)
    measure = solution_measure(loaded)
    volume = float(np.prod(np.ptp(arm.bounds, axis=1)))
    total = float(measure.solution_measure.sum()) * measure.attrs["cell"] ** 3
    mean = float(np.nansum(found.manipulability.values)) / SAMPLES
    assert total == pytest.approx(volume * mean)


def test_strains_are_those_of_stable_equilibria(loaded):
    lost = int((loaded.status != 0).sum())
    assert lost > 0
    assert curvature_statistics(loaded, [0.09]).samples == SAMPLES - lost


def test_exports_and_stores_keep_the_status(lossy, tmp_path):
    export_cloud(lossy, tmp_path / "cloud.csv")
    export_cloud(lossy, tmp_path / "cloud.npz")
    with (tmp_path / "cloud.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["status"]) for row in rows] == lossy.status.values.tolist()
    assert np.array_equal(np.load(tmp_path / "cloud.npz")["status"], lossy.status.values)
    export_cloud(lossy, tmp_path / "cloud.ply")
    assert b"property uchar status" in (tmp_path / "cloud.ply").read_bytes()[:20_000]
    save_cloud(lossy, tmp_path / "cloud.zarr")
    opened = open_cloud(tmp_path / "cloud.zarr")
    assert np.array_equal(opened.tip.status.values, lossy.status.values)


@pytest.mark.parametrize("color", ["rgb", 1])
def test_unstable_samples_have_a_color_of_their_own_and_a_key(lossy, color):
    coloring = color_samples(lossy, color)
    unstable = lossy.status.values == 1
    marks = np.unique(coloring.rgb[unstable], axis=0)
    assert len(marks) == 1
    assert not (coloring.rgb[~unstable] == marks[0]).all(axis=1).any()
    assert coloring.key is not None
    assert coloring.key.unstable
    plain = color_samples(kept(lossy), color).key
    assert plain is not None
    assert not plain.unstable


def test_a_cloud_of_free_bundles_is_that_of_the_arm():
    arm = designs.lce_arm()
    held = arm.with_bounds([*arm.bounds[:2], arm.bounds[2, [0, 0]]])
    part, whole = compute_cloud(free_bundles(as_tip_map(held)), 50), compute_cloud(held, 50)
    assert np.array_equal(part.activation.values, whole.activation.values)
    assert np.array_equal(part.tip.values, whole.tip.values)


def test_a_configuration_says_whether_it_is_stable(loaded):
    shapes = configuration(design_of(loaded), loaded.activation.values[:200])
    assert np.array_equal(shapes.status.values, loaded.status.values[:200])
