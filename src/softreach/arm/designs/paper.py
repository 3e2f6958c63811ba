"""The designs of the paper."""

from __future__ import annotations

import math

from softreach.arm.actuator_checks import FIBER_RANGES
from softreach.arm.actuators import FiberArchitecture
from softreach.arm.checks import PROFILE_RANGES, RING_RANGES
from softreach.arm.manipulator import Manipulator
from softreach.arm.material import Material
from softreach.arm.section import Section
from softreach.support.arguments import checked, instance, optional, within

__all__ = ["minimal_trunk", "redundant_trunk"]

_EXTENT = math.radians(48)

_checked_trunk = checked(
    revolution=within(FIBER_RANGES["revolution"]),
    taper=within(PROFILE_RANGES["taper"]),
    length=within(PROFILE_RANGES["length"]),
    radius_ratio=within(RING_RANGES["inner_ratio"]),
    material=optional(instance(Material, "a Material, or None")),
)


@_checked_trunk
def minimal_trunk(
    revolution: float = math.radians(108),
    taper: float = math.radians(2),
    *,
    length: float = 1.0,
    radius_ratio: float = 0.75,
    material: Material | None = None,
) -> Manipulator:
    """The paper's minimal design: two helical bundles of opposite hand and a longitudinal one.

    [Kaczmarski2024], section 2. The paper prints R1(0) = L/12, which exceeds its R2(0) = L/16;
    12/16 of R2(0) is our reading of that misprint, so `radius_ratio` is a parameter and not the
    paper's value.

    Args:
        revolution: Ω of the right-handed bundle; the left-handed one has -Ω [rad].
        taper: φ [rad].
        length: L [m].
        radius_ratio: R1/R2 [-].
        material: What all of the arm is made of; None for an incompressible one whose Young's
            modulus cancels.
    """
    helices = (
        FiberArchitecture(
            name="left", revolution=-revolution, offset=math.radians(66), extent=_EXTENT
        ),
        FiberArchitecture(
            name="right", revolution=revolution, offset=math.radians(114), extent=_EXTENT
        ),
    )
    return _trunk((*helices, _longitudinal(270)), taper, length, radius_ratio, material)


@_checked_trunk
def redundant_trunk(
    revolution: float = math.radians(108),
    taper: float = math.radians(2),
    *,
    length: float = 1.0,
    radius_ratio: float = 0.75,
    material: Material | None = None,
) -> Manipulator:
    """The paper's redundant design: the longitudinal bundle of `minimal_trunk` split in two.

    [Kaczmarski2024] does not print where the two lie (section 5). Here they have the extent of the
    others and centers at 246° and 294°: adjacent like the helical pair, symmetric about the plane
    of symmetry. At Ω = 108° each then meets a helical bundle near the tip.

    Args:
        revolution: Ω of the right-handed bundle; the left-handed one has -Ω [rad].
        taper: φ [rad].
        length: L [m].
        radius_ratio: R1/R2 [-].
        material: What all of the arm is made of; None for an incompressible one whose Young's
            modulus cancels.
    """
    arm = minimal_trunk(
        revolution, taper, length=length, radius_ratio=radius_ratio, material=material
    )
    pair = (_longitudinal(246, "longitudinal 1"), _longitudinal(294, "longitudinal 2"))
    return arm.replace(actuators=(*arm.actuators[:2], *pair))


def _longitudinal(offset_deg: float, name: str = "longitudinal") -> FiberArchitecture:
    offset = math.radians(offset_deg)
    return FiberArchitecture(name=name, helical_angle=0.0, offset=offset, extent=_EXTENT)


def _trunk(
    fibers: tuple[FiberArchitecture, ...],
    taper: float,
    length: float,
    radius_ratio: float,
    material: Material | None,
) -> Manipulator:
    radius = length / 16
    arm = Manipulator.tapered(
        length=length,
        outer_radius=radius,
        inner_radius=radius_ratio * radius,
        taper=taper,
        poisson_ratio=0.5,
        actuators=fibers,
    )
    if material is None:
        return arm
    (ring,) = arm.section.rings
    return arm.replace(section=Section(rings=(ring.replace(material=material),)))
