"""Tendons that disks guide: an arm is a chain of arcs, and its tendons are chords."""

from dataclasses import replace

import numpy as np
import pytest

import softreach as sr
from softreach.arm import (
    LengthTendon,
    LinearTaper,
    Manipulator,
    Material,
    RestShape,
    RigidPiece,
    Ring,
    Section,
    Tendon,
)
from softreach.calibration.free_numbers import free_numbers
from softreach.calibration.model import MarkerModel
from softreach.rod.rods import as_tip_map
from softreach.support.errors import InvalidDesign
from tests.oracles.guided import ArcChain
from tests.oracles.guided import Tendon as GuidedTendon

LENGTH, RADIUS, AWAY, MODULUS, RATIO = 0.2, 0.001, 0.008, 50e9, 0.3
STEEL = Material(young_modulus=MODULUS, poisson_ratio=RATIO, density=6450.0)
ANGLES = (0.0, 120.0, 240.0, 60.0, 180.0, 300.0)
TENSIONS = 8.0 * 0.6 * np.random.default_rng(0).random((4, 6))


@pytest.fixture(autouse=True)
def few(monkeypatch):
    """Inputs from which the range of strains is found: no law here depends on their number."""
    monkeypatch.setattr("softreach.arm.driving._INSIDE", 20)


