"""The studio: from a moved slider to what the page is sent, and to what a browser has of it.

`python -m benchmarks.bench_studio` prints Markdown tables; under pytest the server's work runs
small. The browser's own drawing is in none of them.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest

pytest.importorskip("viser", reason="the studio needs viser")

from benchmarks.studio_tab import print_latencies
from softreach import tip_positions
from softreach.arm import designs
from softreach.arm.manipulator import Manipulator
from softreach.inverse.path import Drag
from softreach.studio.reach import Quality, stages
from softreach.studio.scene.scene import Scene
from softreach.studio.serve import start_server, stop_server
from softreach.studio.state import Appearance

SMALL = Quality(coarse_level=10, fine_level=12, coarse_accuracy=0.1, fine_accuracy=0.05)


def moved(k: int) -> Manipulator:
    """A design that nothing is known of yet."""
    return designs.minimal_trunk(revolution=np.radians(100 + k), taper=np.radians(2 + k / 100))


class Cost(NamedTuple):
    """Of a piece of work."""

    wall: float
    """[s]."""
    cpu: float
    """[s], of all threads."""
    volume: float = np.nan
    """[L³]."""


def first_picture(
    scene: Scene, arm: Manipulator, quality: Quality, level: int = 17
) -> dict[str, Cost]:
    """What it costs until the coarse and the fine picture are ready to be sent."""
    wall, cpu, taken = time.perf_counter(), time.process_time(), {}
    for reach in stages(arm, level, quality, lambda: None):
        scene.draw_cloud(reach, Appearance(level=level))
        spent = time.perf_counter() - wall, time.process_time() - cpu
        taken["fine" if reach.fine else "coarse"] = Cost(*spent, reach.volume)
    return taken


def arm_updates(scene: Scene, count: int) -> Cost:
    """What one update of the arm costs while an activation is dragged."""
    arm = designs.minimal_trunk()
    scene.draw_arm(arm, (0.0, 0.0, 0.0))
    wall, cpu = time.perf_counter(), time.process_time()
    for k in range(count):
        scene.draw_arm(arm, (-1.5 * k / count, -0.2, 0.0))
    return Cost((time.perf_counter() - wall) / count, (time.process_time() - cpu) / count)


def tip_drags(scene: Scene, count: int) -> Cost:
    """What one update of the arm costs while its tip is dragged along its branch."""
    arm, activation = designs.minimal_trunk(), (-0.7, -0.4, -0.9)
    drag = Drag(arm)
    begin, end = tip_positions(arm, [activation, (-0.6, -0.55, -0.8)])
    wall, cpu = time.perf_counter(), time.process_time()
    for share in np.linspace(0, 1, count):
        dragged = drag.to(activation, begin + share * (end - begin))
        assert dragged is not None
        activation = dragged.activation
        scene.draw_arm(arm, activation)
    return Cost((time.perf_counter() - wall) / count, (time.process_time() - cpu) / count)


def with_scene(use: Callable[[Scene], None]) -> None:
    """A scene that nobody looks at."""
    server = start_server()
    try:
        use(Scene(server.scene))
    finally:
        stop_server(server)


def test_a_moved_slider(benchmark):
    with_scene(lambda scene: benchmark(first_picture, scene, moved(1), SMALL, 14))


def test_a_dragged_activation(benchmark):
    with_scene(lambda scene: benchmark(arm_updates, scene, 3))


def test_a_dragged_tip(benchmark):
    with_scene(lambda scene: benchmark(tip_drags, scene, 3))


def main(repeat: int = 5) -> None:
    """Print the tables."""
    with_scene(lambda scene: print_table(scene, repeat))
    print_latencies(repeat)


def print_table(scene: Scene, repeat: int) -> None:
    """The best of several runs, each of a design that nothing is known of yet."""
    first_picture(scene, moved(0), Quality())  # compile
    first_picture(scene, designs.redundant_trunk(), SMALL, 14)
    runs = [first_picture(scene, moved(k), Quality()) for k in range(1, repeat + 1)]
    off = max(abs(run["coarse"].volume / run["fine"].volume - 1) for run in runs)
    four = first_picture(scene, designs.redundant_trunk(), Quality())
    arm_updates(scene, 10)
    arm = best([arm_updates(scene, 60) for _ in range(repeat)])
    tip_drags(scene, 3)
    dragged = best([tip_drags(scene, 60) for _ in range(repeat)])
    print(f"## Studio, server side: the best of {repeat}, minimal trunk\n")
    print("| what | wall [s] |")
    print("|---|--:|")
    row("slider to first cloud (65,536 points) and volume", best([r["coarse"] for r in runs]))
    row("slider to fine result (524,288 points, 0.3 %)", best([r["fine"] for r in runs]))
    row("first cloud and volume with four bundles, once", four["coarse"])
    row("fine result with four bundles, once", four["fine"])
    row("update of the arm while an activation is dragged", arm)
    row("update of the arm while its tip is dragged", dragged)
    print(f"\nThe first volume is off by {100 * off:.2g} % at most.\n")


def best(costs: list[Cost]) -> Cost:
    """The least of each, as other work on the machine only adds."""
    return Cost(min(cost.wall for cost in costs), min(cost.cpu for cost in costs))


def row(what: str, cost: Cost) -> None:
    """One line of the table."""
    print(f"| {what} | {cost.wall:.3f} |")


if __name__ == "__main__":
    main()
