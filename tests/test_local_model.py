"""Laws of arms near one posture: frequencies of beams, their modes, compliance and mass."""

import math
from itertools import product

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import brentq

import softreach as sr
from softreach.rod.rods import as_tip_map
from softreach.support.errors import InvalidDesign, NotPossible
from tests.bodies import of_body, rubber, uniform

TRUNK = sr.designs.minimal_trunk(taper=0.0)  # L = 1 m
STRAIGHT, BENT, PULLED = np.zeros(3), np.array([60e3, 20e3, 0.0]), [4.0, 1.0, 0.0]
CHAMBERS, TENDONS = sr.designs.three_chamber_arm(), sr.designs.three_tendon_robot()


def beam_frequencies(arm, elements=40):
    """Of a cantilever in a plane, by cubic elements with consistent masses and inertia [Hz]."""
    stiffness, mass, h = *np.zeros((2, 2 * elements + 2, 2 * elements + 2)), arm.length / elements
    nodes, weights = np.polynomial.legendre.leggauss(5)
    for k, (x, w) in product(range(elements), zip((nodes + 1) / 2, h * weights / 2, strict=True)):
        a, b = x**2 * (3 - 2 * x), h * x * (1 - x)
        shape = np.array([1 - a, b * (1 - x), a, -b * x])
        bend = np.array([12 * x - 6, h * (6 * x - 4), 6 - 12 * x, h * (6 * x - 2)]) / h**2
        turn = (
            np.array([-6 * x, h * (1 - 3 * x), 6 * x, h * x * (3 * x - 2) / (1 - x)]) * (1 - x) / h
        )
        at, z = np.s_[2 * k : 2 * k + 4, 2 * k : 2 * k + 4], np.array([h * (k + x)])
        stiffness[at] += w * arm.stiffness_at(z).bending * np.outer(bend, bend)
        moving = np.outer(shape, shape) + arm.section.gyration_at(arm.profile, z) * np.outer(
            turn, turn
        )
        mass[at] += w * arm.section.mass_per_length_at(arm.profile, z) * moving
    return np.sqrt(eigh(stiffness[2:, 2:], mass[2:, 2:], eigvals_only=True)) / (2 * math.pi)


def rayleigh_determinant(omega, bending, mass, turning, length):
    """0 where B w⁗ + J ω² w″ = m ω² w of a clamped beam leaves its end free: w″ = 0, no force."""
    middle = turning * omega**2 / (2 * bending)
    spread = math.sqrt(middle**2 + mass * omega**2 / bending)
    a, b = math.sqrt(spread - middle), math.sqrt(spread + middle)
    grow, fall, wave, swing = (
        f(x * length) for f, x in ((math.cosh, a), (math.sinh, a), (math.cos, b), (math.sin, b))
    )
    moment = a * a * grow + b * b * wave, a * a * fall + a * b * swing
    slope = a * fall + b * swing, a * (grow - wave)
    bent = a**3 * fall - b**3 * swing, a**3 * grow + a * b * b * wave
    force = [bending * x + turning * omega**2 * y for x, y in zip(bent, slope, strict=True)]
    return moment[0] * force[1] - moment[1] * force[0]


def test_a_uniform_cantilever_bends_as_that_of_rayleigh_and_twists_as_a_shaft():
    arm = of_body(TRUNK, uniform(2.0, mass=0.3), None)
    turning = 0.3 * arm.profile.outer_radius**2 / 4
    roots = np.array([1.87510407, 4.69409113, 7.85475744])
    slender = roots**2 * math.sqrt(2.0 / 0.3)
    bent = [brentq(rayleigh_determinant, 0.9 * w, w, (2.0, 0.3, turning, 1.0)) for w in slender]
    exact = np.sort([*np.repeat(bent, 2), math.pi / 2 * math.sqrt(2.0 / (2 * turning))])[:6]
    found = sr.models.local_model(arm, STRAIGHT)
    assert np.abs(found.frequencies / (exact / (2 * math.pi)) - 1).max() <= 2 * found.error < 2e-4


