"""Muscular hydrostats: arms that are all muscle."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from softreach.arm.actuators import Actuator, ObliqueMuscle, RadialMuscle
from softreach.arm.manipulator import Manipulator
from softreach.arm.materials import named_material
from softreach.arm.profile import LinearTaper
from softreach.arm.section import Ring, Section

__all__ = ["elephant_trunk"]

_LENGTH, _BASE, _TIP = 1.8, 0.18, 0.05  # m
_RINGS = (("inner", 0.2, 0.4), ("middle", 0.4, 0.7), ("outer", 0.7, 1.0))  # radii over R2
_DORSAL, _VENTRAL = (270.0, 342.0), (20.0, 90.0)  # where muscles of the right lie [deg]
_OBLIQUE = 30.0  # deg
_BOUNDS = (-0.5, 0.0)


def elephant_trunk() -> Manipulator:
    """An elephant's trunk: longitudinal, oblique and radial muscles, each on the right and left.

    The groups of muscles are those of [KaczmarskiTrunk2025]: dorsal longitudinal, outer and inner
    ventral oblique of opposite hand, dorsal and ventral radial; the sectors do not wind, and the
    section is homogeneous. Young's modulus is the apparent one of [Wilson1991], the density that of
    muscle, [MendezKeys1960]. Lengths, radii, sectors, angles and bounds were not published: those
    here are ours. The trunk is 1.8 m long and tapers from 0.18 to 0.05 m; the obliques run at 30°;
    γ is in [-0.5, 0]. Dorsal is -y, ventral +y, and right is +x.
    """
    matter = named_material("elephant_trunk")
    rings = tuple(
        Ring(inner_ratio=inner, outer_ratio=outer, material=matter, name=name)
        for name, inner, outer in _RINGS
    )
    taper = math.atan((_BASE - _TIP) / _LENGTH)
    return Manipulator(
        profile=LinearTaper(length=_LENGTH, outer_radius=_BASE, taper=taper),
        section=Section(rings=rings),
        actuators=tuple(_muscles()),
    )


def _muscles() -> Iterator[Actuator]:
    """Each group on the right and, mirrored at x = 0, on the left."""
    for side in (1, -1):
        yield _oblique("dorsal longitudinal", "outer", _DORSAL, side, 0.0)
    for side in (1, -1):
        yield _oblique("outer oblique", "outer", _VENTRAL, side, -side * _OBLIQUE)
    for side in (1, -1):
        yield _oblique("inner oblique", "middle", _VENTRAL, side, side * _OBLIQUE)
    for group, sector in (("dorsal radial", _DORSAL), ("ventral radial", _VENTRAL)):
        for side in (1, -1):
            yield RadialMuscle(name=_name(group, side), ring="inner", **_place(sector, side))


def _oblique(
    group: str, ring: str, sector: tuple[float, float], side: int, angle_deg: float
) -> ObliqueMuscle:
    angle = math.radians(angle_deg)
    return ObliqueMuscle(
        name=_name(group, side), ring=ring, helical_angle=angle, **_place(sector, side)
    )


def _name(group: str, side: int) -> str:
    return f"{group} {'right' if side > 0 else 'left'}"


def _place(sector: tuple[float, float], side: int) -> dict[str, Any]:
    """Where a muscle lies on the right (1), or mirrored on the left (-1), and its bounds."""
    start, end = sector
    middle = (start + end) / 2
    return {
        "offset": math.radians(middle if side > 0 else (180.0 - middle) % 360.0),
        "extent": math.radians(end - start),
        "activation_bounds": _BOUNDS,
    }
