"""Steps of arms as they are made: how many breakpoints they have, and what these cost."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import softreach as sr
from softreach import designs
from softreach.arm import (
    Actuator,
    Chamber,
    FiberArchitecture,
    LinearTaper,
    Manipulator,
    Material,
    Pieces,
    PiecewiseTaper,
    Profile,
    Ring,
    SampledTaper,
    Samples,
    Section,
    Tendon,
)
from softreach.rod.free import FreeRod

RUBBER = Material(young_modulus=1e6, poisson_ratio=0.45)
SECTION = Section(
    rings=(Ring(inner_ratio=0.75, material=RUBBER),), core=Material(young_modulus=3e5)
)
TOLERANCES = (1e-4, 1e-6, 1e-9)


def main() -> None:
    """Print the table."""
    print("## Steps of arms with segments\n")
    print(
        "Steps of the sixth-order rule from base to tip for a tolerance of the tip [L], and CPU "
        "time of 1,000,000 tips\nat 1e-6. Wherever the arm is not smooth a step ends: profile, "
        "angles, routing, ends of segments. An arm of n\nbreakpoints so takes at most n steps "
        "more than its bending asks for.\n"
    )
    print("| arm | bundles | breakpoints | 1e-4 | 1e-6 | 1e-9 | 1,000,000 tips [s] |")
    print("|---|--:|--:|--:|--:|--:|--:|")
    for name, arm in arms().items():
        steps = " | ".join(str(step_count(arm, tol)) for tol in TOLERANCES)
        print(f"| {name} | {arm.bundles} | {len(arm.breakpoints)} | {steps} | {tips(arm):.2f} |")


def step_count(arm: Manipulator, tol: float) -> int:
    """Steps from base to tip, those that breakpoints add among them."""
    rod = FreeRod(arm, tol)
    return len(rod.rule.edges(rod.steps)) - 1


def tips(arm: Manipulator) -> float:
    """CPU time of a million tips [s], the least of three."""
    low, high = arm.bounds.T
    gamma = low + np.random.default_rng(0).random((1_000_000, arm.bundles)) * (high - low)
    sr.tip_positions(arm, gamma[:10])
    return min(_cpu(arm, gamma) for _ in range(3))


def _cpu(arm: Manipulator, gamma: np.ndarray) -> float:
    start = time.process_time()
    sr.tip_positions(arm, gamma)
    return time.process_time() - start


def arms() -> dict[str, Manipulator]:
    """The paper's trunk, and arms in which it would not be recognized."""
    trunk = designs.minimal_trunk()
    line = trunk.profile.radius
    return {
        "the paper's trunk": trunk,
        "with its radius in three pieces": trunk.replace(profile=_radii(PiecewiseTaper, line)),
        "with its radius through four samples": trunk.replace(profile=_radii(SampledTaper, line)),
        "two segments of three fibers": _arm(*_segments(2)),
        "four segments of three fibers": _arm(*_segments(4)),
        "fibers whose angle changes": _arm(*_winding()),
        "three tendons": _arm(_tendons(0.0, 1.0)),
        "three tendons, three more to the middle": _arm(_tendons(0.0, 1.0), _tendons(0.0, 0.5)),
        "three chambers above three tendons": _arm(_tendons(0.0, 0.5), _chambers()),
    }


def _radii(kind: Callable[..., Profile], radius: Callable[..., Any]) -> Profile:
    places = (0.0, 0.3, 0.6, 1.0)
    return kind(length=1.0, stations_over_length=places, radii=tuple(radius(places)))


def _arm(*actuators: Actuator) -> Manipulator:
    profile = LinearTaper(length=1.0, outer_radius=1 / 16, taper=math.radians(1))
    return Manipulator(profile=profile, section=SECTION, actuators=actuators)


def _segments(count: int) -> list[FiberArchitecture]:
    return [
        FiberArchitecture(
            name=f"segment {k + 1}",
            revolution=1.0,
            extent=0.8,
            bundles=3,
            start_over_length=k / count,
            end_over_length=(k + 1) / count,
            activation_bounds=(-1.0, 0.0),
        )
        for k in range(count)
    ]


def _winding() -> list[FiberArchitecture]:
    curved = Samples(stations_over_length=(0, 0.25, 0.5, 1), values=(0.0, 0.3, -0.3, 0.0))
    pieces = Pieces(stations_over_length=(0, 0.4, 1), values=(0.2, -0.2))
    return [
        FiberArchitecture(
            helical_angle=angle, extent=0.8, offset=offset, activation_bounds=(-1.0, 0.0)
        )
        for angle, offset in ((curved, 0.0), (pieces, 2.0), (0.0, 4.0))
    ]


def _tendons(start: float, end: float) -> Tendon:
    return Tendon(
        name=f"to {100 * end:g} % of L",
        bundles=3,
        distance_ratio=0.9,
        start_over_length=start,
        end_over_length=end,
        activation_bounds=(0.0, 200.0),
    )


def _chambers() -> Chamber:
    return Chamber(
        bundles=3,
        distance_ratio=0.5,
        radius_ratio=0.2,
        start_over_length=0.5,
        activation_bounds=(0.0, 5e5),
    )
