"""Named designs, each with its source."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from softreach.arm.actuators import (
    Actuator,
    Chamber,
    FiberArchitecture,
    ObliqueMuscle,
    RadialMuscle,
    Tendon,
)
from softreach.arm.manipulator import Manipulator
from softreach.arm.number import fields_of
from softreach.arm.profile import LinearTaper, Profile
from softreach.arm.section import Material, Ring, Section, named_material
from softreach.support.arguments import as_instance, as_integer, as_number

__all__ = [
    "elephant_trunk",
    "filament",
    "helical_tendon_robot",
    "lce_arm",
    "minimal_trunk",
    "redundant_trunk",
    "three_chamber_arm",
    "three_tendon_robot",
]


def minimal_trunk(
    revolution: float = math.radians(108),
    taper: float = math.radians(2),
    *,
    length: float = 1.0,
    radius_ratio: float = 0.75,
    material: Material | str | None = None,
) -> Manipulator:
    """The paper's minimal design: two helical bundles of opposite hand and a longitudinal one.

    [Kaczmarski2024], section 2. The paper prints R1(0) = L/12, which exceeds its R2(0) = L/16. We
    read 12/16 of R2(0); `radius_ratio` changes this reading, which is not the paper's value.

    Args:
        revolution: Ω of the right-handed bundle; the left-handed one has -Ω [rad].
        taper: φ [rad].
        length: L [m].
        radius_ratio: R1/R2 [-].
        material: Material of all of the arm, also by its name in the library; None for an
            incompressible one whose Young's modulus cancels.
    """
    turn, body = fields_of(FiberArchitecture)["revolution"], fields_of(LinearTaper)
    revolution = as_number("revolution", revolution, turn.allowed)
    taper = as_number("taper", taper, body["taper"].allowed)
    length = as_number("length", length, body["length"].allowed)
    radius_ratio = as_number("radius_ratio", radius_ratio, fields_of(Ring)["inner_ratio"].allowed)
    matter = named_material(material) if isinstance(material, str) else material
    if matter is not None:
        as_instance("material", matter, Material, "a Material, its name, or None")
    left = _fiber("left", 66, revolution=-revolution)
    right = _fiber("right", 114, revolution=revolution)
    profile = LinearTaper(length=length, outer_radius=length / 16, taper=taper)
    ring = Ring(inner_ratio=radius_ratio, material=Material() if matter is None else matter)
    return _arm(profile, (left, right, _fiber("longitudinal", 270, helical_angle=0.0)), ring)


def redundant_trunk(
    revolution: float = math.radians(108),
    taper: float = math.radians(2),
    *,
    length: float = 1.0,
    material: Material | str | None = None,
) -> Manipulator:
    """The paper's redundant design: the longitudinal bundle of `minimal_trunk` split in two.

    [Kaczmarski2024] does not print where the two lie (section 5). Here they have the extent of the
    others and centers at 246° and 294°: adjacent like the helical pair, symmetric about the plane
    of symmetry. At Ω = 108° each then meets a helical bundle near the tip.

    Args:
        revolution: Ω of the right-handed bundle; the left-handed one has -Ω [rad].
        taper: φ [rad].
        length: L [m].
        material: Material of all of the arm, also by its name in the library; None for an
            incompressible one whose Young's modulus cancels.
    """
    arm = minimal_trunk(revolution, taper, length=length, material=material)
    angles = {"longitudinal 1": 246, "longitudinal 2": 294}
    pair = (_fiber(name, angle, helical_angle=0.0) for name, angle in angles.items())
    return arm.replace(actuators=(*arm.actuators[:2], *pair))


def _fiber(name: str, offset_deg: float, **others: Any) -> FiberArchitecture:
    """A fiber of 48°."""
    offset = math.radians(offset_deg)
    return FiberArchitecture(name=name, offset=offset, extent=math.radians(48), **others)


def _arm(
    profile: Profile, actuators: tuple[Actuator, ...], *rings: Ring, core: Material | None = None
) -> Manipulator:
    section = Section(rings=rings, core=core)
    return Manipulator(profile=profile, section=section, actuators=actuators)


_LCE_LENGTH = 0.09  # m
_LCE_FAMILIES = (("left", -108, 66), ("right", 108, 114), ("longitudinal", 0, 270))  # Ω, θ0 [deg]


def lce_arm() -> Manipulator:
    """The laboratory's arm: three fibers of liquid-crystal elastomer on a soft core.

    The released code of [Veil2025]; the robot is that of [Leanza2024]. Three rings in the same
    place stand for the three families of fibers in one layer, each with 48°/360° of their Young's
    modulus. The code multiplies activations in [-5/3, 0] by 3 to compensate; here they are in
    [-5, 0]. A third of the one density, 1000 kg/m³, goes to each ring.
    """
    fibers = named_material("liquid_crystal_elastomer")
    share = math.radians(48) / (2 * math.pi)
    matter = fibers.replace(
        young_modulus=share * (fibers.young_modulus or 0.0),
        density=(fibers.density or 0.0) / len(_LCE_FAMILIES),
        name="fibers",
    )
    core = Material(young_modulus=0.1278e6, poisson_ratio=0.5, density=1000.0, name="core")
    rings = (Ring(inner_ratio=5 / 6, material=matter, name=name) for name, _, _ in _LCE_FAMILIES)
    bounds = (-5.0, 0.0)
    actuators = tuple(
        _fiber(name, offset, ring=name, revolution=math.radians(turn), activation_bounds=bounds)
        for name, turn, offset in _LCE_FAMILIES
    )
    profile = LinearTaper(length=_LCE_LENGTH, outer_radius=_LCE_LENGTH / 20)
    return _arm(profile, actuators, *rings, core=core)


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
    ring = Ring(inner_ratio=0.6, material=matter, name="fibers")
    return _arm(LinearTaper(length=1.0, outer_radius=1 / 16), (sectors,), ring)


def three_tendon_robot(*, segments: int = 1) -> Manipulator:
    """A nitinol wire of 0.2 m a segment with three parallel tendons for each.

    The numbers are those of the code published with [Rao2021], whose robot has two segments: wire
    of radius 0.7 mm, tendons at 10 mm from its axis and at 90°, 210° and 330°. Its spacer disks add
    neither stiffness nor weight here. Its example has a tension of 8 N; the range [0, 8] N of each
    tendon is our choice.

    Args:
        segments: 1 or 2; the tendons of the first end where the second begins.

    Raises:
        InvalidInput: Another number of segments.
    """
    segments = as_integer("segments", segments, 1, 2)
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
    wire = Ring(inner_ratio=0.0, material=named_material("nitinol_backbone"), name="backbone")
    return _arm(LinearTaper(length=0.2 * segments, outer_radius=0.0007), tendons, wire)


def helical_tendon_robot() -> Manipulator:
    """A steel wire with four tendons that wind once around it from base to tip.

    The static example of the code published with [Till2019], after the robot of [Rucker2011]: 0.5 m
    of wire of radius 1 mm, tendons at 15.06 mm from its axis, one of them under 15 N. The range
    [0, 15] N of each tendon is our choice. The gravity of the example is left out.
    """
    steel = Material(young_modulus=200e9, poisson_ratio=0.25, density=8000.0, name="steel")
    tendons = Tendon(
        name="tendon",
        bundles=4,
        distance=0.01506,
        revolution=2 * math.pi,
        activation_bounds=(0.0, 15.0),
    )
    wire = Ring(inner_ratio=0.0, material=steel, name="backbone")
    return _arm(LinearTaper(length=0.5, outer_radius=0.001), (tendons,), wire)


def three_chamber_arm() -> Manipulator:
    """A silicone cylinder with three reinforced pressure chambers along it.

    After the STIFF-FLOP manipulator, [Cianchetti2014] and [Ranzani2015]: Ecoflex 00-50 with three
    chambers that do not balloon. Its modules are 50 mm long and 25 to 32 mm wide; here three of
    them, 25 mm wide, act as one. The radius of the chambers (4 mm), their distance from the axis
    (7.5 mm) and the pressures in [0, 100] kPa are our choice. The stiffness is that of the full
    cylinder.
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
    return _arm(LinearTaper(length=0.15, outer_radius=0.0125), (chambers,), silicone)


