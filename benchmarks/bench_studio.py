"""The studio's server side: from a moved slider to what the page is sent.

`python -m benchmarks.bench_studio` prints a Markdown table; under pytest the same work runs small.
The browser's own drawing is not in it.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest

pytest.importorskip("viser", reason="the studio needs viser")

from softreach import designs
from softreach.studio.reach import Quality, stages
from softreach.studio.scene import Scene
from softreach.studio.server import start_server, stop_server
from softreach.studio.state import Appearance

SMALL = Quality(coarse_level=10, fine_level=12, coarse_accuracy=0.1, fine_accuracy=0.05)


def moved(k: int):
    """A design that nothing is known of yet."""
    return designs.minimal_trunk(revolution=np.radians(100 + k), taper=np.radians(2 + k / 100))


def first_picture(scene: Scene, k: int, quality: Quality) -> dict[str, float]:
    """Seconds until the coarse and the fine picture are ready to be sent."""
    start, taken = time.perf_counter(), {}
    for reach in stages(moved(k), 17, quality, lambda: None):
        scene.draw_cloud(reach, Appearance())
        taken["fine" if reach.fine else "coarse"] = time.perf_counter() - start
        taken["volume " + ("fine" if reach.fine else "coarse")] = reach.volume
    return taken


def arm_updates(scene: Scene, count: int) -> float:
    """Arm updates per second while an activation is dragged."""
    arm = designs.minimal_trunk()
    scene.draw_arm(arm, (0.0, 0.0, 0.0))
    start = time.perf_counter()
    for k in range(count):
        scene.draw_arm(arm, (-1.5 * k / count, -0.2, 0.0))
    return count / (time.perf_counter() - start)


def with_scene(use: Callable[[Scene], None]) -> None:
    """A scene that nobody looks at."""
    server = start_server()
    try:
        use(Scene(server.scene))
    finally:
        stop_server(server)


def test_a_moved_slider(benchmark):
    with_scene(lambda scene: benchmark(first_picture, scene, 1, SMALL))


def test_a_dragged_activation(benchmark):
    with_scene(lambda scene: benchmark(arm_updates, scene, 3))


def main(repeat: int = 5) -> None:
    """Print the table."""

    def measure(scene: Scene) -> None:
        first_picture(scene, 0, Quality())  # compile
        runs = [first_picture(scene, k, Quality()) for k in range(1, repeat + 1)]
        arm_updates(scene, 10)
        rate = max(arm_updates(scene, 60) for _ in range(repeat))
        off = max(abs(r["volume coarse"] / r["volume fine"] - 1) for r in runs)
        print(f"## Studio, server side, the best of {repeat}\n")
        print("| what | measured | wanted |")
        print("|---|--:|--:|")
        coarse, fine = (min(r[stage] for r in runs) for stage in ("coarse", "fine"))
        print(f"| slider to first cloud (65,536 points) and volume | {coarse:.2f} s | < 0.5 s |")
        print(f"| first volume off by | {100 * off:.2g} % | < 2 % |")
        print(f"| slider to fine result (524,288 points, 0.3 %) | {fine:.2f} s | - |")
        print(f"| arm updates while an activation is dragged | {rate:.0f} /s | >= 20 /s |")

    with_scene(measure)


if __name__ == "__main__":
    main()
