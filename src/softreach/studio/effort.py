"""How many samples of a loaded arm there is time for: what one costs depends on the loads."""

from __future__ import annotations

import math
import time
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from softreach.rod.tip_map import TipMap
from softreach.sampling import cube_blocks

__all__ = ["affordable_level"]

_PILOT = 512
_LOWEST = 10
"""Level below which a cloud shows no shape."""


def affordable_level(rod: TipMap, seconds: float, wanted: int) -> int:
    """The level of the largest cloud of at most 2^wanted samples that is computed in time.

    Args:
        rod: Of a loaded arm.
        seconds: What the cloud may take on one core [s].
        wanted: Level beyond which nobody asks.
    """
    affordable = math.floor(math.log2(max(seconds, 1e-9) / _seconds_each(rod)))
    return min(wanted, max(_LOWEST, affordable))


@lru_cache(maxsize=64)
def _seconds_each(rod: TipMap) -> float:
    """What one sample costs [s], once everything is compiled and prepared."""
    (cube,) = cube_blocks("sobol", _PILOT, rod.box.bundles, 0, _PILOT)
    gamma = rod.box.from_cube(cube)
    rod.status(gamma[:16])
    return max(min(_seconds(rod, gamma) for _ in range(2)), 1e-6) / _PILOT


def _seconds(rod: TipMap, gamma: NDArray[np.float64]) -> float:
    start = time.perf_counter()
    rod.status(gamma)
    return time.perf_counter() - start
