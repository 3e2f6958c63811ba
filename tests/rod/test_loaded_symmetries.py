"""What turns, mirrors or scales an arm together with its loads does the same to its shape."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest

from softreach.arm import designs
from softreach.arm.loads import Loads, PointLoad
from softreach.rod.loaded.solver import Solver
from softreach.rod.loaded.tables import ArmBody, Body, LoadTables
from tests.bodies import rubber

TRUNK = designs.minimal_trunk()
GAMMA = np.array([[-1.2, -0.3, -0.8], [-0.2, -1.5, 0.0], [-1.6, -1.6, -1.6], [0.0, 0.0, -0.4]])
KINDS = {
    "one direction": Loads(gravity=(9.81, 0.0, 0.0), payload=0.2, payload_arm=(0.0, 0.0, 0.05)),
    "any": Loads(
        gravity=(6.0, 0.0, -6.0),
        tip_force=(0.0, 2.0, 1.0),
        tip_moment=(0.1, 0.2, -0.3),
        follower_force=(0.0, 0.5, -1.0),
        follower_moment=(0.1, 0.0, 0.2),
        point_loads=(PointLoad(station=0.6, force=(0.0, 1.0, 0.0), moment=(0.0, 0.1, 0.1)),),
        force_per_length=(0.0, 1.0, 0.5),
    ),
}
of_kinds = pytest.mark.parametrize("loads", KINDS.values(), ids=KINDS.keys())


def tips(arm, loads, young=1e6, gamma=GAMMA):
    arm = rubber(arm, loads, young)
    return Solver(LoadTables(arm, loads, ArmBody(arm)), 24, 1e-9).find(gamma).tips


def changed(loads, change):
    """Loads whose vectors were changed: change(value, unit) with the unit's name."""
    units = dict.fromkeys(("tip_force", "follower_force"), "N")
    units |= dict.fromkeys(("tip_moment", "follower_moment"), "N m")
    units |= {"gravity": "m/s²", "payload_arm": "m", "force_per_length": "N/m"}
    values = {name: change(np.array(getattr(loads, name)), unit) for name, unit in units.items()}
    points = tuple(
        replace(
            one, force=change(np.array(one.force), "N"), moment=change(np.array(one.moment), "N m")
        )
        for one in loads.point_loads
    )
    return loads.replace(point_loads=points, **values)


@of_kinds
def test_turning_the_actuators_and_the_loads_about_the_base_turns_the_tips(loads):
    """Directors turn with the actuators, so that what is told in them turns too."""
    angle = 0.7
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    turned = tuple(a.replace(offset=a.offset + angle) for a in TRUNK.actuators)
    found = tips(TRUNK.replace(actuators=turned), changed(loads, lambda v, _: turn @ v))
    np.testing.assert_allclose(found, tips(TRUNK, loads) @ turn.T, atol=2e-9)


@of_kinds
def test_mirroring_the_loads_mirrors_the_tips_of_mirrored_activations(loads):
    """In the plane of symmetry x = 0; moments are mirrored as axial vectors."""
    mirror = np.array([-1.0, 1.0, 1.0])

    def mirrored(vector, unit):
        return -mirror * vector if unit == "N m" else mirror * vector

    found = tips(TRUNK, changed(loads, mirrored), gamma=GAMMA[:, [1, 0, 2]].copy())
    np.testing.assert_allclose(found, tips(TRUNK, loads) * mirror, atol=2e-9)


@of_kinds
def test_loads_in_proportion_to_young_s_modulus_leave_the_tips_where_they_are(loads):
    """A factor of gravity is one of weights."""
    stiffer = changed(loads, lambda v, unit: v if unit == "m" else 8.0 * v)
    np.testing.assert_allclose(tips(TRUNK, stiffer, young=8e6), tips(TRUNK, loads), atol=2e-9)


@of_kinds
def test_an_arm_of_another_size_with_loads_to_match_has_the_same_shape(loads):
    """Stresses are the same where forces grow as the square of the size, and gravity falls."""
    size = 0.1
    powers = {"N": 2, "N m": 3, "m": 1, "N/m": 1, "m/s²": -1}
    small = changed(loads, lambda v, unit: size ** powers[unit] * v)
    points = tuple(replace(one, station=size * one.station) for one in small.point_loads)
    small = small.replace(point_loads=points, payload=size**3 * loads.payload)
    found = tips(designs.minimal_trunk(length=size), small)
    np.testing.assert_allclose(found / size, tips(TRUNK, loads), atol=2e-9)


@dataclass(frozen=True)
class HeavyEnd:
    """A body with a mass spread over the end of the arm."""

    whole: Body
    start: float
    extra: float

    def compliance(self, z):
        return self.whole.compliance(z)

    def mass_per_length(self, z):
        return self.whole.mass_per_length(z) + np.where(z > self.start, self.extra, 0.0)


def test_a_payload_is_the_limit_of_a_short_heavy_end():
    """The end's center is half its length before the tip, so that it tends there in proportion."""
    mass, side = 0.2, Loads(gravity=(9.81, 0.0, 0.0))
    apart = []
    for length in (0.002, 0.001):
        edge = PointLoad(station=1.0 - length)  # where steps end
        arm = rubber(TRUNK, side.replace(point_loads=(edge,)))
        body = HeavyEnd(ArmBody(arm), edge.station, mass / length)
        found = Solver(LoadTables(arm, arm.loads, body), 24, 1e-9).find(GAMMA).tips
        apart.append(np.linalg.norm(found - tips(TRUNK, side.replace(payload=mass)), axis=1))
    assert 1e-5 < apart[0].min() < apart[0].max() < 2e-3
    np.testing.assert_allclose(apart[0] / apart[1], 2.0, rtol=0.02)


def test_small_loads_add_up():
    """Tips move in proportion, up to the square of the loads."""
    free = tips(TRUNK, Loads(gravity=(0.0, 0.0, 0.0)))
    one, other = Loads(gravity=(0.0, 1e-3, 0.0)), Loads(gravity=(0, 0, 0), tip_force=(1e-3, 0, 0))
    both = one.replace(tip_force=other.tip_force)
    apart = [tips(TRUNK, loads) - free for loads in (one, other, both)]
    assert np.linalg.norm(apart[2], axis=1).min() > 1e-5
    np.testing.assert_allclose(apart[0] + apart[1], apart[2], atol=1e-8)
