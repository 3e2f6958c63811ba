"""Whether every activation of a loaded arm comes to rest, which continuous questions rest on."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from softreach.errors import InvalidInput
from softreach.rod.tip_map import TipMap, TipStatus
from softreach.sampling import cube_blocks

__all__ = ["check_settled"]

_SAMPLES = 4096


def check_settled(rod: TipMap) -> TipMap:
    """The map itself, if all of a sample of its activations have a stable equilibrium.

    A map that is torn where an equilibrium is lost has no image that could be measured between its
    samples, and no branches that could be followed.

    Raises:
        InvalidInput: Some have none.
    """
    if rod.supports_unstable:
        lost, tried = _lost(rod)
        if lost:
            found = f"{lost} of {tried} activations tried have no stable equilibrium"
            allowed = "such that every activation has one"
            hint = "lighten the load or narrow the bounds; a cloud says which samples have one"
            raise InvalidInput("loads", found, allowed, hint)
    return rod


@lru_cache(maxsize=64)
def _lost(rod: TipMap) -> tuple[int, int]:
    """How many activations have no stable equilibrium, and of how many tried."""
    (cube,) = cube_blocks("sobol", _SAMPLES, rod.box.bundles, 0, _SAMPLES)
    gamma = np.concatenate([rod.box.from_cube(cube), _corners(rod)])
    gamma = gamma if rod.box.bundles else gamma[:1]
    return int((rod.status(gamma) != TipStatus.STABLE).sum()), len(gamma)


def _corners(rod: TipMap) -> np.ndarray:
    return rod.box.corners() if rod.box.bundles <= 10 else np.empty((0, rod.box.bundles))
