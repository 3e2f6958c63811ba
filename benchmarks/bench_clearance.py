"""Clearance of whole arms: CPU time of a configuration over that of a tip, scene by scene.

`python -m benchmarks.bench_clearance [n]` prints a Markdown table; a tip, to 1e-6 L, is timed in
the same process.
"""

from __future__ import annotations

import argparse

import numpy as np
import pytest

import softreach as sr
from benchmarks.bench_geometry import cpu_seconds
from softreach.arm import Obstacle
from softreach.requirements import Box, HalfSpace, Mesh, Tube
from softreach.workspace import free

CLEAR_OF_ITSELF = {"itself": False}


def ball(subdivisions: int) -> Mesh:
    """A ball of 20 × 4^subdivisions triangles beside the arm."""
    import trimesh

    sphere = trimesh.creation.icosphere(subdivisions=subdivisions, radius=0.2)
    return Mesh(np.array(sphere.vertices) + [0.3, 0.2, 0.6], np.array(sphere.faces))


def scenes(subdivisions: int) -> dict[str, tuple[tuple[Obstacle, ...], dict[str, bool]]]:
    """Surroundings, and whether the arm must keep clear of itself."""
    plane = Obstacle(region=HalfSpace((0, 0, 0), (0, 0, 1)), start_over_length=0.1)
    tube = Obstacle(region=Tube((0, 0, -0.2), (0, 0, 0.5), 0.5, 0.3), end_over_length=0.9)
    mesh = ball(subdivisions)
    return {
        "plane": ((plane,), CLEAR_OF_ITSELF),
        "plane, and the arm itself": ((plane,), {}),
        "box": ((Obstacle(region=Box((0.2, -0.3, 0.1), (0.5, 0.3, 0.4))),), CLEAR_OF_ITSELF),
        "tube": ((tube,), CLEAR_OF_ITSELF),
        f"mesh, {len(mesh.faces):,} triangles": ((Obstacle(region=mesh),), CLEAR_OF_ITSELF),
    }


def activations(n: int) -> np.ndarray:
    """Of the minimal trunk, uniform in its bounds."""
    low, high = sr.designs.minimal_trunk().input_bounds.T
    return np.random.default_rng(0).uniform(low, high, (n, 3))


@pytest.mark.parametrize("name", scenes(1))
def test_clearance(benchmark, name):
    around, options = scenes(1)[name]
    arm, gamma = sr.designs.minimal_trunk().replace(surroundings=around), activations(200)
    found = benchmark(sr.rod.compute_clearance, arm, gamma, **options)
    assert not np.isnan(found.clearance).any()


def main(n: int = 20_000, subdivisions: int = 6) -> None:
    """Print the table."""
    gamma, trunk = activations(n), sr.designs.minimal_trunk()
    tip = cpu_seconds(lambda: sr.tip_positions(trunk, gamma)) / n
    print(f"## Clearance of {n:,} random configurations, minimal trunk\n")
    print(f"A tip alone takes {1e6 * tip:.2f} µs of CPU.\n")
    print("| surroundings | in contact | a configuration [µs of CPU] | over a tip |")
    print("|---|--:|--:|--:|")
    for name, (around, options) in scenes(subdivisions).items():
        arm = trunk.replace(surroundings=around)
        found = sr.rod.compute_clearance(arm, gamma, **options).clearance.values
        each = cpu_seconds(lambda arm=arm, o=options: sr.rod.compute_clearance(arm, gamma, **o)) / n
        print(
            f"| {name} | {100 * (found < 0).mean():.0f} % | {1e6 * each:.2f} | {each / tip:.0f} |"
        )
    arm = trunk.replace(surroundings=scenes(0)["plane"][0])
    flood = cpu_seconds(lambda: (free.free_grid.cache_clear(), free.free_set(arm, cells=64)))
    print(f"\nThe free set above the plane, flooded on 64³ cells, takes {flood:.1f} s of CPU.")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("n", type=int, nargs="?", default=20_000)
    main(parser.parse_args().n)
