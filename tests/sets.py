"""Reachable sets, asked for as solids, and whether a surface is closed."""

import numpy as np
import pytest

from softreach.arm import Manipulator, designs
from softreach.rod.tip_map import TipMap
from softreach.workspace import ReachableSet, reachable_set


def trunk_at(revolution_deg: float, taper_deg: float) -> Manipulator:
    return designs.minimal_trunk(np.radians(revolution_deg), np.radians(taper_deg))


def solid(arm: Manipulator | TipMap, **options) -> ReachableSet:
    """The set, which has an inside."""
    found = reachable_set(arm, **options)
    assert found.dimension == 3
    return found


def mesh_of(surface):
    """The same surface of trimesh, which measures it."""
    return pytest.importorskip("trimesh").Trimesh(surface.vertices, surface.faces, process=False)


def is_closed(faces: np.ndarray) -> bool:
    """True if each edge has one face in either direction."""
    sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    there, back = np.unique(sides, axis=0), np.unique(sides[:, ::-1], axis=0)
    return len(there) == len(sides) and np.array_equal(there, back)


def tips_of_faces(rod: TipMap, n: int, seed: int, at_bound: float = 0.5) -> np.ndarray:
    """Tips of random activations, each of which is at a bound with this probability."""
    rng = np.random.default_rng(seed)
    cube = rng.random((n, rod.box.dimension))
    bound = rng.random(cube.shape) < at_bound
    cube[bound] = rng.integers(0, 2, int(bound.sum()))
    return rod.tips(rod.box.from_free_cube(cube))
