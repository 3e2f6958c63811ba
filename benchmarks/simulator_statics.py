"""How near models of simulators come to rest to the tips of softreach: the table of docs/models.md.

It takes half an hour on two cores; numbers of bodies or elements as arguments take less.
"""

import sys
from itertools import product
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from tests.made_models import HANGING, at_rest, model_arms, samples

import softreach as sr
from softreach.models import mujoco, pyelastica

TIPS = 20


def main(counts: list[int]) -> None:
    heads = " | ".join(map(str, counts))
    print(f"| arm | weight | {heads} | {heads} |\n|---|---|{'--:|' * 2 * len(counts)}")
    for name, arm in model_arms().items():
        for weight, loads in (("no", {}), ("yes", HANGING)):
            made = arm.replace(**loads)
            gamma = samples(made, TIPS)
            exact, errors = sr.tip_positions(made, gamma), []
            for simulated, count in product((mujoco_at_rest, elastica_at_rest), counts):
                off = np.linalg.norm(simulated(made, gamma, count) - exact, axis=1)
                errors.append(f"{float(off.max()) / arm.length:.5f}")
            print(f"| {name} | {weight} | {' | '.join(errors)} |", flush=True)


def mujoco_at_rest(arm: sr.Manipulator, activations: np.ndarray, bodies: int) -> np.ndarray:
    return at_rest(mujoco(arm, bodies=bodies, damping=10.0), activations)


def elastica_at_rest(arm: sr.Manipulator, activations: np.ndarray, elements: int) -> np.ndarray:
    """Tips of rods of PyElastica whose nodes and elements are in balance, shape (n, 3)."""
    gravity, tips = np.zeros(3) if arm.loads is None else np.array(arm.loads.gravity), []
    for activation in activations:
        model = pyelastica(arm, elements=elements)
        for share in np.arange(1, 11) / 10:
            model.activate(share * activation)
            step = np.ones(1)
            while np.abs(step).max() > (1e-6 if share == 1.0 else 0.03):
                step = _newton_step(model.rod, gravity)
                _move(model.rod, step)
        tips.append(model.rod.position_collection[:, -1].copy())
    return np.array(tips)


def _unbalanced(rod: Any, gravity: np.ndarray) -> np.ndarray:
    """Forces and moments of PyElastica that move nodes and turn elements, (element, 6)."""
    rod.compute_internal_forces_and_torques(0.0)
    forces = rod.internal_forces + np.multiply.outer(gravity, rod.mass)
    return np.concatenate([forces[:, 2:], rod.internal_torques[:, 1:]]).T


def _newton_step(rod: Any, gravity: np.ndarray, small: float = 3e-5) -> np.ndarray:
    """By central differences; an element acts on no other than its two neighbors either way."""
    count = rod.n_elems - 1
    scale = np.repeat([rod.rest_lengths[1:].min(), 1.0], 3)
    kept = rod.position_collection.copy(), rod.director_collection.copy()
    slopes = np.zeros((count, 6, count, 6))
    for first, k in product(range(5), range(6)):
        moved, ends = np.zeros((count, 6)), []
        moved[first::5, k] = small * scale[k]
        for step in (moved, -moved):
            _move(rod, step)
            ends.append(_unbalanced(rod, gravity))
            rod.position_collection[:], rod.director_collection[:] = kept
        for element in range(first, count, 5):
            near = slice(max(0, element - 2), element + 3)
            slopes[near, :, element, k] = (ends[0] - ends[1])[near] / (2.0 * small)
    whole = slopes.reshape(6 * count, 6 * count)
    return scale * np.linalg.solve(whole, -_unbalanced(rod, gravity).ravel()).reshape(count, 6)


def _move(rod: Any, step: np.ndarray) -> None:
    """Move nodes and turn elements by (element, 6), so that strains change linearly."""
    directors, nodes = rod.director_collection[..., 1:], rod.position_collection[:, 1:]
    gaps = np.diff(step[:, :3], axis=0, prepend=0.0).T
    before, by_moves = (np.einsum("abe,be->ea", directors, x) for x in (np.diff(nodes), gaps))
    strains = before + by_moves - np.cross(step[:, 3:], before)
    turns = Rotation.from_rotvec(-step[:, 3:]).as_matrix()
    directors[:] = np.einsum("eab,bce->ace", turns, directors)
    ahead = np.einsum("abe,ea->be", directors, strains)
    nodes[:, 1:] = nodes[:, :1] + np.cumsum(ahead, axis=1)


if __name__ == "__main__":
    main([int(count) for count in sys.argv[1:]] or [25, 100])
