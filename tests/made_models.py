"""Arms whose models are simulated, and how a model is brought to rest."""

import numpy as np
import pytest

import softreach as sr

HANGING = {"loads": sr.Loads(), "base": sr.Base(points="down")}
SLOW = 10.0  # s; damping for which inertia plays no part


def model_arms():
    """Arms by the names of their designs; those that fibers drive have moduli and densities."""
    return {
        "three_tendon_robot": sr.designs.three_tendon_robot(segments=2),
        "minimal_trunk": sr.designs.minimal_trunk(material="dragon_skin_30"),
        "three_chamber_arm": sr.designs.three_chamber_arm(),
        "lce_arm": sr.designs.lce_arm(),
    }


def samples(arm, count):
    low, high = arm.bounds.T
    return low + np.random.default_rng(1).random((count, arm.bundles)) * (high - low)


def at_rest(text, activations, site="tip"):
    """Places of a site when the model has come to rest, shape (n, 3).

    A step as long as the damping would move it to where its springs balance what acts there; a
    quarter of that stays stable where weight makes the arm stiffer than its springs.
    """
    simulator = pytest.importorskip("mujoco")
    model = simulator.MjModel.from_xml_string(text)
    model.opt.timestep, tips = SLOW / 4, []
    for activation in activations:
        data = simulator.MjData(model)
        for step in range(300):
            data.ctrl[:] = activation * min(1.0, (step + 1) / 10)
            data.qvel[:] = 0.0
            simulator.mj_step(model, data)
            if step > 10 and np.abs(data.qvel).max() * SLOW < 1e-8:
                break
        simulator.mj_forward(model, data)
        tips.append(data.site(site).xpos.copy())
    return np.array(tips)


def simulated(model, activation, frequency, seconds):
    """The tip of a rod of PyElastica after so long under critical damping of a frequency [Hz]."""
    elastica = pytest.importorskip("elastica")
    parts = elastica.BaseSystemCollection, elastica.Constraints, elastica.Forcing, elastica.Damping
    simulator, rate = type("Simulator", parts, {})(), 4.0 * np.pi * frequency
    model.add_to(simulator)
    step = {"uniform_damping_constant": rate, "time_step": model.time_step}
    simulator.dampen(model.rod).using(elastica.AnalyticalLinearDamper, **step)
    simulator.finalize()
    model.activate(activation)
    time, stepper = 0.0, elastica.PositionVerlet()
    while time < seconds:
        time = stepper.step(simulator, time, model.time_step)
    return model.rod.position_collection[:, -1].copy()
