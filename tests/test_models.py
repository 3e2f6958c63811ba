"""Arms as models of other programs: at rest they stand where softreach says, at second order."""

import math
import xml.etree.ElementTree as ET

import numpy as np
import pytest

import softreach as sr
from softreach.arm.actuators import LengthTendon
from softreach.arm.body import RestShape, mass
from softreach.arm.drives import Drive
from softreach.arm.loads import PointLoad
from softreach.arm.section import Measured
from softreach.arm.stations import Marker, RigidPiece
from softreach.models.mjcf import mujoco
from tests.made_models import HANGING, SLOW, at_rest, model_arms, samples, simulated

every_arm = pytest.mark.parametrize("kind", model_arms())


def tips_of(arm, activations, bodies):
    return at_rest(mujoco(arm, bodies=bodies, damping=SLOW), activations)


@every_arm
@pytest.mark.parametrize("loads", [{}, HANGING], ids=["alone", "hanging"])
def test_tips_at_rest_converge_to_those_of_the_rod_with_the_square_of_the_bodies(kind, loads):
    """Fourfold with twice the bodies; what is left after extrapolation is far smaller, but for
    the springs that make up for growth, which are off by up to 0.2 % where a third is lost."""
    arm = model_arms()[kind].replace(**loads)
    gamma = samples(arm, 2)
    exact = sr.tip_positions(arm, gamma)
    tips = {bodies: tips_of(arm, gamma, bodies) for bodies in (12, 24)}
    coarse, fine = (np.linalg.norm(tip - exact, axis=1).max() for tip in tips.values())
    assert fine < 0.02 * arm.length
    assert 3.0 < coarse / fine < 5.5
    left = (4.0 * tips[24] - tips[12]) / 3.0 - exact
    assert np.linalg.norm(left, axis=1).max() < 0.15 * fine + 4e-4 * arm.length


@pytest.mark.parametrize("kind", ["minimal_trunk", "three_chamber_arm"])
def test_the_bodies_that_an_error_asks_for_are_enough(kind):
    arm = model_arms()[kind]
    gamma = samples(arm, 2)
    tips = at_rest(mujoco(arm, tol=5e-3, damping=SLOW), gamma)
    error = np.linalg.norm(tips - sr.tip_positions(arm, gamma), axis=1)
    assert error.max() < 5e-3 * arm.length


def whole_arm():
    """One with all that a model has: spans, a rigid piece, markers, a payload beside the tip.

    It hardly twists, as its cable would then pull along a twisted line, which no linear law has.
    """
    arm = sr.designs.three_chamber_arm()
    flat = Measured(torsion_stiffness=0.1, bending_stiffness=(2e-3, 4e-3), angle=0.6)
    chambers = arm.actuators[0].replace(end_over_length=0.6)
    tendon = sr.Tendon(name="cable", distance=0.01, offset=0.3, activation_bounds=(0.0, 2.0))
    return arm.replace(
        section=arm.section.replace(measured=flat),
        actuators=(chambers, tendon),
        rigid_pieces=(RigidPiece(start_over_length=0.6, end_over_length=0.7),),
        markers=(Marker(name="tip", station_over_length=0.5, offset=(0.0, 0.01, 0.0)),),
        loads=sr.Loads(payload=0.01, payload_arm=(0.002, 0.0, 0.02)),
        base=sr.Base(points="x", turn=0.4, position=(0.1, -0.2, 0.3)),
    )


def test_rigid_pieces_spans_payload_base_and_markers_are_those_of_the_arm():
    arm, gamma = whole_arm(), np.array([[6e4, 1e4, 0.0, 0.5]])
    text = mujoco(arm, bodies=50, damping=SLOW)
    exact = sr.tip_positions(arm, gamma)
    assert np.linalg.norm(at_rest(text, gamma, "tip of the arm") - exact) < 2e-3 * arm.length
    marked = sr.tip_positions(arm.at_point("tip"), gamma)
    assert np.linalg.norm(at_rest(text, gamma, "tip") - marked) < 5e-3 * arm.length


@pytest.mark.parametrize("kind", ["minimal_trunk", "three_chamber_arm"])
def test_a_rest_shape_is_where_the_model_rests(kind):
    arm = model_arms()[kind]
    bent = arm.replace(rest=RestShape(curvature_x=1.0 / arm.length, twist=2.0 / arm.length))
    gamma = samples(bent, 1) * np.array([[0.0], [1.0]])
    off = tips_of(bent, gamma, 30) - sr.tip_positions(bent, gamma)
    assert np.linalg.norm(off, axis=1).max() < 0.015 * arm.length


def test_controls_are_the_bundles_in_their_order_with_their_bounds():
    simulator, arm = pytest.importorskip("mujoco"), whole_arm()
    model = simulator.MjModel.from_xml_string(mujoco(arm, bodies=12))
    names = [model.actuator(k).name for k in range(model.nu)]
    assert names == [*arm.bundle_names]
    np.testing.assert_allclose(model.actuator_ctrlrange, arm.bounds, rtol=1e-12)
    hidden = sum(model.body_mass[k] for k in range(model.nbody) if "growth" in model.body(k).name)
    weight = mass(arm) + arm.loads.payload
    assert math.isclose(model.body_mass.sum() - hidden, weight, rel_tol=1e-9)


def test_a_model_keeps_still_while_nothing_acts_on_it():
    """A second of a passive chain without loads, in the steps that the model asks for."""
    simulator = pytest.importorskip("mujoco")
    model = simulator.MjModel.from_xml_string(mujoco(sr.designs.lce_arm(), bodies=20))
    data = simulator.MjData(model)
    data.qpos[-1] = 0.002
    for _ in range(500):
        simulator.mj_step(model, data)
    assert np.abs(data.qpos).max() < 1e-6


