"""What an arm weighs, and its load number."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from scipy.integrate import quad

import softreach as sr
from softreach.arm import (
    LengthTendon,
    LinearTaper,
    Manipulator,
    Material,
    Measured,
    Pieces,
    PiecewiseTaper,
    PointLoad,
    Profile,
    Ring,
    SampledTaper,
    Samples,
    Section,
    Tendon,
)
from softreach.arm.body import load_number, mass
from softreach.arm.lines import pull_error
from softreach.arm.loads import GRAVITY
from softreach.arm.parameters import changed
from softreach.arm.tables import compliance, tables
from softreach.rod.summary import describe
from softreach.support.errors import InvalidDesign

RUBBER = Material(young_modulus=1e5, density=1100.0)
SOLID = Section(rings=(Ring(inner_ratio=0.7, material=RUBBER),))
CYLINDER = LinearTaper(length=0.3, outer_radius=0.012)


def arm(profile: Profile = CYLINDER, section: Section = SOLID) -> Manipulator:
    tendon = Tendon(distance_ratio=0.8, activation_bounds=(0.0, 0.01))
    return Manipulator(profile=profile, section=section, actuators=(tendon,))


GIVEN = {
    "length": 0.3,
    "stations_over_length": (0, 0.2, 0.7, 1),
    "radii": (0.012, 0.015, 0.006, 0.004),
}


@pytest.mark.parametrize(
    "profile",
    [
        LinearTaper(length=0.3, outer_radius=0.012, taper=0.02),
        PiecewiseTaper(**GIVEN),
        SampledTaper(**GIVEN),
    ],
)
def test_any_profile_weighs_the_integral_of_its_mass_per_length(profile):
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


# Laws of measured numbers: they take the place of what follows from materials, and no other


MATTER = sr.Material(young_modulus=1e6, poisson_ratio=0.4, density=1100.0)
LENGTH, RADIUS = 0.3, 0.01
FIELDS = ("axial_stiffness", "bending_stiffness", "torsion_stiffness")
HEAVY = sr.Loads(payload=0.005, tip_force=(0.01, 0.0, 0.0))
GAMMA = np.array([[-0.3, 1.0], [-0.1, 0.0]])


def tube(material: sr.Material = MATTER, taper: float = 0.0, **others) -> sr.Manipulator:
    measured = others.pop("measured", None)
    actuators = (
        sr.FiberArchitecture(name="helix", revolution=2.0, extent=0.8),
        sr.Tendon(name="tendon", distance=0.008, offset=2.0, activation_bounds=(0.0, 2.0)),
    )
    parts = {"actuators": actuators} | others
    return sr.Manipulator(
        profile=sr.LinearTaper(length=LENGTH, outer_radius=RADIUS, taper=taper),
        section=sr.Section(rings=(sr.Ring(inner_ratio=0.5, material=material),), measured=measured),
        **parts,
    )


def numbers(z: float = 0.0, of: sr.Manipulator | None = None) -> dict[str, float]:
    """Numbers of the sections of an arm as its materials make them."""
    of = of or tube()
    stiffness = of.section.stiffness_at(of.profile, z)
    values = dict(zip(FIELDS, map(float, stiffness), strict=True))
    return values | {"mass_per_length": float(of.section.mass_per_length_at(of.profile, z))}


@pytest.mark.parametrize("loads", [None, HEAVY])
def test_measuring_what_the_materials_make_changes_no_bit_of_a_tip(loads):
    one, other = (
        tube(loads=loads),
        tube(loads=loads, measured=Measured(**numbers())),
    )
    np.testing.assert_array_equal(sr.tip_positions(other, GAMMA), sr.tip_positions(one, GAMMA))


def test_what_is_not_measured_follows_from_the_materials_and_what_is_from_the_measurement():
    z = np.linspace(0.0, LENGTH, 7)
    for k, field in enumerate(FIELDS):
        for taper in (0.0, 0.01):
            plain, made = (
                tube(taper=taper),
                tube(taper=taper, measured=Measured(**{field: 3.0})),
            )
            expected = list(plain.section.stiffness_at(plain.profile, z))
            expected[k] = np.full(7, 3.0)
            axial, yields = compliance(made, z)
            stretched, bent, twisted = (1.0 / value for value in expected)
            np.testing.assert_array_equal(axial, stretched)
            np.testing.assert_array_equal(yields.T, [bent, bent, twisted])


def test_measured_stiffness_divides_strains():
    z, values = np.linspace(0.0, LENGTH, 5), numbers()
    doubled = {field: 2.0 * values[field] for field in FIELDS}
    one, other = (tables(tube(measured=m), z) for m in (None, Measured(**doubled)))
    np.testing.assert_allclose(other.extension, one.extension / 2.0, rtol=1e-14)
    np.testing.assert_allclose(other.curvature, one.curvature / 2.0, rtol=1e-14)


def test_a_step_of_the_measured_bending_stiffness_is_two_beams():
    """The inner half turns and moves the outer one: half the compliance there shows exactly."""
    force, inner, outer = 1e-4, 0.02, 0.01
    along = Pieces(stations_over_length=(0.0, 0.5, 1.0), values=(inner, outer))
    stiff = Measured(axial_stiffness=1e9, bending_stiffness=along, torsion_stiffness=1.0)
    loads = sr.Loads(gravity=(0.0, 0.0, 0.0), tip_force=(force, 0.0, 0.0))
    beam = tube(sr.Material(), measured=stiff, loads=loads, actuators=())
    assert beam.breakpoints == (LENGTH / 2,)
    (tip,) = sr.tip_positions(beam, np.empty((1, 0)), tol=1e-10)
    # ∫ (L - Z)² / K1 dZ, half by half
    sunk = force * LENGTH**3 / 3 * ((1 - 1 / 8) / inner + (1 / 8) / outer)
    assert tip[0] == pytest.approx(sunk, rel=1e-6)


def test_a_flat_strip_bends_about_each_axis_by_the_stiffness_about_it():
    """Moments about d1 and d2 bend by M1/K1 and M2/K2: the shape is an arc in the plane between."""
    first, second, away = 0.04, 0.4, 0.3
    pull = Tendon(distance=0.008, offset=away, activation_bounds=(0.0, 4.0))

    def strip(bending):
        measured = Measured(axial_stiffness=1e9, bending_stiffness=bending, torsion_stiffness=0.03)
        return tube(sr.Material(), measured=measured, actuators=(pull,))

    made = strip((first, second))
    (tip,) = sr.tip_positions(made, [[3.0]], tol=1e-10)
    bend = 3.0 * 0.008 * np.array([np.cos(away) / second, np.sin(away) / first])
    kappa = np.hypot(*bend)
    across = (1.0 - np.cos(kappa * LENGTH)) / kappa * bend / kappa
    expected = [*across, np.sin(kappa * LENGTH) / kappa]
    np.testing.assert_allclose(tip, expected, atol=1e-8 * LENGTH)
    same = sr.tip_positions(strip((first, first)), [[3.0]])
    np.testing.assert_array_equal(same, sr.tip_positions(strip(first), [[3.0]]))
    assert sr.Manipulator.from_toml(made.to_toml()) == made


def flat(kind=sr.Tendon, angle=0.0, turn=0.0, bending=(0.02, 0.06), **own) -> sr.Manipulator:
    """A flat strip with three tendons; both may be turned about the axis."""
    bounds = (0.0, 4.0) if kind is sr.Tendon else (-0.004, 0.004)
    given = {"bundles": 3, "distance": 0.02, "activation_bounds": bounds} | own
    pair = {"bending_stiffness": bending, "angle": angle}
    measured = Measured(axial_stiffness=1e5, torsion_stiffness=0.03, **pair)
    tendons = kind(name="pull", offset=0.4 + turn, **given)
    return tube(sr.Material(density=1100.0), measured=measured, actuators=(tendons,))


PULLED = np.random.default_rng(3).uniform(0.1, 1.0, (4, 3))
FLAT = {
    "parallel": {},
    "twisted": {"revolution": 3.0},
    "guided": {"revolution": 1.0, "guides": 4},
    "by length": {"kind": LengthTendon, "tendon_stiffness": 2e3},
    "guided by length": {"kind": LengthTendon, "tendon_stiffness": 2e3, "guides": 3},
}


def tips_of(arm: sr.Manipulator) -> np.ndarray:
    low, high = arm.bounds.T
    return sr.tip_positions(arm, low + PULLED * (high - low), tol=1e-9)


@pytest.mark.parametrize("case", FLAT)
def test_a_strip_that_is_turned_with_its_tendons_takes_its_tips_along(case):
    plain, turned = flat(**FLAT[case]), flat(angle=0.7, turn=0.7, **FLAT[case])
    cos, sin = np.cos(0.7), np.sin(0.7)
    about = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    tips = tips_of(plain)
    np.testing.assert_allclose(tips_of(turned), tips @ about.T, atol=1e-8 * LENGTH)
    assert pull_error(turned) == pytest.approx(pull_error(plain), rel=1e-9)
    # The strip alone turned by a right angle has its stiffnesses swapped, by half a turn none.
    swapped = flat(bending=(0.06, 0.02), **FLAT[case])
    right, half = (flat(angle=angle, **FLAT[case]) for angle in (np.pi / 2, -np.pi))
    np.testing.assert_allclose(tips_of(right), tips_of(swapped), atol=1e-8 * LENGTH)
    np.testing.assert_allclose(tips_of(half), tips, atol=1e-8 * LENGTH)
    assert np.abs(tips_of(swapped) - tips).max() > 1e-3 * LENGTH
    # Where both stiffnesses are one, no angle changes a bit.
    round_one, any_angle = (flat(angle=a, bending=(0.02, 0.02), **FLAT[case]) for a in (0.0, 0.7))
    single = flat(bending=0.02, **FLAT[case])
    for other in (any_angle, single):
        np.testing.assert_array_equal(tips_of(other), tips_of(round_one))


def test_the_axes_of_a_strip_stand_in_files_and_summaries_and_are_a_parameter():
    arm = flat(angle=np.radians(30.0))
    assert "angle_deg = 30" in arm.to_toml()
    assert sr.Manipulator.from_toml(arm.to_toml()) == arm
    summary = str(sr.describe(arm))
    assert re.search(r"K1 at base and tip +0.02, 0.02 N m²", summary)
    assert re.search(r"K2 at base and tip +0.06, 0.06 N m²\n", summary)
    assert re.search(r"axis of K1 from x +30 deg", summary)
    assert not re.search(r"K2|axis of K1", str(sr.describe(flat(bending=0.02))))
    assert re.search(r"at rest upright +stable", summary)
    swapped = flat(angle=np.radians(120.0), bending=(0.06, 0.02))
    assert load_number(swapped) == pytest.approx(load_number(arm), rel=1e-12)
    assert changed(arm, {"measured.angle": 0.0}) == flat()
    for bending, warned in ((0.02, True), ((0.02, 0.06), False)):
        said = str(sr.describe(flat(angle=0.3, bending=bending)))
        assert ("measured.angle turns nothing" in said) == warned


def test_pictures_show_a_strip_as_wide_as_its_stiffnesses_say():
    """Of ellipses and strips, the widths along the axes of K1 and K2 are as √K2 to √K1."""
    from softreach.arm.skin import arm_surface
    from softreach.rod.kinematics import rest_configuration

    for bending, widths in (((1.0, 4.0), (1.0, 0.5)), ((9.0, 1.0), (1 / 3, 1.0))):
        arm = flat(angle=0.5, bending=bending)
        drawn = arm_surface(arm, rest_configuration(arm), 360).vertices
        for angle, width in zip((0.5, 0.5 + np.pi / 2), widths, strict=True):
            along = drawn @ [np.cos(angle), np.sin(angle), 0.0]
            assert along.max() == pytest.approx(width * RADIUS, rel=1e-4)
        axes = sr.plot.plot_cross_section(arm, unit="m")
        box = axes.patches[0].get_extents().transformed(axes.transData.inverted())
        expected = np.hypot(widths[0] * np.cos(0.5), widths[1] * np.sin(0.5))
        assert box.width == pytest.approx(2 * RADIUS * expected, rel=1e-3)
    assert tube(measured=Measured(bending_stiffness=(1.0, 4.0))).half_axes == (1.0, 1.0)


def test_measured_mass_per_length_is_the_weight():
    along = Samples(stations_over_length=(0.0, 1.0), values=(0.3, 0.1), interpolation="linear")
    assert sr.describe(tube(measured=Measured(mass_per_length=along))).mass == pytest.approx(
        0.2 * LENGTH, rel=1e-14
    )
    halves = Pieces(stations_over_length=(0.0, 0.25, 1.0), values=(0.4, 0.0))
    assert sr.describe(tube(measured=Measured(mass_per_length=halves))).mass == pytest.approx(
        0.1 * LENGTH, rel=1e-14
    )


def test_nothing_is_asked_of_materials_that_was_measured():
    tendon = tube().actuators[1]
    values = numbers()
    made = tube(sr.Material(), measured=Measured(**values), actuators=(tendon,), loads=HEAVY)
    known = tube(actuators=(tendon,), loads=HEAVY)
    np.testing.assert_array_equal(sr.tip_positions(made, [1.0]), sr.tip_positions(known, [1.0]))
    facts = sr.describe(made)
    assert facts.lacking == ()
    assert facts.load_number == sr.describe(known).load_number


@pytest.mark.parametrize(
    ("given", "changes", "message"),
    [
        ({"bending_stiffness": 1.0}, {}, r"rings\[0\].material.young_modulus.*not all stiffnesses"),
        (
            {field: 1.0 for field in FIELDS},
            {},
            r"rings\[0\].material.young_modulus.*for 'helix', which acts on measured",
        ),
        ({field: 1.0 for field in FIELDS}, {"actuators": (), "loads": HEAVY}, "density"),
    ],
)
def test_what_is_still_needed_is_asked_for(given, changes, message):
    with pytest.raises(InvalidDesign, match=message):
        tube(sr.Material(), measured=Measured(**given), **changes)


def test_files_hold_what_was_measured():
    along = Pieces(stations_over_length=(0.0, 0.5, 1.0), values=(0.1, 0.2))
    made = tube(measured=Measured(bending_stiffness=along, mass_per_length=0.1 + 0.2))
    assert "[section.measured]\nbending_stiffness_n_m2 = {" in made.to_toml()
    assert sr.Manipulator.from_toml(made.to_toml()) == made


def test_what_was_not_measured_is_no_parameter():
    with pytest.raises(sr.InvalidInput, match="nothing was measured on the arm"):
        changed(tube(), {"measured.bending_stiffness": 1.0})
