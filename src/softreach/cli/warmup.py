"""`softreach warmup` and `doctor`: kernels compiled ahead; the machine and the installation."""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, requires, version
from itertools import chain
from pathlib import Path

import softreach as sr
from softreach.cli.console import console
from softreach.cli.options import AsJson
from softreach.support.arguments import as_one_of
from softreach.support.errors import no_warnings
from softreach.support.memory import free_memory
from softreach.support.parallel import thread_count
from softreach.support.progress import bar


def warmup(*, only: str | None = None) -> int:
    """Compile all kernels now, so that no later command has to.

    A cache on disk keeps them; if it has them already, this takes seconds.
    Exits with 1 if the cache cannot be written.

    Example: softreach warmup --only free

    Args:
        only: free (kernels of arms without loads) or loaded (the others): both if left out.
    """
    from softreach.kernels.compiler import not_kept

    if only is not None:
        as_one_of("only", only, [*_JOBS])
    with bar("compiling", None) as done, no_warnings():  # of clouds and grids too coarse
        for _ in chain(*(jobs() for name, jobs in _JOBS.items() if only in (None, name))):
            if not_kept:
                break
            done(1)
    if not_kept:
        reason = f"nothing could be kept: {not_kept[0]}"
        console.error(f"{reason}; set NUMBA_CACHE_DIR to a folder that can be written")
        return 1
    console.line(f"all kernels{'' if only is None else f' of {only} arms'} are compiled")
    return 0


def _free() -> Iterator[object]:
    """Results that need the kernels of arms without loads, each computed when it is asked for."""
    import numpy as np

    from softreach.picture.zbuffer import Extent, ZBuffer

    arm, redundant = sr.designs.minimal_trunk(), sr.designs.redundant_trunk()
    hanging = arm.replace(base=sr.Base(points="down"))
    target, beyond = (0.2, 0.1, 0.6), (2.0, 0.0, 0.0)
    path = (target, (0.2, 0.1, 0.61))
    yield _hulls()
    yield ZBuffer(Extent(0, 1, 0, 1), 4).draw_triangles(np.zeros((1, 3, 3)), np.zeros((1, 3, 3)))
    yield _calibration()
    yield sr.tip_jacobian(arm, [[-1.0, 0.0, -0.4]])
    yield sr.tip_jacobian(hanging, [[-1.0, 0.0, -0.4]])
    yield sr.configuration(arm, [-1.0, 0.0, -0.4])
    reached = sr.reachable_set(arm, accuracy=0.1)
    yield reached.contains(target)
    yield reached.distance(beyond)
    yield sr.solve_inverse(arm, [target, beyond])
    yield sr.inverse.prepared_map(arm).tree
    yield sr.track_path(arm, path)
    yield sr.reachable_set(redundant, accuracy=0.1)
    yield sr.solve_inverse(redundant, [target], near=[-0.5] * 4)
    yield sr.solve_inverse(redundant, [target])
    yield sr.track_path(redundant, path)


def _calibration() -> None:
    import numpy as np

    tendon = sr.arm.LengthTendon(distance=0.01, bundles=3, activation_bounds=(0.0, 0.01))
    arm = sr.Manipulator.tapered(
        length=0.2, outer_radius=0.01, inner_radius=0.005, young_modulus=1e6, actuators=[tendon]
    )
    inputs = 0.01 * np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.5, 1.0]])
    data = {f"{name}_m": values for name, values in zip(arm.input_names, inputs.T, strict=True)}
    places = np.array([[0.0, 0.0, 0.2], [0.01, 0.0, 0.2], [0.0, 0.01, 0.2]])
    data |= {f"{axis}_m": values for axis, values in zip("xyz", places.T, strict=True)}
    sr.calibrate(arm, data, free=["pose.x"], rivals=False)


def _hulls() -> None:
    import numpy as np

    from softreach.geometry.alpha_shape import alpha_hull
    from softreach.geometry.surface import Surface

    cloud = sr.compute_cloud(sr.designs.minimal_trunk(), 2000)
    sr.concave_hull(cloud.tip, alpha=0.2)
    hull = sr.concave_hull(cloud.tip, alpha="critical")
    Surface(vertices=hull.vertices, faces=hull.faces).distance(hull.vertices[:2])
    tips = cloud.tip.values
    alpha_hull(tips, 0.1, boxes=2)
    sr.concave_hull(np.concatenate([tips, tips + 9.0]), alpha="critical")  # in two parts
    for design in (sr.designs.minimal_trunk(), sr.designs.redundant_trunk()):
        sr.activation_distance(sr.compute_cloud(design, 2000), 0.1)


def _loaded() -> Iterator[object]:
    free = sr.designs.lce_arm()
    rest, pulled = [0.0] * free.bundles, free.input_bounds[:, 0].tolist()
    weight = free.replace(loads=sr.Loads(gravity=(0, 0, 9.81), payload=0.001))
    follower = free.replace(loads=sr.Loads(follower_force=(0, 0.001, 0)))
    for arm in (weight, follower):
        yield sr.tip_positions(arm, [rest])
        yield sr.tip_jacobian(arm, [rest])
        yield sr.configuration(arm, rest)
    yield sr.equilibria(weight, pulled)


_JOBS = {"free": _free, "loaded": _loaded}


def doctor(*, json: AsJson = False) -> None:
    """Print versions, cores, memory and caches, for the report of a fault.

    Example: softreach doctor --json
    """
    from softreach.kernels.compiler import not_kept
    from softreach.kernels.rod import tips

    cache = getattr(tips._tips, "_cache", None)
    kept = str(getattr(cache, "cache_path", "nowhere: not compiled"))
    kept = f"nowhere: {not_kept[0]}" if not_kept else kept
    names = re.findall(r"^[\w.-]+", "\n".join(requires("softreach") or []), re.MULTILINE)
    has_screen = platform.system() in ("Windows", "Darwin")
    has_screen = has_screen or bool({"DISPLAY", "WAYLAND_DISPLAY"} & {*os.environ})
    rows = {
        "softreach": (sr.__version__, ""),
        "installed in": (str(Path(sr.__file__).parent), ""),
        "Python": (platform.python_version(), ""),
        "system": (platform.platform(), ""),
        "cores": (os.cpu_count(), ""),
        "threads used": (thread_count(), ""),
        "free memory": (round(free_memory() / 1e9, 1), "GB"),
        "kernels are kept in": (kept, ""),
        "screen": ("yes" if has_screen else "none: headless", ""),
    }
    rows |= {name: (_version(name), "") for name in names if name != "softreach"}
    console.rows("this machine and this installation", rows, json)


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
