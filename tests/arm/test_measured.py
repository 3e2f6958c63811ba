"""Laws of measured numbers: they take the place of what follows from materials, and no other."""

from __future__ import annotations

import numpy as np
import pytest

import softreach as sr
from softreach.arm import Measured, Pieces, Samples
from softreach.arm.parameters import changed, parameters
from softreach.arm.tables import compliance, tables
from softreach.support.errors import InvalidDesign

MATTER = sr.Material(young_modulus=1e6, poisson_ratio=0.4, density=1100.0)
LENGTH, RADIUS = 0.3, 0.01
FIELDS = ("axial_stiffness", "bending_stiffness", "torsion_stiffness")
HEAVY = sr.Loads(payload=0.005, tip_force=(0.01, 0.0, 0.0))
GAMMA = np.array([[-0.3, 1.0], [-0.1, 0.0]])


def arm(material: sr.Material = MATTER, taper: float = 0.0, **others) -> sr.Manipulator:
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
    of = of or arm()
    stiffness = of.section.stiffness_at(of.profile, z)
    values = dict(zip(FIELDS, map(float, stiffness), strict=True))
    return values | {"mass_per_length": float(of.section.mass_per_length_at(of.profile, z))}


@pytest.mark.parametrize("loads", [None, HEAVY])
def test_measuring_what_the_materials_make_changes_no_bit_of_a_tip(loads):
    one, other = arm(loads=loads), arm(loads=loads, measured=Measured(**numbers()))
    np.testing.assert_array_equal(sr.tip_positions(other, GAMMA), sr.tip_positions(one, GAMMA))


def test_what_is_not_measured_follows_from_the_materials_and_what_is_from_the_measurement():
    z = np.linspace(0.0, LENGTH, 7)
    for k, field in enumerate(FIELDS):
        for taper in (0.0, 0.01):
            plain, made = arm(taper=taper), arm(taper=taper, measured=Measured(**{field: 3.0}))
            expected = list(plain.section.stiffness_at(plain.profile, z))
            expected[k] = np.full(7, 3.0)
            for found, value in zip(compliance(made, z), expected, strict=True):
                np.testing.assert_array_equal(found, 1.0 / value)


def test_measured_stiffness_divides_strains():
    z, values = np.linspace(0.0, LENGTH, 5), numbers()
    doubled = {field: 2.0 * values[field] for field in FIELDS}
    one, other = (tables(arm(measured=m), z) for m in (None, Measured(**doubled)))
    np.testing.assert_allclose(other.extension, one.extension / 2.0, rtol=1e-14)
    np.testing.assert_allclose(other.curvature, one.curvature / 2.0, rtol=1e-14)


def test_a_measured_cantilever_sinks_as_beams_do():
    """F L³/(3 K1) for a force across the tip so small that squares of angles do not count."""
    force, bending = 1e-4, 0.02
    stiff = Measured(axial_stiffness=1e9, bending_stiffness=bending, torsion_stiffness=1.0)
    loads = sr.Loads(gravity=(0.0, 0.0, 0.0), tip_force=(force, 0.0, 0.0))
    beam = arm(sr.Material(), measured=stiff, loads=loads, actuators=())
    (tip,) = sr.tip_positions(beam, np.empty((1, 0)), tol=1e-10)
    assert tip[0] == pytest.approx(force * LENGTH**3 / (3 * bending), rel=1e-6)


def test_a_step_of_the_measured_bending_stiffness_is_two_beams():
    """The inner half turns and moves the outer one: half the compliance there shows exactly."""
    force, inner, outer = 1e-4, 0.02, 0.01
    along = Pieces(stations_over_length=(0.0, 0.5, 1.0), values=(inner, outer))
    stiff = Measured(axial_stiffness=1e9, bending_stiffness=along, torsion_stiffness=1.0)
    loads = sr.Loads(gravity=(0.0, 0.0, 0.0), tip_force=(force, 0.0, 0.0))
    beam = arm(sr.Material(), measured=stiff, loads=loads, actuators=())
    assert beam.breakpoints == (LENGTH / 2,)
    (tip,) = sr.tip_positions(beam, np.empty((1, 0)), tol=1e-10)
    # ∫ (L - Z)² / K1 dZ, half by half
    sunk = force * LENGTH**3 / 3 * ((1 - 1 / 8) / inner + (1 / 8) / outer)
    assert tip[0] == pytest.approx(sunk, rel=1e-6)


def test_measured_mass_per_length_is_the_weight():
    along = Samples(stations_over_length=(0.0, 1.0), values=(0.3, 0.1), interpolation="linear")
    assert sr.describe(arm(measured=Measured(mass_per_length=along))).mass == pytest.approx(
        0.2 * LENGTH, rel=1e-14
    )
    halves = Pieces(stations_over_length=(0.0, 0.25, 1.0), values=(0.4, 0.0))
    assert sr.describe(arm(measured=Measured(mass_per_length=halves))).mass == pytest.approx(
        0.1 * LENGTH, rel=1e-14
    )


def test_nothing_is_asked_of_materials_that_was_measured():
    tendon = arm().actuators[1]
    values = numbers()
    made = arm(sr.Material(), measured=Measured(**values), actuators=(tendon,), loads=HEAVY)
    known = arm(actuators=(tendon,), loads=HEAVY)
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
        ({"bending_stiffness": 0.0}, {}, "bending_stiffness = 0: .*> 0 N m²"),
        ({"mass_per_length": -1.0}, {}, "mass_per_length = -1: .*>= 0 kg/m"),
        ({"axial_stiffness": "1"}, {}, "axial_stiffness = '1': must be"),
    ],
)
def test_what_is_still_needed_is_asked_for(given, changes, message):
    with pytest.raises(InvalidDesign, match=message):
        arm(sr.Material(), measured=Measured(**given), **changes)


def test_a_measurement_is_measured():
    with pytest.raises(InvalidDesign, match=r"section.measured = 3: must be Measured or None"):
        sr.Section(rings=(sr.Ring(inner_ratio=0.5),), measured=3)


def test_files_hold_what_was_measured():
    along = Pieces(stations_over_length=(0.0, 0.5, 1.0), values=(0.1, 0.2))
    made = arm(measured=Measured(bending_stiffness=along, mass_per_length=0.1 + 0.2))
    assert "[section.measured]\nbending_stiffness_n_m2 = {" in made.to_toml()
    assert sr.Manipulator.from_toml(made.to_toml()) == made


def test_measured_numbers_are_parameters():
    values = numbers()
    made = arm(measured=Measured(**values))
    for field, value in values.items():
        name = f"measured.{field}"
        assert parameters(made)[name].value(made) == value
        assert changed(made, {name: 2 * value}) == arm(
            measured=Measured(**values | {field: 2 * value})
        )
    with pytest.raises(InvalidDesign, match=r"measured.bending_stiffness = -1: must be"):
        changed(made, {"measured.bending_stiffness": -1.0})
    with pytest.raises(sr.InvalidInput, match="nothing was measured on the arm"):
        changed(arm(), {"measured.bending_stiffness": 1.0})
