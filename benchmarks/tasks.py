"""Work that any version of softreach can be asked for, by what it is part of."""

from __future__ import annotations

import math
import subprocess
import sys
import tempfile
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

__all__ = ["PARTS", "Results", "Task", "family_arm"]

Results = dict[str, np.ndarray]
Task = Callable[[], Results]
REST = np.zeros((1, 3))


def design_tasks() -> dict[str, Task]:
    """What a design costs before its first sample."""
    import softreach as sr
    from softreach.arm.tables import tables
    from softreach.rod.free import FreeRod
    from softreach.rod.summary import describe

    trunks = [_trunk(o, p) for o in (36, 75, 108) for p in (0, 2, 3)]
    stations = np.linspace(0.0, 1.0, 101)

    def described(arm: Any) -> list[float]:
        found = describe(arm)
        return [*found.extension, *found.curvature, *found.revolutions]

    return {
        "tables": lambda: {"U": np.array([tables(one, stations).curvature for one in trunks])},
        "steps": lambda: {"K": np.array([FreeRod(one, 1e-6).steps for one in trunks])},
        "first tip": lambda: {"tip": np.array([FreeRod(one, 1e-6).tips(REST) for one in trunks])},
        "describe": lambda: {"numbers": np.array([described(one) for one in trunks])},
        "designs": lambda: {
            "L": np.array([sr.designs.minimal_trunk(length=k).length for k in range(1, 200)])
        },
    }


def kernel_tasks() -> dict[str, Task]:
    """Tips, Jacobians and shapes."""
    import softreach as sr

    def tips(arm: Any, n: int) -> Task:
        gamma = _activations(arm, n)
        return lambda: {"tips": sr.tip_positions(arm, gamma)}

    minimal, redundant = sr.designs.minimal_trunk(), sr.designs.redundant_trunk()
    few, some = _activations(minimal, 2_000), _activations(minimal, 100_000)
    return {
        "tips, 3 bundles": tips(minimal, 1_000_000),
        "tips, 4 bundles": tips(redundant, 1_000_000),
        "Jacobians": lambda: {"twists": sr.tip_jacobian(minimal, some)},
        "tip directions": lambda: {"d3": _tip_directions(minimal, some)},
        "shapes": lambda: {"r": sr.configuration(minimal, few).position.values},
        "cloud": lambda: {"tip": sr.compute_cloud(minimal, 1_000_000).tip.values},
    }


def workspace_tasks() -> dict[str, Task]:
    """The exact reachable set."""
    from softreach.workspace import reachable_set

    def numbers(arm: Any, accuracy: float) -> Task:
        def task() -> Results:
            found = reachable_set(arm, accuracy=accuracy)
            asked = ("volume", "convex_volume")
            return {name: np.array(getattr(found, name)) for name in asked}

        return task

    trunks = {f"{o}°, {p}°": _trunk(o, p) for o, p in ((108, 2), (75, 3), (36, 3))}
    found = {f"reachable set, {name}": numbers(arm, 3e-3) for name, arm in trunks.items()}
    import softreach as sr

    found["reachable set, 4 bundles"] = numbers(sr.designs.redundant_trunk(), 0.02)
    found["reachable set, 4 bundles, 0.3 %"] = numbers(sr.designs.redundant_trunk(), 3e-3)
    found["reachable set, 6 bundles, 0.3 %"] = numbers(family_arm("six"), 3e-3)
    found["reachable set, 12 bundles, 1 %"] = numbers(family_arm("twelve"), 1e-2)
    narrow = sr.designs.minimal_trunk().with_bounds((-0.9, -0.3))
    found["reachable set, one to one"] = numbers(narrow, 3e-3)
    found["reachable surface"] = lambda: {
        "vertices": reachable_set(_trunk(75, 3)).surface().vertices
    }
    return found


