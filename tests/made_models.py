"""Arms whose models are simulated, and how a model is brought to rest."""

from itertools import product

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


def elastica_at_rest(arm, activations, elements):
    """Tips of rods of PyElastica whose nodes and elements are in balance, shape (n, 3)."""
    pytest.importorskip("elastica")
    gravity, tips = np.zeros(3) if arm.loads is None else np.array(arm.loads.gravity), []
    for activation in activations:
        model = sr.models.pyelastica(arm, elements=elements)
        for share in np.arange(1, 11) / 10:
            model.activate(share * activation)
            step = np.ones(1)
            while np.abs(step).max() > (1e-6 if share == 1.0 else 0.03):
                step = _newton_step(model.rod, gravity)
                _move(model.rod, step)
        tips.append(model.rod.position_collection[:, -1].copy())
    return np.array(tips)


def _unbalanced(rod, gravity):
    """Forces and moments of PyElastica that move nodes and turn elements, (element, 6)."""
    rod.compute_internal_forces_and_torques(0.0)
    forces = rod.internal_forces + np.multiply.outer(gravity, rod.mass)
    return np.concatenate([forces[:, 2:], rod.internal_torques[:, 1:]]).T


def _newton_step(rod, gravity, small=1e-5):
    """By central differences; an element acts on no other than its two neighbors either way."""
    count = rod.n_elems - 1
    kept = rod.position_collection.copy(), rod.director_collection.copy()
    slopes = np.zeros((count, 6, count, 6))
    for first, k in product(range(5), range(6)):
        moved, ends = np.zeros((count, 6)), []
        moved[first::5, k] = small
        for step in (moved, -moved):
            _move(rod, step)
            ends.append(_unbalanced(rod, gravity))
            rod.position_collection[:], rod.director_collection[:] = kept
        for element in range(first, count, 5):
            near = slice(max(0, element - 2), element + 3)
            slopes[near, :, element, k] = (ends[0] - ends[1])[near] / (2.0 * small)
    whole = slopes.reshape(6 * count, 6 * count)
    return np.linalg.solve(whole, -_unbalanced(rod, gravity).ravel()).reshape(count, 6)


def _move(rod, step):
    """Move nodes and turn elements by (element, 6), so that strains change linearly."""
    from scipy.spatial.transform import Rotation

    directors, nodes = rod.director_collection[..., 1:], rod.position_collection[:, 1:]
    gaps = np.diff(step[:, :3], axis=0, prepend=0.0).T
    before, by_moves = (np.einsum("abe,be->ea", directors, x) for x in (np.diff(nodes), gaps))
    strains = before + by_moves - np.cross(step[:, 3:], before)
    turns = Rotation.from_rotvec(-step[:, 3:]).as_matrix()
    directors[:] = np.einsum("eab,bce->ace", turns, directors)
    ahead = np.einsum("abe,ea->be", directors, strains)
    nodes[:, 1:] = nodes[:, :1] + np.cumsum(ahead, axis=1)