def test_a_passive_arm_swings_as_a_cantilever_does():
    """ω = 1.8751² √(K1/m)/L² of the first bending of a slender uniform rod."""
    simulator = pytest.importorskip("mujoco")
    arm = sr.designs.three_tendon_robot().replace(actuators=())
    model = simulator.MjModel.from_xml_string(mujoco(arm, bodies=60))
    data = simulator.MjData(model)
    simulator.mj_forward(model, data)
    mass_matrix = np.empty((model.nv, model.nv))
    simulator.mj_fullM(model, data, mass_matrix)
    stiffness = np.diag(model.jnt_stiffness)
    lowest = np.linalg.eigvals(np.linalg.solve(mass_matrix, stiffness)).real.min()
    bending = float(arm.stiffness_at(0.0).bending)
    per_length = mass(arm) / arm.length
    exact = 1.8751040687**2 * math.sqrt(bending / per_length) / arm.length**2
    assert math.isclose(math.sqrt(lowest), exact, rel_tol=1e-3)


def elastica_errors(arm, gamma, elements=(10, 20)):
    """Of tips of rods of PyElastica at rest, in L: of the coarse, the fine, and extrapolated."""
    exact = sr.tip_positions(arm, [gamma])[0]
    first = sr.models.local_model(arm, gamma).frequencies[0]
    rods = (sr.models.pyelastica(arm, elements=count) for count in elements)
    coarse, fine = (simulated(rod, gamma, first, 3.0 / first) - exact for rod in rods)
    errors = coarse, fine, (4.0 * fine - coarse) / 3.0
    return [np.linalg.norm(error) / arm.length for error in errors]


@pytest.mark.parametrize("kind", ["three_chamber_arm", "lce_arm"])
def test_rods_of_pyelastica_swing_to_the_tip_with_the_square_of_their_elements(kind):
    arm = model_arms()[kind]
    coarse, fine, left = elastica_errors(arm, samples(arm, 1)[0])
    assert 3.6 < coarse / fine < 4.4
    assert left < 0.1 * fine


def test_base_rest_shape_flat_section_and_weight_are_those_of_the_arm():
    """Of one that hardly stretches or shears, which it does by another law in PyElastica."""
    flat = Measured(axial_stiffness=500.0, bending_stiffness=(8e-3, 16e-3), angle=0.6)
    arm = SOFT.replace(
        section=SOFT.section.replace(measured=flat),
        rest=RestShape(curvature_x=1.0 / SOFT.length, twist=2.0 / SOFT.length),
        loads=sr.Loads(payload=0.005),
        base=sr.Base(points="x", turn=0.4, position=(0.1, -0.2, 0.3)),
    )
    assert elastica_errors(arm, np.array([6e4, 2e4, 0.0]), (6, 12))[2] < 2e-3


def test_what_no_rod_of_pyelastica_has_is_refused_in_a_sentence():
    stiff, aside = (RigidPiece(start_over_length=0.5),), sr.Loads(payload_arm=(0.0, 0.0, 0.01))
    for change in ({"rigid_pieces": stiff}, {"loads": aside}, {"drives": (DRIVE,)}):
        with pytest.raises(sr.NotPossible, match=r"^a rod of PyElastica has no"):
            sr.models.pyelastica(SOFT.replace(**change))
    with pytest.raises(sr.InvalidInput, match="activation"):
        sr.models.pyelastica(SOFT).activate([1.0])


SOFT = sr.designs.three_chamber_arm()
CABLE = {"name": "cable", "distance": 0.01, "activation_bounds": (0.0, 0.01)}
DRIVE = Drive(name="left", gains={"chamber 1": 1.0}, bounds=(0.0, 1.0))
NOT_THERE = {
    "drives": {"drives": (DRIVE,)},
    "driven by length": {"actuators": (LengthTendon(**CABLE),)},
    "guides hold": {"actuators": (sr.Tendon(**CABLE, guides=3),)},
    "rest shape": {
        "rest": RestShape(twist=1.0),
        "rigid_pieces": (RigidPiece(start_over_length=0.5),),
    },
    "xfrc_applied": {"loads": sr.Loads(tip_force=(0.0, 0.0, 1.0))},
    "forces and moments": {"loads": sr.Loads(point_loads=(PointLoad(station=0.1),))},
}


@pytest.mark.parametrize("sentence", NOT_THERE)
def test_what_the_model_does_not_have_is_refused_in_a_sentence(sentence):
    with pytest.raises(sr.NotPossible, match=sentence):
        mujoco(SOFT.replace(**NOT_THERE[sentence]))


def test_moduli_and_densities_are_asked_for_and_numbers_out_of_range_are_refused():
    with pytest.raises(sr.InvalidDesign, match=r"young_modulus.*\n.*density"):
        mujoco(sr.designs.minimal_trunk())
    for wrong in ({"bodies": 1}, {"bodies": 501}, {"tol": 0.0}, {"damping": 0.0}, {"bodies": 2.5}):
        with pytest.raises(sr.InvalidInput, match=next(iter(wrong))):
            mujoco(SOFT, **wrong)


def test_the_command_writes_the_model(tmp_path, monkeypatch):
    from softreach.cli.app import run

    monkeypatch.chdir(tmp_path)
    assert run(["export", "three_chamber_arm", "arm.xml"]) == 0
    assert (tmp_path / "arm.xml").read_text() == mujoco(SOFT)
    assert run(["export", "three_chamber_arm", "other.xml", "--activation", "1,2,3"]) == 2
    assert ET.parse("arm.xml").getroot().tag == "mujoco"
