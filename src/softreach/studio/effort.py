"""How many samples of an arm there is time and memory for."""

from __future__ import annotations

import math
import time
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from softreach.rod.tip_map import TipMap
from softreach.sampling import cube_blocks

__all__ = ["affordable_level", "level_in_memory"]

_PILOT = 512
_LOWEST = 10
"""Level below which a cloud shows no shape."""
_COPIES = 4
"""Of a cloud that exist at a time: while it is drawn, colored or written."""


def affordable_level(rod: TipMap, seconds: float, wanted: int) -> int:
    """The level of the largest cloud of at most 2^wanted samples that is computed in time.

    Args:
        rod: Of an arm whose samples cost much: loaded, or of many bundles.
        seconds: What the cloud may take on one core [s].
        wanted: Level beyond which nobody asks.
    """
    affordable = math.floor(math.log2(max(seconds, 1e-9) / _seconds_each(rod)))
    return min(wanted, max(_LOWEST, affordable))


def level_in_memory(bundles: int, memory: float, wanted: int) -> int:
    """The level of the largest cloud of at most 2^wanted samples that memory holds.

    Args:
        bundles: How many activations a sample has.
        memory: What the cloud and its copies may take [bytes].
        wanted: Level beyond which nobody asks.
    """
    each = 8.0 * (bundles + 3) * _COPIES
    return min(wanted, max(_LOWEST, math.floor(math.log2(max(memory, 1.0) / each))))


@lru_cache(maxsize=64)
def _seconds_each(rod: TipMap) -> float:
    """What one sample costs [s], once everything is compiled and prepared."""
    (cube,) = cube_blocks("sobol", _PILOT, rod.box.bundles, 0, _PILOT)
    gamma = rod.box.from_cube(cube)
    _tips(rod, gamma[:16])
    return max(min(_seconds(rod, gamma) for _ in range(2)), 1e-6) / _PILOT


def _seconds(rod: TipMap, gamma: NDArray[np.float64]) -> float:
    start = time.perf_counter()
    _tips(rod, gamma)
    return time.perf_counter() - start


def _tips(rod: TipMap, gamma: NDArray[np.float64]) -> None:
    """What a cloud computes of samples."""
    (rod.status if rod.supports_unstable else rod.tips)(gamma)
