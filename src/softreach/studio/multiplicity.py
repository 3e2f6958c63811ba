"""How many activations reach the places of samples, as the inverse finds them.

The grid of the exact set counts as well, but not near its folds, which in a folded set is where
half of the samples are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softreach import parallel
from softreach.progress import Progress, silent
from softreach.studio.reach import Reach
from softreach.studio.rod import solvable_rod
from softreach.studio.worker import StaleCheck, all_cores
from softreach.workspace import ReachableSolid

__all__ = ["count_activations", "uncounted"]

_BLOCK = 1 << 13
"""Targets solved at a time: a tenth of a second, after which others have their turn."""


def uncounted(reach: Reach, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Those of the samples whose number of activations is not known yet."""
    return rows[:0] if _reached_once(reach) else rows[np.isnan(reach.counts[rows])]


def count_activations(
    reach: Reach,
    rows: NDArray[np.int64],
    check: StaleCheck = lambda: None,
    progress: Progress = silent,
) -> NDArray[np.float64]:
    """How many stable activations put the tip where that of each sample is, shape (n,).

    What is found is kept with the reach, also if `check` raises.

    Args:
        reach: Of an arm with three free bundles.
        rows: Numbers of the samples.
        check: Called between blocks; raises to stop.
        progress: Called with the number of samples done since its last call.
    """
    if _reached_once(reach):
        return np.ones(len(rows))
    missing = uncounted(reach, rows)
    for block in parallel.blocks(len(missing), _BLOCK):
        check()
        _count(reach, missing[block])
        progress(block.stop - block.start)
    return reach.counts[rows]


def _reached_once(reach: Reach) -> bool:
    """Whether it is proved that no place is reached by two activations."""
    return isinstance(reach.exact, ReachableSolid) and reach.exact.route == "flux"


def _count(reach: Reach, rows: NDArray[np.int64]) -> None:
    from softreach.inverse import solve_inverse

    with all_cores:
        found = solve_inverse(solvable_rod(reach.arm), reach.cloud.tip.values[rows])
    reach.counts[rows] = found.counts
