"""Kernels of the GPU beside those of the CPU: in CUDA's simulator, and on a GPU where there is one.

The simulator runs a kernel and its parts in Python, in a process of its own, as what is compiled
otherwise must not be there.
"""

import os
import subprocess
import sys
from unittest.mock import patch

import numpy as np
import pytest

import softreach as sr
from softreach.arm import designs
from softreach.arm.stations import Marker
from softreach.cloud import cells
from softreach.cloud.cells import reached_cells
from softreach.rod.rods import as_tip_map, refined
from softreach.rod.steps import StepRule

FEW = 5  # samples
SAMPLES = 60  # in cells
VARIABLES = ("count", "activation_distance", "extreme_tip")


def _arms():
    """Drives, a bundle that is held, a pose, a marker off the axis, and ζ that is not η."""
    trunk = designs.minimal_trunk().replace(base=sr.Base(points="x", position=(0.1, 0.2, -0.3)))
    low, high = trunk.input_bounds[0]
    held = trunk.with_bounds([(low, high), (low, low), (low, high)])
    tool = Marker(name="tool", station=0.8 * trunk.length, offset=(0.02, -0.01, 0.05))
    return {
        "trunk": designs.minimal_trunk(),
        "held": held,
        "tool": trunk.replace(markers=(tool,), point="tool"),
        "tendons": designs.three_tendon_robot(segments=2),
        "chambers": designs.three_chamber_arm(),
    }


@patch.object(cells, "_PILOT", 40)
@patch.object(StepRule, "steps_for", lambda rule, tol: 12)  # the simulator is slow to find it
def _results(device):
    """Everything that a device computes, by name."""
    results = {}
    for name, arm in _arms().items():
        tip_map = as_tip_map(arm, device=device)
        gamma = tip_map.box.from_cube(np.random.default_rng(5).random((FEW, arm.inputs)))
        tips, slopes, directions, rotations = tip_map.tip_motions(gamma)
        whole = tip_map.box.widths
        results[f"{name} tips"], results[f"{name} directions"] = tips, directions
        results[f"{name} positions"] = sr.tip_positions(arm, gamma, device=device)
        results[f"{name} slopes"] = slopes * whole  # over the range of each bundle
        results[f"{name} rotations"] = rotations * whole
        results[f"{name} slopes alone"] = tip_map.tips_and_slopes(gamma)[1] * whole
        results[f"{name} jacobian"] = sr.tip_jacobian(arm, gamma, device=device) * whole
    cloud = sr.compute_cloud(_arms()["held"], FEW, sampler="counter", device=device)
    results["cloud"] = cloud.tip.values
    for name in ("held", "tool"):
        arm = _arms()[name]
        counted = reached_cells(arm, SAMPLES, cell=0.1 * arm.length, device=device)
        results |= {f"{name} {key}": counted[key].values for key in VARIABLES}
        results[f"{name} outside"] = np.array(counted.attrs["samples_outside"])
    return results


if __name__ == "__main__":
    with np.errstate(over="ignore"):  # whole numbers of a counter wrap around
        np.savez(sys.argv[1], **_results("cuda"))


def _has_gpu():
    try:
        from softreach.rod.cuda import device_name

        return "simulator" not in device_name()
    except sr.errors.SoftreachError:
        return False


@pytest.fixture(scope="module", params=["simulator", "gpu"])
def on_cuda(request, tmp_path_factory):
    if request.param == "gpu":
        return _results("cuda") if _has_gpu() else pytest.skip("no GPU")
    file = tmp_path_factory.mktemp("cuda") / "results.npz"
    simulated = {"NUMBA_ENABLE_CUDASIM": "1", "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-m", "tests.rod.test_cuda", str(file)]
    subprocess.run(command, check=True, env={**os.environ, **simulated})
    return np.load(file)


def test_a_gpu_computes_what_the_cpu_computes(on_cuda):
    on_cpu = _results("cpu")
    assert set(on_cuda) == set(on_cpu)
    for name, values in on_cpu.items():
        scale = np.nanmax(np.abs(values)) or 1.0
        by_frames = name.startswith("tool") or name.endswith("directions")  # in other steps there
        by_pulling_back = name.endswith("slopes alone")  # another series for steps beyond 1 rad
        atol = (1e-6 if by_frames else 1e-11 if by_pulling_back else 1e-12) * scale
        np.testing.assert_allclose(on_cuda[name], values, rtol=0, atol=atol, err_msg=name)


def test_counted_cells_are_those_of_the_cloud(trunk):
    """An independent count: the cloud of the same samples, its density and its convex hull."""
    n, cell = 20_000, 0.05 * trunk.length
    counted = reached_cells(trunk, n, cell=cell, seed=4)
    cloud = sr.compute_cloud(trunk, n, seed=4, sampler="counter")
    tips, gamma = cloud.tip.values, cloud.activation.values
    density = sr.cloud.redundancy.tip_density(cloud, cell=cell)
    shared = counted.sel(x=density.x, y=density.y, z=density.z, method="nearest")
    np.testing.assert_allclose(n * shared.density, density.density, atol=1e-9)
    assert counted["count"].sum() == n
    assert counted.attrs["convex_volume"] <= (hull := sr.convex_hull(tips)).volume
    assert counted.attrs["convex_volume"] == pytest.approx(hull.volume, rel=2e-3)
    fullest = counted["count"].argmax(...)
    center = [float(counted[axis][fullest[axis]]) for axis in "xyz"]
    inside = gamma[(np.abs(tips - center) < 0.5 * cell).all(axis=1)]
    pairs = np.linalg.norm(inside[:, None] - inside[None], axis=2)[np.triu_indices(len(inside), 1)]
    rms = np.sqrt((pairs**2).mean())
    assert float(counted["activation_distance"][fullest]) == pytest.approx(rms, rel=1e-4)


def test_blocks_do_not_change_what_is_counted(trunk, monkeypatch):
    whole = reached_cells(trunk, 3000, cell=0.1 * trunk.length)
    monkeypatch.setattr(cells, "_ON_CPU", 700)
    assert reached_cells(trunk, 3000, cell=0.1 * trunk.length).identical(whole)


def test_a_map_of_a_gpu_stays_one(trunk, monkeypatch):
    monkeypatch.setattr("softreach.rod.cuda.device_name", lambda: "a GPU")
    tip_map = as_tip_map(trunk, 1e-4, device="cuda")
    assert tip_map.device == refined(tip_map, 1e-6).device == "a GPU"
    assert as_tip_map(trunk, 1e-4).device == "cpu"


def test_what_a_gpu_cannot_do_is_said(trunk, monkeypatch):
    activation = np.zeros((1, 3))
    with pytest.raises(sr.InvalidInput, match="device = 'gpu': must be one of cpu, cuda"):
        sr.tip_positions(trunk, activation, device="gpu")
    if not _has_gpu():
        with pytest.raises(sr.errors.SoftreachError, match=r"numba_cuda|no GPU of NVIDIA"):
            sr.tip_positions(trunk, activation, device="cuda")
    monkeypatch.setattr("softreach.rod.cuda.device_name", lambda: "a GPU")
    loaded = designs.lce_arm().replace(loads=sr.Loads())
    with pytest.raises(sr.NotPossible, match="arms under loads are computed on the CPU"):
        sr.compute_cloud(loaded, 10, device="cuda")
