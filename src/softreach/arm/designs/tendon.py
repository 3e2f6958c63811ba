"""Continuum robots: a thin elastic backbone and tendons that disks hold away from it."""

from __future__ import annotations

import math

from softreach.arm.actuators import Tendon
from softreach.arm.manipulator import Manipulator
from softreach.arm.material import Material
from softreach.arm.materials import named_material
from softreach.arm.profile import LinearTaper
from softreach.arm.section import Ring, Section
from softreach.support.arguments import checked, whole

__all__ = ["helical_tendon_robot", "three_tendon_robot"]


@checked(segments=whole(1, 2))
def three_tendon_robot(*, segments: int = 1) -> Manipulator:
    """A nitinol wire of 0.2 m a segment with three parallel tendons for each.

    The numbers are those of the code published with [Rao2021], whose robot has two segments: wire
    of radius 0.7 mm, tendons at 10 mm from its axis and at 90°, 210° and 330°. Its spacer disks add
    neither stiffness nor weight here. The tension of its example is 8 N; that [0, 8] N is the range
    of each tendon is our choice.

    Args:
        segments: 1 or 2; the tendons of the first end where the second begins.

    Raises:
        InvalidInput: Another number of segments.
    """
    names = ("tendon",) if segments == 1 else ("proximal", "distal")
    tendons = tuple(
        Tendon(
            name=name,
            bundles=3,
            distance=0.01,
            offset=math.pi / 2,
            end_over_length=(place + 1) / segments,
            activation_bounds=(0.0, 8.0),
        )
        for place, name in enumerate(names)
    )
    return _backbone(0.2 * segments, 0.0007, named_material("nitinol_backbone"), tendons)


def helical_tendon_robot() -> Manipulator:
    """A steel wire with four tendons that wind once around it from base to tip.

    The static example of the code published with [Till2019], after the robot of [Rucker2011]: 0.5 m
    of wire of radius 1 mm, tendons at 15.06 mm from its axis, one of them under 15 N. That
    [0, 15] N is the range of each tendon is our choice. The example's gravity is not part of it.
    """
    steel = Material(young_modulus=200e9, poisson_ratio=0.25, density=8000.0, name="steel")
    tendons = Tendon(
        name="tendon",
        bundles=4,
        distance=0.01506,
        revolution=2 * math.pi,
        activation_bounds=(0.0, 15.0),
    )
    return _backbone(0.5, 0.001, steel, (tendons,))


def _backbone(
    length: float, radius: float, matter: Material, tendons: tuple[Tendon, ...]
) -> Manipulator:
    """A solid round wire."""
    wire = Ring(inner_ratio=0.0, material=matter, name="backbone")
    return Manipulator(
        profile=LinearTaper(length=length, outer_radius=radius),
        section=Section(rings=(wire,)),
        actuators=tendons,
    )