def inverse_tasks() -> dict[str, Task]:
    """Every branch, least change, directions, places out of reach."""
    import softreach as sr

    def solve(arm: Any, n: int, **options: Any) -> Task:
        targets = sr.tip_positions(arm, _activations(arm, n))

        def task() -> Results:
            found = sr.solve_inverse(arm, targets, **options)
            # Within a target their order is a matter of rounding.
            keys = found.activations.T[::-1].round(5)
            order = np.lexsort((*keys, np.repeat(np.arange(n), found.counts)))
            return {"counts": found.counts, "activations": found.activations[order]}

        return task

    def away() -> Results:
        targets = 1.3 * np.random.default_rng(3).normal(size=(100, 3))
        return {"gap": np.array([one.gap for one in sr.solve_inverse(_trunk(108, 2), targets)])}

    def track() -> Results:
        arm = _trunk(108, 2)
        path = sr.tip_positions(arm, np.linspace([-0.2] * 3, [-1.2, -0.6, -0.9], 30))
        return {"activation": sr.track_path(arm, path).activation.values}

    designs = ((108, 2), (75, 3), (36, 3), (0, 0))
    found = {f"every branch, {o}°, {p}°": solve(_trunk(o, p), 20_000) for o, p in designs}
    redundant = sr.designs.redundant_trunk()
    return found | {
        "least change, 4 bundles": solve(redundant, 60),
        "direction, 3 bundles": solve(_trunk(108, 2), 60, direction=(0.0, 0.0, 1.0)),
        "out of reach": away,
        "path": track,
    }


def redundancy_tasks() -> dict[str, Task]:
    """Questions asked of a cloud."""
    import softreach as sr

    try:
        from softreach.cloud.curvature import curvature_statistics
        from softreach.cloud.dexterity import dexterity
    except ImportError:  # an earlier version
        from softreach.curvature import curvature_statistics  # type: ignore[no-redef]
        from softreach.dexterity import dexterity  # type: ignore[no-redef]

    cloud = sr.compute_cloud(sr.designs.redundant_trunk(), 200_000)
    large = sr.compute_cloud(sr.designs.minimal_trunk(), 2_000_000)

    def statistics() -> Results:
        found = curvature_statistics(cloud)
        return {name: found[name].values for name in found if not name.endswith("_count")}

    def distance(of: Any, queries: int) -> Task:
        return lambda: {"distance": sr.activation_distance(of, 1 / 60, queries=queries).values}

    return {
        "activation distance": distance(cloud, 10_000),
        "activation distance, 10,000 of 2,000,000": distance(large, 10_000),
        "activation distance, 100 of 2,000,000": distance(large, 100),
        "dexterity": lambda: {"manipulability": dexterity(cloud).manipulability.values},
        "curvature statistics": statistics,
    }


def atlas_tasks() -> dict[str, Task]:
    """A small atlas with every metric."""
    import softreach as sr

    space = sr.DesignSpace.grid(
        sr.designs.minimal_trunk(), revolution=[0.9, 1.8], taper=np.radians([0.0, 2.0]).tolist()
    )
    exact = ("extent", "convex", "exact", "curvature")

    def build(n: int, *metrics: str) -> Task:
        def task() -> Results:
            with tempfile.TemporaryDirectory() as folder:
                atlas = sr.build_atlas(space, f"{folder}/a.zarr", n, metrics=metrics)
                names = ("volume", "convex_volume", "exact_volume", "unreachability", "x_min")
                return {name: atlas[name].values for name in names if name in atlas}

        return task

    return {
        "atlas, 2 x 2 of 100,000": build(100_000, *exact, "concave"),
        "atlas, 2 x 2 of 400,000": build(400_000, *exact, "concave"),
        "atlas, 2 x 2 of 400,000, without α-shapes": build(400_000, *exact),
    }


def hull_tasks() -> dict[str, Task]:
    """Alpha shapes of one radius."""
    import softreach as sr

    arm = sr.designs.minimal_trunk()

    def hull(n: int, alpha: float, *, bias: bool = False) -> Task:
        tips = sr.compute_cloud(arm, n).tip.values

        def task() -> Results:
            found = sr.concave_hull(tips, alpha, bias=bias)
            numbers = [found.volume, found.area, found.regions, found.volume_corrected or 0.0]
            return {"numbers": np.array(numbers), "vertices": found.vertices}

        return task

    return {
        "α-shape of 400,000 points": hull(400_000, 0.05),
        "α-shape of 400,000 points, with bias": hull(400_000, 0.05, bias=True),
        "α-shape of 2,000,000 points": hull(2_000_000, 0.03),
        "α-shape of 20,000 points": hull(20_000, 0.1),
    }


