"""Reachable sets, asked for as solids, and whether a surface is closed."""

import numpy as np

from softreach.arm import Manipulator, designs
from softreach.rod.tip_map import TipMap
from softreach.workspace import ReachableSet, reachable_set


def trunk_at(revolution_deg: float, taper_deg: float) -> Manipulator:
    """The paper's trunk."""
    return designs.minimal_trunk(np.radians(revolution_deg), np.radians(taper_deg))


def solid(arm: Manipulator | TipMap, **options) -> ReachableSet:
    """The set, which has an inside."""
    found = reachable_set(arm, **options)
    assert found.dimension == 3
    return found


def is_closed(faces: np.ndarray) -> bool:
    """True if each edge has one face in either direction."""
    sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    there, back = np.unique(sides, axis=0), np.unique(sides[:, ::-1], axis=0)
    return len(there) == len(sides) and np.array_equal(there, back)
