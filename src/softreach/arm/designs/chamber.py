"""Pneumatic arms."""

from __future__ import annotations

import math

from softreach.arm.actuators import Chamber
from softreach.arm.manipulator import Manipulator
from softreach.arm.materials import named_material
from softreach.arm.profile import LinearTaper
from softreach.arm.section import Ring, Section

__all__ = ["three_chamber_arm"]


def three_chamber_arm() -> Manipulator:
    """A silicone cylinder with three reinforced pressure chambers along it.

    After the STIFF-FLOP manipulator, [Cianchetti2014] and [Ranzani2015]: Ecoflex 00-50, three
    chambers 120° apart, kept from ballooning. Its modules are 50 mm long and 25 to 32 mm wide; here
    three modules, 0.15 m, act as one and are 25 mm wide. The chambers' radius of 4 mm, their
    distance of 7.5 mm from the axis and the pressures in [0, 100] kPa are our choice, and the
    stiffness is that of the full cylinder.
    """
    silicone = Ring(inner_ratio=0.0, material=named_material("ecoflex_00_50"), name="body")
    chambers = Chamber(
        name="chamber",
        bundles=3,
        distance=0.0075,
        radius=0.004,
        offset=math.pi / 2,
        activation_bounds=(0.0, 100e3),
    )
    return Manipulator(
        profile=LinearTaper(length=0.15, outer_radius=0.0125),
        section=Section(rings=(silicone,)),
        actuators=(chambers,),
    )
