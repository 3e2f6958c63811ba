"""An arm for each kind of actuator, and one in which they, rings and a bent profile meet."""

import numpy as np

from softreach.arm import (
    Chamber,
    Drive,
    FiberArchitecture,
    LinearTaper,
    Manipulator,
    Material,
    ObliqueMuscle,
    PiecewiseTaper,
    RadialMuscle,
    Ring,
    Samples,
    Section,
    Tendon,
)

__all__ = ["MADE_ARMS", "antagonists", "mixed_arm", "one_ring_arm"]

SOFT = Material(young_modulus=7e4, name="soft")
STIFF = Material(young_modulus=6e5, poisson_ratio=0.45, name="stiff")
FIRM = Material(young_modulus=2e5)


def one_ring_arm(*actuators, length=0.3, radius=0.02, **section):
    """A cylinder of one material."""
    rings = section.pop("rings", (Ring(inner_ratio=0.6, material=SOFT),))
    return Manipulator(
        profile=LinearTaper(length=length, outer_radius=radius),
        section=Section(rings=rings, **section),
        actuators=actuators,
    )


def antagonists(name, pulls, releases, *, gain=1.0, offset=0.0, **others):
    """A drive that pulls one bundle and releases another."""
    offsets = {pulls: offset, releases: offset} if offset else {}
    return Drive(name=name, gains={pulls: gain, releases: -gain}, offsets=offsets, **others)


def mixed_arm():
    """Three overlapping rings, a bore, kinks, stretches, and an actuator of every kind."""
    rings = (
        Ring(inner_ratio=0.45, outer_ratio=0.7, material=STIFF, name="inner"),
        Ring(inner_ratio=0.6, outer_ratio=0.85, material=FIRM, name="middle"),
        Ring(inner_ratio=0.85, material=SOFT, name="skin"),
    )
    angle = Samples(stations_over_length=(0, 0.5, 1), values=(0.2, 0.6, 0.1))
    distance = Samples(stations_over_length=(0, 0.5, 1), values=(0.03, 0.012, 0.006))
    routing = Samples(stations_over_length=(0, 0.4, 1), values=(0, 1, 0))
    right = FiberArchitecture(name="right", ring="skin", helical_angle=angle, extent=0.7)
    right = right.replace(end_over_length=0.62)
    other_end = {"start_over_length": 0.21, "end_over_length": 1.0}
    channel = Chamber(distance_ratio=0.28, radius_ratio=0.12, activation_bounds=(0, 2e4))
    actuators = (
        right,
        right.replace(name="left", revolution=-2.0, offset=0.9, **other_end),
        ObliqueMuscle(name="oblique", ring="inner", helical_angle=-0.5, extent=1.1, offset=2.5),
        RadialMuscle(name="radial", ring="middle", extent=1.0, offset=3.2),
        Tendon(
            name="cable", distance=distance, routing=routing, offset=5.0, activation_bounds=(0, 2)
        ),
        channel.replace(name="channel", offset=4.7, start_over_length=0.1, end_over_length=0.8),
    )
    return Manipulator(
        profile=PiecewiseTaper(
            length=0.3, stations_over_length=(0, 0.3, 0.45, 1), radii=(0.02, 0.02, 0.013, 0.008)
        ),
        section=Section(rings=rings, core=SOFT, bore_ratio=0.1),
        actuators=actuators,
    )


def _tendon_arm():
    """A thin backbone with two segments, and tendons on disks."""
    distal = Tendon(name="distal", distance=0.01, bundles=3, activation_bounds=(0, 0.1))
    proximal = distal.replace(name="proximal", offset=np.pi / 3, end_over_length=0.5)
    rings = (Ring(inner_ratio=0, material=STIFF),)
    return one_ring_arm(distal, proximal, radius=0.001, rings=rings)


MADE_ARMS = {
    "fiber": lambda: one_ring_arm(FiberArchitecture(bundles=3, helical_angle=0.4, extent=0.6)),
    "oblique": lambda: one_ring_arm(ObliqueMuscle(bundles=2, helical_angle=0.4, extent=1.0)),
    "radial": lambda: one_ring_arm(RadialMuscle(extent=2 * np.pi)),
    "tendon": _tendon_arm,
    "chamber": lambda: one_ring_arm(
        Chamber(bundles=3, distance_ratio=0.6, radius=0.006, activation_bounds=(0, 1e4))
    ),
    "chamber on the axis": lambda: one_ring_arm(
        Chamber(distance=0.0, radius_ratio=0.3, activation_bounds=(0, 1e4))
    ),
    "mixed": mixed_arm,
}
"""Makers, as an arm is checked when it is made."""
