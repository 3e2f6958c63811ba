"""The arm of liquid-crystal elastomer of the theory's authors."""

from __future__ import annotations

import math

from softreach.arm.actuators import FiberArchitecture
from softreach.arm.manipulator import Manipulator
from softreach.arm.material import Material
from softreach.arm.materials import named_material
from softreach.arm.profile import LinearTaper
from softreach.arm.section import Ring, Section

__all__ = ["lce_arm"]

_LENGTH = 0.09  # m
_EXTENT = math.radians(48)
_FAMILIES = (("left", -108, 66), ("right", 108, 114), ("longitudinal", 0, 270))  # Ω, θ0 [deg]


def lce_arm() -> Manipulator:
    """The laboratory's arm: three fibers of liquid-crystal elastomer on a soft core.

    [Veil2025], its released code; the robot itself is that of [Leanza2024]. The laboratory models
    the three families of fibers in one layer by three rings in the same place, each with the share
    48°/360° of the fibers' Young's modulus, and multiplies its activations in [-5/3, 0] by 3 to
    make up for it. The activations here are the multiplied ones, in [-5, 0]. The source has one
    density, 1000 kg/m³, for all of the arm; here a third of it goes to each of the three rings.
    """
    fibers = named_material("liquid_crystal_elastomer")
    share = _EXTENT / (2 * math.pi)
    matter = fibers.replace(
        young_modulus=share * (fibers.young_modulus or 0.0),
        density=(fibers.density or 0.0) / len(_FAMILIES),
        name="fibers",
    )
    core = Material(young_modulus=0.1278e6, poisson_ratio=0.5, density=1000.0, name="core")
    rings = tuple(Ring(inner_ratio=5 / 6, material=matter, name=name) for name, _, _ in _FAMILIES)
    return Manipulator(
        profile=LinearTaper(length=_LENGTH, outer_radius=_LENGTH / 20),
        section=Section(rings=rings, core=core),
        actuators=tuple(_fiber(*family) for family in _FAMILIES),
    )


def _fiber(name: str, revolution_deg: float, offset_deg: float) -> FiberArchitecture:
    return FiberArchitecture(
        name=name,
        ring=name,
        revolution=math.radians(revolution_deg),
        offset=math.radians(offset_deg),
        extent=_EXTENT,
        activation_bounds=(-5.0, 0.0),
    )
