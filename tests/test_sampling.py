"""Samplers: points of the unit cube that depend on their four arguments alone."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softreach as sr
from softreach.arm import designs
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


@pytest.mark.parametrize("sampler", ["uniform", "boundary", "sobol"])
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
    assert {tuple(p) for p in points} == {
        (a, b, c) for a in (0, 0.5, 1) for b in (0, 0.5, 1) for c in (0, 0.5, 1)
    }


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("halton", 10, 3, 0), "sampler = 'halton': must be one of uniform, boundary, sobol, grid"),
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


@pytest.mark.parametrize("sampler", ["uniform", "boundary", "sobol", "grid"])
def test_a_cloud_depends_on_its_arguments_alone(trunk, sampler, monkeypatch):
    first = sr.compute_cloud(trunk, n=32**3, seed=1, sampler=sampler)
    monkeypatch.setenv("SOFTREACH_NUM_THREADS", "1")
    monkeypatch.setattr("softreach.cloud.clouds.BLOCK", 1_000)
    assert sr.compute_cloud(trunk, n=32**3, seed=1, sampler=sampler).identical(first)


def test_a_cloud_knows_where_it_comes_from(cloud, trunk):
    assert sr.cloud.design_of(cloud) == trunk
    assert {k: cloud.attrs[k] for k in ("seed", "sampler", "tol")} == {
        "seed": 3,
        "sampler": "uniform",
        "tol": 1e-6,
    }
    assert cloud.tip.attrs["units"] == "m"
    assert cloud.tip.attrs["length"] == trunk.length
    assert list(cloud.bundle.values) == ["left", "right", "longitudinal"]
    again = sr.compute_cloud(sr.cloud.design_of(cloud), n=40_000, seed=cloud.attrs["seed"])
    assert again.identical(cloud)


def test_a_cloud_is_replaced_only_if_one_says_so(cloud, tmp_path):
    path, other = tmp_path / "a.zarr", sr.compute_cloud(designs.lce_arm(), 50)
    sr.save_cloud(cloud, path)
    with pytest.raises(InvalidInput, match="something is there; choose another name"):
        sr.save_cloud(other, path)
    assert sr.open_cloud(path).identical(cloud)
    sr.save_cloud(other, path, overwrite=True)
    assert sr.open_cloud(path).identical(other)


def test_a_cloud_survives_the_disk(cloud, tmp_path):
    path = tmp_path / "cloud.zarr"
    sr.save_cloud(cloud, path)
    sr.save_cloud(cloud, path, overwrite=True)
    assert sr.open_cloud(path).identical(cloud)
    assert list(tmp_path.iterdir()) == [path]


def test_an_interrupted_save_leaves_the_old_cloud(cloud, tmp_path, monkeypatch):
    path = tmp_path / "cloud.zarr"
    sr.save_cloud(cloud, path)

    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("xarray.Dataset.to_zarr", interrupted)
    with pytest.raises(KeyboardInterrupt):
        sr.save_cloud(cloud, path, overwrite=True)
    assert list(tmp_path.iterdir()) == [path]
    assert sr.open_cloud(path).identical(cloud)


def test_an_interrupted_computation_ends(trunk):
    def interrupted(_: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sr.compute_cloud(trunk, n=200_000, progress=interrupted)


def test_progress_adds_up(trunk):
    done = []
    sr.compute_cloud(trunk, n=50_001, progress=done.append)
    assert sum(done) == 50_001


def test_what_is_no_cloud_is_refused(cloud, tmp_path):
    with pytest.raises(InvalidInput, match="a Zarr store"):
        sr.open_cloud(tmp_path / "nothing.zarr")
    with pytest.raises(InvalidInput, match=r"cloud.activation = missing"):
        sr.save_cloud(cloud.drop_vars("activation"), tmp_path / "x.zarr")
    old = cloud.copy()
    old.attrs["schema_version"] = 0
    with pytest.raises(InvalidInput, match="schema_version"):
        sr.save_cloud(old, tmp_path / "x.zarr")


@pytest.mark.parametrize("n", [0, -5, 2.5, True, "10"])
def test_a_count_that_is_no_count_is_refused(trunk, n):
    with pytest.raises(InvalidInput, match=f"n = {n!r}: must be a whole number, 1 or more"):
        sr.compute_cloud(trunk, n=n)


@pytest.mark.parametrize("bundles", [1, 2, 4])
def test_any_number_of_bundles_makes_a_cloud(bundles):
    arm = designs.minimal_trunk()
    fiber = arm.fibers[0].replace(bundles=bundles)
    cloud = sr.compute_cloud(arm.replace(actuators=(fiber,)), n=500)
    assert cloud.activation.shape == (500, bundles)
    assert np.isfinite(cloud.tip).all()


_PEAKS = """
import sys, tracemalloc
import softreach as sr
arm, store = sr.designs.minimal_trunk(), sys.argv[1]
sr.save_cloud(sr.compute_cloud(arm, 100), store)  # what is loaded once
tracemalloc.start()
cloud = sr.compute_cloud(arm, 3_000_000)
print(cloud.nbytes, tracemalloc.get_traced_memory()[1])
sr.save_cloud(cloud, store, overwrite=True)
print(cloud.nbytes, tracemalloc.get_traced_memory()[1])
size = cloud.nbytes
del cloud
sr.open_cloud(store)
print(size, tracemalloc.get_traced_memory()[1])
"""


def test_making_and_keeping_a_large_cloud_takes_little_more_memory_than_the_cloud(
    tmp_path, monkeypatch
):
    monkeypatch.setenv("SOFTREACH_NUM_THREADS", "1")
    # A process of its own: here, threads of other tests' servers would be counted, too.
    command = [sys.executable, "-c", _PEAKS, str(tmp_path / "cloud.zarr")]
    printed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    sizes, peaks = np.array(printed.split(), float).reshape(3, 2).T
    assert (peaks <= 1.3 * sizes).all()