_TRUNK_LENGTH, _TRUNK_BASE, _TRUNK_TIP = 1.8, 0.18, 0.05  # m
_TRUNK_RINGS = (("inner", 0.2, 0.4), ("middle", 0.4, 0.7), ("outer", 0.7, 1.0))  # radii over R2
_TRUNK_DORSAL, _TRUNK_VENTRAL = (270.0, 342.0), (20.0, 90.0)  # where muscles of the right lie [deg]
_TRUNK_GROUPS = (
    ("dorsal longitudinal", "outer", _TRUNK_DORSAL, 0),
    ("outer oblique", "outer", _TRUNK_VENTRAL, -30),
    ("inner oblique", "middle", _TRUNK_VENTRAL, 30),
    ("dorsal radial", "inner", _TRUNK_DORSAL, None),
    ("ventral radial", "inner", _TRUNK_VENTRAL, None),
)
"""Name, ring, sector, and angle of the fibers of muscles on the right [deg]."""


def elephant_trunk() -> Manipulator:
    """An elephant's trunk: longitudinal, oblique and radial muscles, each on the right and left.

    The groups of muscles are those of [KaczmarskiTrunk2025]: dorsal longitudinal, outer and inner
    ventral oblique of opposite hand, dorsal and ventral radial. The sectors do not wind, and the
    section is homogeneous. Young's modulus is the apparent one of [Wilson1991], the density that of
    muscle, [MendezKeys1960]. Lengths, radii, sectors, the obliques' angle of 30° and the bounds
    [-0.5, 0] were not published and are our choice. Dorsal is -y, ventral +y, and right is +x.
    """
    matter = named_material("elephant_trunk")
    rings = tuple(
        Ring(inner_ratio=inner, outer_ratio=outer, material=matter, name=name)
        for name, inner, outer in _TRUNK_RINGS
    )
    taper = math.atan((_TRUNK_BASE - _TRUNK_TIP) / _TRUNK_LENGTH)
    profile = LinearTaper(length=_TRUNK_LENGTH, outer_radius=_TRUNK_BASE, taper=taper)
    return _arm(profile, tuple(_muscles()), *rings)


def _muscles() -> Iterator[Actuator]:
    for group, ring, (start, end), angle in _TRUNK_GROUPS:
        middle, extent = (start + end) / 2, math.radians(end - start)
        for side, offset, hand in (("right", middle, 1), ("left", (180.0 - middle) % 360.0, -1)):
            sector: dict[str, Any] = {
                "name": f"{group} {side}",
                "ring": ring,
                "extent": extent,
                "offset": math.radians(offset),
                "activation_bounds": (-0.5, 0.0),
            }
            if angle is None:
                yield RadialMuscle(**sector)
            else:
                yield ObliqueMuscle(helical_angle=math.radians(hand * angle), **sector)