def arm_of(guides: int, kind: type[Tendon] = Tendon, **changes) -> Manipulator:
    """Two segments of three tendons; disks at the same places for all."""
    own = {"bundles": 3, "distance": AWAY, "activation_bounds": (0.0, 8.0)}
    if kind is LengthTendon:
        own |= {"activation_bounds": (-0.012, 0.012), "tendon_stiffness": 1e4}
    tendons = (
        kind(name="near", end_over_length=0.5, guides=guides // 2, **own),
        kind(name="far", offset=np.radians(60.0), guides=guides, **own),
    )
    given = {"actuators": tendons} | changes
    return Manipulator(
        profile=LinearTaper(length=LENGTH, outer_radius=RADIUS),
        section=Section(rings=(Ring(inner_ratio=0.0, material=STEEL),)),
        **given,
    )


def chain_of(disks: int) -> ArcChain:
    area, second = np.pi * RADIUS**2, np.pi * RADIUS**4 / 4
    shear = MODULUS / (2 * (1 + RATIO))
    stiffness = [MODULUS * area, MODULUS * second, MODULUS * second, 2 * shear * second]
    each = []
    for k, angle in enumerate(np.radians(ANGLES)):
        passed = tuple(range(disks // 2 + 1 if k < 3 else disks + 1))
        hole = (AWAY * np.cos(angle), AWAY * np.sin(angle))
        each.append(GuidedTendon(passed, (hole,) * len(passed)))
    lengths = np.full(disks, LENGTH / disks)
    return ArcChain(lengths, np.tile(stiffness, (disks, 1)), tuple(each))


def pulled_in(count: int) -> np.ndarray:
    """Displacements that bend both segments and hardly squeeze them [m]."""
    rng, angles = np.random.default_rng(1), np.radians(ANGLES)
    near, far = rng.uniform(0.001, 0.006, (2, count, 1))
    toward, there = rng.uniform(0.0, 2 * np.pi, (2, count, 1))
    bent = near * np.cos(angles - toward)
    bent[:, 3:] += far * np.cos(angles[3:] - there)
    return bent


def test_tips_by_tension_are_those_of_a_chain_of_arcs():
    tips = sr.tip_positions(arm_of(6), TENSIONS, tol=1e-9)
    chain = chain_of(6)
    for tension, tip in zip(TENSIONS, tips, strict=True):
        places, _ = chain.disks(chain.at_tensions(tension))
        np.testing.assert_allclose(tip, places[-1], atol=1e-7 * LENGTH)


def test_tips_by_length_are_those_of_a_chain_of_arcs():
    arm, chain, pulled = arm_of(4, LengthTendon), chain_of(4), pulled_in(2)
    tips = sr.tip_positions(arm, pulled, tol=1e-9)
    for displacement, tip in zip(pulled, tips, strict=True):
        places, _ = chain.disks(chain.at_pulled(displacement, 1e4))
        np.testing.assert_allclose(tip, places[-1], atol=1e-6 * LENGTH)


def test_a_tendon_is_straight_across_a_rigid_piece_too():
    """A disk at the tip alone; half of the arm is rigid, and the rest bends."""
    held = Tendon(name="t", distance=AWAY, guides=1, activation_bounds=(0.0, 4.0))
    piece = RigidPiece(start_over_length=0.25, end_over_length=0.75)
    arm = arm_of(0, actuators=(held,), rigid_pieces=(piece,))
    (tip,) = sr.tip_positions(arm, [[2.0]], tol=1e-9)
    chain = chain_of(4)
    tendon = GuidedTendon((0, 3), ((AWAY, 0.0), (AWAY, 0.0)))
    stiff = chain.stiffness[:3] * np.array([1.0, 1e9, 1.0])[:, None]
    chain = ArcChain(np.array([0.05, 0.1, 0.05]), stiff, (tendon,))
    places, _ = chain.disks(chain.at_tensions(np.array([2.0])))
    np.testing.assert_allclose(tip, places[-1], atol=1e-6 * LENGTH)


def test_a_rest_shape_is_spanned_by_chords():
    rest = 4.0
    arm = arm_of(6, rest=RestShape(curvature_y=rest))
    chain = chain_of(6)
    shape = np.zeros((6, 4))
    shape[:, 2] = rest * chain.lengths
    bent = replace(chain, rest=shape)
    (tip,) = sr.tip_positions(arm, TENSIONS[:1], tol=1e-9)
    places, _ = bent.disks(bent.at_tensions(TENSIONS[0]))
    np.testing.assert_allclose(tip, places[-1], atol=1e-7 * LENGTH)


@pytest.mark.parametrize("loads", [None, sr.Loads(payload=0.02)], ids=["free", "loaded"])
def test_more_guides_lead_to_a_tendon_that_follows_the_arm_at_second_order(loads):
    limit, *tips = (
        sr.tip_positions(arm_of(n, loads=loads), TENSIONS[:2], tol=1e-9) for n in (0, 4, 8, 16)
    )
    off = [np.linalg.norm(one - limit) for one in tips]
    assert off[0] / off[1] == pytest.approx(4.0, rel=0.08)
    assert off[1] / off[2] == pytest.approx(4.0, rel=0.04)


LOADED = sr.Loads(payload=0.02)
CASES = {
    "by tension": (arm_of(6), TENSIONS[:2]),
    "by length": (arm_of(6, LengthTendon), pulled_in(1)),
    "loaded": (arm_of(6, loads=LOADED), TENSIONS[:1]),
    "loaded by length": (arm_of(2, LengthTendon, loads=LOADED), pulled_in(2)),
}


EACH = [
    pytest.param(case, marks=[pytest.mark.large] if "loaded by" in case else []) for case in CASES
]


@pytest.mark.parametrize("case", EACH)
def test_slopes_are_those_of_differences(case):
    arm, inputs = CASES[case]
    tip_map = as_tip_map(arm, 1e-9)
    _, slopes = tip_map.tips_and_slopes(inputs)
    steps = 1e-4 * arm.input_bounds[:, 1]
    for k, step in enumerate(steps):
        moved = np.eye(arm.inputs)[k] * step
        difference = (tip_map.tips(inputs + moved) - tip_map.tips(inputs - moved)) / (2 * step)
        np.testing.assert_allclose(slopes[..., k], difference, atol=1e-6 * np.abs(slopes).max())


@pytest.mark.parametrize("case", EACH)
def test_places_of_markers_change_with_numbers_as_in_differences(case):
    arm, inputs = CASES[case]
    names = ["pose.x", "pose.rx", "near.distance", "rings[0].material.young_modulus", "length"]
    names += ["near.slack"] if isinstance(arm.actuators[0], LengthTendon) else ["far.offset"]
    model = MarkerModel(free_numbers(arm, names), inputs, ("tip",))
    start = model.free.start
    prediction = model.predict(start, slopes=True)
    for k, scale in enumerate(model.free.scale):
        moved = np.eye(len(start))[k] * 1e-3 * scale
        ends = model.predict(start + moved).places, model.predict(start - moved).places
        difference, slope = (ends[0] - ends[1]) / (2 * moved[k]), prediction.slopes[..., k]
        np.testing.assert_allclose(slope, difference, atol=2e-5 * np.abs(slope).max())


def test_equilibria_far_below_buckling_are_found():
    """Arcs that twist, several arcs under one chord, and large bends: each by its own chain."""
    pulled = np.array([[5.54e-3, 2.70e-3, 0.49e-3]])
    cables = arm_of(4, LengthTendon).actuators[1].replace(offset=0.0)
    (tip,) = sr.tip_positions(arm_of(0, actuators=(cables,)), pulled, tol=1e-9)
    passed = (0, 1, 2, 3, 4)
    holes = [(AWAY * np.cos(a), AWAY * np.sin(a)) for a in np.radians(ANGLES[:3])]
    three = replace(chain_of(4), tendons=tuple(GuidedTendon(passed, (h,) * 5) for h in holes))
    places, _ = three.disks(three.at_pulled(pulled[0], 1e4))
    np.testing.assert_allclose(tip, places[-1], atol=1e-6 * LENGTH)

    most = 12.0 * MODULUS * np.pi * RADIUS**4 / 4 / LENGTH**2
    pull = Tendon(name="pull", distance=AWAY, guides=1, activation_bounds=(0.0, 0.85 * most))
    slack = Tendon(name="slack", distance=AWAY, guides=6, activation_bounds=(0.0, 0.0))
    for beside, arcs, share in ((slack, 6, 0.4), (None, 1, 0.8)):
        arm = arm_of(0, actuators=tuple(filter(None, (pull, beside))))
        tension = [share * most, 0.0][: arm.inputs]
        (tip,) = sr.tip_positions(arm, [tension], tol=1e-9)
        one = GuidedTendon((0, arcs), ((AWAY, 0.0), (AWAY, 0.0)))
        chain = replace(chain_of(arcs), tendons=(one,))
        places, _ = chain.disks(chain.at_tensions(np.array(tension[:1])))
        np.testing.assert_allclose(tip, places[-1], atol=2e-6 * LENGTH)


def test_lengths_of_lines_are_those_of_chords_between_disks():
    arm, chain = arm_of(6), chain_of(6)
    lengths = sr.configuration(arm, TENSIONS[0])["line_length"].values
    strains = chain.at_tensions(TENSIONS[0])
    np.testing.assert_allclose(lengths, chain.tendon_lengths(strains), atol=1e-7 * LENGTH)


def test_guides_by_their_number_are_those_at_even_stations():
    arm = arm_of(4)
    near, far = arm.actuators
    stations = replace(near, guides=0, guide_stations=(0.05,)), far
    same = arm.replace(actuators=stations)
    np.testing.assert_allclose(
        sr.tip_positions(same, TENSIONS), sr.tip_positions(arm, TENSIONS), atol=1e-14
    )
    for each in (arm, same):
        assert Manipulator.from_toml(each.to_toml()) == each


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"guide_stations": (0.1, 0.1 + 1e-12)}, "must rise between 0 m"),
        ({"guides": 2.5}, "guides = 2.5: must be a whole number"),
        ({"guides": 2, "guide_stations": (0.1,)}, "give exactly one of guide_stations and guides"),
        ({"guide_stations": (0.1, 0.05)}, "must rise between 0 m, where the tendon begins"),
        ({"guide_stations": (0.1, 0.3)}, "its anchor at 0.2 m"),
    ],
)
def test_guides_that_cannot_be_are_refused(given, said):
    with pytest.raises(InvalidDesign, match=said):
        arm_of(0, actuators=(Tendon(distance=AWAY, activation_bounds=(0.0, 1.0), **given),))


def test_an_arm_that_buckles_between_guides_is_refused():
    """One arc under P: w = P h ω/12 balances K ω/h, and more than 12 K/h² has no balance."""
    most = 12.0 * MODULUS * np.pi * RADIUS**4 / 4 / LENGTH**2

    def pulled(share, guides=1):
        held = Tendon(distance=AWAY, guides=guides, activation_bounds=(0.0, share * most))
        return sr.tip_positions(arm_of(0, actuators=(held,)), [[0.1 * most]])

    assert np.isfinite(pulled(0.8)).all()
    with pytest.raises(InvalidDesign, match="buckle between guides: narrow the bounds, or add"):
        pulled(1.1)
    assert np.isfinite(pulled(1.1, guides=2)).all()
