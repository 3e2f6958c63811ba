"""What an arm weighs, and its load number."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

import softreach as sr
from softreach.arm import (
    LinearTaper,
    Manipulator,
    Material,
    PiecewiseTaper,
    PointLoad,
    Profile,
    Ring,
    SampledTaper,
    Section,
    Tendon,
)
from softreach.arm.load_number import load_number, mass
from softreach.arm.loads import GRAVITY
from softreach.rod.summary import describe

RUBBER = Material(young_modulus=1e5, density=1100.0)
SOLID = Section(rings=(Ring(inner_ratio=0.7, material=RUBBER),))
CYLINDER = LinearTaper(length=0.3, outer_radius=0.012)


def arm(profile: Profile = CYLINDER, section: Section = SOLID) -> Manipulator:
    tendon = Tendon(distance_ratio=0.8, activation_bounds=(0.0, 0.01))
    return Manipulator(profile=profile, section=section, actuators=(tendon,))


def test_a_cylinder_weighs_its_density_times_its_volume():
    assert mass(arm()) == pytest.approx(1100 * math.pi * 0.012**2 * 0.3, rel=1e-14)


def test_a_cone_weighs_what_a_frustum_does():
    profile = LinearTaper(length=0.3, outer_radius=0.012, taper=0.02)
    base, tip = profile.radius([0.0, 0.3])
    volume = math.pi * 0.3 / 3 * (base**2 + base * tip + tip**2)
    assert mass(arm(profile)) == pytest.approx(1100 * volume, rel=1e-14)


@pytest.mark.parametrize("kind", [PiecewiseTaper, SampledTaper])
def test_any_profile_weighs_the_integral_of_its_mass_per_length(kind):
    profile = kind(
        length=0.3, stations_over_length=(0, 0.2, 0.7, 1), radii=(0.012, 0.015, 0.006, 0.004)
    )
    expected, _ = quad(
        lambda z: float(SOLID.mass_per_length(profile.radius(z))),
        0.0,
        0.3,
        points=profile.breakpoints,
        epsabs=0,
        epsrel=1e-12,
    )
    assert mass(arm(profile)) == pytest.approx(expected, rel=1e-11)


def test_the_load_number_of_a_solid_arm_of_one_material_is_the_weight_over_its_stiffness():
    """Λ = ρ g L³/(E R2²)."""
    assert load_number(arm()) == pytest.approx(
        1100 * GRAVITY * 0.3**3 / (1e5 * 0.012**2), rel=1e-14
    )


def test_equal_layers_do_not_change_the_load_number():
    rings = tuple(
        Ring(inner_ratio=inner, outer_ratio=outer, material=RUBBER)
        for inner, outer in ((0.5, 0.8), (0.8, 1.0))
    )
    layered = Section(rings=rings, core=RUBBER)
    assert load_number(arm(section=layered)) == pytest.approx(load_number(arm()), rel=1e-14)


def test_a_bore_makes_an_arm_stand_more_easily():
    """Bending stiffness goes with the fourth power of the radius, weight with the second."""
    bore = 0.6
    hollow = SOLID.replace(bore_ratio=bore)
    assert load_number(arm(section=hollow)) == pytest.approx(
        load_number(arm()) * (1 - bore**2) / (1 - bore**4), rel=1e-13
    )


@pytest.mark.parametrize(
    "loads",
    [
        sr.Loads(gravity=(0, 0, 9.81)),
        sr.Loads(gravity=(9.81, 0, 0)),
        sr.Loads(gravity=(0, -9.81 * 0.6, 9.81 * 0.8)),
    ],
)
def test_weight_counts_the_same_whatever_its_direction(loads):
    assert load_number(arm().replace(loads=loads)) == pytest.approx(load_number(arm()), rel=1e-13)


LEVER = dict(payload=0.02, payload_arm=(0, 0.3, 0))


@pytest.mark.parametrize(
    ("changes", "force"),
    [
        ({"payload": 0.02}, 0.02 * 9.81),
        ({"tip_force": (0.3, 0, 0.4)}, 0.5),
        ({"follower_force": (0.3, 0, 0.4)}, 0.5),
        ({"force_per_length": (0, 2.0, 0)}, 2.0 * 0.3),
        ({"tip_moment": (0, 0.6, 0)}, 0.6 / 0.3),
        ({"follower_moment": (0, 0.6, 0)}, 0.6 / 0.3),
        ({"point_loads": (PointLoad(station=0.1, force=(0, 0, 2), moment=(0.3, 0, 0)),)}, 3.0),
        (LEVER, 0.02 * 9.81 * 2),
    ],
)
def test_every_force_adds_f_l2_over_four_times_the_bending_stiffness(changes, force):
    """And every moment M what the force M/L would."""
    stiffness = 1e5 * math.pi / 4 * 0.012**4
    added = load_number(arm().replace(loads=sr.Loads(**changes))) - load_number(arm())
    assert added == pytest.approx(force * 0.3**2 / (4 * stiffness), rel=1e-12)


def test_where_nothing_weighs_the_load_number_needs_no_density():
    light = arm(
        section=Section(rings=(Ring(inner_ratio=0.7, material=Material(young_modulus=1e5)),))
    )
    pulled = light.replace(loads=sr.Loads(gravity=(0, 0, 0), tip_force=(0, 0, 1e-3)))
    stiffness = 1e5 * math.pi / 4 * 0.012**4
    assert describe(pulled).load_number == pytest.approx(1e-3 * 0.3**2 / (4 * stiffness))


@pytest.mark.parametrize("loads", [sr.Loads(), sr.Loads(payload=0.001, tip_force=(1e-3, 0, 0))])
def test_a_rod_of_no_density_bends_as_one_that_nothing_pulls_down_but_its_loads(loads):
    made = arm(
        section=Section(rings=(Ring(inner_ratio=0.7, material=RUBBER.replace(density=0.0)),))
    )
    assert (mass(made), load_number(made)) == (0.0, 0.0)
    weight = 9.81 * loads.payload
    free = sr.Loads(gravity=(0, 0, 0), tip_force=np.add(loads.tip_force, (0, 0, -weight)))
    tips = [sr.tip_positions(made.replace(loads=each), [[0.005], [0.01]]) for each in (loads, free)]
    np.testing.assert_allclose(tips[0], tips[1], atol=1e-9)


def test_loads_beyond_the_verified_ones_are_warned_of_with_their_number():
    number = load_number(arm())
    heavy = arm().replace(loads=sr.Loads(gravity=(0, 0, 9.81 * 12.5 / number)))
    (warning,) = [line for line in describe(heavy).warnings if "load number" in line]
    assert "12.5" in warning
    assert "up to 12" in warning
    less = arm().replace(loads=sr.Loads(gravity=(0, 0, 9.81 * 11.9 / number)))
    assert not any("load number" in line for line in describe(less).warnings)


def test_a_summary_tells_stiffness_mass_and_load_number():
    facts = describe(arm())
    assert facts.stiffness is not None
    k0, k1, k3 = (np.unique(values) for values in facts.stiffness)
    assert k0 == pytest.approx(1e5 * math.pi * 0.012**2)
    assert k1 == pytest.approx(1e5 * math.pi / 4 * 0.012**4)
    assert k3 == pytest.approx(k1 / 1.5)
    assert facts.mass == mass(arm())
    assert facts.load_number == load_number(arm())
    assert facts.lacking == ()


def test_a_summary_tells_only_what_is_known_and_what_else_to_give():
    ring = Ring(inner_ratio=0.7, material=RUBBER.replace(density=None))
    core = Material(young_modulus=1e5, density=1100.0)
    facts = describe(arm(section=Section(rings=(ring,), core=core)))
    assert facts.stiffness is not None
    assert (facts.mass, facts.load_number) == (None, None)
    assert facts.lacking == (
        "give the density [kg/m³] of rings[0].material to know the mass and the load number",
    )


def test_without_moduli_and_densities_both_are_asked_for(trunk):
    facts = describe(trunk)
    assert (facts.stiffness, facts.mass, facts.load_number) == (None, None, None)
    assert len(facts.lacking) == 2


def test_the_range_of_each_activation_alone_is_that_of_the_closed_form():
    """A parallel tendon: ζ = 1 - τ/K0, and κ = τ d/(K1 ζ) of the centerline, which is shorter."""
    facts = describe(arm())
    tension, distance = 0.01, 0.8 * 0.012
    k0, k1 = 1e5 * math.pi * 0.012**2, 1e5 * math.pi / 4 * 0.012**4
    np.testing.assert_allclose(facts.bundle_extension, [[1 - tension / k0, 1.0]], rtol=1e-12)
    kappa = tension * distance / k1 / (1 - tension / k0)
    np.testing.assert_allclose(facts.bundle_bending, [[0.0, kappa * 0.012]], rtol=1e-9)


def test_an_activation_that_never_rests_has_a_least_bending_of_its_own():
    tight = arm().with_bounds((0.005, 0.01))
    least, largest = describe(tight).bundle_bending[0]
    k0 = 1e5 * math.pi * 0.012**2
    assert least == pytest.approx(largest / 2 * (1 - 0.01 / k0) / (1 - 0.005 / k0))


def test_a_summary_says_where_the_law_of_each_kind_ends_once():
    twice = arm().replace(
        actuators=tuple(
            Tendon(name=name, distance_ratio=0.8, activation_bounds=(0.0, 0.01)) for name in "ab"
        )
    )
    assert describe(twice).validity == (f"tendon: {Tendon.validity}",)


def test_a_mass_without_density_is_refused_by_name(trunk):
    with pytest.raises(sr.InvalidDesign, match=r"rings\[0\].material.density: must be given"):
        mass(trunk)
    with pytest.raises(sr.InvalidDesign, match=r"rings\[0\].material.young_modulus: must be given"):
        load_number(trunk)