def test_a_tapered_cantilever_vibrates_as_one_of_finite_elements():
    arm = rubber(sr.designs.minimal_trunk(taper=0.03), None)
    found = sr.models.local_model(arm, STRAIGHT).frequencies[[0, 1, 2, 3, 5]]  # the other twists
    np.testing.assert_allclose(found, np.repeat(beam_frequencies(arm)[:3], 2)[:5], rtol=1e-4)


@pytest.mark.parametrize("lever", [0.0, 0.2])
def test_a_payload_on_a_light_cantilever_vibrates_on_its_spring(lever):
    loads = sr.Loads(gravity=(0.0, 0.0, 0.0), payload=0.5, payload_arm=(0.0, 0.0, lever))
    found = sr.models.local_model(of_body(TRUNK, uniform(2.0, mass=1e-8), loads), STRAIGHT)
    expected = 1 / (2 * math.pi * math.sqrt(0.5 * (1 / 3 + lever + lever**2) / 2.0))
    np.testing.assert_allclose(found.frequencies[:2], expected, rtol=1e-6)


def test_weight_stiffens_a_hanging_arm_and_softens_an_upright_one():
    heavy = rubber(TRUNK, sr.Loads(), 1e7)
    arms = heavy, heavy.replace(loads=None), heavy.replace(base=sr.Base(points="down"))
    first = [sr.models.local_model(arm, STRAIGHT).frequencies[0] for arm in arms]
    assert np.diff(np.log(first)).min() > 0.02


def test_compliance_and_jacobian_are_those_of_the_tip_and_made_up_of_modes():
    loads, base = sr.Loads(payload=0.005, payload_arm=(0.01, 0.0, 0.01)), sr.Base(points="down")
    found = sr.models.local_model(arm := TENDONS.replace(loads=loads, base=base), PULLED)
    np.testing.assert_array_equal(found.compliance, sr.stiffness.tip_compliance(arm, [PULLED])[0])
    np.testing.assert_array_equal(found.jacobian, as_tip_map(arm).tips_and_slopes([PULLED])[1][0])
    by_rate = found.tip_modes / (2 * math.pi * found.frequencies[:, None])
    made = by_rate.T @ by_rate, found.tip_modes.T @ found.gains
    for modes, whole in zip(made, (found.compliance, found.jacobian), strict=True):
        np.testing.assert_allclose(modes, whole, atol=0.03 * np.abs(whole).max())


def test_mass_is_that_of_differences_of_frames():
    z = np.linspace(0.0, CHAMBERS.length, 401)
    ends = BENT + 10.0 * np.concatenate([np.eye(3), -np.eye(3)])
    frames = as_tip_map(CHAMBERS).frames(ends, z)
    density = CHAMBERS.section.mass_per_length_at(CHAMBERS.profile, z)
    there, back = frames.position.reshape(2, 3, 401, 3)
    moves = (there - back) / 20.0
    there, back = frames.directors.reshape(2, 3, 401, 3, 3)
    turns = np.einsum("azdx,azx->zad", back, np.cross(back, there).sum(axis=2)) / 40.0
    own = CHAMBERS.section.gyration_at(CHAMBERS.profile, z)
    energy = np.einsum("azx,bzx->zab", moves, moves)
    energy += np.einsum("z,zad,zbd,d->zab", own, turns, turns, [1.0, 1.0, 2.0])
    expected = np.trapezoid(density[:, None, None] * energy, z, axis=0)
    found = sr.models.local_model(CHAMBERS, BENT).mass
    np.testing.assert_allclose(found, expected, atol=1e-4 * expected.max())


def test_it_prints_itself_is_a_dataset_and_refuses_what_it_cannot():
    found = sr.models.local_model(CHAMBERS, BENT)
    assert str(found).startswith("tip (")
    np.testing.assert_array_equal(found.to_dataset().frequency, found.frequencies)
    with pytest.raises(InvalidDesign, match=r"young_modulus: must be given in Pa for a local"):
        sr.models.local_model(TRUNK, STRAIGHT)
    with pytest.raises(NotPossible, match="no mass"):
        sr.models.local_model(of_body(TRUNK, uniform(2.0), None), STRAIGHT)