def picture_tasks() -> dict[str, Task]:
    """Pictures of clouds and hulls, and the demo from the start of its process to its end."""
    import softreach as sr
    from softreach import plot
    from softreach.plot.style import pyplot

    arm = sr.designs.minimal_trunk()
    clouds = {n: sr.compute_cloud(arm, n) for n in (400_000, 2_000_000)}
    hull = sr.concave_hull(clouds[400_000].tip, 0.05 * arm.length)

    def drawn(draw: Callable[[], object]) -> Task:
        def task() -> Results:
            draw()
            pyplot().close("all")
            return {}

        return task

    def demo() -> Results:
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, "-m", "softreach", "demo", "--json", "--out", folder]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return {}

    views = {
        f"four views of {n:,} points and the arm": drawn(partial(plot.plot_views, cloud, arm))
        for n, cloud in clouds.items()
    }
    return {**views, "picture of a hull": drawn(lambda: plot.plot_hull(hull)), "demo": demo}


def studio_tasks() -> dict[str, Task]:
    """From a moved slider to the fine result."""
    import softreach as sr
    from softreach.studio.reach import Quality

    try:
        from softreach.studio.reach import stages
    except ImportError:  # an earlier version
        from softreach.studio.stages import stages

    def fine(arm: Any) -> Task:
        def task() -> Results:
            *_, last = stages(arm, 17, Quality(), lambda: None)
            return {"volume": np.array(last.volume)}

        return task

    return {
        "studio's fine result": fine(_trunk(108, 2)),
        "studio's fine result, 4 bundles": fine(sr.designs.redundant_trunk()),
    }


PARTS: dict[str, Callable[[], dict[str, Task]]] = {
    "design": design_tasks,
    "kernels": kernel_tasks,
    "workspace": workspace_tasks,
    "inverse": inverse_tasks,
    "redundancy": redundancy_tasks,
    "atlas": atlas_tasks,
    "hulls": hull_tasks,
    "pictures": picture_tasks,
    "studio": studio_tasks,
}


def family_arm(name: str) -> Any:
    """Designs with five, six and twelve bundles."""
    import softreach as sr

    families, inner, poisson, high = {
        "five": (((0, 50, 90, 3), (-90, 30, 20, 2)), 0.05, 0.5, 0.0),
        "six": (((90, 40, 90, 3), (-90, 40, 30, 3)), 0.03, 0.4, 0.1),
        "twelve": (
            ((90, 25, 0, 3), (-90, 25, 20, 3), (0, 25, 40, 3), (45, 25, 60, 3)),
            0.03,
            0.4,
            0.1,
        ),
    }[name]
    fibers = tuple(
        sr.FiberArchitecture(
            revolution=math.radians(turn),
            extent=math.radians(extent),
            offset=math.radians(offset),
            bundles=bundles,
        )
        for turn, extent, offset, bundles in families
    )
    return sr.Manipulator.tapered(
        length=1.0,
        outer_radius=0.06,
        inner_radius=inner,
        taper=math.radians(1),
        poisson_ratio=poisson,
        actuators=fibers,
        activation_bounds=(-1.2, high),
    )


def _trunk(revolution: float, taper: float) -> Any:
    import softreach as sr

    return sr.designs.minimal_trunk(np.radians(revolution), np.radians(taper))


def _activations(arm: Any, n: int) -> np.ndarray:
    return np.random.default_rng(0).uniform(*arm.bounds.T, (n, arm.bundles))


def _tip_directions(arm: Any, gamma: np.ndarray) -> np.ndarray:
    import softreach as sr

    return sr.configuration(arm, gamma, [arm.length]).directors.values[:, 0, 2]
