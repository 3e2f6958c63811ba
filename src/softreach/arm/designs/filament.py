"""The filament that ActiveFilaments.jl introduces itself with."""

from __future__ import annotations

import math

from softreach.arm.actuators import FiberArchitecture
from softreach.arm.manipulator import Manipulator
from softreach.arm.material import Material
from softreach.arm.profile import LinearTaper
from softreach.arm.section import Ring, Section

__all__ = ["filament"]


def filament() -> Manipulator:
    """One ring of three helical sectors: the example of [ActiveFilamentsJl].

    All numbers are those of its README: L = 1 m, R2 = L/16, R1 = 0.6 R2, α = π/10, sectors of 30°.
    """
    matter = Material(young_modulus=1e6, poisson_ratio=0.5, density=1000.0, name="filament")
    sectors = FiberArchitecture(
        name="sector",
        bundles=3,
        helical_angle=math.pi / 10,
        extent=math.radians(30),
        activation_bounds=((-2.4, 0.0), (-2.0, 0.0), (-2.7, 0.0)),
    )
    return Manipulator(
        profile=LinearTaper(length=1.0, outer_radius=1 / 16),
        section=Section(rings=(Ring(inner_ratio=0.6, material=matter, name="fibers"),)),
        actuators=(sectors,),
    )
